"""The paper's seven steps from a scan to a map of chains (section 2.2), the same for every back end."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from .association.ambiguity import TornConfig, observed_either_way
from .association.joint_compatibility import relocate
from .association.matching import KnownWalls, Matches, MatchingConfig, match
from .estimation.backend import Backend, Observations
from .extraction.config import ExtractionConfig
from .extraction.extract import NO_BENDS, extract
from .extraction.segments import Segments
from .extraction.visible_extent import sure_pieces
from .map.candidates import FaintConfig, FaintLines
from .map.chains import Chain, ChainConfig, connect
from .map.change_points import Kink, KinksConfig
from .map.extents import WallsConfig
from .map.landmarks import Landmarks
from .map.merging import DuplicatesConfig, duplicate_of
from .map.openings import GapsConfig
from .map.reliability import are_clear, as_told
from .map.stochastic_map import StochasticMap
from .map.vertices import BendsConfig, bends_within, laid_across, meetings, mistaken
from .robot import Odometry, Scan


@dataclass(frozen=True)
class MapperConfig:
    """The rules of the seven steps."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    bends: BendsConfig = field(default_factory=BendsConfig)
    chains: ChainConfig = field(default_factory=ChainConfig)
    walls: WallsConfig = field(default_factory=WallsConfig)
    faint: FaintConfig = field(default_factory=FaintConfig)
    gaps: GapsConfig = field(default_factory=GapsConfig)
    torn: TornConfig = field(default_factory=TornConfig)
    kinks: KinksConfig = field(default_factory=KinksConfig)
    duplicates: DuplicatesConfig | None = field(default_factory=DuplicatesConfig)
    """None where one wall may stand in the map twice."""


@dataclass(frozen=True)
class MapUpdate:
    """What one scan did to the map."""

    segments: Segments
    matches: Matches
    walls_of_segments: Int[np.ndarray, " s"]
    """For each segment the id of the wall that it was fused into or began; -1 where it was not used."""
    map: StochasticMap
    chains: tuple[Chain, ...]
    merged: tuple[tuple[int, int], ...]
    """Ids (kept, dropped) of the entries that were found to be one wall."""


Matcher = Callable[..., Matches]
NONE = np.zeros(0, dtype=np.int64)
"""No rows."""


@runtime_checkable
class Extractor(Protocol):
    """Finds the straight segments of a scan."""

    def __call__(
        self, scan: Scan, config: ExtractionConfig, *, bends_rad: Float[np.ndarray, " b"] = NO_BENDS
    ) -> Segments:
        """Return the segments; at the bearings `bends_rad` the map knows a bend, which an oracle may know better."""
        ...


