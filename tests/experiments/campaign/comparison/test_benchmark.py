"""The benchmark: what its version fixes, the rows that it leaves, and their order in a table."""

import json
import sys
from dataclasses import asdict, replace
from hashlib import sha256

import numpy as np
import pytest

from chainslam import BACKENDS, BackendEntry
from chainslam.experiments.campaign.comparison.benchmark import CURRENT, QUICK, _fault, ranked
from chainslam.experiments.commands.campaigns import benchmark
from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.numbers import markdown
from chainslam.sim.worlds import load

TINY = replace(QUICK, name="tiny", worlds=("random:7",), seeds=1, max_steps=5)


def test_a_version_keeps_its_worlds_and_settings():
    """A change of any of them needs a new name in place of `consistency-2026.1`."""
    assert asdict(CURRENT) == {
        "name": "consistency-2026.1",
        "worlds": ("paper-fig8", "paper-fig9", "rooms", "random:1", "random:2", "random:3"),
        "seeds": 5,
        "driver": "invariant-ekf",
        "max_steps": 1500,
        "strategy": "nearest-robot",
        "p0": "small",
    }
    digest = sha256()
    for name in CURRENT.worlds:
        world = load(name)
        for part in (world.faces, world.start):
            digest.update(np.round(1e6 * part).astype(np.int64).tobytes())
    assert digest.hexdigest() == "5265a07c9a335b3773153286ebf9e8dab0a385f3d4c33931152173220a619217"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A benchmark of one world, one seed and five steps, by an estimator of chainslam and two of somebody else."""
    out = tmp_path_factory.mktemp("benchmark")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(BACKENDS, "theirs", replace(BACKENDS["block-ekf"], version="1.2"))
        patch.setitem(BACKENDS, "broken", BackendEntry(lambda *start: 1 / 0, "fails"))
        patch.setattr(benchmark, "QUICK", TINY)
        words = ["benchmark", "--quick", "--jobs", "1", "--backend", "full-ekf", "theirs", "broken", "--out", str(out)]
        assert main(words) == 0
        before = (out / "rows.jsonl").read_bytes()
        assert main(words) == 0
        assert (out / "rows.jsonl").read_bytes() == before
    return out


def test_each_estimator_has_a_row_that_says_what_it_may_be_used_for(folder):
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    names = [(row["estimator"], row["estimator_version"]) for row in rows]
    assert names == [("full-ekf", None), ("theirs", "1.2"), ("broken", None)]
    pooled = json.loads((folder / "comparison.json").read_text())["pooled"]
    means = {(row["backend"], row["arm"]): (row["pose_anees_from_start"] or {}).get("mean") for row in pooled}
    for part in (rows[2]["recorded"], rows[2]["closed"]):
        assert (part["scored"], part["pose_anees"], part["step_ms"]) == (0, None, None)
        assert [(each["world"], each["seed"]) for each in part["failures"]] == [("random:7", 1)]
        assert "division by zero" in part["failures"][0]["reason"]
    for row in rows[:2]:
        assert "--quick" in row["not_citable"]
        assert len(row["scans_sha256"]) == 64
        for part, arm in (("recorded", "replay-own"), ("closed", "closed")):
            assert row[part]["pose_anees"] == {"mean": means[row["estimator"], arm], "low": None, "high": None}
            assert (row[part]["trials"], row[part]["scored"]) == (1, 1)
            assert row[part]["step_ms"] > 0
            assert row[part]["failures"] == []
        assert row["closed"]["complete"] == 0


def test_a_program_has_a_row_of_its_recorded_drives_alone_and_stands_in_the_table(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(benchmark, "QUICK", TINY)
    program = tmp_path / "still.py"
    program.write_text(
        "import sys\nsys.stdin.readline()\nfor line in sys.stdin:\n"
        '    print(\'{"pose": [0, 0, 0], "covariance": [1, 0, 0, 1, 0, 1]}\', flush=True)\n'
    )
    command = f"{sys.executable} {program}"
    words = ["benchmark", "--quick", "--jobs", "1", "--external", f"still={command}", "--out", str(tmp_path / "out")]
    try:
        assert main(words) == 0
    finally:
        BACKENDS.pop("still", None)
    (row,) = [json.loads(line) for line in (tmp_path / "out" / "rows.jsonl").read_text().splitlines()]
    assert (row["estimator"], row["external"], row["closed"]) == ("still", command, None)
    assert row["recorded"]["pose_anees"]["mean"] < 1.0  # it states a metre
    assert (row["recorded"]["map_anees"], row["recorded"]["false_matches"]) == (None, None)
    assert "| `still` (not citable) |" in capsys.readouterr().out
    assert main(["report", str(tmp_path / "out")]) == 0


def test_rows_of_several_files_are_one_table(folder, tmp_path, capsys):
    rows = folder / "rows.jsonl"
    more = tmp_path / "more.jsonl"
    more.write_text(rows.read_text().replace('"full-ekf"', '"another"'))
    assert main(["benchmark", "--table", str(rows), str(more)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("tiny")
    assert said.count("| `") == 6
    assert "`theirs` 1.2 (not citable)" in said
    assert all("broken" in line for line in said.splitlines()[-2:])


@pytest.mark.parametrize(
    ("text", "words"),
    [("{}\n", "format"), ("no JSON\n", "JSON"), ("", "found none"), ('"tiny"', "consistency-1 and tiny")],
)
def test_rows_that_are_none_or_of_another_benchmark_are_refused(text, words, folder, tmp_path, capsys):
    rows, other = folder / "rows.jsonl", tmp_path / "other.jsonl"
    other.write_text(rows.read_text().replace(text, '"consistency-1"') if text == '"tiny"' else text)
    assert main(["benchmark", "--table", *([] if not text else [str(rows)]), str(other)]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize("words", [[], ["--backend", "full-ekf", "--table", "x.jsonl"], ["--backend", "no-such"]])
def test_a_benchmark_needs_estimators_or_rows(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["benchmark", *words]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_a_try_tells_the_papers_filter_from_a_consistent_one(tmp_path, capsys):
    words = ["benchmark", "--quick", "--backend", "block-ekf", "invariant-ekf", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    rows = {
        row["estimator"]: row for row in map(json.loads, (tmp_path / "out" / "rows.jsonl").read_text().splitlines())
    }
    for part in (part for row in rows.values() for part in (row["recorded"], row["closed"])):
        assert (part["complete"], part["scored"], part["failures"]) == (4, 4, [])
    assert (
        rows["block-ekf"]["recorded"]["map_anees"]["mean"]
        > 3.0
        > rows["invariant-ekf"]["recorded"]["map_anees"]["mean"]
    )
    said = capsys.readouterr().out
    assert said.index("| `invariant-ekf`") < said.index("| `block-ekf`")


def row(name, pose, error, scored=30, map_anees=1.0):
    estimates = {"pose_anees": pose, "map_anees": map_anees, "path_error_m": error}
    part = {name: value and {"mean": value} for name, value in estimates.items()}
    return {"estimator": name, "recorded": part | {"scored": scored, "trials": 30}}


def test_the_most_consistent_stand_first_then_the_more_precise_and_last_what_lost_runs():
    rows = [
        row("lost", 1.0, 0.01, scored=29),
        row("none", None, None),
        row("over", 3.0, 0.01),
        row("cautious", 0.5, 0.01),
        row("bad map", 1.0, 0.01, map_anees=9.0),
        row("good", 1.0, 0.03),
        row("better", 0.98, 0.02),
    ]
    names = [each["estimator"] for each in ranked(rows)]
    assert names == ["better", "good", "cautious", "over", "bad map", "none", "lost"]


def test_estimators_within_ten_per_cent_are_ordered_by_their_errors():
    rows = [row("near", 1.04, 0.03), row("far", 1.06, 0.01), row("same", 0.97, 0.02), row("under", 0.94, 0.005)]
    assert [each["estimator"] for each in ranked(rows)] == ["same", "near", "under", "far"]


@pytest.mark.parametrize(
    ("fixed", "said", "commit", "words"),
    [(CURRENT, {}, "abc", None), (CURRENT, {}, None, None), (QUICK, {}, "abc", "--quick"),
     (CURRENT, {"resumed_with": {}}, "abc", "different versions"), (CURRENT, {}, "abc+", "changed sources")],
)  # fmt: skip
def test_a_row_can_be_cited_unless_something_is_against_it(fixed, said, commit, words):
    found = _fault(fixed, said, commit)
    assert found is None if words is None else words in str(found)


def test_a_table_is_markdown():
    assert markdown([["a", "b"], ["1", "2"]]) == "| a | b |\n|---|---|\n| 1 | 2 |"


def test_an_estimator_states_a_version_or_none():
    assert BackendEntry(lambda *start: None, "one").version is None
    assert all(entry.version is None for entry in BACKENDS.values())
