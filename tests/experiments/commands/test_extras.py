"""What not everybody needs may be missing: all else runs, and what cannot is told with the extra that it takes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
MISSING = ("gtsam", "rerun", "pyarrow", "distributed", "rosbags")
CODE = """
import sys
sys.modules.update(dict.fromkeys({missing}))
from chainslam.experiments.commands.cli import main
sys.exit(main(sys.argv[1:]))
"""


def without(*words, cwd):
    """Run a command where the packages are not there."""
    code = CODE.format(missing=MISSING)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, cwd=cwd, env=environment, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_exploring_replaying_scoring_and_reports_need_no_extras(tmp_path):
    status, out, err = without("explore", "paper-fig4", "--max-steps", "3", "--out", "run", cwd=tmp_path)
    assert (status, err) == (0, "")
    assert re.search("gtsam is not installed.*invariant-ekf", out)
    for words in (["replay", "run", "--backend", "full-ekf", "--out", "again"], ["report", "run"], ["measure", "run"]):
        status, _, err = without(*words, cwd=tmp_path)
        assert (status, err) == (0, "")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("explore paper-fig4 --backend graph", "expected the package gtsam, found none: .* another --backend"),
        ("explore paper-fig4 --rrd run.rrd", r"expected the package rerun, found none: .*chainslam\[view\]"),
        (
            "compare --worlds paper-fig4 --backends full-ekf --strategies nearest-robot --trials 2 --out c",
            r"expected the package pyarrow, found none: .*chainslam\[campaign\]",
        ),
    ],
)
def test_what_needs_an_extra_names_it_in_one_line(words, told, tmp_path):
    status, _, err = without(*words.split(), cwd=tmp_path)
    assert status == 2
    assert len(err.splitlines()) == 1
    assert re.search(told, err)
