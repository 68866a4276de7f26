"""Poses in space are audited on all six axes, from the formats that have them."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import chainslam
from chainslam.experiments.campaign.comparison.consistency import CONSISTENT, OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.auditing import audit, read
from chainslam.experiments.library.audit.draws import score
from chainslam.experiments.library.audit.geometry import space
from chainslam.experiments.library.audit.verdicts import pool
from chainslam.slam.evaluation.consistency import nees, whitened
from tests.sim.logs.written_bag import Bag

from ..drives import drives
from ..written import in_space, tum, written
from .spaces import FRAMES, UPPER, fixes, pose, spatial

RUN = fixes(600, seed=2)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_true_covariance_is_consistent_and_a_quarter_of_it_overconfident(frame, tmp_path):
    time_s, true, mean, covs = RUN
    covs, against = space.to_frame(mean, covs, "body", frame), spatial(tmp_path / "true", time_s, true)
    right, wrong = (spatial(tmp_path / f"{part}", time_s, mean, part * covs) for part in (1.0, 0.25))
    found = audit([right, wrong], truth=against, space="space", error=frame).trajectories
    assert [each.verdict.words for each in found] == [CONSISTENT, OVERCONFIDENT]
    assert found[0].pose.low < 1.0 < found[0].pose.high
    assert found[1].verdict.factor == pytest.approx(2.0, rel=0.1)
    assert found[0].pose.anees == pytest.approx(np.mean(nees(space.errors(mean, true, frame), covs)) / 6.0)
    coverage = found[0].record()["rotation"]["coverage"]
    assert coverage["0.95"] == pytest.approx(0.95, abs=0.03)


def test_runs_of_a_true_filter_together_are_consistent_and_reject_no_more_than_five_per_cent_would():
    runs = [fixes(200, seed) for seed in range(10, 20)]
    scores = [score(whitened(space.errors(mean, true, "body"), covs)) for _, true, mean, covs in runs]
    pooled = pool(scores)
    assert pooled.verdict.words == CONSISTENT
    assert pooled.low < 1.0 < pooled.high
    assert sum(each.low > 1.0 or each.high < 1.0 for each in scores) <= 2


@pytest.mark.long
def test_of_100_true_filters_about_five_are_rejected_and_of_those_told_half_the_noise_nearly_all():
    found = {}
    for told in (1.0, 0.5):
        runs = [fixes(300, seed, told) for seed in range(100)]
        scores = [score(whitened(space.errors(mean, true, "body"), covs)) for _, true, mean, covs in runs]
        found[told] = [each.low > 1.0 or each.high < 1.0 for each in scores]
    assert 1 <= sum(found[1.0]) <= 10
    assert sum(found[0.5]) >= 95


@pytest.mark.parametrize("align", ["start", "all"])
def test_another_origin_of_the_world_is_taken_away(align, tmp_path):
    time_s, true, mean, covs = RUN
    moved = space.moved(mean, pose([5.0, -3.0, 2.0], [0.3, 0.4, -0.5]))
    against = spatial(tmp_path / "true", time_s, true)
    words = {"truth": against, "space": "space", "error": "body", "align": align}
    one, other = (
        audit(spatial(tmp_path / name, time_s, poses, covs), **words).trajectories[0]
        for name, poses in (("a", mean), ("b", moved))
    )
    assert one.pose.anees == pytest.approx(other.pose.anees, rel=1e-6)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_robot_in_the_plane_has_the_same_errors_in_space(frame, tmp_path):
    drive = drives(1, 200, seed=7, seen_every=1000)[0]  # by its wheels, so that there is a score from the start
    wide = in_space(drive.covs)
    wide[:, [3, 4], [3, 4]] = 0.01 + 0.001 * np.arange(200.0)[:, None]
    wide[:, 2, 2] = 0.01 + 20.0 * np.arange(200.0)
    poses = read(tum(tmp_path / "poses", drive.time_s, drive.estimated)).spatial
    wide = space.to_frame(poses, wide, "additive", frame)
    path, true = tum(tmp_path / "a", drive.time_s, drive.estimated, wide), written(tmp_path, drive)[1]
    flat, found = (audit(path, truth=true, error=frame, space=each).trajectories[0] for each in ("plane", "space"))
    assert 6.0 * found.pose.anees == pytest.approx(3.0 * flat.pose.anees, rel=1e-6)
    assert 6.0 * found.from_start == pytest.approx(3.0 * flat.from_start, rel=1e-6)
    for lag, in_plane in zip(found.lags, flat.lags, strict=True):
        assert 6.0 * lag.score.anees == pytest.approx(3.0 * in_plane.score.anees, rel=1e-6)
        assert (lag.error_m, lag.error_rad) == pytest.approx((in_plane.error_m, in_plane.error_rad))


def test_all_formats_say_the_same(tmp_path):
    time_s, true, mean, covs = (part[:60] for part in RUN)
    against = spatial(tmp_path / "true", time_s, true)
    axes = ("x", "y", "z", "roll", "pitch", "yaw")
    cells = np.column_stack([time_s, mean, covs[:, UPPER[0], UPPER[1]]])
    header = [
        "t",
        "x",
        "y",
        "z",
        "qx",
        "qy",
        "qz",
        "qw",
        *(f"cov_{axes[i]}_{axes[j]}" for i, j in zip(*UPPER, strict=True)),
    ]
    order = [0, *range(28, 0, -1)]
    lines = [",".join(f"{row[k]:.17g}" for k in order) for row in cells]
    (tmp_path / "a.csv").write_text("\n".join([",".join(header[k] for k in order), *lines]))
    paths = [
        spatial(tmp_path / "21", time_s, mean, covs), spatial(tmp_path / "36", time_s, mean, covs, True),
        tmp_path / "a.csv", tmp_path / "a.bag",
    ]  # fmt: skip
    with Bag(tmp_path / "a.bag", "ros1") as bag:
        for at, x, cov in zip(time_s + 1e9, mean, covs, strict=True):
            p, q = (bag.type(f"geometry_msgs/msg/{name}", **dict(zip("xyzw", part.tolist(), strict=False)))
                    for name, part in (("Point", x[:3]), ("Quaternion", x[3:])))  # fmt: skip
            kinds = "geometry_msgs/msg/PoseWithCovariance", "geometry_msgs/msg/PoseWithCovarianceStamped"
            inner = bag.type(
                kinds[0], pose=bag.type("geometry_msgs/msg/Pose", position=p, orientation=q), covariance=cov.ravel()
            )
            bag.write("/pose", kinds[1], bag.type(kinds[1], header=bag.header(at, "map"), pose=inner), at)
    late = spatial(tmp_path / "late", time_s + 1e9, true)
    found = [
        audit(path, truth=late if path.suffix == ".bag" else against, space="space", error="body").trajectories[0]
        for path in paths
    ]
    for each in found:
        assert each.pose.count == 60
        assert each.pose.anees == pytest.approx(found[0].pose.anees, rel=1e-9)
    # The same table is still audited in the plane.
    assert read(tmp_path / "a.csv").used_covs == pytest.approx(covs[:, [0, 1, 5]][:, :, [0, 1, 5]])


def test_rotations_first_are_recognised(tmp_path):
    time_s, true, mean, covs = RUN
    swap = [3, 4, 5, 0, 1, 2]
    covs = space.to_frame(mean, covs, "body", "additive")[:, swap][:, :, swap]
    path, against = spatial(tmp_path / "a", time_s, mean, covs), spatial(tmp_path / "true", time_s, true)
    [found] = audit(path, truth=against, space="space").trajectories
    assert found.hints == ("they would be consistent in the order roll pitch yaw x y z, as GTSAM has it",)


def test_the_command_names_rotations_and_writes_the_report(tmp_path, capsys):
    time_s, true, mean, covs = RUN
    path, against = spatial(tmp_path / "a", time_s, mean, covs), spatial(tmp_path / "true", time_s, true)
    words = ["audit", str(path), "--truth", str(against), "--space", "space", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "rotation" in told
    assert "heading" not in told
    assert "additive error of x y z and the turns about these axes, by default" in told
    page = (tmp_path / "out" / "report.html").read_text()
    assert "--space space" in page
    assert "rotation" in page
    [record] = json.loads((tmp_path / "out" / "audit.json").read_text())["trajectories"]
    assert record["rms_rotation_rad"] == pytest.approx(
        np.sqrt(np.mean((Rotation.from_quat(mean[:, 3:]).inv() * Rotation.from_quat(true[:, 3:])).magnitude() ** 2))
    )


def test_what_has_no_six_axes_is_refused_in_one_line(tmp_path):
    time_s, true, mean, covs = RUN
    against, drive = spatial(tmp_path / "true", time_s, true), drives(1, 40)[0]
    flat, _ = written(tmp_path, drive)
    np.savetxt(tmp_path / "txy", np.column_stack([drive.time_s, drive.true]))
    zero = tum(tmp_path / "zero", drive.time_s, drive.estimated, in_space(drive.covs))
    right = spatial(tmp_path / "a", time_s, mean, covs)
    (tmp_path / "r").write_text("0 1 0 0 0 0 0 0\n")
    for path, more, told in (
        (against, {"truth": against}, "found none: append their 21 columns"),
        (flat, {"truth": against}, "found those of x, y and heading"),
        (right, {"truth": tmp_path / "txy"}, "found poses in the plane: leave --space out"),
        (zero, {"truth": against}, "expected covariances of x y z roll pitch yaw in zero, found that 40 of 40"),
        (right, {"relations": tmp_path / "r"}, "at least 10 relations between poses of a within 10 ms, found 1 of 1"),
    ):
        with pytest.raises(chainslam.UsageError) as found:
            audit(path, space="space", **more)
        assert told in str(found.value)
        assert "\n" not in str(found.value)
