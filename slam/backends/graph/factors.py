"""Poses, lines and their measurements as GTSAM sees them.

GTSAM has no lines of the plane, but planes of space: the motion plane is embedded in Y-Z, a pose (x, y, heading) as
the turn by heading about X at (0, x, y), a line (alpha, r) as the plane (0, cos alpha, sin alpha, -r). What leaves
the motion plane (three directions of a pose, the tilt of a plane) meets no measurement of the rest and stays at zero.
In this embedding the charts are the same for every alpha: a plane's is (-d alpha, tilt, -d r), a pose's is
(d heading, -, -, -, d x, d y) in the body frame.

The plane factor's error is (-sin(epsilon), tilt, r - r_predicted), epsilon the angle by which the observation departs
from the line. The model (`chainslam.slam.estimation.models.innovations`) has (epsilon, r cos(epsilon) - t0
sin(epsilon) - r_predicted), t0 the place of the observed piece along its line. As r cos(epsilon) - t0 sin(epsilon) is
rho sin(epsilon + phi), a plane factor that observes the line turned by phi through the robot holds the second part
exactly, and another one the first.
"""

from collections.abc import Iterator
from math import atan2, cos, hypot, sin, sqrt

import gtsam
import numpy as np
from jaxtyping import Float

from ...geometry.poses import rotation
from ...robot import Odometry
from .record import Observation

POSE_ROWS = (4, 5, 0)
"""Where x, y and heading stand in the chart of a pose, which has 6 rows."""
POSE_BLOCK = np.ix_(POSE_ROWS, POSE_ROWS)
LINE_ROWS = (0, 2)
"""Where -alpha and -r stand in the chart of a line, which has 3 rows."""
HELD = 1e-6
"""Standard deviation, m and rad, of what is held: the first pose, and odometry that states no error."""
OFF_PLANE = 1e-2
"""Standard deviation, m and rad, of what leaves the motion plane: of a motion's part and of a tilt in an observation.

Any number gives the same answer, but it is to be one: poses that tilt more freely than walls tell drift off the plane,
until it is known so unevenly that Cholesky refuses it and QR goes astray.
"""

_HELD_COV = HELD**2 * np.eye(3)
_POSES, _LINES = gtsam.symbol("x", 0), gtsam.symbol("l", 0)


def pose_key(index: int) -> int:
    """Return the key of the pose with this index."""
    return _POSES + index


def line_key(line: int) -> int:
    """Return the key of the line with this id."""
    return _LINES + line


def pose3(pose: Float[np.ndarray, "3"]) -> gtsam.Pose3:
    """Embed a pose (x, y, heading)."""
    return gtsam.Pose3(gtsam.Rot3.Rx(float(pose[2])), np.array([0.0, pose[0], pose[1]]))


def pose_of(value: gtsam.Pose3) -> Float[np.ndarray, "3"]:
    """Return (x, y, heading) of an embedded pose."""
    matrix = value.matrix()
    return np.array([matrix[1, 3], matrix[2, 3], atan2(matrix[2, 1], matrix[1, 1])])


def plane(alpha: float, r: float) -> Float[np.ndarray, "4"]:
    """Embed a line as the coefficients of a plane."""
    return np.array([0.0, cos(alpha), sin(alpha), -r])


def line_of(value: gtsam.OrientedPlane3) -> Float[np.ndarray, "2"]:
    """Return (alpha, r) of an embedded line."""
    _, x, y, d = value.planeCoefficients()
    return np.array([atan2(y, x), -d])


def origin_factor() -> gtsam.PriorFactorPose3:
    """Hold the first pose as the frame's origin."""
    return gtsam.PriorFactorPose3(pose_key(0), gtsam.Pose3(), _noise(np.zeros((3, 3))))


def odometry_factor(index: int, odometry: Odometry) -> gtsam.BetweenFactorPose3:
    """Say how the robot moved to pose `index`; GTSAM takes the error in the frame after the motion, not before it."""
    turn = np.eye(3)
    turn[:2, :2] = rotation(-odometry.motion[2])
    noise = _noise(turn @ odometry.cov @ turn.T)
    return gtsam.BetweenFactorPose3(pose_key(index - 1), pose_key(index), pose3(odometry.motion), noise)


def line_factors(line: int, observation: Observation) -> Iterator[gtsam.OrientedPlane3Factor]:
    """Say in which direction, and at which distance, a line was seen."""
    alpha, r, along, cross, across = observation.seen
    t0 = cross / along
    yield _line_factor(line, observation.pose, alpha, np.diag([1.0 / sqrt(along), 1.0 / OFF_PLANE, 0.0]))
    weights, scale = np.zeros((3, 3)), cos(observation.epsilon) - t0 * sin(observation.epsilon) / r
    sigma = sqrt(across - cross * t0) * abs(scale)
    weights[0] = -hypot(r, t0) / sigma, 0.0, 1.0 / sigma  # Its row below the diagonal would not be read.
    yield _line_factor(line, observation.pose, alpha + atan2(r, -t0), weights)


def _line_factor(line: int, pose: int, alpha: float, weights: Float[np.ndarray, "3 3"]) -> gtsam.OrientedPlane3Factor:
    noise = gtsam.noiseModel.Gaussian.SqrtInformation(weights)
    return gtsam.OrientedPlane3Factor(plane(alpha, 0.0), noise, pose_key(pose), line_key(line))


def _noise(cov_body: Float[np.ndarray, "3 3"]) -> gtsam.noiseModel.Gaussian:
    cov = OFF_PLANE**2 * np.eye(6)
    cov[POSE_BLOCK] = cov_body + _HELD_COV
    return gtsam.noiseModel.Gaussian.Covariance(cov)
