"""Which wall a segment belongs to: the gate's level, the sides of thin walls, doors, and slips of the wheels."""

import numpy as np
import pytest
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.joint_compatibility import relocate, seen_halfway
from chainslam.slam.association.matching import KnownWalls, MatchingConfig, match
from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.estimation.models import lines_robot
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import compose, inverse, wrap
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan

SURE = np.zeros(1, bool)
"""Of a segment of many beams."""
P0 = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2


def faces_of(polygon):
    polygon = shapely.orient_polygons(polygon)
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


class Walker:
    """Maps from chosen true poses; wheels as exact as stated."""

    def __init__(self, faces, start, rng=None, backend="full-ekf", matcher=match):
        self.finder, self.rng = RangeFinder(faces, LidarConfig()), rng
        self.pose = np.asarray(start, dtype=float)
        self.mapper = Mapper(BACKENDS[backend].make(self.pose.copy(), P0.copy()), matcher=matcher)

    def scan(self):
        ranges = self.finder.cast(self.pose)[0]
        if self.rng is not None:
            ranges = ranges + 0.01 * self.rng.standard_normal(len(ranges))
        return self.mapper.step(Scan(self.finder.bearings_rad, ranges, 0.01, 4.0, 0.0))

    def go(self, pose, sigma=0.01):
        motion = compose(inverse(self.pose), np.asarray(pose, dtype=float))
        cov = np.diag([sigma, sigma, 0.5 * sigma]) ** 2
        noise = np.zeros(3) if self.rng is None else np.sqrt(np.diag(cov)) * self.rng.standard_normal(3)
        self.mapper.predict(Odometry(motion + noise, cov))
        self.pose = np.asarray(pose, dtype=float)
        return self.scan()


def random_joint(rng):
    """Return pose and one line, correlated, with the truth drawn from it."""
    pose = np.append(rng.uniform(-2, 2, 2), rng.uniform(-3, 3))
    alpha = pose[2] + rng.uniform(-2, 2)
    n = np.array([np.cos(alpha), np.sin(alpha)])
    anchor = pose[:2] + rng.uniform(0.8, 3.0) * n + rng.uniform(-1, 1) * np.array([-n[1], n[0]])
    mean = np.concatenate([pose, [wrap(alpha), 0.0]])
    root = np.diag([0.02, 0.02, 0.005, 0.006, 0.01]) @ (np.eye(5) + 0.4 * rng.standard_normal((5, 5)))
    return Joint(mean, root @ root.T, anchor[None]), mean + root @ rng.standard_normal(5)


def segment_of(truth, anchor, rng):
    """Return the true line as one segment of 1 m with noise of the exact model, seen off to one side."""
    pose, (alpha, d) = truth[:3], truth[3:]
    n, t = np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])
    r = d + n @ (anchor - pose[:2])
    t0 = t @ (anchor - pose[:2]) + rng.uniform(-0.2, 0.2)
    turn = np.array([[1.0, 0.0], [t0, 1.0]])
    cov = turn @ np.diag([0.006, 0.004]) ** 2 @ turn.T
    line = np.array([wrap(alpha - pose[2]), r]) + turn @ (np.array([0.006, 0.004]) * rng.standard_normal(2))
    c, s = np.cos(line[0]), np.sin(line[0])
    ends = line[1] * np.array([c, s]) + np.array([[t0 - 0.5], [t0 + 0.5]]) * np.array([-s, c])
    one, two = np.array([9]), np.array([[0, 8]])
    return Segments(line[None], cov[None], ends[None], two, one, np.zeros((1, 2), dtype=bool), np.zeros(1), SURE)


def test_one_true_match_in_a_hundred_is_refused_by_the_gate():
    rng, trials, refused = np.random.default_rng(41), 1500, 0
    level = 1.0 - MatchingConfig().gate
    for _ in range(trials):
        joint, truth = random_joint(rng)
        segment = segment_of(truth, joint.anchors[0], rng)
        matches = match(segment, KnownWalls(np.array([5]), np.array([[-2.0, 2.0]])), joint)
        refused += not len(matches.pairs)
        if len(matches.pairs):
            assert matches.pairs.tolist() == [[0, 5]]
        else:
            assert matches.unmatched.tolist() == [0]
            assert matches.refusals[0]
    assert abs(refused / trials - level) < 3 * np.sqrt(level * (1 - level) / trials) + 1e-3


