"""What the studies of back ends rest on: observations told wall by wall, noise as stated, rings of corridors."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.experiments.campaign.scores.score import offsets
from chainslam.experiments.replays.corridor import FIRM_RAD, Loop, drive, on_ring
from chainslam.experiments.replays.observations import observations_of, ride
from chainslam.experiments.replays.oracles import as_stated
from chainslam.experiments.replays.recordings import record, recorded
from chainslam.experiments.replays.replay import ReplayOptions, replay
from chainslam.experiments.reproductions.runs.origin import ShiftedOrigin
from chainslam.experiments.reproductions.runs.standing import slope, stand
from chainslam.experiments.scenario import TrialConfig, drawn_start
from chainslam.experiments.scoring.statistics import mean_interval
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError
from chainslam.slam.backends import BACKENDS
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.estimation.models import innovations
from chainslam.slam.geometry.poses import to_world
from studies.consistency.bias import BiasStudy
from studies.consistency.existence import ExistenceStudy, Looks, counted, seen_lines, table
from studies.consistency.extraction import PLANS, ExtractionStudy, worlds
from studies.consistency.loops import LoopStudy
from studies.runner.faults import Fault, faulty

few = settings(max_examples=20, deadline=None, derandomize=True)


@pytest.mark.parametrize("perfect", [True, False])
def test_a_back_end_alone_gets_what_the_mapper_would_hand_it_bit_for_bit(perfect):
    run = recorded(run_trial(TrialConfig("paper-fig4", seed=4, max_steps=25)))
    ridden = ride(BACKENDS["full-ekf"].make(run.start_pose.copy(), run.start_cov.copy()), observations_of(run, perfect))
    mapped = replay(run, "full-ekf", ReplayOptions("true", perfect))
    np.testing.assert_array_equal(ridden.estimated_world, mapped.log.estimated_world)
    np.testing.assert_array_equal(ridden.estimated_cov, mapped.log.estimated_cov)
    assert ridden.pose_nees.mean() / 3 == pytest.approx(mapped.summary["pose_anees"], rel=1e-9)


@few
@given(seed=st.integers(0, 2**32))
def test_an_observation_drawn_as_stated_has_the_error_that_the_model_weighs(seed):
    """Whitened by the model's own R at the truth, the innovation is the draw, however far off the direction is.

    The middle of the piece stays on its beam, wherever the line that it was fitted with lay.
    """
    rng = np.random.default_rng(seed)
    pose, alpha, r = np.array([1.0, -2.0, 0.4]), rng.uniform(-3, 3, 6), rng.uniform(0.5, 4.0, 6)
    t0, along, across = rng.uniform(-2, 2, 6), rng.uniform(1e-3, 0.15, 6), rng.uniform(1e-3, 0.02, 6)
    turn = np.tile(np.eye(2), (6, 1, 1))
    turn[:, 1, 0] = t0
    cov = turn @ (np.stack([along, across], -1)[..., None] ** 2 * np.eye(2)) @ turn.swapaxes(1, 2)
    draws = rng.standard_normal((6, 2))
    bearings = alpha + rng.uniform(-1.0, 1.0, 6)
    seen, told = as_stated(np.stack([alpha, r], axis=-1), bearings, cov, draws)
    n = np.stack([np.cos(alpha + pose[2]), np.sin(alpha + pose[2])], axis=-1)
    anchors = pose[:2] + r[:, None] * n
    model = innovations(pose, anchors, np.stack([alpha + pose[2], np.zeros(6)], axis=-1), seen, told)
    white = model.e / np.sqrt(np.diagonal(model.R, axis1=1, axis2=2))
    np.testing.assert_allclose(white, draws, atol=1e-9)
    middle = np.arctan2(told[:, 0, 1] / told[:, 0, 0], seen[:, 1])
    np.testing.assert_allclose(np.cos(seen[:, 0] + middle - bearings), 1.0, atol=1e-12)
    for before, after in zip(cov, told, strict=True):
        assert after[0, 0] == before[0, 0]
        assert np.linalg.det(after) == pytest.approx(np.linalg.det(before), rel=1e-6)


def test_no_observation_is_drawn_from_behind_however_slanted_its_wall_is():
    bearings, count = np.repeat([1.49, -1.49, 1.56], 40), 120
    lines, cov = np.tile([0.0, 1.0], (count, 1)), np.tile(np.diag([0.25, 1e-4]), (count, 1, 1))
    seen, told = as_stated(lines, bearings, cov, np.random.default_rng(0).standard_normal((count, 2)))
    assert np.all(seen[:, 1] > 0.0)
    assert np.all(np.abs(np.arctan2(told[:, 0, 1] / told[:, 0, 0], seen[:, 1])) < 1.5 + 1e-9)
    assert np.abs(seen[:, 0]).max() <= 1.0


def test_a_recording_is_made_once_and_kept(tmp_path):
    config = TrialConfig("paper-fig4", seed=2, max_steps=20)
    new, kept = record(config, tmp_path), record(config, tmp_path)
    np.testing.assert_array_equal(new.recording.ranges_m, kept.recording.ranges_m)
    np.testing.assert_array_equal(new.true_poses_world, kept.true_poses_world)
    (home,) = tmp_path.iterdir()
    home.rename(tmp_path / home.name.replace("fig4", "fig8"))
    with pytest.raises(UsageError, match="another"):
        record(TrialConfig("paper-fig8", seed=2), tmp_path)


@pytest.mark.parametrize("length_m", [30.0, 200.0])
def test_a_ring_closes_smoothly(length_m):
    way = np.linspace(0.0, length_m, 4001)
    poses = on_ring(way, length_m)
    np.testing.assert_allclose(poses[-1] - poses[0], 0.0, atol=1e-9)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    np.testing.assert_allclose(steps, length_m / 4000, rtol=1e-3)
    off = poses[:-1, 2] - np.arctan2(*np.diff(poses[:, :2], axis=0).T[::-1])
    np.testing.assert_allclose(np.sin(0.5 * off), 0.0, atol=0.03)


def test_every_back_end_meets_the_same_ring_and_nothing_is_seen_in_the_gap():
    one, again = drive(Loop(30.0, gap_m=6.0), 7), drive(Loop(30.0, gap_m=6.0), 7)
    for a, b in zip(one.again, again.again, strict=True):
        np.testing.assert_array_equal(a.lines, b.lines)
    seen = np.array([len(a) + len(b) for a, b in zip(one.again, one.first, strict=True)])
    way = 0.25 * np.arange(len(seen))
    gap = (way > 24.0) & (way < 30.0)
    assert not seen[gap].any()
    assert np.mean(seen[~gap]) > 3
    assert not len(one.first[-1])
    assert max(np.sqrt(looks.cov[:, 0, 0].max(initial=0.0)) for looks in one.again) < FIRM_RAD


def mean_anees(told, loops=16):
    """Return each ring's pose ANEES of the invariant filter, from a sure start."""
    found = []
    for seed in range(1, loops + 1):
        seen = drive(Loop(20.0, after_m=5.0), seed)
        make = BACKENDS["invariant-ekf"].make
        found.append(
            ride(make(*drawn_start(seen.chance, seen.true_poses_world[0], "zero")), seen.told(told)).pose_nees.mean()
            / 3
        )
    return np.array(found)


