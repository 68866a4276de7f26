"""Walls that a map held twice, and how it saw them in model space when the second entry was made (paper, figure 10)."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from chainslam.explore.step import Step
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz.shapes import hessian_cov

from ...replays.recordings import recorded
from ...replays.replay import replay
from ...scenario import TrialConfig
from ...scoring.association import duplicate_pairs
from ...trial import TrialResult, run_trial
from .drives import PAPER, driven

SIGMAS = 3.0
"""Ellipses are drawn at so many."""
LASTING = 30
"""A duplicate wall that lasts so many steps, some three metres, is no passing doubt of the filter's."""
STANDS = f"a duplicate wall lasts {LASTING} steps or more, A* entered outside A's ellipse"
SEEDS = 40
"""So many drives are searched for a wall that stands in the map twice."""


@dataclass(frozen=True)
class ModelSpace:
    """Lines of one map at one step, in the paper's (alpha rad, r m), world frame."""

    ids: Int[np.ndarray, " n"]
    lines_world: Float[np.ndarray, "n 2"]
    covs: Float[np.ndarray, "n 2 2"]
    ends_world: Float[np.ndarray, "n 2 2"]

    def about(self, point_world: Float[np.ndarray, "2"]) -> "ModelSpace":
        """Return the same lines with r measured from a point, as if the world's origin were there."""
        alpha, away = self.lines_world[:, 0], np.broadcast_to(-point_world, (len(self.ids), 2))
        lines = self.lines_world + np.stack([0.0 * alpha, np.sum(normals(alpha) * away, axis=1)], axis=-1)
        return replace(self, lines_world=lines, covs=hessian_cov(alpha, away, self.covs))

    def rows(self, ids: tuple[int, int]) -> tuple[int, int]:
        """Return the rows of two lines."""
        first, second = np.searchsorted(self.ids, ids)
        return int(first), int(second)

    def sigmas_away(self, ids: tuple[int, int]) -> float:
        """Return how far the second of two lines is from the first one, in standard deviations of the first."""
        first, second = self.rows(ids)
        off = self.lines_world[second] - self.lines_world[first]
        off[0] = wrap(off[0])
        return float(np.sqrt(off @ np.linalg.solve(self.covs[first], off)))


@dataclass(frozen=True)
class Double:
    """The paper's A and A*."""

    ids: tuple[int, int]
    """The wall, and its second entry."""
    wall: int
    """The true wall."""
    entered: int
    """The step at which the second entry was made."""
    standing: tuple[int, ...]
    """The steps at which both overlap, and neither is tentative."""
    space: ModelSpace
    """The map at the step when it was entered."""

    @property
    def sigmas_away(self) -> float:
        """How far A* was from A then, in standard deviations of A alone."""
        return self.space.sigmas_away(self.ids)


@dataclass(frozen=True)
class WatchedDrive:
    """A drive with all walls that its map ever held twice."""

    made: TrialResult
    steps: tuple[Step, ...]
    """Their beliefs answer for no joint covariance any more."""
    doubles: tuple[Double, ...]
    """In the order in which they show: both overlap, and neither is tentative."""


@lru_cache(maxsize=8)
def watched(config: TrialConfig, backend: str = PAPER) -> WatchedDrive:
    """Return what a back end makes of a trial's scans, with all walls that its map ever held twice.

    Raises UsageError for bad names.
    """
    steps: list[Step] = []
    spaces: dict[int, tuple[int, ModelSpace]] = {}

    def watch(step: Step) -> None:
        steps.append(step)
        new = [wall for wall in step.map.ids.tolist() if wall not in spaces]
        spaces.update(dict.fromkeys(new, (step.index, _space(step.map))) if new else {})

    if backend == config.backend:
        made = run_trial(config, watch)
    else:
        drive = driven(config)
        made = replay(recorded(drive), backend, watch=watch, world=drive.scenario.world)
    maps = [step.map for step in steps]
    pairs = [duplicate_pairs(walls, made.votes.walls_of(walls.ids), ~walls.tentative) for walls in maps]
    found = []
    for pair in dict.fromkeys(pair for each in pairs for pair in each):
        entered, space = spaces[pair[1]]
        wall = int(made.votes.walls_of(np.array(pair[:1]))[0])
        standing = tuple(index for index, each in enumerate(pairs) if pair in each)
        found.append(Double(pair, wall, entered, standing, space))
    return WatchedDrive(made, tuple(steps), tuple(found))


@dataclass(frozen=True)
class Search:
    """Drives with one seed after the other, until a wall stands in the map twice, A* outside A's ellipse."""

    config: TrialConfig
    """Of the drive that has one; of the first drive, where none has."""
    tried: int
    """How many seeds that took, or how many were tried in vain."""
    double: Double | None

    @property
    def words(self) -> str:
        """What the search came to."""
        first = self.config.seed
        if self.double is None:
            return f"in none of {self.tried} drives, seeds {first} and on, {STANDS}"
        return f"seed {first}, number {self.tried} of those tried, is the first in which {STANDS}"


@lru_cache(maxsize=8)
def first_double(config: TrialConfig, most: int = SEEDS) -> Search:
    """Drive with the seed of a trial, the next one and so on, `most` of them, until there is a duplicate wall.

    It does so for `LASTING` steps or more, and A* is outside the 3 sigma ellipse of A when it is entered.
    """
    for tried in range(most):
        own = replace(config, seed=config.seed + tried)
        for double in watched(own).doubles:
            if len(double.standing) >= LASTING and double.sigmas_away > SIGMAS:
                return Search(own, tried + 1, double)
    return Search(config, most, None)


def _space(walls: StochasticMap) -> ModelSpace:
    """Return the lines of a map in model space, while its back end has not moved on."""
    belief = walls.belief
    count = len(belief.ids)
    cov = belief.joint(belief.ids).cov[3:, 3:].reshape(count, 2, count, 2)
    covs = hessian_cov(belief.means[:, 0], belief.anchors, cov[np.arange(count), :, np.arange(count)])
    return ModelSpace(belief.ids.copy(), belief.lines_world, covs, walls.ends_world)
