"""Experiments: the only package in which the truth and the estimate meet."""

import os

# Runs must be reproducible to the byte, but a threaded BLAS changes the order of sums. It reads these variables when
# numpy is first imported, which is after this line for every command and study.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_name] = "1"