@pytest.mark.parametrize("slip_rad", [-0.1, -0.05, 0.08])
def test_how_far_off_a_wall_is_after_a_slip_is_what_the_slip_itself_costs(slip_rad):
    """The wall is known to a millimetre: from a tangent at the estimate a slip of 0.085 rad cost 24 for 11."""
    alpha, anchor = 0.3, np.array([[2.0, 0.4]])
    sigma = 0.03
    joint = Joint(np.array([0.0, 0.0, 0.0, alpha, 0.0]), np.diag([1e-3, 1e-3, sigma, 1e-4, 1e-4]) ** 2, anchor)
    line = lines_robot(np.array([0.0, 0.0, slip_rad]), anchor, joint.mean[None, 3:])[0]
    t0, along = 0.5, np.array([-np.sin(line[0]), np.cos(line[0])])
    turn = np.array([[1.0, 0.0], [t0, 1.0]])
    cov = turn @ np.diag([1e-3, 1e-3]) ** 2 @ turn.T
    ends = line[1] * np.array([np.cos(line[0]), np.sin(line[0])]) + np.array([[t0 - 0.5], [t0 + 0.5]]) * along
    one = np.array([60])
    segment = Segments(
        line[None], cov[None], ends[None], np.array([[0, 59]]), one, np.zeros((1, 2), bool), np.zeros(1), SURE
    )
    found = match(segment, KnownWalls(np.array([5]), np.array([[-3.0, 3.0]])), joint, clear_only=True)
    assert found.distances == pytest.approx([(slip_rad / sigma) ** 2], rel=0.05)


def test_without_walls_nothing_matches_and_nothing_is_doubtful():
    joint = Joint(np.zeros(3), P0, np.zeros((0, 2)))
    _, truth = random_joint(np.random.default_rng(44))
    segment = segment_of(truth, truth[:2] + 1.0, np.random.default_rng(44))
    matches = match(segment, KnownWalls(np.zeros(0, dtype=np.int64), np.zeros((0, 2))), joint)
    assert matches.pairs.shape == (0, 2)
    assert matches.unmatched.tolist() == [0]
    assert len(matches.doubtful) == 0


@pytest.mark.parametrize("seed", range(25))
def test_the_two_faces_of_a_thin_wall_never_fuse(seed):
    """Seen from one side, then from the other, anywhere in the plane and at any angle, with a vague pose between."""
    rng = np.random.default_rng(seed)
    thick, turn = rng.uniform(0.06, 0.3), rng.uniform(-np.pi, np.pi)
    place = rng.uniform(-30, 30, 2)
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]])
    corners = np.array([[-1.5, 0.0], [-1.5, thick], [1.5, thick], [1.5, 0.0]]) @ R.T + place
    faces = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)  # clockwise: free outside

    def beside(y):
        return np.append(np.array([rng.uniform(-0.8, 0.8), y]) @ R.T + place, rng.uniform(-3, 3))

    walker = Walker(faces, beside(-rng.uniform(0.4, 1.5)), rng)
    front = set(walker.scan().walls_of_segments.tolist()) - {-1}
    far = walker.go(beside(thick + rng.uniform(0.4, 1.5)), sigma=0.1)
    back = set(far.walls_of_segments.tolist()) - {-1}
    assert front
    assert back
    assert not front & back
    again = walker.go(beside(-rng.uniform(0.4, 1.5)), sigma=0.1)
    assert not back & (set(again.walls_of_segments.tolist()) - {-1})


