"""Split covariance intersection: the paper's memory, the diagonal blocks alone, and yet never surer than is right.

Julier and Uhlmann (2001). Whatever the cross-covariances are that were dropped, blocks P_i / w_i with weights that add
up to 1 bound the whole. What is known to be independent, the noise of the scan and of the wheels since the last one,
need not be divided.
"""

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import POSE, Observations
from ...estimation.models import Initialisation, Linear, Motion
from ..kalman.ekf import Ekf
from .block_map import BlockMap

ROUNDS = 30
"""Of finding weights. Any are safe; after so many the trace is within hundredths of the least."""
LONGEST = 10.0
"""How far weights are extrapolated, in rounds."""
LEAST_WEIGHT = 1e-11
"""Next to a smaller one nothing is left of the noise of two pieces of one wall, and S is singular."""


class IntersectionMap(BlockMap):
    """Blocks, each of which bounds the error of its own part, the pose or a line, however they err together."""

    def __init__(self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"]) -> None:
        super().__init__(pose_world, pose_cov)
        self._fresh: Float[np.ndarray, "3 3"] = np.zeros((POSE, POSE))
        """What the wheels have added to the pose's error since anything else came to share it."""

    def move(self, motion: Motion, Q: Float[np.ndarray, "3 3"]) -> None:
        """Take the pose along a motion: its error becomes F times what it was, and noise of covariance Q."""
        super().move(motion, Q)
        self._fresh = motion.F @ self._fresh @ motion.F.T + Q

    def append(self, new: Initialisation, noise: Float[np.ndarray, "m 2 2"]) -> Int[np.ndarray, " m"]:
        """Add lines whose error is G_pose times the pose's, and noise: they share the wheels' error, too."""
        self._fresh = np.zeros((POSE, POSE))
        return super().append(new, noise)

    def condition(self, model: Linear) -> None:
        """Take in a measurement, for each part by the gain and the weights that leave the least trace of its own block.

        A radian counts as much as a metre. With J = T - K H what is left of each error, T taking one part out of all,
        the blocks add s_i^2 / w_i to the trace, s_i^2 = tr J_i P_i J_i'. Weights as the s_i make it least: (sum s_i)^2,
        what errors add up to that all go together. Gain and weights follow from each other in turn.
        """
        P, H, T = self._padded(model)
        HP = H @ P
        fresh, R = H[0] @ self._fresh, H[0] @ self._fresh @ H[0].T + model.R
        rounds = [np.full((len(P), len(P)), 1.0 / len(P))]
        for turn in range(ROUNDS + 1):
            weights = rounds[-1]
            S = np.einsum("ti,ikl->tkl", 1.0 / weights, HP @ H.swapaxes(1, 2)) + R
            HPt = HP / np.diagonal(weights)[:, None, None]
            HPt[0] += fresh
            K = np.linalg.solve(S, HPt).swapaxes(1, 2)
            J = T - np.einsum("tak,ikb->tiab", K, H)
            JP = J @ P
            if turn < ROUNDS:
                rounds.append(_shares(np.sqrt(np.maximum(np.einsum("tiab,tiab->ti", JP, J), 0.0))))
                rounds = rounds if len(rounds) < 3 else [_extrapolated(*rounds)]
        covs = np.einsum("tiab,ticb,ti->tac", JP, J, 1.0 / weights)
        covs += J[:, 0] @ self._fresh @ J[:, 0].swapaxes(1, 2) + K @ model.R @ K.swapaxes(1, 2)
        moved = K @ model.e
        self._put_pose(self.pose_world + moved[0], covs[0])
        self.put(model.rows, self.means[model.rows] + moved[1:, :2], covs[1:, :2, :2])
        self._fresh = np.zeros((POSE, POSE))

    def _padded(
        self, model: Linear
    ) -> tuple[Float[np.ndarray, "b 3 3"], Float[np.ndarray, "b k 3"], Float[np.ndarray, "b b 3 3"]]:
        """Return P and H by part, the pose first, and T, each part filled up with zeros to the pose's size."""
        u, k = len(model.rows), len(model.e)
        P, H, T = np.zeros((u + 1, POSE, POSE)), np.zeros((u + 1, k, POSE)), np.zeros((u + 1, u + 1, POSE, POSE))
        P[0], P[1:, :2, :2] = self.pose_cov - self._fresh, self.covs[model.rows]
        H[0], H[1:, :, :2] = model.H[:, :POSE], model.H[:, POSE:].reshape(k, u, 2).swapaxes(0, 1)
        T[np.arange(u + 1), np.arange(u + 1)] = np.eye(POSE)
        return P, H, T


def _shares(parts: Float[np.ndarray, "t b"]) -> Float[np.ndarray, "t b"]:
    """Return weights as these parts, none of them zero."""
    total = parts.sum(axis=1, keepdims=True)
    shares = np.maximum(np.divide(parts, total, out=np.ones_like(parts), where=total > 0.0), LEAST_WEIGHT)
    return shares / shares.sum(axis=1, keepdims=True)


def _extrapolated(
    first: Float[np.ndarray, "t b"], second: Float[np.ndarray, "t b"], third: Float[np.ndarray, "t b"]
) -> Float[np.ndarray, "t b"]:
    """Return where the logarithms of three rounds' weights lead (SQUAREM, Varadhan and Roland 2008)."""
    start = np.log(first)
    step = np.log(second) - start
    bend = np.log(third) - np.log(second) - step
    size, turn = np.linalg.norm(step, axis=1), np.linalg.norm(bend, axis=1)
    far = np.clip(np.divide(size, turn, out=np.ones_like(size), where=turn > 0.0), 1.0, LONGEST)[:, None]
    ahead = start + 2.0 * far * step + far**2 * bend
    return _shares(np.exp(ahead - ahead.max(axis=1, keepdims=True)))


class IntersectionEkf(Ekf[IntersectionMap]):
    """One joint update a scan on blocks of which each is a bound."""

    new_map = IntersectionMap

    def linearise(self, rows: Int[np.ndarray, " m"], seen: Observations) -> Linear:
        """Linearise a scan in the order of its lines, for weights depend on how their rounds were rounded."""
        order = np.argsort(rows, kind="stable")
        return super().linearise(rows[order], Observations(seen.ids[order], seen.lines[order], seen.cov[order]))
