"""What the ear makes of innovations, against plain arithmetic on two walls."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from chainslam.experiments.campaign.scores.innovation import InnovationEar, stacked
from chainslam.slam.association.matching import NO_MATCHES, KnownWalls, MatchingConfig
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.estimation.models import innovations
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.extraction.straightness import StraightnessConfig, cov_of_faces
from chainslam.slam.map.reliability import ReliabilityConfig

IDS = np.array([3, 8, 9])
WALLS = KnownWalls(IDS, np.tile([-1.0, 1.0], (3, 1)))
LINES = np.array([[0.0, 2.0], [np.pi / 2, 1.5], [-2.0, 1.0]])
"""(alpha, d) of walls anchored in the origin; the robot stands there, so that it sees them so."""
RNG = np.random.default_rng(3)
ROOT = 0.1 * RNG.normal(size=(9, 9))
JOINT = Joint(np.concatenate([np.zeros(3), LINES.ravel()]), ROOT @ ROOT.T + 1e-3 * np.eye(9), np.zeros((3, 2)))
COV = np.diag([1e-4, 4e-4])


def seen(lines, sigma_rad=0.01):
    count = len(lines)
    cov = np.tile(np.diag([sigma_rad**2, 4e-4]), (count, 1, 1))
    none, lines = np.zeros((count, 2), int), np.array(lines)
    n = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    foot, along = lines[:, 1:] * n, n[:, ::-1] * [-1.0, 1.0]
    return Segments(
        lines,
        cov,
        np.stack([foot - 2.0 * along, foot + 2.0 * along], axis=1),
        none,
        np.full(count, 20),
        none > 0,
        np.zeros(count),
        np.zeros(count, bool),
    )


def hear(ear, scans):
    """Let the ear listen to scans of (segments, ids of their walls)."""
    for segments, ids in scans:
        pairs = np.column_stack([np.arange(len(ids)), ids]).astype(np.int64).reshape(-1, 2)
        matches = replace(NO_MATCHES, pairs=pairs, distances=np.zeros(len(pairs)))
        matcher = ear.around(lambda *given, clear_only=False, said=matches: said)
        for clear_only in (True, False):
            found = matcher(segments, WALLS, JOINT, MatchingConfig(), clear_only=clear_only)
            assert found is matches


def test_stacked_innovations_are_those_of_each_line_with_the_covariance_of_pose_and_lines():
    rows, off = np.array([2, 0]), np.array([[0.02, -0.05], [-0.01, 0.1]])
    cov = np.stack([COV, 2.0 * COV])
    e, S = stacked(JOINT, rows, LINES[rows] + off, cov)
    H, R = np.zeros((4, 9)), []
    for k, row in enumerate(rows):
        one = innovations(np.zeros(3), np.zeros((1, 2)), LINES[[row]], LINES[[row]] + off[[k]], cov[[k]])
        np.testing.assert_allclose(e[2 * k : 2 * k + 2], one.e[0])
        H[2 * k : 2 * k + 2, :3], H[2 * k : 2 * k + 2, 3 + 2 * row : 5 + 2 * row] = one.H_pose[0], one.H_line[0]
        R.append(one.R[0])
    np.testing.assert_allclose(S, H @ JOINT.cov @ H.T + block_diag(*R), rtol=1e-12)


def test_the_nis_of_a_scan_is_that_of_all_its_lines_together_and_each_call_is_heard_once():
    ear = InnovationEar(ReliabilityConfig())
    hear(ear, [(seen(LINES[[0, 2]] + 0.03), [3, 9]), (seen(LINES[[1]] - 0.02), [8])])
    expected = []
    for rows, off in (([0, 2], 0.03), ([1], -0.02)):
        e, S = stacked(JOINT, np.array(rows), LINES[rows] + off, np.tile(COV, (len(rows), 1, 1)))
        expected.append(e @ np.linalg.solve(S, e))
    assert ear.values == pytest.approx(expected)
    assert ear.dofs == [4, 2]


def test_what_a_short_face_lacks_of_its_covariance_is_added_by_the_ear_s_own_rule():
    for straightness in (StraightnessConfig(), StraightnessConfig(edge_m=0.05)):
        ear = InnovationEar(ReliabilityConfig(heading_rad=3.0, straightness=straightness))
        short = replace(seen(LINES[[0]] + 0.03), ends=np.array([[[2.0, -0.05], [2.0, 0.05]]]))
        hear(ear, [(short, [3])])
        more = cov_of_faces(short, straightness)
        assert more.max() > 1e-6
        e, S = stacked(JOINT, np.array([0]), LINES[[0]] + 0.03, COV[None] + more)
        assert ear.values == pytest.approx([e @ np.linalg.solve(S, e)])


def test_the_mean_is_over_all_degrees_of_freedom_together():
    ear = InnovationEar(ReliabilityConfig())
    assert ear.mean() is None
    ear.values, ear.dofs = [1.0, 8.0], [2, 4]
    assert ear.mean() == pytest.approx(1.5)


def test_the_share_in_the_band_counts_scans_whose_nis_is_neither_too_large_nor_too_small():
    """Two lines have four degrees of freedom: from 0.484 to 11.1; one has two: from 0.0506 to 7.38."""
    ear = InnovationEar(ReliabilityConfig())
    assert ear.in_band() is None
    ear.values, ear.dofs = [0.4, 0.4, 5.0, 8.0, 8.0, 12.0], [2, 4, 4, 4, 2, 4]
    assert ear.in_band() == pytest.approx(3 / 6)


def whitened(row, off):
    e, S = stacked(JOINT, np.array([row]), LINES[[row]] + off, COV[None])
    return np.linalg.solve(np.linalg.cholesky(S), e)


def test_whiteness_is_the_correlation_of_a_wall_s_innovations_in_scans_running():
    ear = InnovationEar(ReliabilityConfig())
    assert ear.whiteness() is None
    offs = {3: (0.03, 0.02, -0.05), 9: (0.01, None, 0.04), 8: (None, -0.02, -0.03)}
    row_of = {3: 0, 8: 1, 9: 2}
    for scan in range(3):
        ids = [wall for wall, off in offs.items() if off[scan] is not None]
        lines = [LINES[row_of[wall]] + offs[wall][scan] for wall in ids]
        hear(ear, [(seen(lines), ids)])
    pairs = [(3, 0.03, 0.02), (3, 0.02, -0.05), (8, -0.02, -0.03)]
    before = np.concatenate([whitened(row_of[wall], first) for wall, first, _ in pairs])
    after = np.concatenate([whitened(row_of[wall], second) for wall, _, second in pairs])
    assert ear.whiteness() == pytest.approx(before @ after / np.sqrt((before @ before) * (after @ after)))


def test_a_scan_without_a_clear_wall_is_not_heard_and_parts_those_beside_it():
    ear = InnovationEar(ReliabilityConfig())
    clear, unclear = seen(LINES[[0]] + 0.03), seen(LINES[[0]] + 0.03, sigma_rad=0.2)
    hear(ear, [(clear, [3]), (unclear, [3]), (clear, [3]), (seen(np.zeros((0, 2))), []), (clear, [3])])
    assert ear.dofs == [2, 2, 2]
    assert ear.whiteness() is None


def test_only_the_clear_ones_of_a_scan_are_heard():
    ear, alone = InnovationEar(ReliabilityConfig()), InnovationEar(ReliabilityConfig())
    mixed = seen(LINES[[0, 1]] + 0.02)
    mixed.cov[1] = np.diag([0.2**2, 4e-4])
    hear(ear, [(mixed, [3, 8])])
    hear(alone, [(seen(LINES[[0]] + 0.02), [3])])
    assert (ear.values, ear.dofs) == (alone.values, alone.dofs)


def test_a_covariance_that_is_none_is_not_heard_and_ends_what_runs():
    ear = InnovationEar(ReliabilityConfig())
    good = (seen(LINES[[0]] + 0.03), [3])
    hear(ear, [good])
    broken = replace(good[0], cov=np.array([np.diag([1e-4, -10.0])]))
    hear(ear, [(broken, [3]), good])
    assert ear.dofs == [2, 2]
    assert ear.whiteness() is None


def test_innovations_of_nothing_have_no_direction():
    ear = InnovationEar(ReliabilityConfig())
    hear(ear, [(seen(LINES[[0]]), [3]), (seen(LINES[[0]]), [3])])
    assert ear.values == pytest.approx([0.0, 0.0])
    assert ear.whiteness() is None


def test_the_overheard_matcher_is_asked_just_what_was_asked():
    asked, config = [], MatchingConfig(gate=0.9)

    def matcher(*given, **named):
        asked.append((given, named))
        return NO_MATCHES

    segments, overheard = seen(LINES), InnovationEar(ReliabilityConfig()).around(matcher)
    overheard(segments, WALLS, JOINT, config, clear_only=True)
    overheard(segments, WALLS, JOINT, config, clear_only=False)
    overheard(segments, WALLS, JOINT, config)
    for (given, named), clear_only in zip(asked, (True, False, False), strict=True):
        assert [id(each) for each in given] == [id(each) for each in (segments, WALLS, JOINT, config)]
        assert named == {"clear_only": clear_only}


def test_what_is_clear_is_told_by_the_ear_s_own_rule():
    strict = InnovationEar(ReliabilityConfig(heading_rad=1e-4))
    hear(strict, [(seen(LINES), IDS)])
    assert strict.values == []
    free = InnovationEar(ReliabilityConfig(heading_rad=3.0))
    hear(free, [(seen(LINES, sigma_rad=0.5), IDS)])
    assert free.dofs == [6]
