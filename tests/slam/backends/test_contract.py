"""What every back end of the registry owes: sound covariances, no preferred frame, no preferred order, honest ids."""

from dataclasses import dataclass

import jaxtyping
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.backend import Backend, Observations, StaleBeliefError
from slam.backends import BACKENDS
from slam.geometry.poses import compose, to_world, wrap
from slam.robot import Odometry

few = settings(max_examples=12, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
NOWHERE = np.zeros(3)
START, P0 = np.array([0.5, -0.3, 0.2]), np.diag([0.01, 0.01, 0.002]) ** 2
NONE = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))

pytestmark = pytest.mark.parametrize("name", list(BACKENDS))


@pytest.fixture
def _unchecked():
    """Without the shape checks that pytest adds, which the shorter tests keep."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def normal(alpha):
    return np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)


@dataclass
class Room:
    """True lines (alpha, r) with the points where they are looked at, and a robot that drives in a circle."""

    lines: np.ndarray
    points: np.ndarray

    @classmethod
    def random(cls, rng, count=8):
        alpha = rng.uniform(-np.pi, np.pi, count)
        r = rng.uniform(2.0, 6.0, count)
        along = np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
        return cls(np.stack([alpha, r], axis=-1), r[:, None] * normal(alpha) + rng.uniform(-1, 1, (count, 1)) * along)

    def seen(self, pose, rows, rng=None):
        """Return lines, covariances and centres in the robot frame, noisy with a generator."""
        alpha = self.lines[rows, 0] - pose[2]
        r = self.lines[rows, 1] - normal(self.lines[rows, 0]) @ pose[:2]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        centres = (self.points[rows] - pose[:2]) @ np.array([[c, -s], [s, c]])
        t0 = np.sum(centres * np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1), axis=-1)
        turn = np.zeros((len(rows), 2, 2))
        turn[:, 0, 0] = turn[:, 1, 1] = 1.0
        turn[:, 1, 0] = t0
        cov = turn @ np.diag([0.004**2, 0.003**2]) @ turn.swapaxes(1, 2)
        lines = np.stack([wrap(alpha), r], axis=-1)
        if rng is not None:
            lines = lines + np.einsum("mij,mj->mi", np.linalg.cholesky(cov), rng.standard_normal((len(rows), 2)))
        return lines, cov, centres


def odometry(rng, forward=0.1, turn=0.15):
    cov = np.diag([0.01, 0.005, 0.008]) ** 2
    return Odometry(np.array([forward, 0.0, turn]), cov), cov


def see(backend: Backend, ids, lines, cov):
    observed = Observations(np.asarray(ids, dtype=np.int64), lines, cov)
    backend.update(observed, observed)


def everything(backend):
    return backend.belief.joint(backend.belief.ids)


def volume(backend):
    """Return the log of the uncertainty's volume, which no change of the error's coordinates alters."""
    return np.linalg.slogdet(everything(backend).cov)[1]


def assert_sound(backend):
    """The joint covariance is symmetric and positive definite, and says what the belief says."""
    belief = backend.belief
    joint = belief.joint(belief.ids)
    P = joint.cov
    np.testing.assert_allclose(P, P.T, rtol=0, atol=1e-14 * np.abs(P).max())
    scale = np.sqrt(np.diag(P))
    assert np.all(scale > 0)
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0
    np.testing.assert_array_equal(joint.mean[:3], belief.pose_world)
    np.testing.assert_array_equal(joint.mean[3:].reshape(-1, 2), belief.means)
    np.testing.assert_array_equal(P[:3, :3], belief.pose_cov)
    np.testing.assert_array_equal(joint.anchors, belief.anchors)


def journey(name, room, steps, rng, start=START, world=NOWHERE, order=lambda rows: rows):
    """Drive a noisy circle through a room whose sightings do not depend on where `world` puts it.

    Every line is entered when first seen; two to five lines are seen in each step.
    """
    backend = BACKENDS[name].make(compose(world, start), rotated(P0, world[2]))
    true, ids = start.copy(), {}
    for _ in range(steps):
        odo, cov = odometry(rng)
        true = compose(true, odo.motion + np.linalg.cholesky(cov) @ rng.standard_normal(3))
        backend.predict(odo)
        rows = np.sort(rng.choice(len(room.lines), rng.integers(2, 6), replace=False))
        lines, covs, centres = room.seen(true, rows, rng)
        known = order(np.array([k for k, row in enumerate(rows) if row in ids], dtype=np.int64))
        if len(known):
            see(backend, [ids[rows[k]] for k in known], lines[known], covs[known])
        new = np.array([k for k, row in enumerate(rows) if row not in ids], dtype=np.int64)
        if len(new):
            grown = backend.grow(lines[new], covs[new], centres[new])
            ids.update(zip(rows[new].tolist(), grown.tolist(), strict=True))
    return backend, true, ids


def rotated(P, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ P @ turn.T


@few
@given(seed=seeds)
def test_covariances_stay_sound_through_any_program_of_verbs(name, seed):
    rng = np.random.default_rng(seed)
    room, backend = Room.random(rng), BACKENDS[name].make(START.copy(), P0.copy())
    true, owner, used = START.copy(), {}, set()
    for _ in range(40):
        verb = rng.choice(["predict", "update", "grow", "merge", "remove"], p=[0.3, 0.3, 0.2, 0.1, 0.1])
        ids = backend.belief.ids
        if verb == "predict":
            odo, cov = odometry(rng, rng.uniform(-0.15, 0.15), rng.uniform(-0.17, 0.17))
            true = compose(true, odo.motion + np.linalg.cholesky(cov) @ rng.standard_normal(3))
            backend.predict(odo)
        elif verb == "grow":
            rows = rng.choice(len(room.lines), rng.integers(1, 4), replace=False)
            new = backend.grow(*room.seen(true, rows, rng)).tolist()
            assert not used & set(new)
            used |= set(new)
            owner.update(zip(new, rows.tolist(), strict=True))
        elif len(ids) and verb == "update":
            chosen = rng.choice(ids, rng.integers(1, len(ids) + 1), replace=False)
            lines, cov, _ = room.seen(true, np.array([owner[i] for i in chosen.tolist()]), rng)
            see(backend, chosen, lines, cov)
        elif verb == "merge":
            walls = [owner[i] for i in ids.tolist()]
            twins = [i for i, wall in zip(ids.tolist(), walls, strict=True) if walls.count(wall) > 1]
            if twins:
                keep = int(rng.choice(twins))
                backend.merge(keep, next(i for i in twins if i != keep and owner[i] == owner[keep]))
        elif len(ids):
            backend.remove(rng.choice(ids, rng.integers(1, len(ids) + 1), replace=False).tolist())
        assert_sound(backend)
        assert np.all(np.diff(backend.belief.ids) > 0)


@pytest.mark.usefixtures("_unchecked")
def test_covariances_stay_sound_over_a_thousand_steps(name):
    rng = np.random.default_rng(5)
    backend, _, _ = journey(name, Room.random(rng), 1200, rng)
    assert_sound(backend)


@pytest.mark.usefixtures("_unchecked")
def test_covariances_stay_sound_while_the_robot_stands_still(name):
    rng = np.random.default_rng(6)
    room, backend = Room.random(rng), BACKENDS[name].make(START.copy(), P0.copy())
    rows = np.arange(len(room.lines))
    ids = backend.grow(*room.seen(START, rows, rng))
    for _ in range(1000):
        lines, cov, _ = room.seen(START, rows, rng)
        see(backend, ids, lines, cov)
    assert_sound(backend)


def test_a_sighting_that_says_nothing_changes_next_to_nothing(name):
    rng = np.random.default_rng(7)
    room = Room.random(rng)
    backend, true, ids = journey(name, room, 30, rng)
    before = everything(backend)
    rows = np.array(list(ids), dtype=np.int64)
    lines, cov, _ = room.seen(true, rows, rng)
    see(backend, [ids[row] for row in rows.tolist()], lines + 0.1, 1e12 * cov)
    after = everything(backend)
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-9)
    np.testing.assert_allclose(after.cov, before.cov, atol=1e-9 * np.abs(before.cov).max())


def test_a_scan_without_matches_changes_nothing(name):
    rng = np.random.default_rng(8)
    backend, _, _ = journey(name, Room.random(rng), 10, rng)
    before = everything(backend)
    backend.update(NONE, NONE)
    after = everything(backend)
    np.testing.assert_array_equal(after.mean, before.mean)
    np.testing.assert_array_equal(after.cov, before.cov)


@pytest.mark.usefixtures("_unchecked")
@pytest.mark.parametrize(
    "world", [np.array([100.0, -100.0, 0.0]), np.array([0.0, 0.0, 2.0]), np.array([70.0, 70.0, -1.0])]
)
def test_moving_the_world_moves_the_answer_on_the_same_sightings(name, world):
    def run(world):
        rng = np.random.default_rng(9)
        return journey(name, Room.random(rng), 80, rng, world=world)[0]

    here, there = everything(run(np.zeros(3))), everything(run(world))
    np.testing.assert_allclose(there.mean[:2], to_world(here.mean[None, :2], world)[0], atol=1e-9)
    np.testing.assert_allclose(wrap(there.mean[2] - here.mean[2] - world[2]), 0.0, atol=1e-9)
    np.testing.assert_allclose(there.anchors, to_world(here.anchors, world), atol=1e-9)
    lines, moved = here.mean[3:].reshape(-1, 2), there.mean[3:].reshape(-1, 2)
    np.testing.assert_allclose(wrap(moved[:, 0] - lines[:, 0] - world[2]), 0.0, atol=1e-9)
    np.testing.assert_allclose(moved[:, 1], lines[:, 1], atol=1e-9)
    c, s = np.cos(world[2]), np.sin(world[2])
    turn = np.eye(len(here.mean))
    turn[:2, :2] = [[c, -s], [s, c]]
    np.testing.assert_allclose(there.cov, turn @ here.cov @ turn.T, atol=1e-9)


@pytest.mark.usefixtures("_unchecked")
def test_the_order_of_the_sightings_in_one_scan_does_not_matter(name):
    def run(order):
        rng = np.random.default_rng(10)
        return everything(journey(name, Room.random(rng), 60, rng, order=order)[0])

    forth, back = run(lambda rows: rows), run(lambda rows: rows[::-1].copy())
    np.testing.assert_allclose(back.mean, forth.mean, atol=1e-11)
    np.testing.assert_allclose(back.cov, forth.cov, atol=1e-13)


def test_the_order_in_which_lines_are_entered_renumbers_the_answer(name):
    rng = np.random.default_rng(11)
    room, rows = Room.random(rng), np.arange(8)
    seen, again = room.seen(START, rows, rng), room.seen(START, rows, rng)
    answers = []
    for order in (rows, rng.permutation(rows)):
        backend = BACKENDS[name].make(START.copy(), P0.copy())
        ids = np.empty(8, dtype=np.int64)
        ids[order] = backend.grow(*(part[order] for part in seen))
        see(backend, ids, again[0], again[1])
        answers.append(backend.belief.joint(ids))
    np.testing.assert_allclose(answers[1].mean, answers[0].mean, atol=1e-12)
    np.testing.assert_allclose(answers[1].cov, answers[0].cov, atol=1e-15)


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


def test_several_sightings_of_one_line_in_one_scan_are_each_taken_in(name):
    rng = np.random.default_rng(17)
    room = Room.random(rng)
    backend, true, ids = journey(name, room, 30, rng)
    line = ids[0]
    seen = [room.seen(true, np.array([0]), rng) for _ in range(3)]
    before = volume(backend)
    see(backend, [line] * 3, *(np.concatenate([s[k] for s in seen]) for k in range(2)))
    assert_sound(backend)
    assert volume(backend) < before


def test_a_line_entered_once_and_seen_again_is_better_known(name):
    rng = np.random.default_rng(18)
    room, backend = Room.random(rng), BACKENDS[name].make(START.copy(), P0.copy())
    ids = backend.grow(*room.seen(START, np.arange(4), rng))
    before = volume(backend)
    lines, cov, _ = room.seen(START, np.arange(4), rng)
    see(backend, ids, lines, cov)
    assert volume(backend) < before
