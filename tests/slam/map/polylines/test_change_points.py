"""What the beams of many scans say of a bend that none of them shows."""

import numpy as np
import pytest

from chainslam.slam.estimation.backend import Belief
from chainslam.slam.estimation.shared import SharedConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.map.polylines.change_points import ChangePoint, ChangePoints, ChangePointsConfig
from chainslam.slam.map.polylines.kernels.change_point_kernels import (
    beams_on_lines,
    feet_along,
    places_between,
    surest,
    turns_of_beams,
)
from chainslam.slam.map.polylines.wall_beams import beams_on_walls
from chainslam.slam.map.records import Records
from chainslam.slam.robot import Scan
from tests.slam.map.polylines.scenes import SIGMA_M, WALL, bent, scans


def belief_of(pose):
    """Return a belief in one wall along y = 0, free side below, anchored at the origin."""
    line = np.array([[np.pi / 2, 0.0]])
    return Belief(pose, np.eye(3), np.array([WALL]), np.zeros((1, 2)), line, lambda ids: None)


def seen(change_points, pose, scan):
    """Show a scan to the sums, every segment of five beams or more as one of the wall; return its segments, too."""
    segments = extract(scan)
    rows = np.flatnonzero(~segments.is_tentative)
    return segments, look(change_points, pose, scan, segments, rows)


def look(change_points, pose, scan, segments, rows):
    """Show some of a scan's segments to the sums, as parts of the wall."""
    pairs = np.stack([rows, np.full(len(rows), WALL)], axis=-1)
    return change_points.see(beams_on_walls(belief_of(pose), scan, segments, pairs, SharedConfig()))


def random_poses(rng, count):
    """Return poses before the wall, 0.5 to 2.5 m from it and up to 3 m along it."""
    return np.column_stack([rng.uniform(-3, 3, count), rng.uniform(-2.5, -0.5, count), rng.uniform(-3, 3, count)])


@pytest.mark.parametrize("seed", range(5))
def test_the_turn_at_a_place_is_that_of_a_dense_least_squares(seed):
    """Of three walls at once, the second of which was not seen; far from their anchors."""
    rng = np.random.default_rng(seed)
    of, place_of = np.repeat([0, 2], [40, 25]), np.repeat([0, 2], [3, 2])
    along = np.concatenate([np.sort(rng.uniform(28, 32, 40)), np.sort(rng.uniform(-9, -7, 25))])
    sigma = rng.uniform(0.005, 0.02, 65)
    across, places = sigma * rng.standard_normal(65), np.array([28.9, 30.0, 30.7, -8.5, -7.4])
    information, sums = turns_of_beams(along, across, sigma, of, places, place_of, 1)
    for k, place in enumerate(places):
        ours = of == place_of[k]
        turned = np.maximum(along[ours] - place, 0.0)
        A = np.stack([np.ones(len(turned)), along[ours], turned], axis=-1) / sigma[ours, None]
        expected = np.linalg.lstsq(A, across[ours] / sigma[ours], rcond=None)[0]
        np.testing.assert_allclose(sums[k] / information[k], expected[2], rtol=1e-6)
        np.testing.assert_allclose(1.0 / information[k], np.linalg.inv(A.T @ A)[2, 2], rtol=1e-6)


def test_places_lie_between_the_first_and_the_last_beam_of_each_wall():
    place, of = places_between(np.array([-0.6, 0.1, 0.55, 0.26, 0.3, 1.2, 1.25]), np.array([0, 0, 0, 2, 2, 5, 5]), 0.25)
    np.testing.assert_array_equal(of, [0, 0, 0, 0, 0])
    np.testing.assert_array_equal(place, [-2, -1, 0, 1, 2])


def test_a_lone_beam_at_a_place_itself_has_none():
    place, of = places_between(np.array([45.0, -0.1, 0.1]), np.array([0, 1, 1]), 0.25)
    np.testing.assert_array_equal(of, [1])
    np.testing.assert_array_equal(place, [0])


@pytest.mark.parametrize("turn_deg", [0.4, 0.7, -0.7])
def test_a_bend_that_no_scan_shows_is_found_where_it_is(turn_deg):
    """Whatever the robot believes its heading to be, and whether the noise that is stated is there or not."""
    rng = np.random.default_rng(3)
    for sigma_m, heading_error in ((SIGMA_M, 0.0), (SIGMA_M, 0.02), (0.0, 0.0)):
        change_points, poses = ChangePoints(), random_poses(rng, 400)
        for pose, scan in zip(poses, scans(bent(np.deg2rad(turn_deg), 0.4), poses, rng, sigma_m), strict=True):
            if len(extract(scan)) > 1:
                continue
            _, change_point = seen(change_points, pose + np.array([0.0, 0.0, heading_error]), scan)
            if change_point is not None:
                break
        assert change_point is not None
        assert abs(change_point.turn_rad - np.deg2rad(turn_deg)) < 4.0 * change_point.sigma_rad
        along = pose[0] - pose[1] / np.tan(pose[2] + change_point.bearing_rad)
        assert along == pytest.approx(0.4, abs=0.6)


