"""Mechanisms turned off: where each stands in the source, what a copy without one gives, and what the table says."""

from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.scenario import load_world
from chainslam.experiments.usage import UsageError
from studies.runner.rows import HERE, append, fingerprint, read
from studies.weights.mechanisms import BASELINE, MECHANISMS, Edit, Mechanism
from studies.weights.run import WeightsRun, copied, driven, drop_replaced
from studies.weights.table import ROWS, SCORES, Measure, difference, newest, table, verdict

MODULE, PIECE = "slam.extraction.straightness_kernels", "return (edge_m / (1.0 + (length_m / face_m) ** 4)) ** 2"
OFF = Mechanism("short faces", "stated unsure", (Edit(MODULE, PIECE, "return 0.0"),))
SAME = Mechanism("as before", "changes nothing", (Edit(MODULE, PIECE, f"{PIECE} + 0.0"),))


@pytest.mark.parametrize("mechanism", MECHANISMS, ids=lambda each: each.name)
def test_every_piece_of_source_is_there_exactly_once_and_what_takes_its_place_is_python(mechanism):
    assert mechanism.edits
    for edit in mechanism.edits:
        source = (HERE / edit.path).read_text()
        made = edit.applied(source)
        assert made != source
        compile(made, edit.path, "exec")


def test_names_tell_mechanisms_apart_and_other_edits_have_another_digest():
    assert len({each.name for each in MECHANISMS}) == len({each.digest for each in MECHANISMS}) == len(MECHANISMS)
    assert OFF.digest != SAME.digest


@pytest.mark.parametrize(("source", "times"), [("y = 2", 0), ("x = 1\nx = 1\n", 2)])
def test_a_piece_that_is_not_there_exactly_once_is_refused(source, times):
    with pytest.raises(UsageError, match=f"expected once in slam/map/chains.py, found {times} times 'x = 1'"):
        Edit("slam.map.chains", "x = 1", "x = 3").applied(source)


