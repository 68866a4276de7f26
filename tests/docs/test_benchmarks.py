"""Benchmarks still run: they are of no package that other tests import."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.long
@pytest.mark.parametrize("name", ["mapping", "backends", "peers", "extraction", "full_ekf"])
def test_a_benchmark_runs(name):
    few = "--benchmark-max-time=0.01", "--benchmark-min-rounds=1", "-k", "not 1000"
    program = [sys.executable, "-m", "pytest", f"benchmarks/test_{name}.py", "--benchmark-only", "-q", *few]
    # In a worker of these tests nothing would be measured.
    alone = {name: value for name, value in os.environ.items() if "XDIST" not in name}
    ran = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, env=alone, check=False)
    assert ran.returncode == 0, ran.stdout