@pytest.mark.parametrize("seed", range(2))
def test_a_straight_wall_never_bends(seed):
    rng = np.random.default_rng(seed)
    change_points, poses = ChangePoints(ChangePointsConfig(sigmas=5.0)), random_poses(rng, 700)
    for pose, scan in zip(poses, scans(bent(0.0), poses, rng), strict=True):
        assert seen(change_points, pose, scan)[1] is None


@pytest.mark.parametrize("heading", [1.5, -1.6, 3.1])
def test_the_scan_cut_at_the_bend_has_a_side_before_and_one_after(heading):
    """Also where the wall lies across the scan's seam; a piece that stands alone has no neighbour."""
    pose = np.array([0.2, -1.2, heading])
    (scan,) = scans(bent(np.deg2rad(0.2)), [pose], np.random.default_rng(1), 0.0)
    segments = extract(scan)
    bearing = np.arctan2(1.2, -0.2) - heading
    pieces = extract(scan, vertices_rad=np.array([bearing]))
    change_points, change_point = ChangePoints(), ChangePoint(WALL, 0, bearing, 0.0, np.deg2rad(0.2), np.deg2rad(0.03))
    before, after = change_points.sides_of(change_point, segments, pieces, scan)
    assert sorted([before, after]) == [0, 1] == list(range(len(pieces)))
    one, other = pieces.ends[[before, after]].mean(axis=1)
    assert one[0] * other[1] - one[1] * other[0] > 0, "counter-clockwise"
    assert change_points.sides_of(change_point, segments, pieces.take(np.array([0])), scan) is None


def test_a_beam_of_the_next_face_at_a_straight_walls_end_is_no_bend():
    """In cml_Vipiteno2 44 beams of a wall of 7 m and one of a face of 0.1 m made a turn of 19 degrees of six sigmas."""
    change_points, found = ChangePoints(), False
    poses = np.column_stack([np.linspace(1.0, 0.0, 60), np.full(60, -1.0), np.zeros(60)])
    for pose, scan in zip(poses, scans(bent(0.0), poses, np.random.default_rng(5), 0.0), strict=True):
        segments = extract(scan)
        last = segments.beams[0, 1]
        ranges = scan.ranges_m.copy()
        ranges[last] += 0.03
        taken = Scan(scan.bearings_rad, ranges, SIGMA_M, 4.0, 0.0)
        found |= look(change_points, pose, taken, segments, np.array([0])) is not None
    assert not found


@pytest.mark.parametrize(("turn_deg", "is_bend"), [(0.05, False), (0.1, False), (0.3, True), (8.0, True)])
def test_a_bend_turns_by_more_than_every_real_wall_does_over_many_scans(turn_deg, is_bend):
    """However sure the turn is after 1,500 scans from one place, all taken for one straight wall."""
    pose, change_points, found = np.array([0.0, -1.0, 0.0]), ChangePoints(), False
    straight, bending = (next(scans(bent(np.deg2rad(turn)), [pose], None, 0.0)) for turn in (0.0, turn_deg))
    segments = extract(straight)
    for _ in range(1500):
        found |= look(change_points, pose, bending, segments, np.array([0])) is not None
        if found:
            break
    assert found == is_bend


def test_pairs_are_renamed_when_entries_are_merged():
    records = Records()
    change_points = ChangePoints(records=records)
    change_points.keep_apart(9, 4)
    assert change_points.cut == {(4, 9)}
    records.merge(2, 9, 0.0)
    assert change_points.cut == {(2, 4)}
    records.remove(np.array([4]))
    assert not change_points.cut
    change_points.keep_apart(1, 2)
    records.merge(1, 2, 0.0)
    assert not change_points.cut


