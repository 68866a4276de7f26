"""A back end's lines and the records of their walls, changed together: a wall begins, merges and ends in both.

`MapUpdate` tells what a scan changed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

from .association.matching import Matches
from .association.ranges.errors import RangeErrors
from .association.ranges.heard import Heard
from .association.recovery import Localisation
from .config import MapperConfig
from .estimation.backend import Backend, Belief
from .estimation.mounting import belief_of_body, odometry_of_body
from .extraction.segments import Segments
from .extraction.straightness import cov_of_bows, cov_of_misfits
from .map.bends import ends_at_bends
from .map.chains import Chain
from .map.existence import LandmarkCandidates
from .map.landmarks import Landmarks
from .map.merging import duplicate_of
from .map.stochastic_map import StochasticMap
from .robot import Scan, ScannerSpec


@dataclass(frozen=True)
class MapUpdate:
    """What one scan did to the map, in the frame of the scanner; `told` gives it in that of the body."""

    segments: Segments
    matches: Matches
    walls_of_segments: Int[np.ndarray, " s"]
    """For each segment the id of the wall that it was fused into or began; -1 where it was not used, or has few beams:
    `matches` has these."""
    map: StochasticMap
    chains: tuple[Chain, ...]
    merged: tuple[tuple[int, int], ...]
    """Ids (kept, dropped) of the landmarks that were found to be one wall."""
    localisation: Localisation = field(default_factory=Localisation)
    heard: Heard | None = None
    """The scan as it was taken in, without the robot's own body."""
    range_errors: RangeErrors = field(default_factory=RangeErrors)
    """What is wrong with the scanner's ranges, as far as all scans tell."""

    def told(self, scanner: ScannerSpec, unsure: Callable[[Belief], Belief]) -> "MapUpdate":
        """Return what is told of a scan: all in the frame of the body, and how far walls may be from their lines.

        `unsure` adds to a belief about the scanner what is unknown of its ranges.
        """
        told, motion = self.map.told, self.localisation.unstated_motion
        belief = unsure(told.belief)
        update = replace(self, map=told if belief is told.belief else replace(told, belief=belief))
        if scanner.is_at_axle:
            return update
        of_body = None if motion is None else odometry_of_body(motion, scanner)
        return replace(
            update,
            segments=update.segments.on_body(scanner),
            map=replace(update.map, belief=belief_of_body(update.map.belief, scanner)),
            localisation=replace(update.localisation, unstated_motion=of_body),
        )


class MapKeeper:
    """Keeps the stochastic map of one back end."""

    def __init__(self, backend: Backend, config: MapperConfig) -> None:
        self.backend = backend
        self.config = config
        self.landmarks = Landmarks(config.walls, config.extraction.sure_beams)
        same = config.matching.gate, config.matching.angle_rad
        self._candidates = LandmarkCandidates(*same, config.extraction.least_beams, config.walls.existence)

    def map(self) -> StochasticMap:
        """Return the map as it is now."""
        return self.landmarks.map(self.backend.belief)

    def follow(self) -> None:
        """Let the ends of walls move along with the map, where an update moved it."""
        self.landmarks.extents.follow(self.backend.belief)

    def store(
        self, scan: Scan, segments: Segments, matches: Matches
    ) -> tuple[StochasticMap, Int[np.ndarray, " s"], tuple[tuple[int, int], ...]]:
        """Take in a scan: initialise landmarks, note what was seen of each wall, and merge what is one.

        Returns the map, the wall of each segment (-1 for none), and the ids (kept, dropped) of landmarks that were one
        wall.
        """
        begun = self._initialised(scan, segments, matches)
        owners = self._observed(scan, segments, *begun, matches.ambiguous)
        walls, merged = self._merged(owners, self._ended_at_bends(float(scan.range_max_m)))
        for keep, drop in merged:
            owners = np.where(owners == drop, keep, owners)
        return walls, owners, merged

    def _initialised(
        self, scan: Scan, segments: Segments, matches: Matches
    ) -> tuple[Int[np.ndarray, " s"], dict[int, float]]:
        """Grow the map by the segments that belong to no wall.

        Returns the wall of each segment, and the log odds of those that begin more likely than others.
        """
        owners = np.full(len(segments), -1, dtype=np.int64)
        owners[matches.pairs[:, 0]] = matches.pairs[:, 1]
        owners[segments.is_tentative] = -1
        is_new = np.zeros(len(segments), dtype=bool)
        is_new[matches.unmatched], is_new[matches.doubtful] = True, False
        few = (is_new & segments.is_tentative).nonzero()[0]
        believed, odds = self._candidates.see(self.backend.belief.pose_world, scan, segments, few)
        is_new[few], is_new[believed] = False, True
        fresh = is_new.nonzero()[0]
        if len(fresh):
            begun = segments.take(fresh)
            straightness = self.config.walls.reliability.straightness
            cov = begun.cov + cov_of_bows(begun, straightness) + cov_of_misfits(begun, straightness)
            # A line that may point anywhere would be one wall with whatever is near.
            told = cov[:, 0, 0] < self.config.matching.angle_rad**2
            fresh = fresh[told]
        if len(fresh):
            owners[fresh] = self.backend.grow(begun.lines[told], cov[told], seen_centres(segments, fresh))
        likely = zip(owners[believed].tolist(), odds.tolist(), strict=True)
        return owners, {owner: log_odds for owner, log_odds in likely if owner >= 0}

    def _observed(
        self,
        scan: Scan,
        segments: Segments,
        owners: Int[np.ndarray, " s"],
        begun: dict[int, float],
        ambiguous: Int[np.ndarray, " a"],
    ) -> Int[np.ndarray, " s"]:
        """Note what was seen of each wall, and forget those that are none; return the wall of each segment."""
        observed = self.landmarks.observe(self.backend.belief, scan, segments, owners, begun, ambiguous)
        if len(observed.forgotten):
            self.backend.remove(observed.forgotten.tolist())
        return observed.owners

    def _ended_at_bends(self, range_m: float) -> StochasticMap:
        """Let walls end where they bend, within range; return the map, which is as it was where walls never merge."""
        walls = self.map()
        if self.config.merging is None:
            return walls
        pairs, along = ends_at_bends(walls, range_m, self.config.matching.one_wall, self.config.shared)
        if not len(pairs):
            return walls
        self.landmarks.extents.meet(pairs, along)
        return self.map()

    def _merged(
        self, owners: Int[np.ndarray, " s"], walls: StochasticMap
    ) -> tuple[StochasticMap, tuple[tuple[int, int], ...]]:
        """Make one of two walls that lie along each other, if their joint covariance agrees; return them, too."""
        if self.config.merging is None:
            return walls, ()
        merged: list[tuple[int, int]] = []
        while twice := duplicate_of(walls, owners, self.config.matching.one_wall, self.config.merging):
            keep, drop = twice
            self.landmarks.merge(self.backend.belief, keep, drop)
            self.backend.merge(keep, drop)
            merged.append(twice)
            walls = self.map()
        return walls, tuple(merged)


def seen_centres(segments: Segments, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 2"]:
    """Return the middle of each seen piece, robot frame, m."""
    return 0.5 * (segments.ends[rows, 0] + segments.ends[rows, 1])