@pytest.mark.parametrize("door", [0.6, 0.8, 1.2])
@pytest.mark.parametrize("noisy", [False, True])
def test_the_walls_beside_a_door_stay_two_also_when_the_robot_drives_through(door, noisy):
    """The paper's example: left and right of the door the walls have one place in model space."""
    wall = shapely.union(shapely.box(2.95, 0, 3.05, 2 - door / 2), shapely.box(2.95, 2 + door / 2, 3.05, 4))
    faces = faces_of(shapely.box(0, 0, 6, 4).difference(wall))
    walker = Walker(faces, [1.5, 2.0, 0.0], np.random.default_rng(7) if noisy else None)
    update = walker.scan()
    for x in np.arange(1.65, 4.6, 0.15):
        update = walker.go([x, 2.0, 0.0])
    ends, alpha = update.map.ends_world, update.map.belief.means[:, 0]
    for n, x in ((1.0, 2.95), (-1.0, 3.05)):
        beside = (np.cos(alpha) * n > 0.95) & (np.abs(ends[..., 0].mean(axis=1) - x) < 0.05) & ~update.map.tentative
        assert np.count_nonzero(beside) >= 2
        low, high = np.sort(ends[beside][..., 1], axis=1).T
        assert not np.any((low < 2.0 - door / 2 + 0.15) & (high > 2.0 + door / 2 - 0.15))
        assert np.any(high < 2.0)
        assert np.any(low > 2.0)


PIECES = [[[1.5, 1.5], [-0.8, 1.5]], [[-1.0, 1.2], [-1.0, -1.2]], [[3.0, -1.8], [3.0, -0.4]]]


def three_walls(slip_rad):
    """Return three walls around the robot and their joint Gaussian with the pose after a step with that slip."""
    pose = np.array([0.0, 0.0, slip_rad])
    alphas, anchors = np.array([np.pi / 2, np.pi, 0.0]), np.array([[0.0, 1.5], [-1.0, 0.0], [3.0, -1.0]])
    mean = np.concatenate([pose, np.stack([alphas, np.zeros(3)], axis=-1).ravel()])
    joint = Joint(mean, np.diag([0.01, 0.01, 0.02, *[0.002, 0.003] * 3]) ** 2, anchors)
    return KnownWalls(np.arange(3), np.array([[-2.0, 2.0], [-1.5, 1.5], [-1.0, 0.95]])), joint


def straight_pieces(ends):
    """Return pieces of straight wall with these ends, robot frame, each known to 4 mrad and 3 mm at its middle."""
    ends = np.array(ends)
    lines, m = through(ends), len(ends)
    along = np.stack([-np.sin(lines[:, 0]), np.cos(lines[:, 0])], axis=-1)
    turn = np.array([[[1.0, 0.0], [t, 1.0]] for t in np.sum(ends.mean(axis=1) * along, axis=-1)])
    cov = turn @ np.diag([0.004, 0.003]) ** 2 @ turn.swapaxes(1, 2)
    beams = np.array([[10 * k, 10 * k + 8] for k in range(m)])
    return Segments(lines, cov, ends, beams, np.full(m, 9), np.ones((m, 2), bool), np.zeros(m), np.zeros(m, bool))


@pytest.mark.parametrize("slip_rad", [-0.05, -0.04, 0.0, 0.05])
def test_a_slip_of_the_wheels_does_not_shift_a_wall_onto_the_next_rooms(slip_rad):
    """Two rooms' walls on one line, a wall of 0.1 m between them; only one of them is in the map yet.

    Turned by the slip the other one reaches past the partition, and both directions are off by 2.5 sigmas: within the
    gate. The two other walls say how far the robot really turned.
    """
    walls, joint = three_walls(slip_rad)
    segments = straight_pieces([*PIECES, [[3.0, 0.05], [3.0, 1.2]]])
    clear = match(segments, walls, joint, clear_only=True)
    assert clear.pairs.tolist() == [[0, 0], [1, 1], [2, 2]]
    rest = match(
        segments.take(clear.unmatched),
        walls,
        relocate(joint, seen_halfway(joint, walls.ids, clear.observations(segments))),
    )
    assert rest.unmatched.tolist() == [0]
    assert not len(rest.doubtful)