def test_the_study_has_teeth():
    """A filter that is told half of the noise is rejected by its interval, and one that is told all of it is not."""
    honest, fooled = mean_anees(1.0), mean_anees(0.5)
    assert mean_interval(fooled)[0] > 1.15
    low, high = mean_interval(honest)
    assert low < 1.15
    assert high > 0.85


def test_a_study_goes_on_where_it_was_left(tmp_path):
    def study(seeds, backends=("full-ekf", "block-ekf")):
        LoopStudy(backends, (20.0,), gap_m=(0.0,), seeds=seeds, jobs=1, out=tmp_path / "loops.jsonl").run()
        return (tmp_path / "loops.jsonl").read_text().splitlines()

    first = study(1)
    assert len(first) == 2
    both = study(2)
    assert len(both) == 4
    assert set(first) < set(both)
    assert study(2) == both
    (tmp_path / "loops.jsonl").write_text("a,b\n1,2\n")
    with pytest.raises(UsageError, match="another"):
        study(1)


@pytest.mark.parametrize(("p0", "seeds", "least"), [("small", range(1, 9), 1.2), ("large", range(1, 4), 5.0)])
def test_the_origin_matters_to_lines_that_are_measured_from_it_alone(p0, seeds, least):
    """Equation (4): the same drives, the world put 100 m away."""
    study = ShiftedOrigin(length_m=20.0, p0=p0)
    here, there, apart = study.ridden(FullEkf, True, 1)
    assert apart < 1e-9
    assert there == pytest.approx(here, rel=1e-6)
    found = np.array([study.ridden(FullEkf, False, seed) for seed in seeds])
    assert found[:, 2].min() > 1e-3
    here, there, _ = found.mean(axis=0)
    print(f"pose ANEES measured from the origin: {here:.1f}, with the origin 100 m away {there:.0f}")
    assert there > least * here


