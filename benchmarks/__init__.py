"""Speed of gyronorth beside its peers, measured in one run: `python -m benchmarks`."""

import os

# One thread: set before anything loads numpy.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"
