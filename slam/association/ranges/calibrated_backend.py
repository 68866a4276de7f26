"""Any back end, kept in the ranges of a scanner as they come, and told without what is found to be wrong with them.

Ranges that are all too long by a bias, or by a scale, agree with each other but for little: every wall lies farther out
along its normal, everything is larger about the start. So the back end within hears of lines with bias and scale, and
of the wheels' motions times the scale. It never contradicts itself when these become better known: the map as it is
told then shrinks or grows, as it does when a loop closes. Covariances are left as they are: they are not known to the
few percent of a scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import POSE, Backend, Belief, Joint, Observations
from ...geometry.lines import normals
from ...robot import Odometry
from .errors import RangeErrors

NOTHING = RangeErrors(bias_sigma_m=0.0, scale_sigma=0.0)


@dataclass
class Taken:
    """What is taken out of ranges now."""

    errors: RangeErrors = NOTHING


class CalibratedBackend:
    """Stands before a back end; who finds out what is wrong says it in `taken`."""

    def __init__(self, inner: Backend) -> None:
        self.inner = inner
        self.taken = Taken()
        self._start = inner.belief.pose_world[:2].copy()

    @property
    def belief(self) -> Belief:
        """The estimate now, as though what is taken out were known."""
        belief, errors = self.inner.belief, self.taken.errors

        def query(ids: Int[np.ndarray, " m"]) -> Joint:
            joint = belief.query(ids)
            mean = joint.mean.copy()
            mean[:2], mean[POSE + 1 :: 2] = self._out(mean[:2]), (mean[POSE + 1 :: 2] - errors.bias_m) / errors.scale
            return Joint(mean, joint.cov, self._out(joint.anchors))

        pose = belief.pose_world.copy()
        pose[:2] = self._out(pose[:2])
        means = np.column_stack([belief.means[:, 0], (belief.means[:, 1] - errors.bias_m) / errors.scale])
        return Belief(pose, belief.pose_cov, belief.ids, self._out(belief.anchors), means, query)

    def unsure(self, belief: Belief) -> Belief:
        """Return a belief about the scanner that states what is unknown of bias and scale, too.

        A bias that errs moves all walls along their normals. A scale that errs by e moves all places by e times their
        distance from the start. Neither turns anything.
        """
        start, errors = self._start, self.taken.errors
        bias_m, scale = errors.bias_sigma_m / errors.scale, errors.scale_sigma / errors.scale

        def query(ids: Int[np.ndarray, " m"]) -> Joint:
            joint = belief.query(ids)
            by_scale, by_bias = np.zeros((2, len(joint.mean)))
            by_scale[:2], by_bias[POSE + 1 :: 2] = joint.mean[:2] - start, 1.0
            into = normals(joint.mean[POSE::2])
            by_scale[POSE + 1 :: 2] = joint.mean[POSE + 1 :: 2] + np.vecdot(into, joint.anchors - start)
            both = np.column_stack([scale * by_scale, bias_m * by_bias])
            return replace(joint, cov=joint.cov + both @ both.T)

        off = scale * np.append(belief.pose_world[:2] - start, 0.0)
        return replace(belief, pose_cov=belief.pose_cov + np.outer(off, off), query=query)

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by the odometry."""
        scale = self.taken.errors.scale
        self.inner.predict(replace(odometry, motion=odometry.motion * np.array([scale, scale, 1.0])))

    def update(self, first: Observations, second: Observations) -> None:
        """Take in one scan."""
        self.inner.update(*(replace(each, lines=self._within(each.lines)) for each in (first, second)))

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Initialise lines and return their new ids."""
        errors = self.taken.errors
        return self.inner.grow(self._within(lines), cov, errors.scale * centres + errors.bias_m * normals(lines[:, 0]))

    def merge(self, keep: int, drop: int) -> None:
        """Make two lines one."""
        self.inner.merge(keep, drop)

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines."""
        self.inner.remove(ids)

    def _within(self, lines: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
        """Return seen lines as the scanner's ranges, bias and scale included, show them."""
        errors = self.taken.errors
        return lines * np.array([1.0, errors.scale]) + np.array([0.0, errors.bias_m])

    def _out(self, places: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Return places in the metres of the wheels."""
        return self._start + (places - self._start) / self.taken.errors.scale
