"""Trajectories in the formats of others."""

import numpy as np
import pytest

from chainslam.experiments.library.audit.auditing import audit, read
from chainslam.experiments.usage import UsageError
from tests.sim.logs.written_bag import Bag

from .drives import drives
from .written import in_space, tum, written

DRIVE = drives(1, 60, seed=3)[0]


def test_six_columns_and_twenty_one_of_a_robot_in_the_plane_say_the_same(tmp_path):
    six, true = written(tmp_path, DRIVE)
    many = tum(tmp_path / "many.tum", DRIVE.time_s, DRIVE.estimated, in_space(DRIVE.covs))
    one, other = (audit(path, truth=true).trajectories[0] for path in (six, many))
    assert one.pose.anees == pytest.approx(other.pose.anees, rel=1e-9)
    assert read(six).used_covs == pytest.approx(DRIVE.covs, rel=1e-12)


@pytest.mark.parametrize(
    ("header", "degrees"),
    [
        ("time_s,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,behaviour", False),
        ("t, x, y, theta, xx, xy, xt, yy, yt, tt, note", False),
        ("\xef\xbb\xbft,tx,ty,theta,xx,xy,xt,yy,yt,tt,note", False),
        ("timestamp,x,y,yaw,p_x_x,p_x_y,p_x_theta,p_y_y,p_y_theta,p_theta_theta,remark", False),
    ],
)
def test_columns_of_a_table_are_found_by_their_names(header, degrees, tmp_path):
    upper = np.triu_indices(3)
    cells = np.column_stack([DRIVE.time_s, DRIVE.estimated, DRIVE.covs[:, upper[0], upper[1]]])
    rows = [",".join([*(f"{value:.17g}" for value in row), "follow"]) for row in cells]
    (tmp_path / "a.csv").write_text("\n".join([header, *rows]), encoding="latin-1")
    found = read(tmp_path / "a.csv")
    assert found.poses_world == pytest.approx(np.column_stack([DRIVE.estimated[:, :2], found.poses_world[:, 2]]))
    assert found.used_covs == pytest.approx(DRIVE.covs)


def test_a_table_without_correlations_says_so(tmp_path):
    (tmp_path / "a.csv").write_text("t,x,y,theta,xx,yy,tt\n0,0,0,0,1,1,1\n1,0,0,0,1,1,1\n")
    assert read(tmp_path / "a.csv").notes == ("correlations without a column count as 0",)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "found no row"),
        ("0 0 0 0\n", "found poses only"),
        ("0 1 2\n", "found 3 columns"),
        ("0 0 0 0\n1 0 0\n", "expected 4 columns in line 2"),
        ("0 0 0 0 0 0 0 1\n1 0 0 zero 0 0 0 1\n", "expected numbers in line 2"),
        ("0 0 0 0 0 0 0 2 1 0 0 1 0 1\n", "unit quaternions"),
        ("0 0 0 90 1 0 0 1 0 1\n1 0 0 180 1 0 0 1 0 1\n2 0 0 -180 1 0 0 1 0 1\n", "degrees?"),
        ("0 nan 0 0 1 0 0 1 0 1\n", "in row 1"),
        ("a,b,c\n1,2,3\n", "expected columns t, x, y and theta"),
        ("t;x;y;theta\n0;0;0;0\n", "between blanks or commas, found other words"),
    ],
)
def test_what_is_no_trajectory_is_refused_in_one_line(text, told, tmp_path):
    (tmp_path / "a.txt").write_text(text)
    true = tum(tmp_path / "true.tum", DRIVE.time_s, DRIVE.true)
    with pytest.raises(UsageError) as found:
        audit(tmp_path / "a.txt", truth=true)
    assert told in str(found.value)
    assert "\n" not in str(found.value)


def test_quaternions_with_w_first_are_told(tmp_path):
    turn = 0.1 * np.arange(12.0)
    zero = np.zeros(12)
    np.savetxt(tmp_path / "a.tum", np.column_stack([turn, zero, zero, zero, np.cos(turn), zero, zero, np.sin(turn)]))
    assert any("in the order w x y z" in note for note in read(tmp_path / "a.tum").notes)


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "a.bag"])
def test_bags_that_are_none_are_refused_in_one_line(name, tmp_path):
    (tmp_path / name).write_bytes(b"none")
    with pytest.raises(UsageError, match="expected a bag that can be read") as found:
        audit(tmp_path / name, truth=tmp_path / name)
    assert "\n" not in str(found.value)


def test_a_straight_drive_is_not_taken_for_quaternions_with_w_first(tmp_path):
    zero, one = np.zeros(12), np.ones(12)
    np.savetxt(tmp_path / "a.tum", np.column_stack([np.arange(12.0), *[zero] * 6, one]))
    assert read(tmp_path / "a.tum").notes == ()


