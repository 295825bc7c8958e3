"""When sigma levels off: the expected sigma against time for three grades of sensor."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

from gyronorth.planning import plan

for name in ("sdc500", "isa100c", "hg9900"):
    planned = plan(name, latitude=radians(32.11), durations=np.array([30, 100, 300, 1000, 3600]))
    print(name)
    for i, duration in enumerate(planned.duration):
        shares = ", ".join(f"{part} {degrees(sigma[i]):.3f}" for part, sigma in planned.parts.items())
        print(f"  {duration:5.0f} s: sigma {degrees(planned.sigma[i]):.3f} deg ({shares})")
    if planned.useful_duration is None:
        print("  sigma falls for more than half a day")
    else:
        print(f"  sigma levels off after {planned.useful_duration:.0f} s")
