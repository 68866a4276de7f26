"""Poses in space as matrices, and drives of a filter in SE(3)."""

import numpy as np
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from chainslam.experiments.library.audit.geometry import space

FRAMES = ("additive", "body", "world")
UPPER = np.triu_indices(6)


def pose(place, turn):
    return np.append(place, Rotation.from_rotvec(turn).as_quat())


def matrix(x):
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_quat(x[3:]).as_matrix(), x[:3]
    return X


def pose_of(X):
    return np.append(X[:3, 3], Rotation.from_matrix(X[:3, :3]).as_quat())


def hat(xi):
    X = np.zeros((4, 4))
    X[:3, 3], X[:3, :3] = xi[:3], np.cross(np.eye(3), xi[3:])
    return X


def vee(X):
    X = np.real(X)
    return np.array([*X[:3, 3], X[2, 1], X[0, 2], X[1, 0]])


def fixes(steps, seed, told=1.0):
    """Return times, true and estimated poses and body covariances of an EKF in SE(3) that measures its pose.

    It is told `told` times the covariance of its measurements.
    """
    rng, motion = np.random.default_rng(seed), pose([0.2, 0.0, 0.02], [0.01, -0.02, 0.05])
    Q = np.diag([0.02, 0.01, 0.01, 0.004, 0.004, 0.01]) ** 2
    R = np.diag([0.05, 0.05, 0.1, 0.02, 0.02, 0.03]) ** 2
    back, kept = np.linalg.inv(matrix(motion)), []
    true, P, Ad = np.eye(4), R, np.zeros((6, 6))
    mean = true @ expm(hat(rng.multivariate_normal(np.zeros(6), R)))
    Ad[:3, :3] = Ad[3:, 3:] = back[:3, :3]
    Ad[:3, 3:] = space.cross(back[None, :3, 3])[0] @ back[:3, :3]
    for _ in range(steps):
        true = true @ matrix(motion) @ expm(hat(rng.multivariate_normal(np.zeros(6), Q)))
        mean, P = mean @ matrix(motion), Ad @ P @ Ad.T + Q
        seen = true @ expm(hat(rng.multivariate_normal(np.zeros(6), R)))
        K = P @ np.linalg.inv(P + told * R)
        mean = mean @ expm(hat(K @ vee(logm(np.linalg.inv(mean) @ seen))))
        P = (np.eye(6) - K) @ P
        P = 0.5 * (P + P.T)
        kept.append((pose_of(true), pose_of(mean), P))
    return 0.1 * np.arange(steps), *(np.array(column) for column in zip(*kept, strict=True))


def spatial(path, time_s, poses, covs=None, full=False):
    columns = [time_s, *poses.T]
    if covs is not None:
        columns += list(covs.reshape(len(covs), -1).T if full else covs[:, UPPER[0], UPPER[1]].T)
    np.savetxt(path, np.column_stack(columns), fmt="%.17g")
    return path
