"""From where to look at an open end: in front of it, past it, round it, and close (paper, section 3.1)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.quantities import Distance
from chainslam.slam.map.chains import HEAD, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import RobotSpec, of_robot

from ..floor.free_space import FreeSpace
from ..planning.paths import Planner
from ..planning.sight import cells_within, sees

FAR_SHARE = 0.875
"""Nothing is looked at from beyond this share of the scanner's range: 3.5 m of 4 m."""
LANE_EVERY_M = 0.25
"""Places along a wall at which it is followed lie this far apart."""


@dataclass(frozen=True)
class ViewpointsConfig:
    """The places from which an open end is viewed."""

    robot: RobotSpec = of_robot()
    standoff_beyond_m: Distance = 0.15
    """Distance between body and wall while a wall is followed and its end is rounded."""
    close_beyond_m: Distance = 0.05
    """Distance between body and wall at the last, close view."""
    slack_m: Distance = 0.25
    """Largest distance between the ideal viewpoint and the one that is used."""
    near_m: Distance = 1.2
    """If no ideal viewpoint can be reached, any place this close to the open end that sees it is used."""
    far_m: Distance = 3.5
    """If there is none within `near_m`, any place this close that sees the open end is used, up to 0.875 of the
    scanner's range."""
    short_m: Distance = 0.12
    """A line of sight may stop this far short of the open end."""

    @property
    def standoff_m(self) -> float:
        """Distance of the middle of the body at which a wall is followed."""
        return self.robot.beyond(self.standoff_beyond_m)

    def farthest_m(self, range_m: float) -> float:
        """Return the farthest place from which an end is looked at by a scanner of this range."""
        return min(self.far_m, FAR_SHARE * range_m)

    @property
    def close_m(self) -> float:
        """Distance of the middle of the body at the last, close look."""
        return self.robot.beyond(self.close_beyond_m)


LOOKS = ("in front of", "past", "round", "close to")
"""The looks in the order in which they are tried."""
TURNS_RAD = np.deg2rad([10.0, 60.0, 120.0])
"""How far the first three go round the end, from straight in front of its wall."""
BEYOND_RAD = float(np.deg2rad(45.0))
"""Seen from this far round, the face that follows is in sight, though at a flat angle."""


def ideal_places(end: OpenEnd, walls: StochasticMap, config: ViewpointsConfig) -> Float[np.ndarray, "4 2"]:
    """Return the four ideal places, one for each of `LOOKS`, world frame, m."""
    alpha = walls.belief.means[walls.belief.rows([end.wall])[0], 0]
    into, outward = normals(alpha), _outward(end, alpha)
    ring = config.standoff_m * (np.sin(TURNS_RAD)[:, None] * outward - np.cos(TURNS_RAD)[:, None] * into)
    return end.position_world + np.vstack([ring, -config.close_m * into + 0.1 * outward])


def places_near(
    ideal_world: Float[np.ndarray, "2"], end: OpenEnd, free_space: FreeSpace, planner: Planner, config: ViewpointsConfig
) -> Float[np.ndarray, "n 2"]:
    """Return passable places near an ideal one that see the end, the nearest to the ideal first."""
    points = planner.passable_points(cells_within(free_space, ideal_world, config.slack_m))
    points = points[np.argsort(np.hypot(*(points - ideal_world).T), kind="stable")]
    return points[sees(free_space, points, end.position_world, config.short_m)]


def places_beyond(
    end: OpenEnd, walls: StochasticMap, free_space: FreeSpace, planner: Planner, config: ViewpointsConfig
) -> Float[np.ndarray, "n 2"]:
    """Return passable places that see the end from past it, for where nobody can stand near the ideal ones."""
    alpha = walls.belief.means[walls.belief.rows([end.wall])[0], 0]
    points = places_that_see(end, free_space, planner, config.near_m, config)
    offset = points - end.position_world
    turn = np.arctan2(offset @ _outward(end, alpha), -offset @ normals(alpha))
    return points[turn > BEYOND_RAD]


def _outward(end: OpenEnd, alpha_rad: np.floating) -> Float[np.ndarray, "2"]:
    """Return the direction in which a wall would go on past its end."""
    along = directions(alpha_rad)
    return along if end.side == HEAD else -along


def places_that_see(
    end: OpenEnd, free_space: FreeSpace, planner: Planner, reach_m: float, config: ViewpointsConfig
) -> Float[np.ndarray, "n 2"]:
    """Return passable places within reach of the end from which it is in sight, in no particular order."""
    points = planner.passable_points(cells_within(free_space, end.position_world, reach_m))
    return points[sees(free_space, points, end.position_world, config.short_m)]


def lane(wall: int, walls: StochasticMap, standoff_m: float) -> Float[np.ndarray, "n 2"]:
    """Return places along a wall at the distance at which it is followed, world frame, m."""
    row = walls.belief.rows([wall])[0]
    tail, head = walls.ends_world[row]
    share = np.linspace(0.0, 1.0, max(int(np.hypot(*(head - tail)) / LANE_EVERY_M), 1) + 1)
    return tail + share[:, None] * (head - tail) - standoff_m * normals(walls.belief.means[row, 0])
