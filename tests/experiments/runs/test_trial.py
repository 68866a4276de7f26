import json
from dataclasses import replace

import numpy as np
import pytest

import chainslam.experiments.trial as trial_module
from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.scoring.summary import TIMED, odometry_path, pose_nees
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError

FILES = (
    "config.json summary.json steps.csv log.npz map.npz map.geojson map.svg map.dxf map.png"
    " visibility.json visibility.png trajectory_true.tum trajectory_estimated.tum"
)


def trial(world, mission, **changes):
    return run_trial(TrialConfig("square", **changes), world=world, mission=mission)


def test_a_run_is_scored(world, scripted_mission):
    summary = trial(world, scripted_mission).summary
    assert summary["status"] == "complete"
    assert summary["steps"] == 19
    assert summary["contours_closed"] == summary["contours_reachable"] == 2
    assert summary["coverage"] == 1.0
    assert summary["false_matches"] == summary["duplicate_lines"] == summary["collisions"] == 0
    assert summary["map_anees"] == pytest.approx(0.0, abs=1e-9), "the walls stand to one another as the true ones do"
    assert 0.5 < summary["swept"] < 1.0
    assert set(summary["step_ms"]) == set(summary["planning_ms"]) == {"mean", "p50", "p95", "max"}
    assert 0.0 < summary["planning_ms"]["mean"] < summary["step_ms"]["mean"]


def test_the_compiler_is_loaded_before_the_first_step(world, scripted_mission, monkeypatch):
    order: list[str] = []
    monkeypatch.setattr(trial_module, "prepare_kernels", lambda: order.append("prepared"))
    trial_module._prepare_process.cache_clear()
    run_trial(TrialConfig("square"), lambda step: order.append("step"), world, scripted_mission)
    assert order[:2] == ["prepared", "step"]
    assert order.count("prepared") == 1


def test_without_noise_there_is_no_nees_and_no_odometry_error(world, scripted_mission):
    summary = trial(world, scripted_mission, errorless=True).summary
    assert summary["pose_anees"] is summary["pose_nees_in_band"] is summary["map_anees"] is None
    assert summary["pose_rmse_m"] < 1e-12
    assert summary["odometry_max_m"] < 1e-12


def test_nees_of_odometry_with_its_own_covariance_is_chi_square(world, scripted_mission):
    """The scripted pose is the odometry's: with its exact first-order covariance the NEES averages 3."""
    values = []
    for seed in range(300):
        robot = build(TrialConfig("square", seed=seed), world).robot
        robot.sense()
        from chainslam.slam.robot import MotionCommand

        odometry = robot.drive(MotionCommand(0.15, 0.1))
        from chainslam.slam.geometry.poses import compose, inverse

        error = compose(inverse(world.start), robot.true_pose) - odometry.motion
        values.append(error @ np.linalg.solve(odometry.cov, error))
    assert np.mean(values) == pytest.approx(3.0, abs=4 * np.sqrt(6 / 300))


def test_the_start_is_drawn_from_p0_alike_for_all(world):
    starts = np.array([build(TrialConfig("square", seed=s, p0="large"), world).start_estimate for s in range(300)])
    sigma = (starts - world.start).std(axis=0)
    np.testing.assert_allclose(sigma, [0.1, 0.1, np.deg2rad(2.0)], rtol=0.2)
    errorless = build(TrialConfig("square", errorless=True), world)
    np.testing.assert_array_equal(errorless.start_estimate, world.start)


def test_a_limit_stops_the_run(world, scripted_mission):
    result = trial(world, scripted_mission, max_steps=4)
    assert (result.summary["status"], result.summary["steps"]) == ("stopped", 4)
    assert "4 steps" in result.summary["reason"]
    assert result.ending.exit_status == 0


@pytest.mark.parametrize(
    ("error", "status", "code"), [(RuntimeError, "failed", 1), (KeyboardInterrupt, "stopped", 130)]
)
def test_whatever_ends_a_run_its_steps_are_kept(world, scripted_mission, tmp_path, error, status, code):
    result = trial(world, lambda scenario: scripted_mission(scenario, fail_at=6, error=error))
    assert (result.ending.status, result.ending.exit_status, result.summary["steps"]) == (status, code, 6)
    assert write_results(result, tmp_path) == []
    assert all((tmp_path / name).exists() for name in FILES.split())
    assert (tmp_path / "failure.txt").exists() == (code == 1)


