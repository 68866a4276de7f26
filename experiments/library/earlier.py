"""A saved run whose map is used again: what it holds, where a robot finds itself in it, and both sessions as one."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import Recording
from chainslam.sim.worlds import World
from chainslam.slam.association.leap import Leap
from chainslam.slam.association.place_search import Place, PlaceSearchConfig, along, place_anywhere
from chainslam.slam.geometry.poses import compose, inverse, to_robot
from chainslam.slam.map.kernels import wall_kernels
from chainslam.slam.robot import Odometry

from ..artifacts.maps.map_files import read_map
from ..artifacts.results import LOG
from ..replays.replay import RecordedRun, read_run
from ..scenario import TrialConfig
from ..scoring.summary import pose_nees
from ..trial import TrialResult
from ..usage import UsageError

EVERY_M = 0.25
"""Path length between two searches for the robot's place."""
SEARCH = PlaceSearchConfig(least=0.7)
"""How finely a place is sought, and when one is believed: as for a robot that got lost."""


@dataclass(frozen=True)
class Earlier:
    """A saved run whose map is used again."""

    run: RecordedRun
    surface_world: Float[np.ndarray, "m 2"]
    """Points along its walls, m."""
    last_world: Float[np.ndarray, "3"]
    """Where it ended, by its map."""

    def carried_to(self, place_world: Float[np.ndarray, "3"], way: Float[np.ndarray, "s 3"]) -> Odometry:
        """Return the motion from there to the begin of a later session, whose way, in a frame of its own, led it to a
        place.
        """
        first_world = compose(place_world, compose(inverse(way[-1]), way[0]))
        return Odometry(compose(inverse(self.last_world), first_world), SEARCH.cov)

    def faces_in(self, world: World) -> Int[np.ndarray, "s k"]:
        """Return the true face of each beam; -1 for all where the building has changed since."""
        faces = self.run.true_face_of_beam
        known = self.run.true_faces is not None and np.array_equal(world.faces, self.run.true_faces)
        return faces if known else np.full_like(faces, -1)


def read_earlier(folder: Path, config: TrialConfig) -> Earlier:
    """Read a saved run of the same building and scanner; raises UsageError for anything else."""
    run, arrays = read_run(folder / LOG), read_map(folder)
    scanner, lidar = run.trial.robot.lidar, config.robot.lidar
    if (scanner.beams, scanner.fov_rad, scanner.range_max_m) != (lidar.beams, lidar.fov_rad, lidar.range_max_m):
        raise UsageError(
            f"expected a map made with the same scanner, found one of {scanner.beams} beams and {scanner.range_max_m:g}"
            f" m in {folder}: take the robot of that run (--robot)"
        )
    ends_world = wall_kernels.ends_world(arrays["anchors"], arrays["lines"], arrays["extents"])[~arrays["tentative"]]
    if not len(ends_world):
        raise UsageError(f"expected a map with walls, found none in {folder}: name another run")
    return Earlier(run, along(ends_world, 0.5 * SEARCH.cell_m), arrays["pose"])


class PlaceSought:
    """Seeks the robot's place in a saved map while it maps for itself; believes one that two searches agree on."""

    def __init__(self, surface_world: Float[np.ndarray, "m 2"]) -> None:
        """Seek it on points of the saved map's walls, m."""
        self._surface_world, self._leap, self._sought_m = surface_world, Leap(SEARCH), -np.inf
        self.best: Place | None = None
        """The best place of the last search, right or not."""
        self.found: Float[np.ndarray, 3] | None = None
        """The robot's pose in the frame of the saved map, once it is believed."""
        self.scans = 0
        """How many scans were seen until then."""

    def see(self, step: Step) -> bool:
        """Take in one step; return whether the place is found."""
        self.scans += 1
        self._leap.move(step.odometry)
        if step.localisation.is_lost or step.path_length_m < self._sought_m + EVERY_M:
            return False
        self._sought_m, walls = step.path_length_m, step.map
        points_world = along(walls.ends_world[~walls.tentative], SEARCH.cell_m)
        if not len(points_world):
            return False
        points = to_robot(points_world, walls.belief.pose_world)
        self.best = place_anywhere(self._surface_world, points, SEARCH)
        if self.best is None or not self.best.is_right(SEARCH):
            self._leap.drop()
        elif self._leap.is_earned(self.best.pose, may_begin=True):
            self.found = self.best.pose
        return self.found is not None

    @property
    def places(self) -> list[list[float]]:
        """The places of the last search that fit about as well as the best one."""
        if self.best is None or self.best.score < SEARCH.least:
            return []
        near = self.best.rival_pose is not None and self.best.rival > SEARCH.rival * self.best.score
        return [pose.tolist() for pose in (self.best.pose, self.best.rival_pose if near else None) if pose is not None]


def scored(said: dict[str, Any], result: TrialResult) -> dict[str, Any]:
    """Return what is told of a later session, with the ANEES of the pose in it alone."""
    unknown = result.log is None or "place_covs" in said  # Of a real robot's log there is no truth.
    if unknown or result.scenario.config.errorless or not said["first_step"]:
        return said
    assert result.log is not None
    return said | {"pose_anees": float(np.mean(pose_nees(result.log)[said["first_step"] :])) / 3.0}


def told_of(folder: Path, sought: PlaceSought, first: int) -> dict[str, Any]:
    """Return what `summary.json` says of a later session."""
    if sought.found is None:
        return {"map": str(folder), "first_step": 0, "placed_at_step": None, "places_world": sought.places}
    at = first + sought.scans - 1
    return {"map": str(folder), "first_step": first, "placed_at_step": at, "places_world": [sought.found.tolist()]}


def joined(first: Recording, then: Recording, carried: Odometry) -> Recording:
    """Return two sessions as one recording; between them the robot was carried."""
    begin = len(first)
    odometry, covs = np.vstack([first.odometry, then.odometry]), np.concatenate([first.odometry_cov, then.odometry_cov])
    odometry[begin], covs[begin] = carried.motion, carried.cov
    flags = np.concatenate([np.zeros(len(r), dtype=bool) if r.carried is None else r.carried for r in (first, then)])
    flags[begin] = True
    shift_s = first.time_s[-1] - min(0.0, then.time_s[0])
    return replace(
        first,
        time_s=np.concatenate([first.time_s, then.time_s + shift_s]),
        ranges_m=np.vstack([first.ranges_m, then.ranges_m]),
        odometry=odometry,
        odometry_cov=covs,
        touched=_both(first.touched, then.touched),
        scan_start_s=_both(first.scan_start_s, None if then.scan_start_s is None else then.scan_start_s + shift_s),
        carried=flags,
    )


def _both(first: np.ndarray | None, then: np.ndarray | None) -> np.ndarray | None:
    return None if first is None or then is None else np.concatenate([first, then])


def driven_m(recording: Recording) -> float:
    """Return the path length by the odometry, m, without the ways on which the robot was carried."""
    driven = slice(None) if recording.carried is None else ~recording.carried
    return float(np.hypot(*recording.odometry[driven, :2].T).sum())