def test_turns_of_a_merged_wall_are_added_at_the_nearest_places_of_the_kept_one():
    """Exact turns of one bent wall that stands in the map twice, told about two anchors 0.6 m apart."""
    records, rng = Records(), np.random.default_rng(3)
    change_points = ChangePoints(records=records)
    kept, dropped = records.rows(np.array([4, 8])).tolist()
    mine, theirs = rng.uniform(size=(2, 5)), rng.uniform(size=(2, 3))
    change_points._add_to(kept, -2, mine)
    change_points._add_to(dropped, 0, theirs)
    records.merge(4, 8, 0.6)
    first, sums = records.columns["turns"][0]
    expected = np.zeros((2, 7))
    expected[:, :5] += mine
    expected[:, 4:] += theirs  # 0.6 m are 2.4 pitches
    assert first == -2
    np.testing.assert_allclose(sums, expected)


def test_sums_of_what_exact_lines_say_do_not_depend_on_how_a_wall_was_grown_along():
    """Observations at places before and after those known before are added where they belong."""
    records, rng = Records(), np.random.default_rng(2)
    change_points, row = ChangePoints(records=records), int(records.rows(np.array([WALL]))[0])
    for first, count in ((3, 4), (-2, 3), (0, 12), (-4, 1)):
        terms = rng.uniform(size=(2, count))
        before = {place: turns_at(records, place) for place in range(first, first + count)}
        now = change_points._add_to(row, first, terms)
        for k, place in enumerate(range(first, first + count)):
            np.testing.assert_allclose(now[:, k], before[place] + terms[:, k])
            np.testing.assert_allclose(turns_at(records, place), before[place] + terms[:, k])


def turns_at(records, place):
    """Return the sums of the wall at one place."""
    begin, sums = records.columns["turns"][0] or (0, np.zeros((2, 0)))
    return sums[:, place - begin].copy() if begin <= place < begin + sums.shape[1] else np.zeros(2)


@pytest.mark.parametrize("seed", range(20))
def test_each_beam_meets_its_line_where_plain_geometry_says(seed):
    """One of the segments crosses the scan's seam; some beams miss their line, and some tell nothing."""
    rng = np.random.default_rng(seed)
    bearings = np.deg2rad(np.arange(0.0, 360.0, 4.0))
    runs, alpha = np.array([[82, 5], [20, 31], [40, 41]]), np.deg2rad([350.0, 104.0, 160.0])
    lines, pose = np.column_stack([alpha, rng.uniform(1.0, 3.0, 3)]), rng.uniform(-2.0, 2.0, 3)
    anchors, turned, expected = rng.uniform(-2.0, 2.0, (3, 2)), alpha + pose[2] + rng.normal(0.0, 0.1, 3), []
    sigmas, ranges = rng.uniform(0.01, 0.02, 90), np.full(90, np.nan)
    feet = feet_along(lines, pose, anchors, turned)
    for k, (first, last) in enumerate(runs):
        run = np.arange(first, last + 1 + 90 * (last < first)) % 90
        n, t = np.array([np.cos(alpha[k]), np.sin(alpha[k])]), np.array([-np.sin(alpha[k]), np.cos(alpha[k])])
        for beam in run:
            ray = np.array([np.cos(bearings[beam]), np.sin(bearings[beam])])
            ranges[beam] = lines[k, 1] / (n @ ray) + rng.normal(0.0, 2.0) * sigmas[beam]
            ranges[beam] = rng.choice([ranges[beam], np.nan, np.inf], p=[0.9, 0.05, 0.05])
            off = ranges[beam] * (n @ ray) - lines[k, 1]
            if beam not in run[[0, -1]] and abs(off) < 3.0 * sigmas[beam] * (n @ ray):
                foot = np.array([np.cos(turned[k]), np.sin(turned[k])])
                middle = pose[:2] + lines[k, 1] * np.array([np.cos(alpha[k] + pose[2]), np.sin(alpha[k] + pose[2])])
                along = np.array([-foot[1], foot[0]]) @ (middle - anchors[k])
                expected.append((along + lines[k, 1] / (n @ ray) * (t @ ray), off, sigmas[beam] * (n @ ray), k))
    found = beams_on_lines(runs, lines, feet, bearings, ranges, sigmas, 3.0)
    np.testing.assert_allclose(np.column_stack(found), expected, atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_the_surest_turn_is_one_that_the_scan_of_now_tells_of_and_not_a_slight_one(seed):
    rng = np.random.default_rng(seed)
    information, sums, now = rng.uniform(0.0, 9.0, 6), rng.normal(0.0, 2.0, 6), rng.choice([0.0, 1.0], 6)
    turn = -sums / information
    square = np.where((np.abs(turn) > 0.3) & (now > 0.0), turn**2 * information, 0.0)
    best = int(np.argmax(square))
    assert surest(information, sums, now, 0.3) == pytest.approx((best, turn[best], square[best]))
