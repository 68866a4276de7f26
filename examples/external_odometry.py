"""The smallest estimator that is a program: the odometry alone, with the covariance that it adds up to.

chainslam writes a line of JSON for each scan, and reads the line that answers it (docs/howto/external.md).
"""

import argparse
import json
import sys

import numpy as np

Array = np.ndarray
UPPER = np.triu_indices(3)


def moved(pose: Array, cov: Array, motion: Array, motion_cov: Array) -> tuple[Array, Array]:
    """Return pose and covariance (x m, y m, heading rad) after a motion in the frame before it."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    end = pose + turn @ motion
    by_pose = np.eye(3)
    by_pose[:2, 2] = pose[1] - end[1], end[0] - pose[0]
    return end, by_pose @ cov @ by_pose.T + turn @ motion_cov @ turn.T


def main() -> None:
    """Answer each scan with the pose that the odometry has come to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=float, default=1.0, help="state the covariance so many times as large")
    times = parser.parse_args().times
    pose, cov = np.zeros(3), np.zeros((3, 3))
    sys.stdin.readline()  # The header: an estimator that uses the scans reads the bearings of their beams here.
    for line in sys.stdin:
        scan = json.loads(line)
        motion_cov = np.zeros((3, 3))
        motion_cov[UPPER] = scan["motion_covariance"]
        motion_cov = motion_cov + np.triu(motion_cov, 1).T
        pose, cov = moved(pose, cov, np.array(scan["motion"]), motion_cov)
        print(json.dumps({"pose": pose.tolist(), "covariance": (times * cov)[UPPER].tolist()}), flush=True)


if __name__ == "__main__":
    main()