@pytest.mark.parametrize("slip_rad", [-0.02, 0.0, 0.02])
def test_a_slip_of_the_wheels_excuses_no_wall_that_the_others_contradict(slip_rad):
    """A piece that turns by 1.1 degrees from its wall: no more than the wheels may slip, and little in the sum of all.

    Given the two other walls it is off by nearly four sigmas.
    """
    walls, joint = three_walls(slip_rad)
    c, s = np.cos(0.0195), np.sin(0.0195)
    middle = np.mean(PIECES[0], axis=0)
    bent = (np.array(PIECES[0]) - middle) @ np.array([[c, s], [-s, c]]) + middle
    segments = straight_pieces([bent, *PIECES[1:]])
    clear = match(segments, walls, joint, clear_only=True)
    assert clear.pairs.tolist() == [[1, 1], [2, 2]]
    rest = match(
        segments.take(clear.unmatched),
        walls,
        relocate(joint, seen_halfway(joint, walls.ids, clear.observations(segments))),
    )
    assert rest.doubtful.tolist() == [0]


TWO = KnownWalls(np.array([4, 7]), np.array([[-1.0, 1.0], [-1.0, 1.0]]))
"""Two walls 6 cm apart, seen from one side."""


@pytest.mark.parametrize(
    ("piece", "few_beams", "may_be"),
    [
        pytest.param([[2.0, -0.5], [2.0, 0.5]], False, [4, 7], id="between them"),
        pytest.param([[2.0, -0.5], [2.0, 0.5]], True, [], id="of few beams"),
        pytest.param([[2.2, -0.5], [2.2, 0.5]], False, [], id="beyond the gate"),
        pytest.param([[2.0, 0.99], [2.0, 1.8]], False, [], id="hardly overlapping"),
        pytest.param([[2.0, 0.97], [2.0, 1.8]], False, [4, 7], id="just overlapping"),
        pytest.param([[2.04, -0.5], [1.96, 0.5]], False, [4, 7], id="turned by 4.6 degrees"),
        pytest.param([[2.05, -0.5], [1.95, 0.5]], False, [], id="turned by 5.7 degrees"),
    ],
)
def test_a_wall_along_which_an_unmatched_segment_lies_may_be_what_it_shows(piece, few_beams, may_be):
    """The segment is known to 3 cm and 2.3 degrees: it fits both walls, and is matched with neither."""
    mean = np.array([0.0, 0.0, 0.0, 0.0, -0.03, 0.0, 0.03])
    joint = Joint(mean, np.diag([1e-3] * 7) ** 2, np.array([[2.0, 0.0], [2.0, 0.0]]))
    segments = straight_pieces([piece])
    segments.cov[:] *= 100.0
    segments.is_tentative[:] = few_beams
    found = match(segments, TWO, joint)
    assert found.unmatched.tolist() == [0]
    assert found.ambiguous.tolist() == may_be
    sure = match(straight_pieces([[[2.03, -0.5], [2.03, 0.5]]]), TWO, joint)
    assert (sure.pairs.tolist(), sure.ambiguous.tolist()) == ([[0, 7]], [])


@pytest.mark.parametrize("seed", range(8))
def test_a_robot_that_knows_how_lost_it_is_finds_its_walls_again(seed):
    """After some metres without a wall in sight it is off by more than any two walls of a room stand apart."""
    rng = np.random.default_rng(seed)
    walker = Walker(faces_of(shapely.box(0, 0, 6, 5)), [3.0, 2.5, 0.3], rng)
    for _ in range(5):
        before = walker.scan().map
    sigma = np.array([0.5, 0.5, np.deg2rad(4.0)])
    error = np.array([*(0.9 * np.array([np.cos(seed), np.sin(seed)])), np.deg2rad(rng.uniform(-6, 6))])
    walker.mapper.predict(Odometry(error, np.diag(sigma) ** 2))
    for _ in range(3):
        after = walker.scan()
    assert after.map.ids.tolist() == before.ids.tolist()
    assert len(after.matches.pairs) >= 3  # one in a hundred is refused
    assert np.abs(after.map.belief.pose_world - before.belief.pose_world)[:2].max() < 0.02
