"""Experiments: the only package in which the truth and the estimate meet."""

import os
from pathlib import Path

# Runs must be reproducible to the byte, but a BLAS sums in an order of its own for each number of threads and each kind
# of processor, and a robot that is a last digit elsewhere may take another door. It reads these variables when numpy is
# first imported, which is after this line for every command and study.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_name] = "1"
try:
    if " avx2 " in Path("/proc/cpuinfo").read_text():
        os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")
except OSError:
    pass
