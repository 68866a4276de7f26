"""The paper's seven steps from a scan to a map of chains (section 2.2), the same for every back end."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from .association.joint_compatibility import Nis
from .association.leap import Leap
from .association.matching import NO_MATCHES, KnownWalls, Matches
from .association.methods import METHODS, Matcher
from .association.motion_noise import MotionInnovation, MotionNoise
from .association.ranges.heard import Heard, Ranges
from .association.recovery import Localisation, unstated_cov, unstated_motion
from .association.view import View, may_be_off, near_segments
from .config import MapperConfig
from .estimation.backend import Backend, Belief, ContradictionError, Observations
from .estimation.mounting import belief_of_body, odometry_of_scanner
from .extraction.config import ExtractionConfig
from .extraction.extract import extract
from .extraction.segments import Segments
from .extraction.visible_extent import sure_pieces
from .map.chains import Chain, connect
from .map.reliability import as_told
from .map.stochastic_map import StochasticMap
from .map_keeper import MapKeeper, MapUpdate
from .odometry.diagnosis import AT_REST, Diagnosis
from .robot import Odometry, RobotError, Scan


@dataclass(frozen=True)
class Localised:
    """A scan beside the map, up to the fourth step."""

    view: View
    first: Observations
    """The matches that localise the robot."""
    second: Observations
    """The matches from the pose that those lead to, as observations."""
    nis: Nis
    innovation: MotionInnovation | None
    """What they say of the last motion's noise."""
    matches: Matches
    """The matches from the pose that those lead to."""


@runtime_checkable
class Extractor(Protocol):
    """Finds the straight segments of a scan."""

    def __call__(self, scan: Scan, config: ExtractionConfig) -> Segments:
        """Return the segments, in the order of their bearings."""
        ...


