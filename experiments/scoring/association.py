"""The true face of each mapped line, decided by its beams and never by the nearest wall."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import directions
from chainslam.slam.map.stochastic_map import StochasticMap

from .beam_votes import ONE_FACE_SHARE, UNLABELLED, vote
from .truth import Truth

OVERLAP_M = 0.2
"""Two lines of one wall that overlap by this length are duplicates."""
NO_PAIRS = np.zeros((0, 2), dtype=np.int64)


@dataclass
class Votes:
    """Beams of each map line by face, gathered over a run."""

    truth: Truth
    beams: dict[int, Int[np.ndarray, " n"]] = field(default_factory=dict)
    """For each line id ever fused, the number of its beams from each face."""
    fused: list[tuple[int, int]] = field(default_factory=list)
    """(line id, true wall) of each segment fused, `UNLABELLED` where its beams came from several walls."""
    fused_of_few_beams: list[tuple[int, int]] = field(default_factory=list)
    """The same for segments of few beams, which update the estimate but do not label a line."""
    merges: int = 0
    false_merges: int = 0
    """Of these, pairs of lines each of which has `ONE_FACE_SHARE` of its beams from a wall of its own."""

    def add(
        self,
        segments: Segments,
        owners: Int[np.ndarray, " s"],
        face_of_beam: Int[np.ndarray, " k"],
        matched: Int[np.ndarray, "m 2"] = NO_PAIRS,
    ) -> None:
        """Count the beams of the segments of one scan.

        `owners` holds line ids, -1 where a segment was not used or has few beams. `matched` are all pairs
        (segment, line id) that moved the estimate, those of few beams among them.
        """
        count = len(self.truth.faces)
        for row in np.flatnonzero(owners >= 0):
            told, owner = vote(segments.beams[row].tolist(), face_of_beam, self.truth.walls), int(owners[row])
            np.add.at(self.beams.setdefault(owner, np.zeros(count, dtype=np.int64)), told.faces, 1)
            self.fused.append((owner, told.wall))
        for row, line in matched[owners[matched[:, 0]] < 0].tolist():
            wall = vote(segments.beams[row].tolist(), face_of_beam, self.truth.walls).wall
            self.fused_of_few_beams.append((line, wall))

    def merge(self, keep: int, drop: int) -> None:
        """Count the beams of two lines as one line's from now on, under both ids: the map has made them one."""
        kept, dropped = self._clear_wall_of(keep), self._clear_wall_of(drop)
        self.merges += 1
        self.false_merges += bool(UNLABELLED not in (kept, dropped) and kept != dropped)
        theirs, none = self.beams.get(drop), np.zeros(len(self.truth.faces), dtype=np.int64)
        ours = self.beams.setdefault(keep, none)
        ours += 0 if theirs is None else theirs
        # Ids that were merged into the dropped one earlier come along.
        same = [line for line, beams in self.beams.items() if theirs is not None and beams is theirs]
        self.beams.update(dict.fromkeys([drop, *same], ours))

    def face_of(self, line_id: int) -> int:
        """Return the face that represents a line: the face with most beams, of the wall with most beams; or -1."""
        if (per_wall := self._beams_by_wall(line_id)) is None:
            return UNLABELLED
        return int(np.argmax(np.where(self.truth.walls == per_wall.argmax(), self.beams[line_id], -1)))

    def faces_of(self, ids: Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return the face of each line, -1 without any beam."""
        return np.array([self.face_of(int(i)) for i in ids], dtype=np.int64)

    def walls_of(self, ids: Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return the true wall of each line, -1 without any beam."""
        faces = self.faces_of(ids)
        return np.where(faces >= 0, self.truth.walls[faces], UNLABELLED)

    def _clear_wall_of(self, line_id: int) -> int:
        """Return the wall of a line by the rule for segments, or `UNLABELLED`."""
        per_wall = self._beams_by_wall(line_id)
        if per_wall is None or per_wall.max() < ONE_FACE_SHARE * per_wall.sum():
            return UNLABELLED
        return int(per_wall.argmax())

    def _beams_by_wall(self, line_id: int) -> Float[np.ndarray, " w"] | None:
        """Return how many beams of a line came from each true wall; None if no beam tells."""
        beams = self.beams.get(line_id)
        return None if beams is None or not beams.any() else np.bincount(self.truth.walls, weights=beams)

    def false_matches(self) -> int:
        """Return how many segments seen on one wall were fused into a line labelled with another."""
        return self._false(self.fused) + self.false_matches_few_beams()

    def false_matches_few_beams(self) -> int:
        """Return how many of these segments have few beams."""
        return self._false(self.fused_of_few_beams)

    def _false(self, fused: list[tuple[int, int]]) -> int:
        ids = np.array(sorted(self.beams), dtype=np.int64)
        label = dict(zip(ids.tolist(), self.walls_of(ids).tolist(), strict=True))
        # A line that replaced another has no beams of its own until it is observed again.
        return sum(UNLABELLED not in (wall, of := label.get(line, UNLABELLED)) and wall != of for line, wall in fused)


def duplicate_lines(walls: StochasticMap, labels: Int[np.ndarray, " n"], among: Bool[np.ndarray, " n"]) -> int:
    """Return how many lines, beyond the first of their true wall, overlap an older one of it over 0.2 m or more."""
    return len(duplicate_pairs(walls, labels, among))


def duplicate_pairs(
    walls: StochasticMap, labels: Int[np.ndarray, " n"], among: Bool[np.ndarray, " n"]
) -> list[tuple[int, int]]:
    """Return the ids (older, younger) of those lines, each with the first line of its wall that it overlaps."""
    rows = np.flatnonzero(among & (labels >= 0))
    pairs = []
    for label in np.unique(labels[rows]):
        same = rows[labels[rows] == label]
        along = _along(walls.ends_world[same], float(walls.belief.means[same[0], 0]))
        for k in range(1, len(same)):
            overlap = np.minimum(along[:k, 1], along[k, 1]) - np.maximum(along[:k, 0], along[k, 0])
            older = np.flatnonzero(overlap >= OVERLAP_M)
            if len(older):
                pairs.append((int(walls.ids[same[older[0]]]), int(walls.ids[same[k]])))
    return pairs


def _along(ends: Float[np.ndarray, "m 2 2"], alpha: float) -> Float[np.ndarray, "m 2"]:
    """Return from and to of each piece along one direction, m."""
    return np.sort(ends @ directions(np.array(alpha)))
