"""In what order linear algebra sums is decided before numpy is imported."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CPU = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
CORES = """
import os, sys, ctypes
from pathlib import Path
{first}
import numpy, scipy.linalg
print(os.environ.get("OPENBLAS_CORETYPE"))
loaded = {{line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "openblas" in line}}
for each in loaded:
    for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename"):
        named = getattr(ctypes.CDLL(each), name, None)
        if named is not None:
            named.restype = ctypes.c_char_p
            print(named().decode())
"""


@pytest.mark.skipif(" avx2 " not in CPU, reason="this processor lacks the kernel, or is told of by no file")
@pytest.mark.parametrize(
    "first", ["import chainslam.experiments", "import studies.paper.following", "import tests.arithmetic"]
)
@pytest.mark.parametrize("chosen", [{}, {"OPENBLAS_CORETYPE": "Nehalem"}])
def test_one_kernel_sums_on_every_processor_that_has_it_unless_another_is_chosen(first, chosen):
    """A processor with wider registers would sum in an order of its own, and its drives would take other ways."""
    env = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"} | chosen
    words = [sys.executable, "-c", CORES.format(first=first)]
    root = Path(__file__).parents[2]
    told = subprocess.run(words, cwd=root, env=env, capture_output=True, text=True, check=True).stdout.split()
    # A numpy that is built with another library has no kernel of OpenBLAS to tell of.
    assert set(told) == set(chosen.values() or ["Haswell"])
