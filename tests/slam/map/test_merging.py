"""One wall that stands in the map twice is found; two walls that are near each other never are one."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.association.matching import MatchingConfig
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.merging import MergingConfig, duplicate_of, lying_along
from chainslam.slam.map.stochastic_map import StochasticMap

CONFIG = MergingConfig()


def twice(known, touched):
    return duplicate_of(known, np.array(list(touched), dtype=np.int64), MatchingConfig().one_wall)


angles, places = st.floats(-3.1, 3.1), st.floats(-20.0, 20.0)


def walls(lines, sigma=(0.004, 0.006), tentative=None, common=0.0):
    """Return a map of pieces (alpha, middle of the piece, length); offsets share an error of sigma `common`."""
    count = len(lines)
    means = np.array([[alpha, 0.0] for alpha, _, _ in lines])
    anchors = np.array([at for _, at, _ in lines], dtype=float)
    half = np.array([[-0.5 * length, 0.5 * length] for _, _, length in lines])
    own = np.diag(np.tile(np.square(sigma), count))
    shared = np.tile(np.diag([0.0, common**2]), (count, count))
    cov = np.zeros((3 + 2 * count, 3 + 2 * count))
    cov[:3, :3], cov[3:, 3:] = 1e-4 * np.eye(3), own + shared
    mean = np.concatenate([np.zeros(3), means.ravel()])
    ids = 7 * np.arange(count) + 3

    def query(wanted):
        rows = np.searchsorted(ids, wanted)
        index = np.concatenate([np.arange(3), (3 + 2 * rows[:, None] + np.arange(2)).ravel()])
        return Joint(mean[index], cov[np.ix_(index, index)], anchors[rows])

    belief = Belief(np.zeros(3), cov[:3, :3], ids, anchors, means, query)
    marks = np.zeros(count, dtype=bool) if tentative is None else np.array(tentative)
    return StochasticMap(belief, half, np.full(count, 9), marks, np.zeros(count, dtype=bool))


def beside(alpha, at, along=0.0, across=0.0):
    a = np.array(alpha)
    return np.asarray(at, dtype=float) + along * directions(a) + across * normals(a)


@settings(max_examples=60, deadline=None)
@given(angles, places, places, st.floats(0.3, 6.0), st.floats(0.3, 6.0), st.floats(-0.99, 0.99), st.integers(0, 2**31))
def test_a_wall_entered_twice_is_found_whatever_pieces_were_seen(alpha, x, y, one, two, share, seed):
    """The pieces overlap; their lines are drawn with the errors that the covariance states."""
    rng = np.random.default_rng(seed)
    along = share * (0.5 * (one + two) - CONFIG.shared.resolution_m)
    draw = rng.standard_normal((2, 2)) * [0.002, 0.003]
    draw = np.clip(draw, [-0.003, -0.005], [0.003, 0.005])
    lines = [(alpha + draw[0, 0], (x, y), one), (alpha + draw[1, 0], beside(alpha, (x, y), along, draw[1, 1]), two)]
    assert twice(walls(lines), {10}) == (3, 10)
    assert twice(walls(lines), {3}) == (3, 10)
    assert twice(walls(lines), set()) is None


@settings(max_examples=60, deadline=None)
@given(
    angles, places, places, st.floats(0.3, 6.0), st.floats(0.3, 6.0), st.floats(-1.1, 1.1),
    st.sampled_from([-0.1, 0.1]), st.floats(0.001, 1.0),
)  # fmt: skip
def test_walls_a_tenth_of_a_metre_apart_are_two_however_little_is_known(alpha, x, y, one, two, share, across, sigma):
    lines = [(alpha, (x, y), one), (alpha, beside(alpha, (x, y), share * 0.5 * (one + two), across), two)]
    assert twice(walls(lines, sigma=(0.2 * sigma, sigma)), {3, 10}) is None


@settings(max_examples=40, deadline=None)
@given(angles, places, places, st.floats(-1.0, 1.0), st.floats(0.0, 0.1))
def test_the_two_faces_of_a_thin_wall_are_two(alpha, x, y, along, thick):
    lines = [(alpha, (x, y), 2.0), (alpha + np.pi, beside(alpha, (x, y), along, thick), 2.0)]
    assert twice(walls(lines, sigma=(0.1, 0.1)), {3, 10}) is None


def test_the_walls_on_both_sides_of_a_door_or_of_a_wall_between_are_two():
    for gap in (-0.04, 0.0, 0.03, 0.1, 0.6):
        lines = [(0.3, (1.0, 2.0), 2.0), (0.3, beside(0.3, (1.0, 2.0), 2.0 + gap), 2.0)]
        assert twice(walls(lines), {3, 10}) is None
    overlapping = [(0.3, (1.0, 2.0), 2.0), (0.3, beside(0.3, (1.0, 2.0), 1.94), 2.0)]
    assert twice(walls(overlapping), {3, 10}) == (3, 10)


def test_a_pair_that_only_one_in_a_hundred_would_be_is_merged_all_the_same():
    """Refused once, it would stay for good; two walls on one side never stand 3 cm behind each other."""
    lines = [(0.3, (1.0, 2.0), 1.0), (0.3, beside(0.3, (1.0, 2.0), 0.0, 0.03), 1.0)]
    assert twice(walls(lines, sigma=(0.004, 0.0067)), {3}) == (3, 10)
    assert twice(walls(lines, sigma=(0.004, 0.003)), {3}) is None


def test_the_joint_covariance_decides_where_geometry_does_not():
    """4 cm apart: two walls to a map that knows both to a few millimetres, one to a map that knows neither so well."""
    lines = [(0.3, (1.0, 2.0), 2.0), (0.3, beside(0.3, (1.0, 2.0), 0.0, 0.04), 2.0)]
    assert twice(walls(lines), {3}) is None
    assert twice(walls(lines, sigma=(0.01, 0.03)), {3}) == (3, 10)
    # What both have in common says nothing about the distance between them.
    assert twice(walls(lines, common=0.5), {3}) is None


def test_a_face_that_hides_another_is_the_same_wall_however_sure_the_filter_is_of_the_millimetres():
    """5 mm and 0.03 degrees along 4 m, as after a thousand looks at each; 1.5 cm apart the covariance decides."""
    sure = (1e-5, 1e-4)
    turn = float(np.deg2rad(0.03))

    def pair(along, across, length=4.0):
        return walls([(0.3, (1.0, 2.0), 4.0), (0.3 + turn, beside(0.3, (1.0, 2.0), along, across), length)], sigma=sure)

    for along, across in [(0.0, 0.005), (1.9, -0.005), (0.5, 0.008)]:
        assert twice(pair(along, across), {3}) == (3, 10)
    assert twice(pair(0.0, 0.015), {3}) is None
    assert twice(pair(0.0, 0.005, length=0.9), {3}) is None, "too short to tell"


def test_two_walls_are_not_made_straight_before_their_turn_is_known():
    """Half a metre seen twice, beside a long wall: it may turn by 2 degrees, and one cannot take a merge back."""
    lines = [(0.3, (1.0, 2.0), 3.0), (0.3 + np.deg2rad(2.2), beside(0.3, (1.0, 2.0), 1.6), 0.5)]
    assert twice(walls(lines, sigma=(0.015, 0.005)), {3}) is None
    straight = [lines[0], (0.3, beside(0.3, (1.0, 2.0), 1.6), 0.5)]
    assert twice(walls(straight, sigma=(0.015, 0.005)), {3}) is None
    assert twice(walls(straight, sigma=(0.01, 0.005)), {3}) == (3, 10)
    assert twice(walls(lines, sigma=(0.008, 0.005)), {3}) is None


def test_tentative_walls_are_left_alone():
    lines = [(0.3, (1.0, 2.0), 2.0), (0.3, (1.0, 2.0), 2.0)]
    assert twice(walls(lines, tentative=[False, True]), {3, 10}) is None


def test_candidates_are_those_of_a_plain_loop():
    rng = np.random.default_rng(8)
    places = [(rng.choice([0.0, 0.004, 0.03, 0.7]), rng.uniform(0, 1.5)) for _ in range(60)]
    lines = [(rng.choice([0.0, 0.04, 1.57, 3.1]), place, rng.uniform(0.2, 3)) for place in places]
    known = walls(lines)
    touched = set(known.ids[:40].tolist())
    plain = []
    for i in range(60):
        for j in range(i + 1, 60):
            if not touched & {int(known.ids[i]), int(known.ids[j])}:
                continue
            long, short = (i, j) if lines[i][2] > lines[j][2] else (j, i)
            n, t = normals(np.array(lines[long][0])), directions(np.array(lines[long][0]))
            off = known.ends_world[short] - known.ends_world[long, 0]
            near = np.abs(off @ n).max() <= CONFIG.shared.resolution_m
            apart = max((off @ t)[0] - lines[long][2], -(off @ t)[1])
            straight = np.cos(lines[i][0] - lines[j][0]) > np.cos(CONFIG.shared.straight_rad)
            if near and apart <= -CONFIG.shared.resolution_m and straight:
                plain.append((int(known.ids[i]), int(known.ids[j])))
    assert len(plain) > 5
    pairs, hidden = lying_along(known, np.array(list(touched)), CONFIG)
    assert pairs.tolist() == [list(pair) for pair in plain]
    for (one, other), is_hidden in zip(np.searchsorted(known.ids, pairs), hidden, strict=True):
        long, short = (one, other) if lines[one][2] > lines[other][2] else (other, one)
        points = np.linspace(*known.ends_world[short], 2001)
        off = points - known.ends_world[long, 0]
        n, t = normals(np.array(lines[long][0])), directions(np.array(lines[long][0]))
        shared = np.mean((off @ t >= 0.0) & (off @ t <= lines[long][2]))
        enough = shared * lines[short][2] >= CONFIG.shared.long_m
        assert is_hidden == (enough and bool(np.all(np.abs(off @ n) <= CONFIG.hidden_m)))
    assert 3 < np.count_nonzero(hidden) < len(pairs) - 3