def test_a_map_that_has_only_moved_keeps_its_shape():
    """Offsets of points from their lines: all of a small shift and turn, none once they are undone."""
    rng = np.random.default_rng(8)
    lines = np.stack([rng.uniform(-np.pi, np.pi, 9), rng.uniform(1.0, 5.0, 9)], axis=-1)
    n, t = (
        np.stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])], -1),
        np.stack([-np.sin(lines[:, 0]), np.cos(lines[:, 0])], -1),
    )
    points = lines[:, 1, None, None] * n[:, None] + np.array([-1.0, 2.0])[:, None] * t[:, None]
    assert offsets(points, lines) == pytest.approx((0.0, 0.0), abs=1e-12)
    off, shape = offsets(to_world(points.reshape(-1, 2), np.array([0.02, -0.01, 1e-3])).reshape(-1, 2, 2), lines)
    assert off > 0.01
    assert shape < 1e-5
    points[0] += 0.05 * n[0]
    assert offsets(points, lines)[1] > 0.005


def test_a_fault_changes_what_is_reported_and_nothing_else():
    run = recorded(run_trial(TrialConfig("paper-fig4", seed=4, max_steps=12)))
    old = run.recording
    assert faulty(run, Fault()) is run
    again = faulty(run, Fault("range-noise", float(old.sigma_m[0])))
    np.testing.assert_array_equal(again.recording.ranges_m, old.ranges_m)
    np.testing.assert_array_equal(again.true_face_of_beam, run.true_face_of_beam)
    louder = faulty(run, Fault("range-noise", float(2 * old.sigma_m[0]))).recording
    np.testing.assert_array_equal(louder.sigma_m, 2 * old.sigma_m)
    both = np.isfinite(louder.ranges_m) & np.isfinite(old.ranges_m)
    assert np.abs(louder.ranges_m[both] - old.ranges_m[both]).max() > 2 * old.sigma_m[0]
    longer = faulty(run, Fault("wheel-scale", 0.1)).recording
    np.testing.assert_allclose(longer.odometry, 1.1 * old.odometry)
    bent = faulty(run, Fault("heading", 10.0)).recording.odometry - old.odometry
    way = np.hypot(*old.odometry[:, :2].T)
    np.testing.assert_allclose(bent, np.outer(way, [0.0, 0.0, np.deg2rad(10.0)]), atol=1e-15)
    off = faulty(run, Fault("range", 0.02)).recording.ranges_m - old.ranges_m
    np.testing.assert_allclose(off[np.isfinite(off)], 0.02, atol=1e-12)
    with pytest.raises(ValueError, match="expected a fault"):
        faulty(run, Fault("gravity", 1.0))


