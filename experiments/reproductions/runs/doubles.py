"""Walls that a map holds twice, and how it saw them in model space when the second entry was made."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from explore.step import Step
from slam.geometry.lines import directions
from viz.shapes import hessian_cov

from ...replays.recordings import recorded
from ...replays.replay import replay
from ...scenario import TrialConfig
from ...scoring.association import Votes, duplicate_pairs
from ...trial import TrialResult
from .drives import driven

NONE = -1


@dataclass(frozen=True)
class Double:
    """The paper's A and A*."""

    ids: tuple[int, int]
    """The wall, and its second entry."""
    wall: int
    """The true wall."""
    step: int
    """At which the second entry was made."""


@dataclass(frozen=True)
class ModelSpace:
    """Lines of one map at one step, in the paper's (alpha rad, r m), world frame."""

    ids: Int[np.ndarray, " n"]
    lines_world: Float[np.ndarray, "n 2"]
    covs: Float[np.ndarray, "n 2 2"]
    ends_world: Float[np.ndarray, "n 2 2"]


def double_entry(result: TrialResult) -> tuple[int, int] | None:
    """Return the ids (older, younger) of the first wall that the last map of a trial holds twice, or None."""
    assert result.last is not None
    walls = result.last.map
    pairs = duplicate_pairs(walls, result.votes.walls_of(walls.ids), ~walls.tentative)
    return pairs[0] if pairs else None


def entered(config: TrialConfig, backend: str, pair: tuple[int, int]) -> Double:
    """Return when a back end entered a wall anew; its replay is made once more, to look at every step."""
    steps: list[int] = []

    def watch(step: Step) -> None:
        if not steps and pair[1] in step.map.ids:
            steps.append(step.index)

    made = driven(config)
    result = replay(recorded(made), backend, watch=watch, world=made.scenario.world)
    return Double(pair, int(result.votes.walls_of(np.array(pair[:1]))[0]), steps[0])


def model_space(config: TrialConfig, backend: str, at_step: int) -> tuple[ModelSpace, Votes]:
    """Return the lines of a back end's map at one step, and which true wall each is of."""
    found: list[ModelSpace] = []

    def watch(step: Step) -> None:
        if step.index != at_step:
            return
        belief = step.map.belief
        count = len(belief.ids)
        cov = belief.joint(belief.ids).cov[3:, 3:].reshape(count, 2, count, 2)
        covs = hessian_cov(belief.means[:, 0], belief.anchors, cov[np.arange(count), :, np.arange(count)])
        found.append(ModelSpace(belief.ids.copy(), belief.lines_world, covs, step.map.ends_world))

    made = driven(config)
    result = replay(recorded(made), backend, watch=watch, world=made.scenario.world)
    return found[0], result.votes


def row_of_wall(space: ModelSpace, votes: Votes, wall: int, like: Float[np.ndarray, "2 2"]) -> int:
    """Return the row of the line of a true wall that shares most of its length with a piece, `NONE` where none is."""
    rows = np.flatnonzero(votes.walls_of(space.ids) == wall)
    if not len(rows):
        return NONE
    along = directions(space.lines_world[rows[0], 0])
    spans, span = np.sort(space.ends_world[rows] @ along, axis=1), np.sort(like @ along)
    shared = np.minimum(spans[:, 1], span[1]) - np.maximum(spans[:, 0], span[0])
    return int(rows[np.argmax(shared)])