class Mapper:
    """Drives one back end through the seven steps; extractor and matcher may be replaced by oracles."""

    def __init__(
        self,
        backend: Backend,
        config: MapperConfig = MapperConfig(),
        extractor: Extractor = extract,
        matcher: Matcher = match,
    ) -> None:
        self.backend = backend
        self.config = config
        self._extract = extractor
        self._match = matcher
        self._landmarks = Landmarks(config.walls, config.kinks, config.gaps, config.chains)
        self._candidates = FaintLines(config.faint)

    def predict(self, odometry: Odometry) -> None:
        """Move the robot's estimate by the odometry."""
        self.backend.predict(odometry)

    def step(self, scan: Scan, set_aside: Collection[tuple[int, int]] = ()) -> MapUpdate:
        """Take in one scan; `set_aside` holds (wall id, side) of ends that exploration gave up."""
        # 1. Extract features from the sensory input.
        walls = self._landmarks.map(self.backend.belief)
        segments = self._segments(scan, walls)
        walls = self._without(mistaken(segments, walls, self.config.bends), walls)
        # 2. Match observed features to the best fitting equivalents in the map.
        near = self._nearby(scan, walls)
        joint = self.backend.belief.joint(near.ids)
        clear = self._match(segments, near, joint, self.config.matching, clear_only=True)
        first = self._firm(clear, segments)
        # 3. Localise the robot with matched features (here as a pure function, to match again).
        relocated = relocate(joint, near.ids, first)
        # 4. Match the remaining features with their re-prediction from the new robot pose.
        rest = clear.unmatched
        again = self._match(segments.take(rest), near, relocated, self.config.matching)
        matches = _both(clear, again)
        # 5. Update map features with their matched re-observation, and store unmatched features as new ones.
        firm = self._firm(matches, segments)
        if not len(firm.ids):
            firm = self._may_move(segments, *observed_either_way(matches, segments, near.ids, joint, self.config.torn))
        self.backend.update(first, firm)
        kink = self._landmarks.change_points.see(self.backend.belief, scan, segments, matches.pairs)
        sides = NONE
        if kink is not None:
            segments, matches, sides = self._cut(kink, scan, segments, matches)
        owners = self._store(scan, segments, matches, sides)
        walls, merged = self._merge(owners, self._ended(scan))
        # 6. Initialise a new chain for each new segment.  7. Connect open ends of chains that are near.
        self._landmarks.openings.see(walls, scan)
        openings = self._landmarks.openings
        chains = connect(walls, set_aside, openings.passed, openings.cut_off, self.config.chains)
        return MapUpdate(segments, matches, owners, walls, chains, merged)

    def _segments(self, scan: Scan, walls: StochasticMap) -> Segments:
        """Return the straight pieces of the scan, cut where the map knows a bend."""
        segments = self._pieces(scan)
        bends = self._bends(segments, walls)
        return self._pieces(scan, bends) if len(bends) else segments

    def _pieces(self, scan: Scan, bends_rad: Float[np.ndarray, " b"] = NO_BENDS) -> Segments:
        config = self.config.extraction
        return sure_pieces(self._extract(scan, config, bends_rad=bends_rad), scan, config)

    def _bends(self, segments: Segments, walls: StochasticMap) -> Float[np.ndarray, " b"]:
        return bends_within(segments, walls, self.config.bends, self._landmarks.change_points.cut)

    def _cut(
        self, kink: Kink, scan: Scan, segments: Segments, matches: Matches
    ) -> tuple[Segments, Matches, Int[np.ndarray, " c"]]:
        """Forget a wall that bends, and others laid across the bend, so that its sides can take their place.

        Returns the scan's segments, cut there too, what they are of the walls that are left, and the rows of the two
        beside the bend; all as it was, and none, while the scan shows a side too poorly or another turn.
        """
        walls = self._landmarks.map(self.backend.belief)
        bends = self._bends(segments, walls)
        pieces = self._pieces(scan, np.append(bends, kink.bearing_rad))
        clear = np.flatnonzero(are_clear(pieces, self.config.walls.firmness))
        sides = self._landmarks.change_points.sides_of(kink, segments, pieces.take(clear), scan)
        if sides is None:
            return segments, matches, NONE
        bent = np.union1d(laid_across(walls, kink.wall, kink.along_m, self.config.bends), [kink.wall])
        near = self._nearby(scan, self._without(bent, walls))
        again = self._match(pieces, near, self.backend.belief.joint(near.ids), self.config.matching)
        return pieces, again, clear[list(sides)]

    def _without(self, mistaken: Int[np.ndarray, " n"], walls: StochasticMap) -> StochasticMap:
        """Forget walls of the map that are none, and return what is left of it."""
        if not len(mistaken):
            return walls
        self.backend.remove(mistaken.tolist())
        self._landmarks.remove(mistaken)
        return self._landmarks.map(self.backend.belief)

    def _firm(self, matches: Matches, segments: Segments) -> Observations:
        """Return the matches that may move the estimate."""
        return self._may_move(segments, matches.pairs[:, 0], matches.observations(segments))

    def _may_move(self, segments: Segments, rows: Int[np.ndarray, " k"], observed: Observations) -> Observations:
        """Return those of the observations, made by the segments of these rows, that may move the estimate."""
        firm = self._landmarks.reliability.may_move(segments.take(rows), observed.ids)
        cov = as_told(observed.cov[firm], segments.is_tentative[rows[firm]], self.config.walls.firmness)
        return Observations(observed.ids[firm], observed.lines[firm], cov)

    def _nearby(self, scan: Scan, walls: StochasticMap) -> KnownWalls:
        """Return the walls that this scan can show."""
        lost_m = 3.0 * float(np.sqrt(np.trace(walls.belief.pose_cov[:2, :2])))
        near = walls.distances_m < scan.range_max_m + max(self.config.matching.offset_m, lost_m)
        return KnownWalls(walls.ids[near], walls.extents[near])

    def _store(
        self, scan: Scan, segments: Segments, matches: Matches, sides: Int[np.ndarray, " c"]
    ) -> Int[np.ndarray, " s"]:
        """Grow the map by the segments that belong to no wall, and note how far each wall was seen.

        `sides` are the two segments beside a bend that was found now: many scans stand behind them.
        """
        owners = np.full(len(segments), -1, dtype=np.int64)
        owners[matches.pairs[:, 0]] = matches.pairs[:, 1]
        owners[segments.is_tentative] = -1
        fresh = np.setdiff1d(matches.unmatched, matches.doubtful, assume_unique=True)
        faint, fresh = fresh[segments.is_tentative[fresh]], fresh[~segments.is_tentative[fresh]]
        believed = faint[self._candidates.see(self.backend.belief.pose_world, segments.take(faint))]
        fresh = np.sort(np.concatenate([fresh, believed]))
        if len(fresh):
            centres = seen_centres(segments, fresh)
            owners[fresh] = self.backend.grow(segments.lines[fresh], segments.cov[fresh], centres)
        known = np.unique(owners[sides][owners[sides] >= 0])
        if len(known) == 2:
            self._landmarks.change_points.keep_apart(*known.tolist())
        believed_ids = np.union1d(owners[believed], known)
        observed = self._landmarks.observe(self.backend.belief, scan, segments, owners, believed_ids)
        if len(observed.forgotten):
            self.backend.remove(observed.forgotten.tolist())
        return observed.owners

    def _ended(self, scan: Scan) -> StochasticMap:
        """Return the map, in which the sides of a bend end where they meet."""
        walls = self._landmarks.map(self.backend.belief)
        pairs, along = meetings(walls, scan.range_max_m, self.config.bends, self._landmarks.change_points.cut)
        if not len(pairs):
            return walls
        self._landmarks.extents.meet(pairs, along)
        return self._landmarks.map(self.backend.belief)

    def _merge(
        self, owners: Int[np.ndarray, " s"], walls: StochasticMap
    ) -> tuple[StochasticMap, tuple[tuple[int, int], ...]]:
        """Make one of two walls of the map that lie along each other, if the joint covariance agrees.

        `owners` is brought up to date. Returns the map, and the ids (kept, dropped).
        """
        if self.config.duplicates is None:
            return walls, ()
        merged: list[tuple[int, int]] = []
        touched, one_wall = set(owners[owners >= 0].tolist()), self.config.matching.one_wall
        sides = self._landmarks.change_points
        while twice := duplicate_of(walls, touched, one_wall, self.config.duplicates, sides.cut):
            keep, drop = twice
            self._landmarks.merge(self.backend.belief, keep, drop)
            self.backend.merge(keep, drop)
            owners[owners == drop] = keep
            merged.append(twice)
            walls = self._landmarks.map(self.backend.belief)
        return walls, tuple(merged)


def _both(clear: Matches, again: Matches) -> Matches:
    """Join the clear matches with those of the remaining segments."""
    rest = clear.unmatched
    more = again.pairs.copy()
    more[:, 0] = rest[more[:, 0]]
    return Matches(
        np.concatenate([clear.pairs, more]),
        np.concatenate([clear.distances, again.distances]),
        rest[again.unmatched],
        rest[again.doubtful],
        np.column_stack([rest[again.torn[:, 0]], again.torn[:, 1:]]),
        {int(rest[k]): why for k, why in again.refusals.items()},
    )


def seen_centres(segments: Segments, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 2"]:
    """Return the middle of each seen piece, robot frame, m."""
    return 0.5 * (segments.ends[rows, 0] + segments.ends[rows, 1])
