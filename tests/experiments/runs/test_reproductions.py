"""The paper's figures: what each claims holds, and the command writes what DESIGN.md names."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.experiments import reproductions
from chainslam.experiments.commands.cli import main
from chainslam.experiments.reproductions import REPRODUCTIONS, Entry, Reproduction, eq4, fig4, fig8, standing, table1
from chainslam.experiments.reproductions.runs import maps
from chainslam.experiments.reproductions.runs.traversals import passes
from chainslam.viz.figures.panels import panels

PAPER_NAMES = ["table1", "fig4", "fig5", "fig6", "fig8", "fig9", "fig10", "fig11", "eq4", "standing"]
few = settings(max_examples=15, deadline=None, derandomize=True)


def stub(seed):
    figure, _ = panels("a stub", 1, 1, (2.0, 2.0))
    return Reproduction("a stub", {"length, m": 6.5}, {"block-ekf": {"length, m": 6.4, "lost": None}}, figure)


def test_all_figures_that_the_design_names_are_in_the_registry():
    assert list(REPRODUCTIONS) == PAPER_NAMES


def test_the_command_writes_picture_and_numbers_and_the_same_bytes_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(reproductions.REPRODUCTIONS, "eq4", Entry(stub, dict, {}, "a stub"))
    for folder in ("a", "b"):
        assert main(["reproduce", "eq4", "eq4", "--out", str(tmp_path / folder), "--seed", "3"]) == 0
    said = capsys.readouterr().out
    assert "6.5" in said
    assert "6.4" in said
    record = json.loads((tmp_path / "a/eq4.json").read_text())
    assert record["paper"] == {"length, m": 6.5}
    assert record["ours"] == {"block-ekf": {"length, m": 6.4, "lost": None}}
    assert record["command"] == "chainslam reproduce eq4 --seed 3"
    for kind in ("png", "svg", "json"):
        assert (tmp_path / f"a/eq4.{kind}").read_bytes() == (tmp_path / f"b/eq4.{kind}").read_bytes()


@pytest.mark.parametrize("words", [["fig7"], ["eq4", "nothing"], ["eq4", "--seed", "-1"]])
def test_a_bad_name_or_seed_is_told_in_one_line_before_anything_is_computed(words, tmp_path, capsys):
    assert main(["reproduce", *words, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "expected" in said
    assert "found" in said
    assert not (tmp_path / "out").exists()


@few
@given(away=st.floats(5.0, 500.0), name=st.sampled_from(list(eq4.FILTERS)))
def test_r_from_the_origin_is_magnified_by_the_way_there_and_from_the_wall_it_is_not(away, name):
    here, there = (eq4.sigmas(eq4.FILTERS[name], False, at) for at in (away, 2.0 * away))
    assert np.all(there[:2] > 1.7 * here[:2])
    np.testing.assert_allclose(there[2], here[2], rtol=1e-3)  # its covariance with alpha takes it back
    here, there = (eq4.sigmas(eq4.FILTERS[name], True, at) for at in (away, 2.0 * away))
    np.testing.assert_allclose(there, here, rtol=1e-6)


def test_passes_counts_the_beginning_and_each_return():
    out_and_back = np.concatenate([np.linspace(0.0, 5.0, 50), np.linspace(5.0, 0.2, 50)])
    path = np.stack([np.tile(out_and_back, 3), np.zeros(300), np.zeros(300)], axis=-1)
    assert passes(path) == 4
    assert passes(path[:50]) == 1


@pytest.mark.long
def test_figure_4_is_planned_and_driven_as_in_the_text():
    made = fig4.reproduce(1)
    ours = made.ours["block-ekf"]
    for quantity, said in made.paper.items():
        assert ours[quantity] == said
    assert ours["wall 16 was reached"] is True
    # It stops beside wall 16 in an inner corner, where wall 15 may be nearer still.
    passed = ours["walls nearest to the robot on this way"].removesuffix(", 16")
    assert f"{passed}, 16" == fig4.SAID[fig4.PLANNED]
    place, graph = made.figure.axes
    written = [text.get_text() for text in graph.texts]  # the numbers of the walls, and the length of the scale bar
    assert sorted(int(text) for text in written if text.isdigit()) == list(range(1, 17))
    assert [line.get_label() for line in place.lines if not line.get_label().startswith("_")] == [
        "exploration", "to wall 8", "from wall 8 to wall 16", "start",
    ]  # fmt: skip


def test_table_1_and_figure_8_are_made_from_one_drive(monkeypatch):
    monkeypatch.setattr(table1, "DRIVES", 1)
    for module in (table1, maps):
        monkeypatch.setattr(module, "BESIDE", ("block-ekf", "invariant-ekf"))
    distances, map_made = table1.reproduce(1), fig8.reproduce(1)
    for pair, by_hand in table1.BY_HAND.items():
        assert distances.ours["true"][f"{pair}, m"] == pytest.approx(by_hand, abs=0.026)
        assert distances.ours["block-ekf"][f"{pair}, m"] == pytest.approx(by_hand, abs=0.05)
    assert map_made.ours["block-ekf"]["least trace of the pose covariance over the start's"] < 0.5
    # What no scan can tell it never claims, on any seed; the full EKF loses a little of it.
    assert map_made.ours["invariant-ekf"]["least trace of the pose covariance over the start's"] >= 1.0 - 1e-6
    assert {"paper", "ours", "command"} <= set(map_made.record("made by"))


def test_a_robot_that_stands_still_learns_by_dropped_correlations_and_by_nothing_else(monkeypatch):
    monkeypatch.setattr(standing, "COMPARED", ("block-ekf", "oc-ekf", "intersection-ekf"))
    monkeypatch.setattr(standing, "LOOKS", 40)
    made = standing.reproduce(1)
    trace = {name: values[standing.LAST] for name, values in made.ours.items()}
    assert trace["block-ekf"] < 1e-3
    assert trace["oc-ekf"] == pytest.approx(1.0, abs=1e-9)
    assert trace["intersection-ekf"] >= 1.0 - 1e-9
    assert len(made.figure.axes) == 2
