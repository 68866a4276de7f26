"""What a belief of any back end owes: parts of one whole, stale once its back end has moved on, honest ids."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.backends import BACKENDS
from slam.estimation.backend import StaleBeliefError
from slam.robot import Odometry
from tests.slam.backends.rooms import P0, START, Room, everything, journey, see

few = settings(max_examples=12, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)

pytestmark = pytest.mark.parametrize("name", list(BACKENDS))


@few
@given(seed=seeds)
def test_a_part_of_the_joint_belief_is_a_slice_of_the_whole_in_the_order_asked(name, seed):
    rng = np.random.default_rng(seed)
    backend, _, _ = journey(name, Room.random(rng), 8, rng)
    belief = backend.belief
    whole = belief.joint(belief.ids)
    chosen = rng.permutation(belief.ids)[: rng.integers(0, len(belief.ids) + 1)]
    rows = np.searchsorted(belief.ids, chosen)
    index = np.concatenate([np.arange(3), (3 + 2 * rows[:, None] + np.arange(2)).ravel()])
    part = belief.joint(chosen)
    np.testing.assert_array_equal(part.mean, whole.mean[index])
    np.testing.assert_array_equal(part.cov, whole.cov[np.ix_(index, index)])
    np.testing.assert_array_equal(part.anchors, whole.anchors[rows])


def verbs(backend, room):
    lines, cov, centres = room.seen(backend.belief.pose_world, np.arange(2))
    first = backend.belief.ids[:2]
    return {
        "predict": lambda: backend.predict(Odometry(np.array([0.1, 0.0, 0.0]), 1e-4 * np.eye(3))),
        "update": lambda: see(backend, first, lines, cov),
        "grow": lambda: backend.grow(lines, cov, centres),
        "merge": lambda: backend.merge(*first.tolist()),
        "remove": lambda: backend.remove(first[:1].tolist()),
    }


@pytest.mark.parametrize("verb", ["predict", "update", "grow", "merge", "remove"])
def test_a_belief_goes_stale_when_its_back_end_moves_on_and_keeps_what_it_said(name, verb):
    rng = np.random.default_rng(12)
    room = Room.random(rng)
    backend, _, _ = journey(name, room, 10, rng)
    belief = backend.belief
    said = [np.array(part) for part in (belief.pose_world, belief.pose_cov, belief.ids, belief.anchors, belief.means)]
    belief.joint(belief.ids)
    verbs(backend, room)[verb]()
    with pytest.raises(StaleBeliefError):
        belief.joint(belief.ids[:1])
    for now, then in zip(
        (belief.pose_world, belief.pose_cov, belief.ids, belief.anchors, belief.means), said, strict=True
    ):
        np.testing.assert_array_equal(now, then)
    backend.belief.joint(backend.belief.ids)


def test_a_joint_taken_earlier_is_not_changed_by_what_follows(name):
    rng = np.random.default_rng(13)
    room = Room.random(rng)
    backend, _, _ = journey(name, room, 10, rng)
    joint = everything(backend)
    mean, cov = joint.mean.copy(), joint.cov.copy()
    for verb in verbs(backend, room).values():
        verb()
    np.testing.assert_array_equal(joint.mean, mean)
    np.testing.assert_array_equal(joint.cov, cov)


def test_ids_are_never_used_again(name):
    rng = np.random.default_rng(14)
    room, backend = Room.random(rng), BACKENDS[name].make(START.copy(), P0.copy())
    used: set[int] = set()
    for _ in range(6):
        ids = backend.grow(*room.seen(START, np.arange(3), rng)).tolist()
        assert len(set(ids)) == 3
        assert not used & set(ids)
        used |= set(ids)
        backend.remove(backend.belief.ids.tolist())
    assert len(backend.belief.ids) == 0


def test_unknown_ids_raise_key_errors(name):
    rng = np.random.default_rng(15)
    room, backend = Room.random(rng), BACKENDS[name].make(START.copy(), P0.copy())
    lines, cov, centres = room.seen(START, np.arange(2), rng)
    with pytest.raises(KeyError):
        backend.belief.joint([0])
    kept, gone = backend.grow(lines, cov, centres).tolist()
    backend.remove([gone])
    for ask in (
        lambda: backend.belief.joint([kept, gone]),
        lambda: backend.remove([gone]),
        lambda: backend.merge(kept, gone),
        lambda: backend.merge(999, kept),
        lambda: see(backend, [gone], lines[:1], cov[:1]),
        lambda: backend.belief.rows([-1]),
    ):
        with pytest.raises(KeyError):
            ask()
    assert backend.belief.ids.tolist() == [kept]


def test_removing_lines_leaves_the_marginal_of_the_rest(name):
    rng = np.random.default_rng(16)
    backend, _, ids = journey(name, Room.random(rng), 40, rng)
    gone = [ids[0], ids[3]]
    rest = np.array([i for i in backend.belief.ids.tolist() if i not in gone])
    before = backend.belief.joint(rest)
    backend.remove(gone)
    after = everything(backend)
    np.testing.assert_array_equal(backend.belief.ids, rest)
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-14)
    np.testing.assert_allclose(after.cov, before.cov, atol=1e-16)
    np.testing.assert_array_equal(after.anchors, before.anchors)
