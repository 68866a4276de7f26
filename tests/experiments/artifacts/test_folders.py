"""Results folders with a file that is broken: one line and status 2 from whatever reads them, and nothing lost."""

import json
import os
import shutil

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main
from chainslam.sim.logs.recorded_robot import FORMAT

CAMPAIGN = (
    *("--worlds", "paper-fig4", "--backends", "block-ekf", "full-ekf", "--strategies", "nearest-robot"),
    *("--trials", "2", "--max-steps", "3", "--modes", "closed", "--jobs", "1"),
)
CONTENTS = {
    "nothing": b"",
    "a list": b"[]",
    "null": b"null",
    "no campaign": b'{"campaign": null}',
    "no campaign of this format": b'{"format": %d, "campaign": null, "trial": null, "merged": null}' % FORMAT,
    "no format": b"{}",
    "another format": b'{"format": 99}',
    "400 digits": b'{"format": ' + b"1" * 400 + b"}",
    "400 digits below a point": b'{"format": 1.' + b"1" * 400 + b"}",
    "a number beyond all": b'{"format": 1e999}',
    "NaN": b'{"format": NaN}',
    "deep nesting": b"[" * 200_000,
    "nesting that is too deep": b'{"format": %d, "more": ' % FORMAT + b"[" * 200 + b"]" * 200 + b"}",
    "a lone surrogate": b'{"format": %d, "more": "\\ud800"}' % FORMAT,
    "text that moves the cursor": b'{"format": %d, "more": "\\u001b[2J"}' % FORMAT,
    "binary": bytes(range(256)) * 9,
    "cut short": b'{"format": %d, "tri' % FORMAT,
}

FEW = ("a list", "no campaign", "no campaign of this format", "400 digits", "deep nesting")
"""Those that every reader meets; all read by the same few lines."""


def folder_for(path):
    path.unlink()
    path.mkdir()


