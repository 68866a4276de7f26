"""Arrays over the steps of a trial, with truth and estimate side by side."""

import sys
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.explore.step import Step
from chainslam.sim.logs.columns import Columns
from chainslam.sim.logs.recorded_robot import differing, fan_of
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.evaluation.from_start import FromStart, as_it_is
from chainslam.slam.extraction.curved_share import curved_beams

from ..scenario import WitnessedRobot
from .association import Votes

EVERY_M = 1.0
"""Path length between two samples of the map."""


@dataclass(frozen=True)
class Route:
    """A planned sequence of walls."""

    step: int = 0
    """Step at which it was planned first."""
    walls: tuple[int, ...] = ()
    """Ids, in order; a wall that was merged since has the id of the merged one."""


@dataclass(frozen=True)
class Log:
    """A run, step by step; s steps, k beams."""

    time_s: Float[np.ndarray, " s"]
    scan_start_s: Float[np.ndarray, " s"]
    """Time of the first beam of each scan; NaN if unknown."""
    bearings_rad: Float[np.ndarray, " k"]
    """Bearings of the scan with most beams."""
    ranges_m: Float[np.ndarray, "s k"]
    """NaN after the last beam of a scan with fewer."""
    sigma_m: Float[np.ndarray, " k"]
    sigma_share: float
    resolution_m: float
    range_max_m: float
    odometry: Float[np.ndarray, "s 3"]
    """Motion before each step by the odometry, in the robot frame before the motion, m m rad."""
    odometry_cov: Float[np.ndarray, "s 3 3"]
    heard: Float[np.ndarray, "s 3"]
    """The same motions as the mapper received them: from odometry, or from scan matching."""
    heard_cov: Float[np.ndarray, "s 3 3"]
    touched: Bool[np.ndarray, " s"]
    """Whether the body touched something before each step."""
    estimated_world: Float[np.ndarray, "s 3"]
    """Estimate available at that step."""
    estimated_cov: Float[np.ndarray, "s 3 3"]
    from_start_world: Float[np.ndarray, "s 3"]
    """Estimate as if the start had been known (`from_start.py`); NaN if it could not be computed."""
    from_start_cov: Float[np.ndarray, "s 3 3"]
    true_world: Float[np.ndarray, "s 3"]
    face_of_beam: Int[np.ndarray, "s k"]
    path_length_m: Float[np.ndarray, " s"]
    open_ends: Int[np.ndarray, " s"]
    lines: Int[np.ndarray, " s"]
    """Lines in the map, tentative ones included."""
    tentative: Int[np.ndarray, " s"]
    closed_chains: Int[np.ndarray, " s"]
    set_aside: Int[np.ndarray, " s"]
    seconds: Float[np.ndarray, " s"]
    """Wall-clock time of each step, sense to command."""
    planning_seconds: Float[np.ndarray, " s"]
    """Processor time of each step's planning."""
    nis: Float[np.ndarray, " s"]
    """Normalised innovation squared of the matches that localised the robot."""
    nis_dof: Int[np.ndarray, " s"]
    """Its degrees of freedom; 0 if no match localised the robot."""
    unstated_motion: Bool[np.ndarray, " s"]
    """Whether the scan showed a motion that the odometry had not reported."""
    is_lost: Bool[np.ndarray, " s"]
    """Whether the scan fitted nowhere and was not used."""
    wheel_noise_factor: Float[np.ndarray, " s"]
    """Factor on the stated noise of the wheels."""
    curved_beams: Int[np.ndarray, " s"]
    """Number of beams of each scan on something curved."""
    own_beams: Int[np.ndarray, " s"]
    """Number of beams of each scan that hit the robot itself."""
    route_walls: Int[np.ndarray, " s"]
    """Number of walls in the planned sequence; 0 without one."""
    behaviours: tuple[str, ...]
    """Behaviour of the robot, one word for each step."""
    reasons: tuple[str, ...]
    longest_route: Route = Route()
    """The first route with the most walls."""
    fans: Float[np.ndarray, "s 3"] | None = None
    """As `Recording.fans`: the beams of each scan, where they differ."""
    carried: Bool[np.ndarray, " s"] | None = None
    """As `Recording.carried`: first steps of later sessions; None for one session."""

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True)
class Sketch:
    """The walls of the map at a given path length."""

    path_length_m: float
    ends_world: Float[np.ndarray, "n 2 2"]
    """Without tentative walls."""