def test_a_copy_with_an_edit_gives_other_scores_and_one_with_an_edit_that_changes_nothing_the_same(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    before = (HERE / OFF.edits[0].path).read_text()
    with copied(tmp_path) as folder:
        on, off, same = (
            dict(zip(SCORES, driven(folder, each, ["paper-fig4"], 8, 1)["paper-fig4"], strict=True))
            for each in (BASELINE, OFF, SAME)
        )
        with pytest.raises(UsageError, match="another run in it"), copied(tmp_path):
            pass
    assert (HERE / OFF.edits[0].path).read_text() == before
    assert on["steps"] == 8
    assert same == on
    assert off["map_anees"] != on["map_anees"]


def test_plans_that_have_rows_of_this_code_are_not_run_again_and_rows_of_what_is_gone_go(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("studies.weights.run.copied", lambda _: copied(tmp_path / "copy"))
    monkeypatch.setattr("studies.weights.run.MECHANISMS", (OFF,))
    asked = []

    def made_up(folder, mechanism, worlds, max_steps, jobs):
        asked.append((mechanism.name, len(worlds)))
        return {Path(world).stem: [1.0] * len(SCORES) for world in worlds}

    monkeypatch.setattr("studies.weights.run.driven", made_up)
    for k in range(9):
        (tmp_path / f"lifull_{k}.json").touch()
    out = tmp_path / "rows.jsonl"
    old = {"set": "apartments", "code": "of yore", "scores": list(SCORES), "plans": {"lifull_0": [1.0] * len(SCORES)}}
    monkeypatch.setattr("studies.weights.table.MECHANISMS", (OFF, SAME))
    gone = [old | {"mechanism": "long faces", "edits": OFF.digest}, old | {"mechanism": OFF.name, "edits": "other"}]
    append(out, [old | {"mechanism": each.name, "edits": each.digest} for each in (BASELINE, OFF, SAME)] + gone)
    study = WeightsRun(tmp_path, ("short faces",), first=2, out=out)
    study.run()
    assert "dropped 2 rows of older code" in capsys.readouterr().err
    study.run()
    assert asked == [("", 2), ("short faces", 2)]
    WeightsRun(tmp_path, ("short faces",), out=out).run()
    assert asked[2:] == [("", 3), ("short faces", 3)]
    with pytest.raises(UsageError, match="expected names of mechanisms, found long faces"):
        WeightsRun(tmp_path, ("long faces",), out=out).run()
    drop_replaced(out)
    assert len(read(out)) == 4
    older = [row["mechanism"] for row in read(out, any_code=True) if row["code"] == "of yore"]
    assert older == [BASELINE.name, SAME.name]


def rows(mechanism, **changes):
    """One row of 40 apartments; `changes` are scores and what is added to them, alike or plan by plan."""
    chance = np.random.default_rng(3)
    columns = {score: 1.0 + chance.normal(0.0, 0.1, 40) for score in SCORES} | {"complete": np.ones(40)}
    for score, added in changes.items():
        columns[score] = columns[score] + added
    plans = {f"lifull_{k}": [float(columns[score][k]) for score in SCORES] for k in range(40)}
    key = {"mechanism": mechanism.name, "edits": mechanism.digest, "set": "apartments"}
    return key | {"code": fingerprint(), "scores": list(SCORES), "plans": plans}


def test_the_table_says_what_a_mechanism_holds_and_that_another_does_nothing():
    chance = np.random.default_rng(4)
    lost = chance.normal(-0.02, 0.01, 40)
    noise = chance.normal(0.0, 0.01, 40)
    noise -= noise.mean()
    without = rows(OFF, coverage=lost, steps=-0.3, duplicate_lines=noise)
    made = table([rows(BASELINE), without, rows(SAME, coverage=noise)], (OFF, SAME, MECHANISMS[0]))
    worse, nothing, unknown = made.splitlines()[2:]
    ratio = np.log(np.array([values[8] for values in without["plans"].values()]))
    ratio -= np.log(np.array([values[8] for values in rows(BASELINE)["plans"].values()]))
    error = 100.0 * ratio.std(ddof=1) / np.sqrt(40)
    steps = f"steps {100.0 * np.expm1(ratio.mean()):+.1f} % ± {error:.1f}"
    coverage = f"coverage {lost.mean():+.2g} ± {lost.std(ddof=1) / np.sqrt(40):.1g}"
    assert worse.startswith(f"| short faces | stated unsure | 40 pairs: worse: {coverage}; better: {steps} | not run")
    assert nothing == "| as before | changes nothing | 40 pairs: nothing | not run yet | not run yet |"
    assert unknown.endswith("| not run yet | not run yet | not run yet |")


@pytest.mark.parametrize(("shift", "is_told"), [(1.95, False), (2.05, True)])
def test_a_difference_is_told_beyond_two_standard_errors_of_its_mean(shift, is_told):
    off = np.array([-1.0, 1.0, -1.0, 1.0, 0.0])
    error = off.std(ddof=1) / np.sqrt(5)
    pairs = np.column_stack([np.ones(5), 1.0 + off + shift * error])
    told = difference(pairs, SCORES["coverage"])
    assert told == ((pytest.approx(shift * error), "+0.92 ± 0.4") if is_told else None)


def test_four_pairs_tell_nothing():
    pairs = np.column_stack([np.zeros(5), [1.0, 1.01, 0.99, 1.0, 1.0]])
    assert difference(pairs, SCORES["coverage"]) is not None
    assert difference(pairs[:4], SCORES["coverage"]) is None
    few = [rows(each) for each in (BASELINE, OFF)]
    for row in few:
        row["plans"] = dict(list(row["plans"].items())[:4])
    assert verdict(few, OFF, "apartments") == "not run yet"


def test_runs_by_other_edits_and_runs_that_failed_count_for_nothing():
    stored = [rows(BASELINE), rows(OFF, coverage=-0.5) | {"edits": "other"}]
    assert verdict(stored, OFF, "apartments") == "not run yet"
    failed = rows(OFF, complete=-np.eye(40)[:6].sum(axis=0))
    for k in range(6):
        failed["plans"][f"lifull_{k}"][1:] = [None] * (len(SCORES) - 1)
    assert verdict([rows(BASELINE), failed], OFF, "apartments") == "40 pairs: worse: runs complete -0.15 ± 0.06"


def test_rows_of_older_code_stay_beside_its_own_runs_with_everything_on_until_there_are_newer_ones(monkeypatch):
    monkeypatch.setattr("studies.weights.table.MECHANISMS", (OFF, SAME))
    old = [row | {"code": "old"} for row in (rows(BASELINE), rows(OFF, coverage=-0.5), rows(SAME))]
    older = [row | {"code": "older"} for row in (rows(BASELINE), rows(OFF))]
    assert newest(older + old) == old
    assert verdict(older + old, OFF, "apartments") == "40 pairs, older code: worse: coverage -0.5 ± 0"
    now = [rows(BASELINE, coverage=-0.5), rows(OFF, coverage=-0.5)]
    assert newest(old + now) == [old[0], old[2], *now]
    assert verdict(old + now, OFF, "apartments") == "40 pairs: nothing"
    assert verdict(old + now, SAME, "apartments") == "40 pairs, older code: nothing"
    assert verdict(old[1:], OFF, "apartments") == "not run yet"
    few = [row | {"plans": dict(list(row["plans"].items())[:6])} for row in now]
    assert newest(old + few) == [*old, *few]
    assert verdict(old + few, OFF, "apartments") == "40 pairs, older code: worse: coverage -0.5 ± 0"


def test_the_page_shows_what_was_stored():
    assert table(read(ROWS, any_code=True)) in (HERE / "docs" / "contributing" / "mechanisms.md").read_text()


def test_uneven_apartments_are_drawn_and_run_to_their_ends(tmp_path, monkeypatch):
    monkeypatch.setattr("studies.weights.run.copied", lambda _: copied(tmp_path / "copy"))
    asked = []

    def made_up(folder, mechanism, worlds, max_steps, jobs):
        asked.append(([load_world(world).free for world in worlds], max_steps))
        return {Path(world).stem: [1.0] * len(SCORES) for world in worlds}

    monkeypatch.setattr("studies.weights.run.driven", made_up)
    (tmp_path / "lifull_0.json").write_text(Path("tests/data/plans/apartment.json").read_text())
    study = WeightsRun(tmp_path, (), set="uneven", out=tmp_path / "rows.jsonl")
    study.run()
    study.run()
    ((free,), max_steps), *again = asked
    assert max_steps == 5_000
    assert not again
    assert len(free.exterior.coords) > len(load_world(str(tmp_path / "lifull_0.json")).free.exterior.coords)


def test_a_large_difference_is_told_without_an_exponent():
    more = np.array([-48.0, -108.0, -78.0, -138.0, -18.0])
    assert difference(np.column_stack([np.zeros(5), more]), Measure("false matches", -1.0))[1] == "-78 ± 20"
