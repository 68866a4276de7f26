"""What `make setup` compiles is all that a run needs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_once_compiled_no_run_compiles_again_and_every_file_of_kernels_was_called(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def run(*words):
        command = [sys.executable, "-m", *words]
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        return done.stderr

    assert run("chainslam.experiments.commands.compile_kernels").count("compiling loops") == 1
    folders = [folder for folder in (tmp_path / "cache").iterdir() if any(folder.rglob("*.nbc"))]
    kept = {folder.name.rpartition("-")[0] for folder in folders}
    files = [path for room in ("slam", "explore", "sim") for path in (ROOT / room).rglob("*kernels.py")]
    every = {".".join(("chainslam", *path.relative_to(ROOT).with_suffix("").parts)) for path in files}
    # Only logs of real robots are looked at again.
    assert {name for name in every if "second_looks" not in name} == kept
    out = tmp_path / "run"
    assert "compiling" not in run(
        "chainslam.experiments.commands.cli", *f"explore hall --max-steps 400 --out {out}".split()
    )
