"""The truth in place of one part of the software, to find out which part causes an error; used by the mapper."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.sim.chance import Chance, Channel
from chainslam.slam.association.matching import NO_MATCHES, KnownWalls, Matches, MatchingConfig
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.extraction.straightness import StraightnessConfig
from chainslam.slam.geometry.poses import compose, inverse, wrap
from chainslam.slam.robot import Scan

from ..scoring.beam_votes import UNLABELLED, vote
from ..scoring.truth import Truth

MOST_TURN_RAD = 1.0
"""Observations are not drawn farther from the direction of their wall; only tentative ones are that uncertain."""
MOST_SLANT_RAD = 1.5
"""Nor so that beams would meet the line at a larger angle to its normal: a wall is not seen from behind."""


@dataclass
class Witness:
    """The true objects in each scan of a run, and the true pose of the robot."""

    truth: Truth
    poses_world: Float[np.ndarray, "s 3"]
    """Pose of the scanner."""
    face_of_beam: Int[np.ndarray, "s k"]
    at: int = 0
    """The scan that is being mapped."""

    def faces(self, segments: Segments) -> Int[np.ndarray, " n"]:
        """Return the true face of each segment, that with most beams; -1 if the segment mixes several walls."""
        beams = self.face_of_beam[self.at]
        votes = (vote(span, beams, self.truth.walls) for span in segments.beams.tolist())
        return np.array([told.face if told.is_clear else UNLABELLED for told in votes], dtype=np.int64)


class TrueAssociation:
    """A matcher that knows the true wall of each segment; a line belongs to the wall of the segment that started it."""

    def __init__(self, witness: Witness) -> None:
        self._witness = witness
        self._line_of_wall: dict[int, int] = {}
        self._all: Int[np.ndarray, " s"] = np.zeros(0, dtype=np.int64)
        self._rest: Int[np.ndarray, "u 2"] = np.zeros((0, 2), dtype=np.int64)

    def __call__(
        self,
        segments: Segments,
        walls: KnownWalls,
        joint: Joint,
        config: MatchingConfig,
        *,
        clear_only: bool = False,
    ) -> Matches:
        """Return the true pairs when asked for the unambiguous ones, and none in the second pass."""
        if not clear_only:
            # Called with the unmatched segments: those of walls without a line start one, the others are not used.
            begins = begins_a_line(self._rest[:, 0], self._rest[:, 1], self._line_of_wall)
            return replace(NO_MATCHES, unmatched=np.arange(len(segments)), doubtful=np.flatnonzero(~begins))
        faces = self._witness.faces(segments)
        wall = np.where(faces >= 0, self._witness.truth.walls[faces], -1)
        line = np.array([self._line_of_wall.get(int(w), -1) for w in wall], dtype=np.int64)
        pairs = np.flatnonzero((line >= 0) & np.isin(line, walls.ids))
        self._all, self._rest = wall, np.delete(np.column_stack([wall, segments.beam_counts]), pairs, axis=0)
        unmatched = np.setdiff1d(np.arange(len(segments)), pairs)
        return replace(
            NO_MATCHES,
            pairs=np.column_stack([pairs, line[pairs]]),
            distances=np.zeros(len(pairs)),
            unmatched=unmatched,
        )

    def learn(self, owners: Int[np.ndarray, " s"]) -> None:
        """Record which walls started new lines; call it after each scan was mapped."""
        for wall, line in zip(self._all.tolist(), owners.tolist(), strict=True):
            if wall >= 0 and line >= 0:
                self._line_of_wall.setdefault(wall, line)


def begins_a_line(
    walls: Int[np.ndarray, " u"], beam_counts: Int[np.ndarray, " u"], known: Collection[int]
) -> Bool[np.ndarray, " u"]:
    """Return the walls of segments that have no line yet (else -1); of several on one wall, that with most beams."""
    begins = np.zeros(len(walls), dtype=bool)
    for wall in np.unique(walls).tolist():
        if wall >= 0 and wall not in known:
            rows = np.flatnonzero(walls == wall)
            begins[rows[np.argmax(beam_counts[rows])]] = True
    return begins


class PerfectExtraction:
    """Real segmentation, but each line is the true one with an error drawn from the measurement model."""

    def __init__(self, witness: Witness, chance: Chance) -> None:
        self._witness, self._chance = witness, chance

    def __call__(self, scan: Scan, config: ExtractionConfig) -> Segments:
        """Extract the segments of one scan; those of several walls are dropped, so that the map need not split them."""
        segments = extract(scan, config)
        faces = self._witness.faces(segments)
        segments, faces = segments.take(faces >= 0), faces[faces >= 0]
        if not len(segments):
            return segments
        pose = self._witness.poses_world[self._witness.at]
        alpha, r = self._witness.truth.lines[faces].T
        exact = np.column_stack([alpha - pose[2], r - np.cos(alpha) * pose[0] - np.sin(alpha) * pose[1]])
        bearings_rad = segments.lines[:, 0] + np.arctan2(
            segments.cov[:, 0, 1] / segments.cov[:, 0, 0], segments.lines[:, 1]
        )
        draws = self._chance.standard_normals(Channel.ORACLE, self._witness.at, 2 * len(scan.bearings_rad))
        lines, cov = as_stated(exact, bearings_rad, segments.cov, draws[: 2 * len(segments)].reshape(-1, 2))
        return replace(segments, lines=lines, cov=cov)


def of_true_lines(config: MapperConfig) -> MapperConfig:
    """Return a mapper for perfect extraction, in which short faces are treated as such."""
    reliability = replace(config.walls.reliability, straightness=StraightnessConfig(edge_m=0.0), edge_m=0.0)
    return replace(config, walls=replace(config.walls, reliability=reliability))


def as_stated(
    lines: Float[np.ndarray, "m 2"],
    bearings_rad: Float[np.ndarray, " m"],
    cov: Float[np.ndarray, "m 2 2"],
    standard_normals: Float[np.ndarray, "m 2"],
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m 2 2"]]:
    """Return observations of true lines (alpha, r), robot frame, with the error that `slam.estimation.models` states.

    The middle of the seen piece stays on its beam, at this bearing: a line that is off by epsilon turns about it.
    There (epsilon, r cos(epsilon) - t0 sin(epsilon) - r_true) has independent parts of variance C_alpha_alpha and
    (C_r_r - C_alpha_r t0) (cos(epsilon) - t0 sin(epsilon) / r)^2, t0 = C_alpha_r / C_alpha_alpha. What is stated along
    and across the piece is taken from `cov`, and returned for the place of the piece on the drawn line.
    """
    slant = np.clip(wrap(bearings_rad - lines[:, 0]), -MOST_SLANT_RAD, MOST_SLANT_RAD)
    across_var = cov[:, 1, 1] - cov[:, 0, 1] ** 2 / cov[:, 0, 0]
    epsilon = np.sqrt(cov[:, 0, 0]) * standard_normals[:, 0]
    epsilon = np.clip(epsilon, slant - MOST_SLANT_RAD, slant + MOST_SLANT_RAD).clip(-MOST_TURN_RAD, MOST_TURN_RAD)
    drawn = slant - epsilon
    across = np.sqrt(across_var) * standard_normals[:, 1] * np.cos(slant) / np.cos(drawn)
    range_m = (lines[:, 1] + across) / np.cos(slant)
    r, t0 = range_m * np.cos(drawn), range_m * np.sin(drawn)
    turned = np.tile(np.eye(2), (len(r), 1, 1))
    turned[:, 1, 0] = t0
    own = np.stack([cov[:, 0, 0], across_var], axis=-1)[:, :, None] * np.eye(2)
    return np.stack([lines[:, 0] + epsilon, r], axis=-1), turned @ own @ turned.swapaxes(1, 2)


def true_odometry(poses_world: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "s 3"]:
    """Return the true motion before each pose, in the frame of the pose before; zero for the first."""
    motions = [np.zeros(3)]
    for before, after in pairwise(poses_world):
        motions.append(compose(inverse(before), after))
    return np.array(motions)
