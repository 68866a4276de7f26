"""Chains of random rooms, of rooms with a wall missing, and of the paper's figure 1."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.estimation.shared import SharedConfig
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.chains import HEAD, TAIL, connect
from chainslam.slam.map.stochastic_map import StochasticMap

few = settings(max_examples=40, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
REACH = SharedConfig().thickness_m
ASIDE_REACH = SharedConfig().door_m


def map_of(segments, ids=None, tentative=None):
    """Return a map whose walls are these segments (free side on the left), anchored in their middles."""
    count = len(segments)
    lines, anchors = through(segments), segments.mean(axis=1)
    d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    means = np.stack([lines[:, 0], d], axis=-1)
    half = 0.5 * np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    mean = np.concatenate([np.zeros(3), means.ravel()])

    def query(wanted):
        return Joint(mean, np.eye(len(mean)), anchors)

    numbers = np.arange(count) if ids is None else np.asarray(ids)
    belief = Belief(np.zeros(3), np.eye(3), numbers, anchors, means, query)
    marks = np.zeros(count, dtype=bool) if tentative is None else tentative
    return StochasticMap(
        belief, np.stack([-half, half], axis=-1), np.full(count, 20), marks, np.zeros(count, dtype=bool)
    )


def edges(corners):
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def random_room(rng, centre=(0.0, 0.0)):
    """Return corners, counter-clockwise (a room seen from inside), with every edge well longer than the reach."""
    while True:
        count = rng.integers(3, 10)
        turns = np.sort(rng.uniform(0, 2 * np.pi, count))
        gaps = np.diff(turns, append=turns[0] + 2 * np.pi)
        if gaps.max() < np.pi and gaps.min() > 0.4:
            radius = rng.uniform(2.0, 5.0, count)
            return np.asarray(centre) + radius[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)


def jittered(segments, rng, by):
    return segments + rng.uniform(-by, by, segments.shape)


def in_order(chain, start):
    """Return the walls of a closed chain, turned so that `start` is first."""
    at = chain.walls.index(start)
    return chain.walls[at:] + chain.walls[:at]


@few
@given(seeds)
def test_a_shuffled_and_jittered_room_is_one_closed_chain_with_its_corners_in_order(seed):
    rng = np.random.default_rng(seed)
    corners = random_room(rng)
    place = rng.permutation(len(corners))
    walls = jittered(edges(corners), rng, 0.3 * REACH)[place]
    (chain,) = connect(map_of(walls))
    assert chain.is_closed
    edge_of_wall = place[list(chain.walls)]
    np.testing.assert_array_equal(edge_of_wall, (edge_of_wall[0] + np.arange(len(corners))) % len(corners))
    np.testing.assert_allclose(chain.corners_world, corners[(edge_of_wall + 1) % len(corners)], atol=0.31)


@few
@given(seeds)
def test_exact_rooms_have_exact_corners(seed):
    rng = np.random.default_rng(seed)
    corners = random_room(rng)
    (chain,) = connect(map_of(edges(corners)))
    walls = np.array(chain.walls)
    np.testing.assert_allclose(chain.corners_world, corners[(walls + 1) % len(corners)], atol=1e-9)


@few
@given(seeds)
def test_a_missing_wall_leaves_one_open_chain_with_its_two_ends_at_the_gap(seed):
    rng = np.random.default_rng(seed)
    corners = random_room(rng)
    gone = int(rng.integers(len(corners)))
    rest = np.delete(edges(corners), gone, axis=0)
    place = rng.permutation(len(rest))
    (chain,) = connect(map_of(jittered(rest, rng, 0.3 * REACH)[place]))
    assert not chain.is_closed
    tail, head = chain.open_ends
    assert (tail.side, head.side) == (TAIL, HEAD)
    assert (tail.wall, head.wall) == (chain.walls[0], chain.walls[-1])
    np.testing.assert_allclose(head.position_world, corners[gone], atol=REACH)
    np.testing.assert_allclose(tail.position_world, corners[(gone + 1) % len(corners)], atol=REACH)
    assert len(chain.corners_world) == len(chain.walls) - 1


@few
@given(seeds)
def test_every_wall_is_in_exactly_one_chain_unless_it_is_tentative(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 25))
    starts = rng.uniform(0, 2.0, (count, 2))
    segments = np.stack([starts, starts + rng.uniform(-0.8, 0.8, (count, 2)) + 1e-3], axis=1)
    ids, tentative = np.sort(rng.choice(100, count, replace=False)), rng.random(count) < 0.3
    aside = {(int(i), int(rng.integers(2))) for i in rng.choice(ids, count // 2)}
    chains = connect(map_of(segments, ids, tentative), aside)
    walls = sorted(wall for chain in chains for wall in chain.walls)
    assert walls == ids[~tentative].tolist()
    ends = map_of(segments, ids, tentative).ends_world
    row = {int(i): k for k, i in enumerate(ids)}
    for chain in chains:
        following = chain.walls[1:] + chain.walls[:1] if chain.is_closed else chain.walls[1:]
        for a, b in zip(chain.walls, following, strict=False):
            gap = np.hypot(*(ends[row[a], HEAD] - ends[row[b], TAIL]))
            both_aside = (a, HEAD) in aside and (b, TAIL) in aside
            assert gap <= (ASIDE_REACH if both_aside else REACH)


@few
@given(seeds)
def test_the_numbering_of_the_walls_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    walls = np.concatenate([edges(random_room(rng)), edges(random_room(rng, (20.0, 0.0)))[1:]])
    place = rng.permutation(len(walls))

    def links(chains, names):
        pairs = set()
        for chain in chains:
            following = chain.walls[1:] + chain.walls[:1] if chain.is_closed else chain.walls[1:]
            pairs |= {(int(names[a]), int(names[b])) for a, b in zip(chain.walls, following, strict=False)}
        return pairs

    same = np.arange(len(walls))
    assert links(connect(map_of(walls)), same) == links(connect(map_of(walls[place])), place)


@few
@given(seeds)
def test_each_of_several_chains_is_the_one_that_its_walls_alone_make(seed):
    rng = np.random.default_rng(seed)
    rooms = [jittered(edges(random_room(rng, (20.0 * k, 0.0))), rng, 0.3 * REACH) for k in range(4)]
    walls = np.concatenate([*rooms[:2], *(room[1:] for room in rooms[2:])])
    walls = walls[rng.permutation(len(walls))]
    chains = connect(map_of(walls))
    assert sorted(chain.is_closed for chain in chains) == [False, False, True, True]
    for chain in chains:
        rows = np.sort(chain.walls)
        (alone,) = connect(map_of(walls[rows], rows))
        assert alone.walls == chain.walls
        np.testing.assert_array_equal(alone.corners_world, chain.corners_world)
        assert [(end.wall, end.side) for end in alone.open_ends] == [(end.wall, end.side) for end in chain.open_ends]
        for one, other in zip(alone.open_ends, chain.open_ends, strict=True):
            np.testing.assert_array_equal(one.position_world, other.position_world)


def test_the_papers_first_figure_is_one_closed_and_one_open_chain():
    """An obstacle stands in a room; of the room's wall the robot has not yet seen one part."""
    room = np.array([[0, 0], [6, 0], [6, 4], [4, 4], [4, 5], [0, 5]], dtype=float)
    obstacle = np.array([[2, 1.5], [2, 3], [3, 3], [3.5, 2.2], [3, 1.5]], dtype=float)
    chains = connect(map_of(np.concatenate([np.delete(edges(room), 4, axis=0), edges(obstacle)])))
    assert sorted(chain.is_closed for chain in chains) == [False, True]
    (closed,) = [chain for chain in chains if chain.is_closed]
    assert sorted(closed.walls) == [5, 6, 7, 8, 9]
    (other,) = [chain for chain in chains if not chain.is_closed]
    places = {end.side: end.position_world for end in other.open_ends}
    np.testing.assert_allclose(places[HEAD], room[4], atol=1e-9)
    np.testing.assert_allclose(places[TAIL], room[5], atol=1e-9)


