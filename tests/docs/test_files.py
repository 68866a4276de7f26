"""The page of files names every key that a run and a campaign write, and no other."""

import csv
import json
import re
from pathlib import Path

import jaxtyping
import numpy as np
import pytest

from chainslam.experiments.commands.cli import main

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "files.md"
pytestmark = [pytest.mark.long, pytest.mark.usefixtures("_unchecked")]


def told(name):
    """The keys in the first column of the table below a heading."""
    part = re.search(rf"^## {re.escape(name)}\n(.*?)(?=^## |\Z)", PAGE.read_text(), flags=re.M | re.S)[1]
    cells = re.findall(r"^\| (`.*?) \|", part, flags=re.M)
    return {key for cell in cells for key in re.findall(r"`([^`]+)`", cell)}


def keys_of(value, name="", whole=()):
    """Dotted keys of a JSON value; `whole` are taken as they are."""
    if name in whole or not isinstance(value, dict | list):
        return {name}
    if isinstance(value, dict):
        return set().union(*(keys_of(v, f"{name}.{k}" if name else k, whole) for k, v in value.items()))
    inside = [keys_of(each, f"{name}[]", whole) for each in value if isinstance(each, dict)]
    return set().union({name} if not inside or name in HEADS else set(), *inside)


LISTS = ("contours", "open_ends", "unseen_borders", "unexplained", "narrow_gaps")
HEADS = {f"certificate.{name}" for name in LISTS} | {"set_aside"}
"""Lists that have a row of their own on the page, whether they are empty or not."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run that came home, one that was stopped early, and a campaign."""
    out = tmp_path_factory.mktemp("runs")
    jaxtyping.config.update("jaxtyping_disable", True)
    words = [
        "explore paper-fig8 --seed 1 --return-to-start --out home",
        "explore paper-fig9 --seed 1 --max-steps 60 --out early",
        "compare --worlds paper-fig8 --backends block-ekf full-ekf --strategies nearest-robot --trials 1 --jobs 1"
        " --modes replay --association own --max-steps 40 --out campaign",
    ]
    for line in words:
        folder = line.split()[-1]
        assert main([*line.split()[:-1], str(out / folder)]) == 0
    return out


def columns(path):
    with path.open() as file:
        return set(next(csv.reader(file)))


SOMETIMES = {"fans", "resolution_m", "carried"}
"""Arrays of `log.npz` that only some logs have: of scans that differ in their beams, in steps of a resolution, or of
several sessions."""


@pytest.mark.parametrize("name", ["log.npz", "map.npz"])
def test_every_array_is_told(runs, name):
    with np.load(runs / "home" / name) as arrays:
        assert told(f"`{name}`") - SOMETIMES == set(arrays) - SOMETIMES


@pytest.mark.parametrize(
    ("heading", "file"),
    [
        ("`steps.csv`", "home/steps.csv"),
        ("`trials.csv`", "campaign/trials.csv"),
        ("`marks.csv`", "campaign/marks.csv"),
        ("Campaign: `steps.csv`", "campaign/steps.csv"),
    ],
)
def test_every_column_is_told(runs, heading, file):
    assert told(heading) == columns(runs / file)


def both(runs, name, whole=()):
    found = set()
    for run in ("home", "early"):
        found |= keys_of(json.loads((runs / run / name).read_text()), "", whole)
    return found


def test_every_key_of_a_summary_is_told(runs):
    found = {re.sub(r"^distances\.[^.]+", "distances.*", key) for key in both(runs, "summary.json")}
    given_up = {f"set_aside[].{name}" for name in ("wall", "side", "position_m", "why")}
    # Only a real robot's log has second looks (tests/experiments/replays/test_measured.py holds their keys).
    looked_again = {f"second_looks.{name}" for name in ("lines", "duplicate_lines", "chains_closed", "closures")}
    # These worlds have no gap too narrow for the body.
    gaps = {f"certificate.narrow_gaps[].{name}" for name in ("width_m", "beyond_m2", "why", "position_m")}
    # Nor was a saved map used again (tests/experiments/runs: test_sessions.py, test_later_logs.py).
    keys = ("map", "first_step", "placed_at_step", "places_world", "pose_anees", "place_covs", "place_walls")
    found |= looked_again | gaps | {f"session.{name}" for name in keys}
    assert told("`summary.json`") - given_up == found - given_up


def test_every_key_of_the_settings_record_is_told(runs):
    assert told("`config.json`") == both(runs, "config.json", ("trial", "versions"))


def test_every_key_of_a_map_is_told(runs):
    assert told("`map.geojson`") == both(runs, "map.geojson") - {"features"}


def test_every_key_of_a_graph_is_told(runs):
    assert told("`visibility.json`") == both(runs, "visibility.json")


def test_every_part_of_a_comparison_is_told(runs):
    document = json.loads((runs / "campaign" / "comparison.json").read_text())
    found = {key if key.startswith(("counts.", "format")) else key.partition("[")[0] for key in keys_of(document)}
    found = {key.partition(".")[0] if key.startswith("hypothesis") else key for key in found}
    assert {key.removesuffix("[]") for key in told("`comparison.json`")} == found


def test_every_file_is_told(runs):
    page = PAGE.read_text()
    left = {path.name for path in (*(runs / "home").iterdir(), *(runs / "campaign").iterdir()) if path.is_file()}
    tables = {name.replace(".parquet", ".csv") for name in left if not name.startswith(".")}
    assert sorted(name for name in tables if f"`{name}`" not in page) == []