PLACES = {
    "a folder": folder_for,
    "a link to nothing": lambda path: (path.unlink(), path.symlink_to("nothing")),
    "a loop of links": lambda path: (path.unlink(), path.symlink_to(path)),
    "a device": lambda path: (path.unlink(), path.symlink_to("/dev/zero")),
    "a pipe": lambda path: (path.unlink(), os.mkfifo(path)),
    "missing": lambda path: path.unlink(),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run, a campaign and another of later seeds, the two held against each other, and the two together."""
    home = tmp_path_factory.mktemp("intact")
    campaign, later = str(home / "campaign"), str(home / "later")
    for words in (
        ["explore", "paper-fig4", "--max-steps", "3", "--out", str(home / "run")],
        ["compare", *CAMPAIGN, "--out", campaign],
        ["compare", *CAMPAIGN, "--first-seed", "2", "--out", later],
        ["compare", "--against", campaign, later, "--out", str(home / "contrast")],
        ["compare", "--merge", campaign, later, "--out", str(home / "merged")],
    ):
        assert main(words) == 0
    return home


READERS = [
    ("run", "config.json", ["report", "DIR"]),
    ("run", "config.json", ["measure", "DIR"]),
    ("run", "config.json", ["replay", "DIR/log.npz", "--out", "OUT"]),
    ("run", "config.json", ["explore", "--resume", "DIR", "--max-steps", "5"]),
    ("run", "config.json", ["view", "DIR"]),
    ("run", "summary.json", ["report", "DIR"]),
    ("run", "map.geojson", ["measure", "DIR", "0", "1"]),
    ("campaign", "config.json", ["report", "DIR"]),
    ("campaign", "config.json", ["compare", *CAMPAIGN, "--out", "DIR"]),
    ("campaign", "config.json", ["compare", "--merge", "DIR", "LATER", "--out", "OUT"]),
    ("campaign", "config.json", ["compare", "--against", "LATER", "DIR", "--out", "OUT"]),
    ("campaign", "comparison.json", ["report", "DIR"]),
    ("merged", "config.json", ["report", "DIR"]),
    ("merged", "config.json", ["compare", "--merge", "DIR", "LATER", "--out", "OUT"]),
    ("contrast", "contrast.json", ["report", "DIR"]),
]


@pytest.fixture
def refused(made, tmp_path, capsys):
    def check(folder, name, words, spoil):
        home = tmp_path / folder
        shutil.copytree(made / folder, home)
        spoil(home / name)
        names = {"DIR": str(home), "OUT": str(tmp_path / "out"), "LATER": str(made / "later")}
        spoken = [names.get(word, word).replace("DIR/", f"{home}/") for word in words]
        before = sorted(home.rglob("*"))
        capsys.readouterr()
        assert main(spoken) == 2
        said = capsys.readouterr()
        (line,) = said.err.splitlines()
        assert line.startswith("chainslam: expected ")
        assert ", found " in line
        assert said.out == ""
        assert not (tmp_path / "out" / "config.json").exists()
        assert {path.name for path in set(home.rglob("*")) - set(before)} <= {".lock"}
        shutil.rmtree(home)

    return check


@pytest.mark.parametrize(
    ("folder", "name", "words"), READERS, ids=lambda v: v if isinstance(v, str) else "-".join(v[:2])
)
def test_a_record_that_is_none_gets_one_line_and_status_2(refused, folder, name, words):
    every = (name, words[0]) in (("summary.json", "report"), ("comparison.json", "report"))
    for content in CONTENTS.values() if every else map(CONTENTS.get, FEW):
        refused(folder, name, words, lambda path, content=content: path.write_bytes(content))
    for place, spoil in PLACES.items():
        if place != "missing" or words[0] != "measure" or name != "config.json":
            refused(folder, name, words, spoil)


def edited(change):
    def spoil(path):
        said = json.loads(path.read_text())
        change(said)
        path.write_text(json.dumps(said))

    return spoil


@pytest.mark.parametrize(
    ("folder", "name", "words", "change"),
    [
        ("run", "config.json", ["report", "DIR"], lambda s: s["trial"].update(seed="1")),
        ("run", "config.json", ["report", "DIR"], lambda s: s["trial"].pop("robot")),
        ("run", "config.json", ["report", "DIR"], lambda s: s["trial"]["robot"].update(wings=2)),
        ("run", "config.json", ["report", "DIR"], lambda s: s.update(more=1)),
        ("run", "config.json", ["report", "DIR"], lambda s: s.update(versions=[])),
        ("run", "config.json", ["explore", "--resume", "DIR", "--max-steps", "5"],
         lambda s: s["trial"].update(backend="magic")),
        ("run", "summary.json", ["report", "DIR"], lambda s: s.update(pose_anees="1")),
        ("run", "summary.json", ["report", "DIR"], lambda s: s.update(set_aside=[{}])),
        ("run", "summary.json", ["report", "DIR"], lambda s: s.pop("status")),
        ("run", "map.geojson", ["measure", "DIR"], lambda s: s.update(features={})),
        ("run", "map.geojson", ["measure", "DIR"], lambda s: s["features"][0].pop("properties")),
        ("campaign", "config.json", ["report", "DIR"], lambda s: s["campaign"].update(trials=10**12)),
        ("campaign", "config.json", ["report", "DIR"], lambda s: s["campaign"].update(strategies=["../../x"])),
        ("campaign", "config.json", ["report", "DIR"], lambda s: s.pop("worlds_sha256")),
        ("campaign", "comparison.json", ["report", "DIR"], lambda s: s["pooled"][0].pop("pose_anees")),
        ("campaign", "comparison.json", ["report", "DIR"], lambda s: s["pooled"][0].update(arm="open")),
        ("campaign", "comparison.json", ["report", "DIR"], lambda s: s["backends"][0].update(value=[])),
        ("campaign", "comparison.json", ["report", "DIR"], lambda s: s.update(findings=[{"kind": "outside"}])),
        ("campaign", "comparison.json", ["report", "DIR"], lambda s: s["marks"][0].update(driving=None)),
        ("contrast", "contrast.json", ["report", "DIR"], lambda s: s["differences"][0].update(measure="beauty")),
        ("contrast", "contrast.json", ["report", "DIR"], lambda s: s["trials"].update(shared=1.5)),
        ("merged", "config.json", ["report", "DIR"], lambda s: s.update({"from": []})),
    ],
)  # fmt: skip
def test_a_record_with_other_keys_or_types_gets_one_line_and_status_2(refused, folder, name, words, change):
    refused(folder, name, words, edited(change))


MAPS = {
    "ids twice": lambda m: {"ids": 0 * m["ids"]},
    "words": lambda m: {"lines": np.full(m["lines"].shape, "x")},
    "no covariance": lambda m: {"cov": None},
    "a covariance of another size": lambda m: {"cov": m["cov"][:-1, :-1]},
    "an invalid covariance": lambda m: {"cov": -m["cov"]},
    "a covariance with one NaN": lambda m: {"cov": np.where(np.eye(len(m["cov"])) * m["cov"] > 0, m["cov"], np.nan)},
    "objects": lambda m: {"anchors": np.full(m["anchors"].shape, None)},
    "a scalar": lambda m: {"pose": np.float64(1.0)},
    "places beyond all": lambda m: {"anchors": 1e300 + m["anchors"]},
    "another format": lambda m: {"format": np.int64(0)},
}


@pytest.mark.parametrize("change", MAPS)
def test_a_map_that_is_none_gets_one_line_and_status_2(refused, change):
    def spoil(path):
        with np.load(path) as archive:
            arrays = dict(archive)
        arrays |= MAPS[change](arrays)
        np.savez(path, **{name: value for name, value in arrays.items() if value is not None})

    for words in (["measure", "DIR"], ["measure", "DIR", "0", "1"]):
        refused("run", "map.npz", words, spoil)


@pytest.mark.parametrize(
    "spoil", [*PLACES.values(), lambda path: path.write_bytes(b"PK\x03\x04")], ids=[*PLACES, "an archive cut short"]
)
def test_a_map_whose_file_is_none_gets_one_line_and_status_2(refused, spoil):
    refused("run", "map.npz", ["measure", "DIR"], spoil)


def a_trial(change):
    """Spoil a trial that both campaigns have: the second of the first back end."""
    return lambda config: change(sorted((config.parent / "trials").rglob("*.npz"))[1])


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def without(name):
    """Take an array out of a trial's file that the others there make no sense without."""

    def spoil(path):
        with np.load(path) as archive:
            arrays = {key: archive[key] for key in archive.files} | {"nis_dof": np.ones(1)}
        np.savez(path, **{key: value for key, value in arrays.items() if key != name})

    return spoil


@pytest.mark.parametrize("words", [
    ["compare", *CAMPAIGN, "--out", "DIR"],
    ["compare", "--merge", "DIR", "LATER", "--out", "OUT"],
    ["compare", "--against", "DIR", "LATER", "--out", "OUT"],
], ids=lambda words: " ".join(words[:2]))  # fmt: skip
def test_a_trial_that_is_none_gets_one_line_and_status_2(refused, words):
    another = a_trial(lambda path: shutil.copy(path.with_name("00001.npz"), path))
    for spoil in (a_trial(cut), a_trial(folder_for), another, a_trial(without("map_closed")), a_trial(without("nis"))):
        refused("campaign", "config.json", words, spoil)


@pytest.mark.parametrize(("name", "words"), [("steps.parquet", "view"), ("trials.parquet", "view")])
def test_a_table_that_was_cut_short_gets_one_line_and_status_2(refused, name, words, monkeypatch):
    monkeypatch.setattr("chainslam.experiments.commands.view.available", lambda: "viewer")
    for spoil in (cut, folder_for, lambda path: path.write_bytes(b"x,y\n1,2\n")):
        refused("campaign", name, [words, "DIR"], spoil)