def test_a_head_never_joins_a_head_nor_a_tail_a_tail():
    """Two faces that meet at a convex edge with their free sides on different hands."""
    meeting = np.array([[[0, 0], [1, 0]], [[1, 1], [1, 0.01]]], dtype=float)
    for walls in (meeting, meeting[:, ::-1]):
        chains = connect(map_of(walls), {(k, side) for k in (0, 1) for side in (TAIL, HEAD)})
        assert len(chains) == 2
        assert not any(chain.is_closed for chain in chains)


def test_a_wall_never_closes_upon_itself():
    (chain,) = connect(map_of(np.array([[[0.0, 0.0], [0.05, 0.0]]])), {(0, TAIL), (0, HEAD)})
    assert not chain.is_closed


def gap_of(metres):
    return np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0 + metres, 0.0], [2.0, 1.0]]])


@pytest.mark.parametrize("metres", [0.12, 0.2, 0.34])
def test_ends_join_across_a_wider_gap_only_when_both_were_set_aside(metres):
    walls = map_of(gap_of(metres))
    assert len(connect(walls)) == 2
    assert len(connect(walls, {(0, HEAD)})) == 2
    assert len(connect(walls, {(1, TAIL)})) == 2
    assert len(connect(walls, {(0, TAIL), (1, HEAD)})) == 2
    (chain,) = connect(walls, {(0, HEAD), (1, TAIL)})
    assert chain.walls == (0, 1)


def test_no_gap_is_too_wide_for_one_that_was_set_aside_but_not_beyond_its_reach():
    assert len(connect(map_of(gap_of(ASIDE_REACH + 0.02)), {(0, HEAD), (1, TAIL)})) == 2


def test_the_nearer_of_two_tails_is_joined():
    walls = np.array([[[0, 0], [1, 0]], [[1.08, 0], [2, 1]], [[1.03, 0], [2, -1]]], dtype=float)
    chains = connect(map_of(walls))
    assert sorted(chain.walls for chain in chains) == [(0, 2), (1,)]


def test_an_empty_map_has_no_chains():
    assert connect(map_of(np.zeros((0, 2, 2)))) == ()
    assert connect(map_of(gap_of(0.0), tentative=np.array([True, True]))) == ()
