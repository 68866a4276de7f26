"""An estimator of one's own, from nothing: an unscented Kalman filter of the pose and of lines (alpha, r)."""

from collections.abc import Callable, Sequence

import numpy as np

import chainslam

Array = np.ndarray


def unscented(function: Callable[[Array], Array], mean: Array, cov: Array) -> tuple[Array, Array]:
    """Return mean and covariance of (x, function(x)) together, x being Gaussian: 2 n + 1 points, n + kappa = 3."""
    root = np.sqrt(3.0) * np.linalg.cholesky(cov)
    points = np.concatenate([mean[None], mean + root.T, mean - root.T])
    values = np.array([np.concatenate([x, function(x)]) for x in points])
    away = values[1:] - values[0]  # spread about the central point: kappa is negative, and a covariance must stay one
    return values[0] + away.sum(axis=0) / 6.0, away.T @ away / 6.0


def half_turn(angle: Array) -> Array:
    """Bring angles into half a turn."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


class OwnUkf:
    """All lines about the world's origin: every anchor is zero."""

    def __init__(self, pose_world: Array, pose_cov: Array) -> None:
        """Start at a pose with its covariance and an empty map."""
        self.x, self.P = np.array(pose_world, dtype=float), np.array(pose_cov, dtype=float)
        self.ids, self.next_id, self.version = np.zeros(0, dtype=int), 0, 0

    @property
    def belief(self) -> chainslam.Belief:
        """The estimate now."""
        x, version, anchors = self.x, self.version, np.zeros((len(self.ids), 2))

        def joint(wanted: Array) -> chainslam.Joint:
            if version != self.version:
                raise chainslam.StaleBeliefError("expected a belief of the present step")
            at = self.columns(belief.rows(wanted))
            return chainslam.Joint(x[at], self.P[np.ix_(at, at)], np.zeros((len(wanted), 2)))

        belief = chainslam.Belief(x[:3], self.P[:3, :3].copy(), self.ids, anchors, x[3:].reshape(-1, 2), joint)
        return belief

    def predict(self, odometry: chainslam.Odometry) -> None:
        """Move the pose by the odometry."""

        def end(x: Array) -> Array:
            (px, py, heading), (dx, dy, turn) = x[:3], x[-3:]
            c, s = np.cos(heading), np.sin(heading)
            return np.array([px + c * dx - s * dy, py + s * dx + c * dy, heading + turn])

        n = len(self.x)
        mean, cov = self.with_noise(end, odometry.motion, odometry.cov)
        keep = np.r_[n + 3 : n + 6, 3:n]  # the new pose in the old one's place
        self.set(mean[keep], cov[np.ix_(keep, keep)])

    def update(self, first: chainslam.Observations, second: chainslam.Observations) -> None:
        """Take in one scan, each observation once."""
        ids, place = np.unique(second.ids, return_inverse=True)  # a wall may be seen twice in one scan
        if not len(ids):
            return
        at = self.columns(self.belief.rows(ids))

        def off(x: Array) -> Array:
            alpha, r = x[3:].reshape(-1, 2)[place].T
            normals = np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
            turned = half_turn(second.lines[:, 0] - (alpha - x[2]))
            return np.stack([turned, second.lines[:, 1] - (r - normals @ x[:2])], axis=-1).ravel()

        mean, cov = unscented(off, self.x[at], self.P[np.ix_(at, at)])
        n, m = len(at), len(second)
        S = cov[n:, n:]
        for k in range(m):
            S[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += second.cov[k]
        slope = np.linalg.solve(cov[:n, :n], cov[:n, n:])  # what is off as a line through the points
        gain = self.P[:, at] @ slope @ np.linalg.inv(S)
        self.set(self.x - gain @ mean[n:], self.P - gain @ S @ gain.T)

    def grow(self, lines: Array, cov: Array, centres: Array) -> Array:
        """Add lines and return their new ids."""

        def begun(x: Array) -> Array:
            alpha = x[-2] + x[2]
            return np.array([alpha, x[-1] + np.cos(alpha) * x[0] + np.sin(alpha) * x[1]])

        for line, noise in zip(lines, cov, strict=True):
            n = len(self.x)
            mean, both = self.with_noise(begun, line, noise)
            keep = np.r_[:n, n + 2 : n + 4]
            self.set(mean[keep], both[np.ix_(keep, keep)])
        new = np.arange(self.next_id, self.next_id + len(lines))
        self.ids, self.next_id = np.concatenate([self.ids, new]), self.next_id + len(lines)
        return new

    def merge(self, keep: int, drop: int) -> None:
        """Take two lines for one."""
        rows = self.belief.rows([keep, drop])
        if keep == drop:
            raise ValueError(f"expected two lines to merge, found line {keep} twice")
        H = np.zeros((2, len(self.x)))
        H[:, self.columns(rows)[3:5]], H[:, self.columns(rows)[5:]] = np.eye(2), -np.eye(2)
        off = H @ self.x
        off[0] = half_turn(off[0])
        gain = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + 1e-12 * np.eye(2))
        self.set(self.x - gain @ off, self.P - gain @ H @ self.P)
        self.remove([drop])

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines."""
        rows = self.belief.rows(ids)
        keep = np.setdiff1d(np.arange(len(self.x)), self.columns(rows)[3:])
        self.set(self.x[keep], self.P[np.ix_(keep, keep)])
        self.ids = np.delete(self.ids, rows)

    def with_noise(self, function: Callable[[Array], Array], mean: Array, cov: Array) -> tuple[Array, Array]:
        """Return the unscented transform of the state and what is independent of it."""
        n = len(self.x)
        P = np.zeros((n + len(mean), n + len(mean)))
        P[:n, :n], P[n:, n:] = self.P, cov
        return unscented(function, np.concatenate([self.x, mean]), P)

    def columns(self, rows: Array) -> Array:
        """Return where the pose and lines stand in the state."""
        return np.concatenate([np.arange(3), (3 + 2 * np.asarray(rows)[:, None] + np.arange(2)).ravel()])

    def set(self, x: Array, P: Array) -> None:
        """Replace the state."""
        x[[2, *range(3, len(x), 2)]] = half_turn(x[[2, *range(3, len(x), 2)]])
        self.x, self.P, self.version = x, 0.5 * (P + P.T), self.version + 1


chainslam.BACKENDS["own-ukf"] = chainslam.BackendEntry(OwnUkf, "UKF about the world's origin", is_about_origin=True)

if __name__ == "__main__":
    failures = chainslam.check_backend(OwnUkf, is_about_origin=True)
    print(f"axioms that fail: {len(failures)}")
    for failure in failures:
        print(f"  {failure.axiom}: {failure.found}")
    run = chainslam.explore("paper-fig4", seed=1, max_steps=150)
    for name, replayed in chainslam.replay(run, backend=["ukf", "own-ukf"]).items():
        print(f"{name}: pose ANEES {replayed.summary['pose_anees']:.2f}, map ANEES {replayed.summary['map_anees']:.2f}")
