import numpy as np
import pytest
import shapely

from chainslam.experiments.scoring.association import Votes, duplicate_lines
from chainslam.experiments.scoring.maps.corners import corners, label_distances
from chainslam.experiments.scoring.maps.coverage import (
    NEAR_M,
    alignment,
    began,
    closed_contours,
    coverage,
    own_alignment,
    sample,
)
from chainslam.experiments.scoring.maps.swept import swept, visible_floor
from chainslam.experiments.scoring.truth import collinear, truth_of
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.line_kernels import intersect
from chainslam.slam.geometry.poses import compose, to_world

CONFIG = RobotConfig()
ALIGNED = np.zeros(3)


@pytest.fixture
def truth(world):
    return truth_of(world, CONFIG)


def one_segment(first, last):
    none = np.zeros((1, 2))
    return Segments(
        none,
        np.zeros((1, 2, 2)),
        np.zeros((1, 2, 2)),
        np.array([[first, last]]),
        np.array([5]),
        np.zeros((1, 2), bool),
        np.zeros(1),
        np.zeros(1, bool),
    )


def test_faces_on_one_line_and_one_side_are_one_wall():
    faces = np.array([
        [[0.0, 0.0], [1.0, 0.0]],
        [[2.0, 0.001], [5.0, 0.001]],
        [[5.0, 0.0], [4.0, 0.0]],
        [[0.0, 0.1], [1.0, 0.1]],
        [[0.0, 0.0], [1.0, 0.05]],
    ])  # fmt: skip
    labels = collinear(faces)
    assert labels[0] == labels[1]
    assert len(set(labels.tolist())) == 4


def test_the_true_map_covers_everything_and_closes_every_contour(world, truth, make_map, make_chains):
    samples, walls = sample(truth), make_map(truth.faces, world.start)
    assert samples.length_m.sum() == pytest.approx(truth.contour.length_m)
    assert coverage(samples, walls.ends_world, NEAR_M) == 1.0
    votes = Votes(truth, {i: np.eye(len(truth.faces), dtype=np.int64)[i] for i in range(len(truth.faces))})
    chains = make_chains(truth.faces, truth.rings)
    assert closed_contours(samples, walls, chains, votes, ALIGNED, NEAR_M) == [0, 1]
    open_chains = make_chains(truth.faces, truth.rings, closed=False)
    assert closed_contours(samples, walls, open_chains, votes, ALIGNED, NEAR_M) == []


def test_a_wall_seen_from_the_wrong_side_covers_nothing(truth):
    assert coverage(sample(truth), truth.faces[:, ::-1], NEAR_M) < 0.1
    assert coverage(sample(truth), np.zeros((0, 2, 2)), NEAR_M) == 0.0


def test_coverage_is_a_share_of_the_whole_reachable_contour(truth):
    half = np.array([[truth.faces[0, 0], truth.faces[0].mean(axis=0)]])
    missing_ends = coverage(sample(truth), half, 0.001)
    length = np.hypot(*(half[0, 1] - half[0, 0]))
    assert missing_ends == pytest.approx(length / truth.contour.length_m, abs=0.002)


@pytest.mark.parametrize(
    ("lines", "step"), [([4, 5, 5], 0), ([0, 0, 3, 4], 2), ([0, 2, 0, 1, 3], 3), ([0, 0], 1), ([0], 0), ([1], 0)]
)
def test_a_map_begins_with_the_first_wall_that_it_still_has(lines, step):
    assert began(np.array(lines)) == step


def test_a_map_that_began_in_the_blind_is_whole_in_its_own_frame(truth):
    samples, faces = sample(truth), truth.faces
    true = np.array([[0.5, 0.5, 0.1], [1.0, 0.7, 0.3], [1.4, 0.8, 0.2]])
    lost = np.array([0.4, -0.7, 0.2])
    estimated = np.array([true[0], compose(lost, true[1]), compose(lost, true[2])])
    mapped = to_world(faces, lost)
    by_first, own = alignment(true[0], true[0]), own_alignment(true[0], estimated, true, 1)
    assert coverage(samples, to_world(mapped, by_first), NEAR_M) < 0.6
    assert coverage(samples, to_world(mapped, own), NEAR_M) == 1.0
    standing = own_alignment(true[0], estimated[[0, 1, 1]], true[[0, 1, 1]], 1)
    np.testing.assert_allclose(standing, own)
    np.testing.assert_allclose(own_alignment(true[0] + lost, estimated, true, 0), alignment(true[0] + lost, true[0]))


def test_a_line_is_labelled_by_its_beams_and_a_wrong_fusion_is_counted(truth):
    votes = Votes(truth)
    beams = np.full(180, -1)
    beams[10:30], beams[30:40] = 0, 1
    votes.add(one_segment(10, 29), np.array([7]), beams)
    votes.add(one_segment(30, 39), np.array([7]), beams)
    votes.add(one_segment(20, 39), np.array([7]), beams)
    assert votes.face_of(7) == 0
    assert votes.false_matches() == 1
    assert votes.face_of(8) == -1
    votes.add(one_segment(30, 39), np.array([-1]), beams)
    assert 9 not in votes.beams


