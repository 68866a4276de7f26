"""Covariances that cannot be right are recognised, whatever is wrong with them, and right ones are not suspected."""

import numpy as np
import pytest

from chainslam.experiments.library.audit.auditing import audit
from chainslam.experiments.usage import UsageError

from .drives import drives
from .written import in_space, tum, written

DRIVE = drives(1, 400, seed=5)[0]
TURNED = np.diag([1.0, 1.0, np.rad2deg(1.0)])


def told(folder, covs=None, drive=DRIVE, **more):
    estimated, true = written(folder, drive, covs=covs, **more)
    return audit(estimated, truth=true).trajectories[0]


@pytest.mark.parametrize("seed", range(20))
def test_right_covariances_are_not_suspected(seed, tmp_path):
    found = told(tmp_path, drive=drives(1, 200, seed=seed)[0])
    assert found.hints == ()
    assert found.notes == ()


@pytest.mark.parametrize("factor", [0.01, 100.0], ids=["overconfident", "cautious"])
def test_a_wrong_scale_is_no_wrong_unit(factor, tmp_path):
    assert told(tmp_path, factor * DRIVE.covs).hints == ()


def broken(kind):
    covs = DRIVE.covs.copy()
    if kind == "zero":
        return np.zeros_like(covs)
    if kind == "NaN":
        covs[:, 1, 1] = np.nan
    if kind == "not positive definite":
        covs[:, 0, 1] = covs[:, 1, 0] = 2.0 * np.sqrt(covs[:, 0, 0] * covs[:, 1, 1])
    if kind == "negative":
        covs[:, 2, 2] *= -1.0
    return covs


@pytest.mark.parametrize("kind", ["zero", "NaN", "not positive definite", "negative"])
def test_no_covariances_are_refused_in_one_line(kind, tmp_path):
    words = "not positive definite" if kind == "negative" else kind
    with pytest.raises(UsageError, match=f"expected covariances .* 400 of 400 covariances are .*{words}") as found:
        told(tmp_path, broken(kind))
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("kind", ["zero", "NaN", "not positive definite"])
def test_a_few_of_them_are_left_out_and_told(kind, tmp_path):
    covs = DRIVE.covs.copy()
    covs[7:10] = broken(kind)[7:10]
    found = told(tmp_path, covs)
    assert found.pose.count == 397
    assert any("3 of 400 covariances" in note and "first in row 8" in note and kind in note for note in found.notes)


def test_a_full_matrix_that_is_not_symmetric_is_told(tmp_path):
    full = np.array([in_space(DRIVE.covs)[k].ravel() for k in range(400)])
    full[5, 1] += 1.0
    half = 0.5 * DRIVE.estimated[:, 2]
    zeros = np.zeros(400)
    poses = [DRIVE.time_s, *DRIVE.estimated[:, :2].T, zeros, zeros, zeros, np.sin(half), np.cos(half)]
    np.savetxt(tmp_path / "full.tum", np.column_stack([*poses, full]))
    true = tum(tmp_path / "true.tum", DRIVE.time_s, DRIVE.true)
    found = audit(tmp_path / "full.tum", truth=true).trajectories[0]
    assert found.pose.count == 399
    assert "1 of 400 covariances are not symmetric, first in row 6: left out" in found.notes


def test_a_covariance_of_the_heading_in_degrees_is_told(tmp_path):
    assert any("in degrees" in hint for hint in told(tmp_path, TURNED @ DRIVE.covs @ TURNED).hints)


def test_headings_in_degrees_beside_a_covariance_in_radians_are_told(tmp_path):
    back = np.linalg.inv(TURNED)
    assert any("headings in degrees" in hint for hint in told(tmp_path, back @ DRIVE.covs @ back).hints)


def test_a_heading_of_which_nothing_is_known_is_told(tmp_path):
    covs = DRIVE.covs.copy()
    covs[:, 2, 2] = 10.0
    covs[:, :2] *= 1e-5  # both are off, so that their ratio tells of no unit
    covs[:, 2, :2] *= 1e-5
    assert any("more than half a turn" in hint or "in degrees" in hint for hint in told(tmp_path, covs).hints)


def test_the_covariance_of_a_step_in_place_of_the_pose_is_told(tmp_path):
    reckoned = drives(1, 400, seed=6, seen_every=1000)[0]
    covs = np.tile(np.diag([1e-4, 1e-4, 1e-4]), (400, 1, 1))
    found = told(tmp_path, covs, drive=reckoned)
    assert any("constant while the errors grow" in hint for hint in found.hints)


@pytest.mark.parametrize(
    ("order", "words"),
    [((0, 3, 5, 1, 2, 4), "the diagonal first"), ((5, 2, 4, 0, 1, 3), "the heading first"),
     ((0, 1, 3, 2, 4, 5), "a lower triangle")],
)  # fmt: skip
def test_another_order_of_the_columns_is_told(order, words, tmp_path):
    drive = drives(1, 400, seed=7)[0]
    try:
        hints = " ".join(told(tmp_path, drive=drive, order=order).hints)
    except UsageError as refused:
        hints = str(refused)
    assert words in hints


def test_the_rotation_first_is_told(tmp_path):
    covs = in_space(DRIVE.covs) + 1e-6 * np.eye(6)
    swapped = covs[:, (3, 4, 5, 0, 1, 2)][:, :, (3, 4, 5, 0, 1, 2)]
    assert any("as GTSAM has it" in hint for hint in told(tmp_path, swapped).hints)