def test_a_run_without_a_step_leaves_a_summary(world, scripted_mission, tmp_path):
    result = trial(world, lambda scenario: scripted_mission(scenario, fail_at=0))
    assert write_results(result, tmp_path) == []
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert summary["coverage"] is None


def test_the_same_command_gives_the_same_bytes_but_for_times(world, scripted_mission, tmp_path):
    contents = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_results(trial(world, scripted_mission), tmp_path / name)
        contents.append({file: (tmp_path / name / file).read_bytes() for file in FILES.split()})
    assert contents[0] == contents[1]


def test_the_files_hold_what_they_promise(world, scripted_mission, tmp_path):
    result = trial(world, scripted_mission)
    write_results(result, tmp_path)
    assert not list(tmp_path.glob(".*"))
    with np.load(tmp_path / "log.npz") as log:
        assert log["ranges_m"].shape == log["true_face_of_beam"].shape == (19, 180)
        assert log["odometry_cov"].shape == (19, 3, 3)
        np.testing.assert_array_equal(log["true_faces"], world.faces)
    with np.load(tmp_path / "map.npz") as map_file:
        assert map_file["cov"].shape == (3 + 2 * 8, 3 + 2 * 8)
        assert map_file["lines"].shape == map_file["anchors"].shape == (8, 2)
    collection = json.loads((tmp_path / "map.geojson").read_text())
    kinds = [feature["properties"]["kind"] for feature in collection["features"]]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "wall": 8, "corner": 8, "chain": 2, "trajectory": 1, "start": 1,
    }  # fmt: skip
    rows = [line.split() for line in (tmp_path / "trajectory_true.tum").read_text().splitlines()]
    assert {len(row) for row in rows} == {8}
    times = [float(row[0]) for row in rows]
    assert times == sorted(set(times))
    assert len((tmp_path / "steps.csv").read_text().splitlines()) == 20


def test_wheels_alone_start_at_the_truth(world, scripted_mission):
    log = trial(world, scripted_mission, p0="large").log
    np.testing.assert_array_equal(odometry_path(log)[0], log.true_world[0])
    assert np.all(np.isfinite(pose_nees(log)))


@pytest.mark.parametrize(
    "changes",
    [{"backend": "magic"}, {"strategy": "magic"}, {"seed": -1}, {"max_steps": 0}],
    ids=lambda c: next(iter(c)),
)
def test_bad_settings_are_told_in_one_line(world, changes):
    with pytest.raises(UsageError, match=r"^expected .*, found .*: .*$"):
        build(TrialConfig("square", **changes), world)


def test_a_back_end_that_smooths_leaves_its_solution_beside_what_each_step_knew(tmp_path):
    config = TrialConfig("paper-fig8", "graph-batch", seed=3, max_steps=25)
    batch, stepwise = run_trial(config), run_trial(replace(config, backend="graph"))
    assert stepwise.smoothed is None
    same = {"backend", *TIMED}
    assert {k: v for k, v in batch.summary.items() if k not in same} == {
        k: v for k, v in stepwise.summary.items() if k not in same
    }
    assert write_results(batch, tmp_path) == []
    smoothed, known = (np.loadtxt(tmp_path / f"trajectory_{name}.tum") for name in ("smoothed", "estimated"))
    np.testing.assert_array_equal(smoothed[:, 0], known[:, 0])
    assert 0.0 < np.abs(smoothed[:, 1:3] - known[:, 1:3]).max() < 0.1
    with np.load(tmp_path / "map.npz") as arrays:
        np.testing.assert_allclose(arrays["pose"][:2], smoothed[-1, 1:3], atol=1e-8)
        np.testing.assert_array_equal(arrays["ids"], batch.last.map.ids)
        assert np.linalg.eigvalsh(arrays["cov"]).min() > 0


def test_every_segment_of_few_beams_that_moved_the_estimate_is_held_against_the_truth():
    moved = []

    def watch(step):
        rows = step.matches.pairs[:, 0]
        moved.extend(step.matches.pairs[step.segments.is_tentative[rows], 1].tolist())

    votes = run_trial(TrialConfig("paper-fig9", "full-ekf", seed=2, max_steps=80), watch).votes
    assert moved
    assert [line for line, _ in votes.fused_of_few_beams] == moved
