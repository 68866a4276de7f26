"""Where the rooms meet, and the only place that joins truth and estimate."""

import os

# The same command must give the same bytes: a threaded BLAS sums in an order of its own. It reads these variables
# once, when numpy is first imported, which is after this line for everything that is started from here.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[_name] = "1"
