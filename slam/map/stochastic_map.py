"""The map: a belief about lines, and how far along each line its wall has been seen."""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import POSE, Belief, Joint
from ..geometry.circles import cov_of_rounding
from .kernels import wall_kernels

ESTABLISHED = 10
"""Walls seen this often end at a bend past which they reach."""


@dataclass(frozen=True)
class StochasticMap:
    """Walls in the order of `belief.ids`."""

    belief: Belief
    extents: Float[np.ndarray, "n 2"]
    """From and to along t = J n(alpha), m, measured from the anchor; the free side is on the left."""
    observations: Int[np.ndarray, " n"]
    """In how many scans each wall was seen with enough beams to be fused."""
    tentative: Bool[np.ndarray, " n"]
    """Walls that were not seen well enough yet to be followed or chained."""
    crooked: Bool[np.ndarray, " n"]
    """Walls that stand for two faces: all scans together show a break between their ends (`profiles`)."""
    off_line_cov: Float[np.ndarray, "n 2 2"] | None = None
    """How far each wall may be from its line, as a covariance of (alpha rad, d m): what no single beam's noise explains
    (`straightness`). A back end's own belief has none of it."""

    def __len__(self) -> int:
        return len(self.extents)

    @property
    def told(self) -> "StochasticMap":
        """The map of a back end's own belief, with one that states how far walls may be from their lines as well."""
        if self.off_line_cov is None:
            return self
        query = partial(_joint_off_lines, self)
        return replace(self, belief=replace(self.belief, query=query))

    @property
    def established(self) -> Bool[np.ndarray, " n"]:
        """Walls that were seen often."""
        return self.observations >= ESTABLISHED

    @property
    def ids(self) -> Int[np.ndarray, " n"]:
        """Ids of the walls, ascending."""
        return self.belief.ids

    @cached_property
    def round_cov(self) -> Float[np.ndarray, "n 2 2"]:
        """How far walls that stand for something round are from it, as a covariance of (alpha rad, d m). Read-only."""
        return cov_of_rounding(self.belief.lines_world, self.ends_world)

    @cached_property
    def ends_world(self) -> Float[np.ndarray, "n 2 2"]:
        """First and last point of each wall, world frame, m: walking on, the free side is on the left. Read-only."""
        ends = wall_kernels.ends_world(self.belief.anchors, self.belief.means, self.extents)
        ends.flags.writeable = False
        return ends

    @cached_property
    def distances_m(self) -> Float[np.ndarray, " n"]:
        """How far each wall is from where the belief puts the robot."""
        return wall_kernels.distances(self.belief.pose_world[:2], self.ends_world)


def _joint_off_lines(walls: StochasticMap, ids: Int[np.ndarray, " m"]) -> Joint:
    """Return the joint Gaussian of a belief, with how far its walls may be from their lines added."""
    joint, rows, of = walls.belief.query(ids), np.arange(len(ids)), walls.belief.rows(ids)
    assert walls.off_line_cov is not None
    cov = joint.cov.copy()
    lines = cov[POSE:, POSE:].reshape(len(ids), 2, len(ids), 2)
    lines[rows, :, rows] += walls.off_line_cov[of] + walls.round_cov[of]
    return replace(joint, cov=cov)
