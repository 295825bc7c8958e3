# %% [markdown]
# # Your own sensor
#
# From a long recording at rest to a profile, and from the profile to a plan: how good can one pose be, and is turning
# worth it? The recording here is simulated; replace it with your own: `recording = gn.read("night.npz")`.

# %%
import json
from math import degrees, radians
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import gyronorth as gn
from gyronorth.allan import identify
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR

LATITUDE = radians(48.0)
recording = gn.simulate(
    "stim300",
    latitude=LATITUDE,
    heading=radians(120),
    duration=3600,
    rate_hz=20,
    rng=np.random.default_rng(7),
)

# %% [markdown]
# ## Allan deviation
#
# Noise falls with slope -1/2 (its value at 1 s is the angle random walk); the flat part is the bias instability.

# %%
plt.figure(figsize=(6, 3.4))
for axis, name in enumerate("xyz"):
    rate = recording.gyro_b[:, axis] / DEG_PER_HOUR
    curve = gn.allan_deviation(rate, rate_hz=recording.rate_hz)
    plt.loglog(curve.tau, curve.deviation, label=f"gyro {name}")
    plt.fill_between(curve.tau, curve.low, curve.high, alpha=0.2)
plt.xlabel("averaging time, s")
plt.ylabel("Allan deviation, deg/h")
plt.legend()
plt.tight_layout()

# %%
found = identify(recording.gyro_b, rate_hz=recording.rate_hz)
noise, bias = found.angle_random_walk, found.bias_instability
walk = noise.value / DEG_PER_SQRT_HOUR
print(f"angle random walk {walk:.3f} deg/sqrt(h), {noise.status}")
print(f"bias instability  {bias.value / DEG_PER_HOUR:.2f} deg/h, {bias.status}")

# %% [markdown]
# ## A profile
#
# One recording is one power-up, so the turn-on bias comes from the data sheet or from several power-ups.

# %%
profile = {
    "schema": "gyronorth.sensor/1",
    "name": "my unit",
    "source": "one hour at rest; turn-on bias of the data sheet",
    "gyro": {
        "angle_random_walk_deg_sqrt_h": walk,
        "bias_instability_deg_h": bias.value / DEG_PER_HOUR,
        "bias_instability_definition": "coefficient",
        "turn_on_bias_deg_h": 4.0,
    },
}
path = Path(mkdtemp()) / "my_unit.json"
path.write_text(json.dumps(profile, indent=2))
sensor = gn.read_sensor(path)

# %% [markdown]
# ## Is it good enough, and how long to wait?

# %%
plan = gn.plan(sensor, latitude=LATITUDE)
plt.figure(figsize=(6, 3.2))
plt.loglog(plan.duration, np.degrees(plan.sigma), color="k", label="sigma")
for name, values in plan.parts.items():
    if np.any(values > 0):
        label = name.replace("_", " ")
        plt.loglog(plan.duration, np.degrees(values), linestyle="--", label=label)
plt.xlabel("duration of one pose, s")
plt.ylabel("sigma, deg")
plt.legend()
plt.tight_layout()

# %% [markdown]
# ## Two poses instead

# %%
for turns in (0, 1, 3):
    starts = [120.0 + 125.0 * k for k in range(turns)]
    motion = gn.Motion(turns=tuple((start, 5.0, np.pi) for start in starts))
    duration = 120.0 + 125.0 * turns
    pose = gn.simulate(
        sensor,
        latitude=LATITUDE,
        heading=radians(120),
        duration=duration,
        rate_hz=20,
        motion=motion,
        rng=np.random.default_rng(11),
    )
    estimate = gn.heading(pose, sensor=sensor)
    sigma = degrees(estimate.sigma)
    print(f"{turns} turns, {duration:4.0f} s: {estimate.method:9} sigma {sigma:6.2f} deg")
