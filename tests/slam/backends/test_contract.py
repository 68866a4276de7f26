"""What every back end of the registry owes: sound covariances, no preferred frame, no preferred order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.backends import BACKENDS
from slam.estimation.backend import Observations
from slam.geometry.poses import compose, to_world, wrap
from tests.slam.backends.rooms import P0, START, Room, assert_sound, everything, journey, odometry, see, volume

few = settings(max_examples=12, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
NONE = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))

pytestmark = pytest.mark.parametrize("name", list(BACKENDS))


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


def test_a_observation_that_says_nothing_changes_next_to_nothing(name):
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
def test_moving_the_world_moves_the_answer_on_the_same_observations(name, world):
    if BACKENDS[name].is_about_origin:
        pytest.skip("equation (4): lines about the world's origin feel where it lies")

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
def test_the_order_of_the_observations_in_one_scan_does_not_matter(name):
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


def test_several_observations_of_one_line_in_one_scan_are_each_taken_in(name):
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
