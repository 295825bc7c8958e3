# %% [markdown]
# # A first heading
#
# A gyroscope at rest senses the rotation of the Earth; the horizontal part of that rotation points to true north.
# This notebook reads a recording, computes its heading, and shows what limits it.

# %%
from math import degrees, radians
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gyronorth as gn

DEMO = "examples/data/demo.npz"
ROOT = next(p for p in Path("here").resolve().parents if (p / DEMO).exists())
recording = gn.read(ROOT / DEMO)
print(f"{recording.duration:.0f} s at {recording.rate_hz:g} Hz")
print(f"latitude {degrees(recording.latitude):.2f} deg")

# %% [markdown]
# ## The heading and its interval
#
# `sensor` names the profile: the size of the gyro's errors. The interval holds the truth in 95 of 100 recordings.

# %%
estimate = gn.heading(recording, sensor="sdc500")
heading = degrees(estimate.heading)
low, high = map(degrees, estimate.interval95)
print("valid" if estimate.valid else estimate.reasons)
print(f"heading {heading:.1f} deg, 95 % from {low:.1f} to {high:.1f} deg")
print(f"true heading {degrees(recording.heading_true):.1f} deg")

# %% [markdown]
# ## What limits it
#
# Noise is small. Drift and turn-on bias dominate, and waiting does not remove them.

# %%
parts = {name: degrees(value) for name, value in estimate.sigma_parts.items()}
plt.figure(figsize=(6, 2.4))
plt.barh(list(parts), list(parts.values()))
plt.xlabel("sigma, deg")
plt.title("Error budget")
plt.tight_layout()

# %%
course = gn.convergence(recording, sensor="sdc500")
plt.figure(figsize=(6, 3))
centre, half = np.degrees(course.heading), np.degrees(course.half_width)
low, high = centre - half, centre + half
plt.fill_between(course.time, low, high, alpha=0.3, label="95 % interval")
plt.plot(course.time, centre, label="heading")
truth = degrees(recording.heading_true)
plt.axhline(truth, color="k", linestyle=":", label="truth")
plt.xlabel("time used, s")
plt.ylabel("heading, deg")
plt.title("Waiting averages the noise only")
plt.legend()
plt.tight_layout()

# %% [markdown]
# ## Turn the unit, and the bias cancels
#
# The same sensor in two poses, half a turn apart. The gyro measures the turn itself.

# %%
turned = gn.simulate(
    "sdc500",
    latitude=radians(32.11),
    heading=radians(40),
    duration=205,
    rate_hz=20,
    motion=gn.Motion(turns=((100.0, 5.0, np.pi),)),
    rng=np.random.default_rng(1),
)
two_poses = gn.heading(turned, sensor="sdc500")
error = (degrees(two_poses.heading - turned.heading_true) + 180) % 360 - 180
print(f"two poses: sigma {degrees(two_poses.sigma):.2f} deg, error {error:+.2f} deg")
print(f"one pose:  sigma {degrees(estimate.sigma):.2f} deg")
