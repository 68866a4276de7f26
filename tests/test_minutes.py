"""A run of the tests that is bounded in time: what begins too late is skipped, and counted."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(("minutes", "told"), [("0", "skipped"), ("60", "passed")])
def test_what_has_not_begun_in_time_is_skipped_and_counted(minutes, told):
    bounded = ("--minutes", minutes, "tests/slam/geometry/test_poses.py")
    asked = (sys.executable, "-m", "pytest", "-q", "-rs", "-n0", *bounded)
    ended = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == 0
    assert re.search(rf"^\d+ {told} in", ended.stdout, re.MULTILINE)
    assert ("0 minutes are over" in ended.stdout) == (told == "skipped")