@dataclass
class Recorder:
    """Collects a run while it goes on, so that everything is kept however it ends."""

    robot: WitnessedRobot
    votes: Votes
    from_start: FromStart = as_it_is
    last: Step | None = None
    joint: Joint | None = None
    """Pose and all lines at the last step; None if the back end could not compute them."""
    sketches: list[Sketch] = field(default_factory=list)
    """Of the map, every `EVERY_M` metres and at the last step."""
    longest_route: Route = Route()
    _columns: Columns = field(default_factory=Columns)
    _reasons: list[str] = field(default_factory=list)
    _behaviours: list[str] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._columns)

    def add(self, step: Step) -> None:
        """Record one step and the truth at the same time; raises ValueError if scans and steps do not correspond."""
        record = self.robot.record
        if len(record.poses_world) != len(self) + 1:
            raise ValueError(
                f"expected one scan for each step, found {len(record.poses_world)} scans at step {len(self) + 1}:"
                " a mission yields a step after each sense()"
            )
        belief = step.map.belief
        from_start_world, from_start_cov = self.from_start(belief)
        self.last, self.joint = step, None
        if step.path_length_m >= EVERY_M * len(self.sketches):
            self.sketches.append(_sketch(step))
        for keep, drop in step.merged:
            self.votes.merge(keep, drop)
            kept = (keep if wall == drop else wall for wall in self.longest_route.walls)
            self.longest_route = replace(self.longest_route, walls=tuple(kept))
        if len(step.decision.walls_to_follow) > len(self.longest_route.walls):
            self.longest_route = Route(step.index, step.decision.walls_to_follow)
        self.votes.add(step.segments, step.walls_of_segments, record.faces_of_beams[-1], step.matches.pairs)
        self._reasons.append(sys.intern(step.decision.words))
        self._behaviours.append(step.decision.behaviour.value)
        self._columns.append(
            {
                "time_s": step.time_s,
                "scan_start_s": step.scan.start_s,
                "fan": fan_of(step.scan.bearings_rad),
                "ranges_m": step.scan.ranges_m,
                "odometry": step.odometry.reported.motion,
                "odometry_cov": step.odometry.reported.cov,
                "heard": step.odometry.motion,
                "heard_cov": step.odometry.cov,
                "touched": step.odometry.touched,
                "carried": step.odometry.carried,
                "estimated_world": belief.pose_world,
                "estimated_cov": belief.pose_cov,
                "from_start_world": from_start_world,
                "from_start_cov": from_start_cov,
                "true_world": record.poses_world[-1],
                "face_of_beam": record.faces_of_beams[-1],
                "path_length_m": step.path_length_m,
                "open_ends": sum(len(chain.open_ends) for chain in step.chains),
                "lines": len(step.map),
                "tentative": int(np.count_nonzero(step.map.tentative)),
                "closed_chains": sum(chain.is_closed for chain in step.chains),
                "set_aside": len(step.set_aside),
                "seconds": step.seconds,
                "planning_seconds": step.planning_seconds,
                "nis": step.localisation.nis.squared,
                "nis_dof": step.localisation.nis.dof,
                "unstated_motion": step.localisation.unstated_motion is not None,
                "is_lost": step.localisation.is_lost,
                "wheel_noise_factor": step.localisation.noise_factor,
                "own_beams": step.own_beams,
                "curved_beams": curved_beams(step.scan, step.segments),
                "route_walls": len(step.decision.walls_to_follow),
            }
        )

    def close(self) -> None:
        """Ask the last belief for its joint covariance, while it is still valid."""
        if self.last is None:
            return
        self.sketches.append(_sketch(self.last))
        try:
            self.joint = self.last.map.belief.joint(self.last.map.ids)
        except Exception:  # errors of the back end must not cost the results so far
            self.joint = None

    def log(self) -> Log:
        """Return the run so far; raises ValueError if there was no step."""
        if self.last is None:
            raise ValueError("expected at least one step, found none: the run failed before its first scan was mapped")
        scan = self.last.scan
        columns = self._columns.arrays()
        fans = columns.pop("fan")
        count, first, pitch = fans[np.argmax(fans[:, 0])]
        is_like = len(scan.bearings_rad) == count
        columns["face_of_beam"] = columns["face_of_beam"].astype(np.int64)
        carried = columns.pop("carried")
        return Log(
            bearings_rad=scan.bearings_rad if is_like else first + pitch * np.arange(int(count)),
            sigma_m=np.resize(np.asarray(scan.sigma_m, dtype=np.float64), int(count)),
            fans=differing(fans),
            carried=carried if carried.any() else None,
            sigma_share=scan.sigma_share,
            resolution_m=scan.resolution_m,
            range_max_m=float(scan.range_max_m),
            reasons=tuple(self._reasons),
            behaviours=tuple(self._behaviours),
            longest_route=self.longest_route,
            **columns,
        )


def _sketch(step: Step) -> Sketch:
    return Sketch(step.path_length_m, step.map.ends_world[~step.map.tentative].copy())
