"""The flat of examples/plans, as five programs write it: explored by the commands of its page."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main

EXAMPLES = Path(__file__).parents[2] / "examples"
COMMANDS = re.findall(r"`chainslam (explore .+?)`", (EXAMPLES / "plans" / "README.md").read_text())
NAMES = [command.split()[1].removeprefix("plans/") for command in COMMANDS]


def test_every_plan_has_its_command():
    assert sorted(NAMES) == sorted(path.name for path in (EXAMPLES / "plans").glob("*.*") if path.suffix != ".md")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "cubicasa.svg" else pytest.mark.long) for name in NAMES]
)
def test_a_plan_is_explored_to_its_end(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(EXAMPLES)
    words = shlex.split(COMMANDS[NAMES.index(name)])
    assert main([*words, "--errorless", "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["status"], summary["contours_closed"], summary["contours_reachable"]) == ("complete", 1, 1)
    assert summary["coverage"] > 0.99
    walls = np.load(tmp_path / "map.npz")
    assert len(walls["ids"]) == 12
    x0, y0, x1, y1 = _bounds(json.loads((tmp_path / "map.geojson").read_text()))
    assert 5.8 < x1 - x0 < 6.3
    assert 3.8 < y1 - y0 < 4.2


def _bounds(document):
    closed = [f["geometry"] for f in document["features"] if f["properties"].get("closed")]
    points = np.concatenate([np.array(ring) for shape in closed for ring in shape["coordinates"]])
    return *points.min(axis=0), *points.max(axis=0)
