"""What an errorless mapper errs by: nothing where every beam is of one face, and named causes where it does."""

from types import SimpleNamespace

import pytest

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.truth import truth_of
from chainslam.experiments.trial import default_mission, run_scenario
from studies.results.exact import JUMP_M, Movements, causes, exact, table


def test_a_room_of_straight_walls_is_mapped_exactly_and_nothing_jumps():
    (row,) = exact("invariant-ekf", 30, "paper-fig8")
    assert row["pose_rms_m"] < 1e-5
    assert (row["steps"], row["jumped"], row["beyond_step"], row["false_matches"]) == (30, None, None, 0)
    assert sum(row["moved_m"].values()) < JUMP_M
    title = table([row]).title
    assert title.startswith("1 of 1 below 5 mm and without a false match")


@pytest.mark.parametrize(("matched", "cause"), [(0, "two faces"), (1, "false match")])
def test_what_moved_a_pose_is_the_observation_farthest_off_its_walls_true_line(matched, cause):
    """The first scan of figure 8 again, one segment of it turned, or fused into the wall of its neighbour."""
    scenario = build(TrialConfig("paper-fig8", "invariant-ekf", errorless=True, max_steps=2))
    votes = Votes(truth_of(scenario.world, scenario.config.robot))
    movements, steps = Movements(scenario, votes), []
    run_scenario(scenario, steps.append, default_mission)
    step, beams = steps[-1], scenario.robot.record.faces_of_beams[-1]
    votes.add(step.segments, step.walls_of_segments, beams, step.matches.pairs)
    assert movements._worst_observation(step)["cause"] == "earlier"
    pairs = step.matches.pairs.copy()
    if matched:
        pairs[0, 1] = pairs[1, 1]
    else:
        row = pairs[0, 0]
        step.segments.lines[row, 0] += 0.02
        first = step.segments.beams[row, 0]
        beams[first] = next(
            k for k in range(len(votes.truth.walls)) if votes.truth.walls[k] != votes.truth.walls[beams[first]]
        )
    told = movements._worst_observation(
        SimpleNamespace(segments=step.segments, matches=SimpleNamespace(pairs=pairs), localisation=step.localisation)
    )
    assert told["cause"] == cause
    assert told["squared"] > 1.0
    if not matched:
        assert told["turn_rad"] == pytest.approx(0.02, abs=1e-6)


def test_causes_are_summed_over_worlds_and_a_world_that_cannot_be_read_is_a_row():
    rows = [
        {"moved_m": {"two faces": 0.5, "earlier": 0.1}, "jumped": {"cause": "two faces"}},
        {"moved_m": {"two faces": 0.25}, "jumped": None},
        *exact("invariant-ekf", 5, "nowhere.json"),
    ]
    shown = causes(rows)
    assert [list(column.cells) for column in shown.columns] == [
        ["two faces", "earlier"],
        ["0.750", "0.100"],
        ["1", "0"],
    ]
    assert "nowhere" in next(table(rows[2:]).columns[0].cells)
