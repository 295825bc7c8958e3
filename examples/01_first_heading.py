"""The heading of a recording, its sigma, and why sigma is what it is."""

from __future__ import annotations

from math import degrees
from pathlib import Path

import gyronorth as gn

recording = gn.read(Path(__file__).parent / "data/demo.npz")
estimate = gn.heading(recording, sensor="sdc500")  # the file knows its latitude

low, high = map(degrees, estimate.interval95)
print(f"heading {degrees(estimate.heading):.1f} deg, 95 % within {low:.1f} to {high:.1f} deg")
print(f"the truth, which a simulated recording knows: {degrees(recording.heading_true):.1f} deg")
print("valid" if estimate.valid else f"refused: {[reason.code for reason in estimate.reasons]}")
for part, sigma in estimate.sigma_parts.items():
    print(f"  sigma from {part}: {degrees(sigma):.2f} deg")
