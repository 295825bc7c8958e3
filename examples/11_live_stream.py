"""A unit that is still running: samples come in pieces, the heading of all so far comes out."""

from __future__ import annotations

from math import degrees
from pathlib import Path

import gyronorth as gn
from gyronorth.streaming import StreamingHeading

recording = gn.read(Path(__file__).parent / "data/demo.npz")  # in place of a unit on a wire
stream = StreamingHeading(
    rate_hz=recording.rate_hz,
    latitude=recording.latitude,
    accelerometer=True,
    sensor="sdc500",
)
block = round(10 * recording.rate_hz)  # any size will do, one sample as well
for first in range(0, len(recording.gyro_b), block):
    stream.add(recording.gyro_b[first : first + block], recording.accel_b[first : first + block])
    estimate = stream.estimate()
    if estimate.valid:
        low, high = map(degrees, estimate.interval95)
        print(f"{stream.duration:5.0f} s  {degrees(estimate.heading):6.1f} deg, 95 % in {low:.1f} to {high:.1f} deg")
    else:
        print(f"{stream.duration:5.0f} s  {estimate.reasons[0].message}")

offline = gn.heading(recording, sensor="sdc500")
print(f"the finished recording gives {degrees(offline.heading):.1f} deg")
