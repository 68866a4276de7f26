"""What a campaign records of a run besides its log: the map at some moments, and the fate of every segment."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

from chainslam.explore.step import Step
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.stochastic_map import StochasticMap

from ...scoring.association import OVERLAP_M, Votes
from ...scoring.beam_votes import UNLABELLED, vote

MARKS_M = (10.0, 20.0, 33.0)
"""Path lengths at which runs are compared; the end of the run is the fourth mark."""
EVERY_M = 2.0
"""Path length between two measurements of the coverage."""
SAME_SIDE_RAD, NEAR_M = np.pi / 4, 0.5
"""A segment lies on a mapped wall if it overlaps it, faces the same side and is this near to its line."""


@dataclass(frozen=True)
class Moment:
    """The map at a given path length."""

    index: int
    """The step."""
    path_length_m: float
    map: StochasticMap
    """A copy, independent of the back end."""
    joint: Joint | None
    """Pose and all lines; only at the marks, and None if the back end could not compute it."""


@dataclass(frozen=True)
class Fate:
    """The fate of a segment whose true wall is clear."""

    owner: int
    """The line into which it was fused or which it started; -1 if it was not used."""
    known: bool
    """Whether that line was in the map before this scan."""
    wall: int
    """The true wall."""
    on: tuple[int, ...]
    """Lines of the map before this scan that it lies on."""


@dataclass
class Observer:
    """Observes the steps of one run."""

    walls_of_faces: Int[np.ndarray, " n"]
    """The true wall of each true face."""
    faces_of_beams: Callable[[int], Int[np.ndarray, " k"]]
    """Returns the true face of each beam of a scan."""
    moments: list[Moment] = field(default_factory=list)
    """Every `EVERY_M` metres."""
    marks: dict[float, Moment] = field(default_factory=dict)
    fates: list[Fate] = field(default_factory=list)
    _before: StochasticMap | None = None

    def __call__(self, step: Step) -> None:
        """Record one step."""
        self.fates += self._fates(step)
        self._before = step.map
        if step.path_length_m >= EVERY_M * len(self.moments):
            self.moments.append(_moment(step, None))
        for mark in MARKS_M:
            if mark not in self.marks and step.path_length_m >= mark:
                self.marks[mark] = _moment(step, _joint(step))

    def _fates(self, step: Step) -> list[Fate]:
        segments, before = step.segments, self._before
        rows = np.flatnonzero(~segments.is_tentative)
        if before is None or not len(rows):
            return []
        faces_of_beams = self.faces_of_beams(step.index)
        on = _lying_on(segments.ends[rows], step.pose_world, before)
        fates = []
        for row, lines in zip(rows.tolist(), on, strict=True):
            wall = vote(segments.beams[row].tolist(), faces_of_beams, self.walls_of_faces).wall
            if wall != UNLABELLED:
                owner = int(step.walls_of_segments[row])
                known = bool(np.isin(owner, before.ids))
                fates.append(Fate(owner, known, wall, tuple(before.ids[lines].tolist())))
        return fates


def association_counts(fates: list[Fate], votes: Votes) -> dict[str, int]:
    """Return how matching fared against the truth, segment by segment.

    `matches_true`: fused into a known line of its own wall. `matches_false`: into a known line of another.
    `matches_missed`: neither, though it lay on a known line of its own wall. A line's wall is that of most of its
    beams over the whole run.
    """
    ids = np.array(sorted(votes.beams), dtype=np.int64)
    label = dict(zip(ids.tolist(), votes.walls_of(ids).tolist(), strict=True))
    counts = {"matches_true": 0, "matches_false": 0, "matches_missed": 0}
    for fate in fates:
        if fate.known:
            counts["matches_true" if label.get(fate.owner) == fate.wall else "matches_false"] += 1
        elif any(label.get(line) == fate.wall for line in fate.on):
            counts["matches_missed"] += 1
    return counts


def _lying_on(
    ends_robot: Float[np.ndarray, "m 2 2"], pose_world: Float[np.ndarray, "3"], walls: StochasticMap
) -> list[Int[np.ndarray, " _"]]:
    """Return, for each segment, the rows of the confirmed walls that it lies on."""
    lines = walls.belief.lines_world
    ends = to_world(ends_robot, pose_world)
    n, t = normals(lines[:, 0]), directions(lines[:, 0])
    own = ends[:, 1] - ends[:, 0]
    along = np.sort(np.vecdot(ends[:, None], t[:, None]))
    wall = np.sort(np.vecdot(walls.ends_world, t[:, None]))
    overlap = np.minimum(along[..., 1], wall[:, 1]) - np.maximum(along[..., 0], wall[:, 0])
    off = np.abs(ends.mean(axis=1) @ n.T - lines[:, 1])
    same_side = own @ t.T >= np.cos(SAME_SIDE_RAD) * np.hypot(*own.T)[:, None]
    lies = (overlap >= OVERLAP_M) & (off <= NEAR_M) & same_side & ~walls.tentative
    return [np.flatnonzero(row) for row in lies]


def _joint(step: Step) -> Joint | None:
    try:
        return step.map.belief.joint(step.map.ids)
    except Exception:  # errors of the back end must not end the observed run
        return None


def _moment(step: Step, joint: Joint | None) -> Moment:
    walls = step.map
    belief = walls.belief
    kept = replace(
        belief, pose_world=belief.pose_world.copy(), pose_cov=belief.pose_cov.copy(), ids=belief.ids.copy(),
        anchors=belief.anchors.copy(), means=belief.means.copy(),
    )  # fmt: skip
    marks = (walls.observations.copy(), walls.tentative.copy(), walls.crooked.copy())
    copied = StochasticMap(kept, walls.extents.copy(), *marks)
    return Moment(step.index, step.path_length_m, copied, joint)