def test_lines_that_were_merged_are_labelled_together_and_a_wrong_merge_is_counted(truth):
    votes = Votes(truth)
    beams = np.full(180, -1)
    beams[10:30], beams[30:40], beams[50:60] = 0, 0, 1
    for line, (first, last) in {7: (10, 29), 8: (30, 39), 9: (50, 59)}.items():
        votes.add(one_segment(first, last), np.array([line]), beams)
    votes.merge(7, 8)
    assert (votes.merges, votes.false_merges, votes.false_matches()) == (1, 0, 0)
    assert votes.beams[7].tolist()[:2] == [30, 0]
    votes.merge(7, 9)
    assert (votes.merges, votes.false_merges, votes.false_matches()) == (2, 1, 1)
    # A line of which no beam was ever counted proves nothing.
    votes.merge(6, 7)
    assert (votes.merges, votes.false_merges) == (3, 1)
    votes.add(one_segment(50, 59), np.array([6]), beams)
    assert votes.walls_of(np.array([6, 7, 8, 9])).tolist() == 4 * [truth.walls[0]]
    assert votes.beams[8].tolist()[:2] == [30, 20]


def test_a_segment_across_the_seam_counts_its_own_beams(truth):
    votes = Votes(truth)
    beams = np.full(180, 1)
    beams[:5] = beams[175:] = 0
    votes.add(one_segment(175, 4), np.array([3]), beams)
    assert votes.beams[3].tolist()[:2] == [10, 0]


def test_duplicates_overlap_on_one_wall(truth, make_map):
    face = truth.faces[0]
    pieces = np.array([
        [face[0], face[0] + 0.5 * (face[1] - face[0])],
        [face[0] + 0.4 * (face[1] - face[0]), face[1]],
        [face[0] + 0.99 * (face[1] - face[0]), face[1]],
    ])  # fmt: skip
    walls, firm = make_map(pieces, np.zeros(3)), np.ones(3, dtype=bool)
    assert duplicate_lines(walls, np.zeros(3, dtype=np.int64), firm) == 1
    assert duplicate_lines(walls, np.arange(3), firm) == 0
    assert duplicate_lines(walls, np.full(3, -1), firm) == 0


def test_corner_covariance_is_the_first_order_one(truth, make_map, make_chains):
    pose = np.zeros(3)
    walls, chains = make_map(truth.faces, pose), make_chains(truth.faces, truth.rings)
    joint = walls.belief.joint(walls.ids)
    corner = corners(walls, chains)[0]
    rows = walls.belief.rows(corner.walls)

    def position(change):
        state = joint.mean[3:] + change[3:]
        alpha, d = state.reshape(-1, 2)[rows].T
        r = d + np.cos(alpha) * joint.anchors[rows, 0] + np.sin(alpha) * joint.anchors[rows, 1]
        lines = np.stack([alpha, r], axis=-1)
        return intersect(lines[:1], lines[1:])[0][0]

    step = 1e-6
    steps = step * np.eye(len(joint.mean))
    expected = np.stack([(position(s) - position(-s)) / (2 * step) for s in steps], axis=-1)
    np.testing.assert_allclose(corner.jacobian, expected, atol=1e-7)
    np.testing.assert_allclose(position(np.zeros(len(joint.mean))), corner.position_world, atol=1e-12)


def test_named_distances_are_those_of_the_nearest_corners(world, truth, make_map, make_chains):
    walls, chains = make_map(truth.faces, np.zeros(3)), make_chains(truth.faces, truth.rings)
    joint = walls.belief.joint(walls.ids)
    found = label_distances(corners(walls, chains), world.labels, ALIGNED, joint)
    assert found["A-B"]["mapped_m"] == pytest.approx(5.0)
    assert found["A-B"]["sigma_m"] > 0
    assert label_distances([], world.labels, ALIGNED, joint)["A-B"]["mapped_m"] is None


def test_the_floor_behind_a_gap_too_narrow_for_the_body_is_visible_only_in_part():
    rooms = shapely.union_all([
        shapely.box(0, 0, 2, 2),
        shapely.box(2, 0.9, 2.1, 1.1),
        shapely.box(2.1, 0, 4.1, 2),
    ])  # fmt: skip
    world = World("slit", shapely.geometry.polygon.orient(rooms), np.array([1.0, 1.0, 0.0]), {})
    cells = visible_floor(world, CONFIG)
    row_beside, row_ahead = 2, 20
    assert cells[:, :40].all()
    assert cells[row_ahead, 60]
    assert not cells[row_beside, 43]


def test_one_scan_in_an_empty_room_sweeps_it(world):
    room = World("room", shapely.box(0, 0, 2, 2), np.array([1.0, 1.0, 0.0]), {})
    bearings = np.linspace(-np.pi, np.pi, 180, endpoint=False)
    ranges = 1.0 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    free = World("room", shapely.geometry.polygon.orient(room.free), room.start, {})
    assert swept(free, CONFIG, room.start[None], bearings, ranges[None])[-1] > 0.97
    assert swept(free, CONFIG, room.start[None], bearings, 0.5 * ranges[None])[-1] == pytest.approx(0.25, abs=0.02)
