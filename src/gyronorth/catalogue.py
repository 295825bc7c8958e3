"""The disturbances by name: what `simulate --disturbance` takes. Imports nothing, so that --help can list them."""

from __future__ import annotations

#: Kinds that training and priors know.
KINDS = ("quiet", "sway", "shock", "warmup", "tilt", "mixed")
#: A warm-up that takes minutes, which only the priors of recordings beyond 300 s know.
SLOW = ("soak",)
#: Kinds kept out of training and of every prior: they test what nobody has modelled.
HELD_OUT = ("square", "ramp", "beat")