class Mapper:
    """Drives one back end through the seven steps; extractor and matcher may be replaced by oracles.

    The back end's pose is that of the scanner (`start_of_scanner`): what comes in is of the body, and what goes out.
    """

    def __init__(
        self,
        backend: Backend,
        config: MapperConfig = MapperConfig(),
        extractor: Extractor = extract,
        matcher: Matcher | None = None,
    ) -> None:
        self.backend = backend
        self.config = config
        self._extract = extractor
        method = METHODS[config.matching.method]
        self._method = method if matcher is None else replace(method, matcher=matcher, looks_near=False)
        self._keeper = MapKeeper(backend, config)
        noise = None if config.recovery is None else config.recovery.noise
        self._noise = None if noise is None else MotionNoise(noise)
        self._leap = None if config.recovery is None else Leap(config.recovery.place)
        diagnosis = None if config.recovery is None else config.recovery.diagnosis
        self._diagnosis = None if diagnosis is None else Diagnosis(diagnosis)
        self._ranges = Ranges(backend, config.robot, config.ranges, self._pieces)
        self._odometry = AT_REST
        self._chains: tuple[Chain, ...] = ()
        self._is_lost = False
        self._left_out = 0

    @property
    def belief(self) -> Belief:
        """Where the body is believed to be, and the map."""
        return belief_of_body(self._ranges.told(self.backend.belief), self.config.robot.scanner)

    def predict(self, odometry: Odometry) -> None:
        """Move the robot's estimate by the odometry; raises RobotError for a motion that states no error at all."""
        if not odometry.states_its_error:
            raise RobotError(
                "expected the covariance of a motion's error, found zero: state how far the wheels slip, 1e-6 m and rad"
                " at least"
            )
        if self._diagnosis is not None:
            self._diagnosis.moved(odometry)
        odometry = odometry_of_scanner(odometry, self.config.robot.scanner)
        self._odometry = odometry if self._noise is None else self._noise.believed(odometry)
        self._move(self._odometry)
        if self._leap is not None:
            self._leap.move(self._odometry)

    def _move(self, odometry: Odometry) -> None:
        """Move the estimate by a motion of the scanner."""
        self._ranges.move(odometry, self.backend.belief)
        self.backend.predict(odometry)

    def step(self, scan: Scan, set_aside: Collection[tuple[int, int]] = ()) -> MapUpdate:
        """Take in one scan; `set_aside` holds (wall id, side) of ends that exploration gave up.

        Raises ContradictionError where no estimate agrees with it, nor with the two that were to be taken in before.
        """
        heard = self._ranges.hear(scan)
        update = self._judged(heard, set_aside)
        if not update.localisation.is_lost:
            self._ranges.learn(heard, update.segments, update.walls_of_segments)
        update = replace(update, heard=heard, range_errors=self._ranges.errors)
        return update.told(self.config.robot.scanner, self._ranges.told)

    def _judged(self, heard: Heard, set_aside: Collection[tuple[int, int]]) -> MapUpdate:
        """Take in a scan, unless it is the last one again, and tell what is wrong with the robot."""
        if self._diagnosis is None:
            return self._taken_in(heard.scan, set_aside)
        scan, factor = heard.scan, 1.0 if self._noise is None else self._noise.factor
        repeats = self._diagnosis.repeats(heard.sensed)
        update = (
            self._nothing_taken_in(self._pieces(scan), self._keeper.map())
            if repeats
            else self._taken_in(scan, set_aside)
        )
        found = update.localisation
        is_in_doubt = found.is_lost or (self._noise is not None and self._noise.factor > factor)
        fault = self._diagnosis.see(heard.sensed, found.unstated_motion is not None, is_in_doubt)
        return replace(update, localisation=replace(found, fault=fault)) if fault else update

    def _taken_in(self, scan: Scan, set_aside: Collection[tuple[int, int]]) -> MapUpdate:
        # 1. Extract features from the sensory input.
        segments, walls = self._pieces(scan), self._keeper.map()
        # 2 to 4. Match them, localise the robot, and match again.
        found = self._localised(scan, segments, walls)
        motion = self._recovery(scan, found, walls)
        self._odometry = AT_REST
        if self._is_lost:
            return self._nothing_taken_in(segments, walls)
        if motion is not None:
            self._move(motion)
            found = self._localised(scan, segments, self._keeper.map())
        matches = found.matches
        # 5. Update map features with their matched re-observation, and store unmatched features as new ones.
        try:
            self.backend.update(found.first, found.second)
            _ = self.backend.belief  # A graph solves for the observations when it is asked.
        except ContradictionError:
            self._left_out += 1
            if self._left_out > self.config.shared.scans:
                raise
            self._is_lost = self.config.recovery is not None  # Else nobody would look for its place.
            return self._nothing_taken_in(segments, self._keeper.map())
        self._left_out = 0
        self._keeper.follow()
        walls, owners, merged = self._keeper.store(scan, segments, matches)
        # 6. Initialise a new chain for each new segment.  7. Connect open ends of chains that are near.
        self._chains = connect(walls, set_aside, self.config.shared)
        localisation = Localisation(found.nis, motion, noise_factor=self._weighed(found, motion))
        return MapUpdate(segments, matches, owners, walls, self._chains, merged, localisation)

    def _localised(self, scan: Scan, segments: Segments, walls: StochasticMap) -> Localised:
        # 2. Match observed features to the best fitting equivalents in the map.
        view = self._view(scan, segments, walls)
        clear = view.match_clear()
        # 3. Localise the robot with matched features (here as a pure function, to match again).
        first = self._observed(clear, segments)
        seen = view.seen(first)
        # 4. Match features with their re-prediction from the new robot pose.
        matches = view.match_again(clear, seen)
        second = first if np.array_equal(matches.pairs, clear.pairs) else self._observed(matches, segments)
        return Localised(view, first, second, *view.surprise(seen, self._odometry), matches)

    def _recovery(self, scan: Scan, found: Localised, walls: StochasticMap) -> Odometry | None:
        """Return the motion that the odometry did not report and this scan shows; notes whether the robot is lost."""
        if self.config.recovery is None or self._leap is None:
            return None
        motion, is_lost = unstated_motion(
            scan,
            found.view,
            found.matches,
            walls,
            self._is_lost,
            self.config.recovery,
            lambda: self._view(scan, found.view.segments, walls, may_have_moved=True),
            self._leap,
            not self._odometry.by_scans,
        )
        if not is_lost:
            self._leap.drop()
        # Where scans told the motion it is walls that are wrong, and only a map that goes on can mend them.
        self._is_lost = is_lost and not self._odometry.by_scans
        return motion

    def _nothing_taken_in(self, segments: Segments, walls: StochasticMap) -> MapUpdate:
        """Return the map as it was: a scan from nobody knows where tells nothing of it."""
        nobody = np.full(len(segments), -1, dtype=np.int64)
        factor = 1.0 if self._noise is None else self._noise.factor
        is_pending = self._leap is not None and self._leap.is_pending
        localisation = Localisation(is_lost=True, is_leap_pending=is_pending, noise_factor=factor)
        return MapUpdate(segments, NO_MATCHES, nobody, walls, self._chains, (), localisation)

    def _weighed(self, found: Localised, motion: Odometry | None) -> float:
        """Weigh what a scan says of the wheels; return how many times as large as stated their noise was."""
        if self._noise is None:
            return 1.0
        factor = self._noise.factor
        if motion is None and found.innovation is not None:
            self._noise.see(found.innovation)
        return factor

    def _view(self, scan: Scan, segments: Segments, walls: StochasticMap, may_have_moved: bool = False) -> View:
        """Return the scan beside the walls that its segments may be of, also after a motion that nobody reported."""
        belief, config, pose_cov = walls.belief, self.config.matching, walls.belief.pose_cov
        near = np.flatnonzero(walls.distances_m < scan.range_max_m + may_be_off(pose_cov, config)[0])
        if may_have_moved and self.config.recovery is not None:
            pose_cov = pose_cov + unstated_cov(self.config.recovery)
        if self._method.looks_near:
            near = near[near_segments(segments, walls.ends_world.take(near, 0), belief.pose_world, pose_cov, config)]
        known = KnownWalls(walls.ids.take(near), walls.extents.take(near, 0))
        return View(segments, known, self.backend.belief.joint(known.ids), self._method, config)

    def _observed(self, matches: Matches, segments: Segments) -> Observations:
        """Return the matches as observations that move the estimate."""
        seen = segments.take(matches.pairs[:, 0])
        cov = as_told(seen.cov, seen, self.config.walls.reliability)
        cov = cov + self._keeper.landmarks.lack_of_fit(seen, matches.pairs[:, 1])
        return Observations(matches.pairs[:, 1], seen.lines, cov)

    def _pieces(self, scan: Scan) -> Segments:
        """Return the straight pieces of the scan."""
        config = self.config.extraction
        return self._ranges.stated(scan, sure_pieces(self._extract(scan, config), scan, config))
