"""Duplicate walls, and how the map saw them in model space when the duplicate was started (paper, figure 10)."""

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
"""Number of standard deviations of the drawn ellipses."""
LASTING = 30
"""A duplicate wall counts if it lasts this many steps, about three metres."""
STANDS = f"a duplicate wall lasts {LASTING} steps or more, A* entered outside A's ellipse"
SEEDS = 40
"""Number of drives that are searched for a duplicate wall."""


@dataclass(frozen=True)
class ModelSpace:
    """Lines of one map at one step, in the paper's (alpha rad, r m), world frame."""

    ids: Int[np.ndarray, " n"]
    lines_world: Float[np.ndarray, "n 2"]
    covs: Float[np.ndarray, "n 2 2"]
    ends_world: Float[np.ndarray, "n 2 2"]

    def about(self, point_world: Float[np.ndarray, "2"]) -> "ModelSpace":
        """Return the same lines with r measured from a point, as if it were the world's origin."""
        alpha, away = self.lines_world[:, 0], np.broadcast_to(-point_world, (len(self.ids), 2))
        lines = self.lines_world + np.stack([0.0 * alpha, np.sum(normals(alpha) * away, axis=1)], axis=-1)
        return replace(self, lines_world=lines, covs=hessian_cov(alpha, away, self.covs))

    def rows(self, ids: tuple[int, int]) -> tuple[int, int]:
        """Return the rows of two lines."""
        first, second = np.searchsorted(self.ids, ids)
        return int(first), int(second)

    def sigmas_away(self, ids: tuple[int, int]) -> float:
        """Return the distance of the second of two lines from the first, in standard deviations of the first."""
        first, second = self.rows(ids)
        off = self.lines_world[second] - self.lines_world[first]
        off[0] = wrap(off[0])
        return float(np.sqrt(off @ np.linalg.solve(self.covs[first], off)))


@dataclass(frozen=True)
class Double:
    """The paper's A and A*."""

    ids: tuple[int, int]
    """The wall and its duplicate."""
    wall: int
    """The true wall."""
    entered: int
    """The step at which the duplicate was started."""
    standing: tuple[int, ...]
    """The steps at which both overlap, and neither is tentative."""
    space: ModelSpace
    """The map at the step at which it was started."""

    @property
    def sigmas_away(self) -> float:
        """Distance of A* from A at that step, in standard deviations of A alone."""
        return self.space.sigmas_away(self.ids)


@dataclass(frozen=True)
class WatchedDrive:
    """A drive with all duplicate walls of its map."""

    made: TrialResult
    steps: tuple[Step, ...]
    """Their beliefs no longer give a joint covariance."""
    doubles: tuple[Double, ...]
    """In order of appearance: both overlap, and neither is tentative."""


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
    """Drives with successive seeds, until there is a duplicate wall with A* outside A's ellipse."""

    config: TrialConfig
    """The drive with a duplicate, or the first drive if there is none."""
    tried: int
    """Number of seeds that were tried."""
    double: Double | None

    @property
    def words(self) -> str:
        """The result of the search."""
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
    """Return the lines of a map in model space, while its belief is valid."""
    belief = walls.belief
    count = len(belief.ids)
    cov = belief.joint(belief.ids).cov[3:, 3:].reshape(count, 2, count, 2)
    covs = hessian_cov(belief.means[:, 0], belief.anchors, cov[np.arange(count), :, np.arange(count)])
    return ModelSpace(belief.ids.copy(), belief.lines_world, covs, walls.ends_world)
