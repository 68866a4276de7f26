"""KISS-ICP as an estimator that is a program: a scan is a cloud of points in the plane (pip install kiss-icp).

KISS-ICP states no covariance. With --sigma one is added here, as if the errors of steps were independent, each with
this standard deviation in x and y, m, and in heading, rad. docs/howto/external.md describes the lines.
"""

import argparse
import json
import sys

import numpy as np
from kiss_icp.config import KISSConfig
from kiss_icp.kiss_icp import KissICP

UPPER = np.triu_indices(3)
Array = np.ndarray


def matrix(motion: Array) -> Array:
    """Return the 4 x 4 matrix of x m, y m, heading rad."""
    c, s = np.cos(motion[2]), np.sin(motion[2])
    found = np.eye(4)
    found[:2, :2], found[:2, 3] = [[c, -s], [s, c]], motion[:2]
    return found


def planar(pose: Array) -> Array:
    """Return x m, y m, heading rad of a 4 x 4 matrix."""
    return np.array([pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])])


def main() -> None:
    """Answer each scan with the pose of KISS-ICP."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--voxel", type=float, default=0.1, help="size of a voxel, m")
    parser.add_argument("--wheels", action="store_true", help="predict by the odometry, not by the last motion")
    parser.add_argument("--sigma", type=float, nargs=2, metavar=("M", "RAD"), help="of each step")
    asked = parser.parse_args()
    header = json.loads(sys.stdin.readline())
    bearings, mount = np.array(header["bearings_rad"]), matrix(np.array(header["scanner"]))
    config = KISSConfig()
    config.data.max_range, config.data.deskew = header["range_max_m"], False
    config.mapping.voxel_size, config.registration.max_num_threads = asked.voxel, 1
    kiss, cov, last = KissICP(config), np.zeros((3, 3)), np.zeros(3)
    for line in sys.stdin:
        scan = json.loads(line)
        bearings = np.array(scan.get("bearings_rad", bearings))
        ranges = np.array(scan["ranges_m"], dtype=float)  # null, for no return, becomes NaN
        points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), np.zeros(len(ranges))], axis=-1)
        if asked.wheels:
            kiss.last_delta = np.linalg.inv(mount) @ matrix(np.array(scan["motion"])) @ mount
        kiss.register_frame(points[np.isfinite(ranges)], np.zeros(0))
        pose = planar(mount @ kiss.last_pose @ np.linalg.inv(mount))
        answer = {"pose": pose.tolist()}
        if asked.sigma:
            lever = np.eye(3)
            lever[:2, 2] = last[1] - pose[1], pose[0] - last[0]
            grown = np.diag(np.square([asked.sigma[0], *asked.sigma])) if scan["scan"] else np.zeros((3, 3))
            cov = lever @ cov @ lever.T + grown
            answer["covariance"] = cov[UPPER].tolist()
        last = pose
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
