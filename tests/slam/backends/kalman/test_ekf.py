"""The verbs of the full filter, step by step, against an EKF of whole matrices that has no verbs of its own."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.backends.kalman.linear import equality
from chainslam.slam.estimation.backend import Observations, StaleBeliefError
from chainslam.slam.estimation.models import initialise, innovations, move
from chainslam.slam.geometry.poses import compose, wrap
from chainslam.slam.robot import Odometry

START, P0 = np.array([0.2, -1.0, 3.1]), np.diag([0.02, 0.02, 0.01]) ** 2
ODOMETRY = Odometry(np.array([0.2, 0.02, 0.15]), np.diag([0.03, 0.02, 0.05]) ** 2)
NONE = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))

pytestmark = pytest.mark.usefixtures("_unchecked")


class Plain:
    """An EKF of (x, y, heading, alpha_1, d_1, ...), from the models' Jacobians alone."""

    def __init__(self, config):
        self.config, self.x, self.P = config, START.copy(), P0.copy()
        self.ids, self.anchors, self.slip = [], np.zeros((0, 2)), np.zeros((3, 3))

    def predict(self, odometry):
        motion, A = move(self.x[:3], odometry.motion), np.eye(len(self.x))
        A[:3, :3], noise = motion.F, motion.W @ odometry.cov @ motion.W.T
        self.x[:3], self.P = motion.pose_world, A @ self.P @ A.T
        self.P[:3, :3] += noise
        self.slip = motion.F @ self.slip @ motion.F.T + noise

    def grow(self, ids, lines, cov, centres):
        new = initialise(self.x[:3], lines, centres, self.config.at_wall)
        for k, id_ in enumerate(ids.tolist()):
            A = np.vstack([np.eye(len(self.x)), np.zeros((2, len(self.x)))])
            A[-2:, :3] = new.G_pose[k]
            self.x, self.P = np.concatenate([self.x, new.means[k]]), A @ self.P @ A.T
            self.P[-2:, -2:] += new.G_line[k] @ cov[k] @ new.G_line[k].T
            self.ids, self.anchors = [*self.ids, id_], np.vstack([self.anchors, new.anchors[k]])

    def columns(self, ids):
        return np.array([[3 + 2 * self.ids.index(i), 4 + 2 * self.ids.index(i)] for i in ids])

    def condition(self, columns, H, e, R):
        whole = np.zeros((len(e), len(self.x)))
        whole[:, columns] = H
        gain = self.P @ whole.T @ np.linalg.inv(whole @ self.P @ whole.T + R)
        self.x, self.P = self.x + gain @ e, self.P - gain @ whole @ self.P
        self.x[2], self.x[3::2] = wrap(self.x[2]), wrap(self.x[3::2])

    def looked(self, pose, seen):
        """Return the Jacobian by the whole state, the innovations and their noise, the pose being elsewhere."""
        columns, m = self.columns(seen.ids.tolist()), len(seen.ids)
        anchors = self.anchors[(columns[:, 0] - 3) // 2]
        model = innovations(pose, anchors, self.x[columns], seen.lines, seen.cov)
        H, R = np.zeros((2 * m, len(self.x))), np.zeros((2 * m, 2 * m))
        for k, here in enumerate(columns):
            rows = slice(2 * k, 2 * k + 2)
            H[rows, :3], H[rows, here], R[rows, rows] = model.H_pose[k], model.H_line[k], model.R[k]
        return H, model.e.ravel(), R

    def update(self, seen):
        H, e, R = self.looked(self.x[:3], seen)
        if self.config.relinearise:
            S = H[:, :3] @ self.slip @ H[:, :3].T + R
            step = self.slip @ H[:, :3].T @ np.linalg.inv(S) @ e
            H, e, R = self.looked(self.x[:3] + step, seen)
            e = e + H[:, :3] @ step
        self.condition(np.arange(len(self.x)), H, e, R)
        self.slip = np.zeros((3, 3))

    def merge(self, keep, drop):
        columns = self.columns([keep, drop])
        H, e = equality(self.x[columns], self.anchors[(columns[:, 0] - 3) // 2])
        self.condition(np.concatenate([[0, 1, 2], columns.ravel()]), H, e, 1e-12 * np.eye(2))
        self.remove([drop])

    def remove(self, ids):
        gone = self.columns(ids)
        self.x, self.P = np.delete(self.x, gone), np.delete(np.delete(self.P, gone, 0), gone, 1)
        self.anchors = np.delete(self.anchors, (gone[:, 0] - 3) // 2, axis=0)
        self.ids = [i for i in self.ids if i not in ids]


@pytest.mark.parametrize("at_wall", [True, False])
@pytest.mark.parametrize("relinearise", [True, False])
def test_every_verb_does_what_whole_matrices_say(at_wall, relinearise, make_walls):
    """Two motions between looks, walls seen in two pieces, in any order, a heading that passes half a turn."""
    config, walls, rng = EkfConfig(at_wall, relinearise), make_walls(12), np.random.default_rng(11)
    backend, plain, true = FullEkf(START, P0, config), Plain(config), START
    walls_of = {}

    def enter(rows):
        new = walls.look(true, rows, rng)
        ids = backend.grow(*new)
        plain.grow(ids, *new)
        walls_of.update(zip(ids.tolist(), rows.tolist(), strict=True))

    enter(np.arange(5))
    for turn in range(12):
        for _ in range(2):
            for each in (backend, plain):
                each.predict(ODOMETRY)
            true = compose(true, ODOMETRY.motion + 0.03 * rng.standard_normal(3))
        ids = np.append(rng.permutation(list(walls_of))[:4], rng.choice(list(walls_of)))
        lines, cov, _ = walls.look(true, np.array([walls_of[i] for i in ids.tolist()]), rng)
        seen = Observations(ids, lines, cov)
        backend.update(NONE if turn % 2 else replace(seen, lines=lines + 1.0), seen)
        plain.update(seen)
        if turn % 3 == 0:
            enter(np.array([turn // 3, 5 + turn // 3]))
            twins = [i for i, wall in walls_of.items() if wall == turn // 3]
            for each in (backend, plain):
                each.merge(*twins)
                each.remove([list(walls_of)[4]])
            del walls_of[twins[1]], walls_of[list(walls_of)[4]]
        belief = backend.belief
        joint = belief.joint(belief.ids)
        assert belief.ids.tolist() == plain.ids
        np.testing.assert_allclose(joint.mean, plain.x, atol=1e-8)
        np.testing.assert_allclose(joint.cov, plain.P, atol=1e-6 * np.abs(plain.P).max())
        np.testing.assert_allclose(joint.anchors, plain.anchors, atol=1e-9)
        np.testing.assert_array_equal(belief.anchors, joint.anchors)
        np.testing.assert_array_equal(belief.means.ravel(), joint.mean[3:])
        np.testing.assert_array_equal(belief.pose_cov, joint.cov[:3, :3])


def test_every_verb_makes_a_belief_stale_but_those_that_do_nothing(make_walls):
    walls, rng = make_walls(), np.random.default_rng(12)
    backend = FullEkf(START, P0)
    new = walls.look(START, np.arange(4), rng)
    ids = backend.grow(*new).tolist()
    seen = Observations(np.array(ids), *new[:2])
    verbs = (
        lambda: backend.predict(ODOMETRY),
        lambda: backend.update(NONE, seen),
        lambda: backend.grow(*new),
        lambda: backend.merge(ids[0], ids[1]),
        lambda: backend.remove(ids[2:3]),
    )
    for verb in verbs:
        belief = backend.belief
        assert backend.belief is belief
        belief.joint(ids[3:])
        verb()
        with pytest.raises(StaleBeliefError, match=r"^expected a belief of the present step, found one whose back end"):
            belief.joint(ids[3:])
    belief = backend.belief
    backend.update(seen, NONE)
    for verb, error, words in (
        (
            lambda: backend.merge(ids[3], ids[3]),
            ValueError,
            f"^expected two lines to merge, found line {ids[3]} twice$",
        ),
        (lambda: backend.merge(ids[3], 99), KeyError, "99"),
        (lambda: backend.remove([99]), KeyError, "99"),
    ):
        with pytest.raises(error, match=words):
            verb()
    assert backend.belief is belief
    belief.joint(ids[3:])


def test_a_map_that_begins_in_the_blind_is_at_its_first_sight_what_whole_matrices_say(make_walls):
    """It has a frame of its own, but what is told of it is in the world's."""
    backend, plain, new = FullEkf(START, P0), Plain(EkfConfig()), make_walls().look(START, np.arange(3))
    for each in (backend, plain):
        each.predict(ODOMETRY)
    ids = backend.grow(*new)
    plain.grow(ids, *new)
    belief = backend.belief
    joint = belief.joint(ids)
    np.testing.assert_allclose(joint.mean, plain.x, atol=1e-12)
    np.testing.assert_allclose(joint.cov, plain.P, atol=1e-15)
    np.testing.assert_allclose(joint.anchors, plain.anchors, atol=1e-12)
    np.testing.assert_allclose(belief.pose_world, plain.x[:3], atol=1e-12)
    np.testing.assert_allclose(belief.pose_cov, plain.P[:3, :3], atol=1e-15)
    np.testing.assert_allclose(belief.anchors, plain.anchors, atol=1e-12)
    np.testing.assert_allclose(belief.means.ravel(), plain.x[3:], atol=1e-12)


def test_a_merge_is_conditioned_on_apart_from_scans_and_its_jacobian_is_taken_where_the_filter_says(make_walls):
    backend, asked, given = FullEkf(START, P0), [], []
    ids = backend.grow(*make_walls().look(START, np.arange(3)))
    backend.observe = lambda *of: pytest.fail("a merge is no scan")
    backend.unite = lambda rows: asked.append(rows.tolist()) or backend._equate(rows, 0.7)
    backend.map.condition = given.append
    means, anchors = backend.belief.means, backend.belief.anchors
    backend.merge(ids[2], ids[0])
    assert asked == [[2, 0]]
    np.testing.assert_array_equal(given[0].H, equality(means[[2, 0]], anchors[[2, 0]], 0.7)[0])
    assert not len(given[0].place)


@pytest.mark.parametrize("seen_twice", [False, True])
def test_a_filter_of_ones_own_may_weigh_each_observation_and_doubt_the_wheels(seen_twice, make_walls):
    """Two hooks of one class: the noise of the motion, and which observation each row of a scan is."""
    walls, rng, once = make_walls(), np.random.default_rng(13), EkfConfig(relinearise=False)

    class Own(FullEkf):
        def motion(self, odometry):
            motion, noise = super().motion(odometry)
            return motion, 4.0 * noise

        def linearise(self, rows, seen):
            model = super().linearise(rows, seen)
            assert model.rows[model.place].tolist() == rows.tolist()
            return replace(model, R=model.R * np.repeat(weights, 2)[:, None])

    ids = (own := Own(START, P0, once)).grow(*(new := walls.look(START, np.arange(4), rng)))
    (plain := FullEkf(START, P0, once)).grow(*new)
    rows = np.array([3, 1, 1] if seen_twice else [3, 1])
    weights = np.array([2.0, 3.0, 5.0])[: len(rows)]
    lines, cov, _ = walls.look(compose(START, ODOMETRY.motion), rows, rng)
    own.predict(ODOMETRY)
    own.update(NONE, Observations(ids[rows], lines, cov))
    plain.predict(replace(ODOMETRY, cov=4.0 * ODOMETRY.cov))
    plain.update(NONE, Observations(ids[rows], lines, weights[:, None, None] * cov))
    np.testing.assert_allclose(own.belief.joint(ids).mean, plain.belief.joint(ids).mean, atol=1e-9)
    np.testing.assert_allclose(own.belief.joint(ids).cov, plain.belief.joint(ids).cov, atol=1e-12)