def test_the_bias_study_sends_every_fault_through_every_back_end(tmp_path, capsys):
    def study(**more):
        BiasStudy(
            world="paper-fig4", seeds=1, backends=("block-ekf", "full-ekf"), faults=("range",), range_m=(0.02,),
            max_steps=25, jobs=1, out=tmp_path / "bias.jsonl", recordings=tmp_path / "recordings", **more,
        ).run()  # fmt: skip
        rows = map(json.loads, (tmp_path / "bias.jsonl").read_text().splitlines())
        return {(r["association"], r["fault"], r["backend"]): r for r in rows}

    rows = study()
    assert len(rows) == 4
    for name in ("block-ekf", "full-ekf"):
        assert rows["true", "range", name]["shape_cm"] > rows["true", "none", name]["shape_cm"]
    assert "range 20 mm" in capsys.readouterr().out
    rows = study(association="own")
    assert len(rows) == 8
    assert "false matches" in capsys.readouterr().out


def test_standing_still_only_a_consistent_filter_learns_nothing():
    for name, least in (("invariant-ekf", -1e-12), ("full-ekf", -1.0)):
        trace, bound = stand(name, "large", 30, 1)
        assert bound.min() >= least
        assert (trace[-1] > 1 - 1e-9) == (name == "invariant-ekf")
    assert slope(stand("block-ekf", "large", 100, 1)[0]) == pytest.approx(-1.1, abs=0.25)


def test_the_study_of_extraction_asks_for_plans_beside_the_checkout_and_refuses_a_folder_without(tmp_path):
    beside = Path(__file__).resolve().parents[3] / "shared" / "data" / "plans"
    assert PLANS.resolve() == beside.resolve()
    with pytest.raises(UsageError, match=r"found no file \*\.json in"):
        next(worlds(ExtractionStudy(plans=tmp_path)))


def test_the_study_of_existence_counts_looks_at_walls_and_asks_for_plans(tmp_path):
    """Exact scans of a few rooms: each wall is one face, and each look shows it."""
    counts = counted(TrialConfig("paper-fig4", "invariant-ekf", seed=1, max_steps=40, errorless=True))
    looks, one_face = counts["looks", False, False], (False, False)
    assert 4 <= counts["first looks", *one_face] <= counts["fresh", *one_face] < 10
    assert 50 < looks == counts["looks that show", *one_face] < counts["segments", *one_face]
    assert counts["segments", False, True] == 0
    assert table(counts).row_count == 9
    few = counted(TrialConfig("paper-fig9", "invariant-ekf", seed=1, max_steps=60))
    looks, fresh = few["line looks", True, False], few["fresh", True, False]
    assert 0.8 * looks < few["line looks that show", True, False] <= looks
    assert 10 < looks <= fresh, "a line is looked at for the first time once"
    with pytest.raises(UsageError, match=r"found no lifull_\*\.json"):
        ExistenceStudy(plans=tmp_path).run()


def test_a_line_is_looked_at_from_another_place_and_by_beams_that_reach_it():
    step = run_trial(TrialConfig("paper-fig4", "invariant-ekf", seed=1, max_steps=3)).last
    line, here = seen_lines(step)[0], step.map.belief.pose_world[:2]
    elsewhere, far_off = here + 1.0, line + np.array([0.0, 100.0, 100.0, 0.0, 0.0, 0.0])
    looks = Looks(np.zeros(0, dtype=np.int64), lambda _: np.zeros(0, dtype=np.int64))
    looks._lines = [(line, here, False), (line, elsewhere, False), (far_off, elsewhere, False)]
    looks._look_at_lines(step)
    assert dict(looks.counts) == {("line looks", True, False): 1, ("line looks that show", True, False): 1}
    assert [place is here for _, place, _ in looks._lines] == [True, False]