def test_a_robot_that_tilts_is_audited_in_the_plane_which_is_told(tmp_path):
    q = np.array([0.3, 0.2, 0.0, np.sqrt(1 - 0.13)])
    np.savetxt(tmp_path / "a.tum", np.array([[k, 0, 0, 0, *q, 1, 0, 0, 1, 0, 1] for k in range(3)]))
    assert read(tmp_path / "a.tum").notes == ("the robot tilts, and only x, y and yaw are audited",)


@pytest.mark.parametrize("kind", ["ros1", "mcap", "sqlite"])
def test_odometry_of_a_bag_is_audited(kind, tmp_path, monkeypatch):
    path = tmp_path / ("a.bag" if kind == "ros1" else "bag")
    covs = in_space(DRIVE.covs)
    with Bag(path, kind) as bag:
        plain = bag.type
        for time_s, pose, cov, true in zip(DRIVE.time_s + 1e9, DRIVE.estimated, covs, DRIVE.true, strict=True):
            for topic, at, values in (("/amcl", pose, cov.ravel()), ("/truth", true, np.zeros(36))):
                bag.type = lambda name, values=values, **fields: plain(
                    name, **(fields | ({"covariance": values} if name.endswith("PoseWithCovariance") else {}))
                )
                bag.odometry(time_s, at, topic=topic)
    with pytest.raises(UsageError, match="found several: name one of /amcl, /truth as --topic"):
        audit(path, truth=path)
    found = audit(path, truth=path, topic="/amcl", truth_topic="/truth").trajectories[0]
    estimated, true = written(tmp_path, DRIVE)
    assert found.pose.anees == pytest.approx(audit(estimated, truth=true).trajectories[0].pose.anees, rel=1e-9)
    with pytest.raises(UsageError, match="did you mean /amcl"):
        audit(path, truth=true, topic="/amc")


def test_times_that_do_not_overlap_are_told_with_what_would_help(tmp_path):
    estimated, _ = written(tmp_path, DRIVE)
    for name, time_s, words in (
        ("ms", 1000.0 * DRIVE.time_s + 1e5, "on the same clock"),
        ("ns", 1e9 * (DRIVE.time_s + 1e-3), "in nanoseconds"),
        ("late", DRIVE.time_s + 500.0, "shift one by about 500.000 s"),
    ):
        true = tum(tmp_path / f"{name}.tum", time_s, DRIVE.true)
        with pytest.raises(UsageError, match=f"expected a common time.*{words}"):
            audit(estimated, truth=true)


def test_the_truth_is_interpolated_or_the_nearest_and_says_so(tmp_path):
    estimated, _ = written(tmp_path, DRIVE)
    true = tum(tmp_path / "t.tum", DRIVE.time_s + 0.03, DRIVE.true)
    found = audit(estimated, truth=true).trajectories[0]
    assert found.notes == ("t.tum is interpolated; 1 of 60 poses have no time in it",)
    found = audit(estimated, truth=true, nearest=0.05).trajectories[0]
    assert found.notes == ("t.tum is nearest within 0.05 s",)
    sparse = tum(tmp_path / "s.tum", DRIVE.time_s[::3], DRIVE.true[::3])
    found = audit(estimated, truth=sparse).trajectories[0]
    assert found.pose.count == 20
    gaps = tum(tmp_path / "g.tum", DRIVE.time_s[::20] + 0.03, DRIVE.true[::20])
    with pytest.raises(UsageError, match="--nearest SECONDS"):
        audit(estimated, truth=gaps)


LONG = drives(1, 400, seed=3)[0]
T = LONG.time_s


@pytest.mark.parametrize(
    ("known_s", "note"),
    [
        (T + 5e-4, ""),
        (T + 5e-3, "interpolated; 1 of 400 poses have no time in it"),
        (np.sort(np.r_[T, T[:300] + 0.03]), ""),
        (np.sort(np.r_[T[::4], T + 0.03]), "interpolated"),
        (T[::8] + 0.03, "interpolated; 8 of 400 poses have no time in it"),
        (T[::20] + 5e-3, "nearest within 0.01 s; 380 of 400 poses have no time in it"),
    ],
    ids=["within 1 ms", "within 5 ms", "most at the same", "few at the same", "gaps of 0.8 s", "gaps of 2 s"],
)
def test_the_truth_is_taken_at_the_same_times_or_between_or_near(known_s, note, tmp_path):
    estimated, _ = written(tmp_path, LONG)
    rows = np.clip(np.searchsorted(T, known_s - 0.04), 0, len(T) - 1)
    true = tum(tmp_path / "t.tum", known_s, LONG.true[rows])
    found = audit(estimated, truth=true).trajectories[0]
    assert found.notes == ((f"t.tum is {note}",) if note else ())


def test_times_of_the_trajectory_in_another_unit_are_told(tmp_path):
    path = tum(tmp_path / "ns.tum", 1e9 * (DRIVE.time_s + 1e-3), DRIVE.estimated, DRIVE.covs)
    with pytest.raises(UsageError, match=r"the times of ns\.tum are in nanoseconds"):
        audit(path, truth=tum(tmp_path / "true.tum", DRIVE.time_s, DRIVE.true))
