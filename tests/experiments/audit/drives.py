"""Simulated drives of a robot that localises itself by range and bearing of known landmarks, with a textbook EKF."""

from dataclasses import dataclass

import numpy as np

LANDMARKS = np.array([[-8.0, 0.0], [8.0, 1.0], [0.0, 9.0], [1.0, -8.0]])
WHEELS = np.diag([0.01**2, 0.005**2, np.deg2rad(0.5) ** 2])
"""Covariance of a step's motion in the body frame."""
SCANNER = np.diag([0.1**2, np.deg2rad(1.0) ** 2])
"""Covariance of range and bearing."""
START = np.diag([0.1**2, 0.1**2, np.deg2rad(2.0) ** 2])


@dataclass(frozen=True)
class Drive:
    """A drive of n poses."""

    time_s: np.ndarray
    true: np.ndarray
    estimated: np.ndarray
    covs: np.ndarray


def drives(runs: int, steps: int, told: float = 1.0, seed: int = 0, seen_every: int = 1) -> list[Drive]:
    """Return drives in circles; the EKF is told `told` times the scanner's covariance."""
    rng = np.random.default_rng(seed)
    motion = np.array([0.1, 0.0, 0.03])
    true = np.tile([0.0, -3.0, 0.0], (runs, 1))
    mean = true + rng.multivariate_normal(np.zeros(3), START, runs)
    P = np.tile(START, (runs, 1, 1))
    kept: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for step in range(steps):
        true = moved(true, motion + rng.multivariate_normal(np.zeros(3), WHEELS, runs))
        c, s = np.cos(mean[:, 2]), np.sin(mean[:, 2])
        F, G = np.tile(np.eye(3), (runs, 1, 1)), np.zeros((runs, 3, 3))
        F[:, 0, 2], F[:, 1, 2] = -s * motion[0] - c * motion[1], c * motion[0] - s * motion[1]
        G[:, 0, 0], G[:, 0, 1], G[:, 1, 0], G[:, 1, 1], G[:, 2, 2] = c, -s, s, c, 1.0
        mean, P = moved(mean, motion), F @ P @ F.swapaxes(1, 2) + G @ WHEELS @ G.swapaxes(1, 2)
        if step % seen_every == 0:
            landmark = LANDMARKS[step // seen_every % len(LANDMARKS)]
            noise = rng.multivariate_normal(np.zeros(2), SCANNER, runs)
            off = seen(true, landmark) + noise - seen(mean, landmark)
            off[:, 1] = (off[:, 1] + np.pi) % (2 * np.pi) - np.pi
            H = jacobian(mean, landmark)
            K = np.linalg.solve(H @ P @ H.swapaxes(1, 2) + told * SCANNER, H @ P).swapaxes(1, 2)
            mean = mean + (K @ off[..., None])[..., 0]
            keep = np.eye(3) - K @ H
            P = keep @ P @ keep.swapaxes(1, 2) + K @ (told * SCANNER) @ K.swapaxes(1, 2)
        kept.append((true, mean, P))
    every = (np.stack(column, axis=1) for column in zip(*kept, strict=True))
    return [Drive(0.1 * np.arange(steps), *run) for run in zip(*every, strict=True)]


def moved(poses: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return poses after a motion in their own frames."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    dx, dy, turn = np.broadcast_to(motion, poses.shape).T
    return poses + np.stack([c * dx - s * dy, s * dx + c * dy, turn], axis=1)


def seen(poses: np.ndarray, landmark: np.ndarray) -> np.ndarray:
    """Return range and bearing."""
    dx, dy = (landmark - poses[:, :2]).T
    return np.stack([np.hypot(dx, dy), np.arctan2(dy, dx) - poses[:, 2]], axis=1)


def jacobian(poses: np.ndarray, landmark: np.ndarray) -> np.ndarray:
    """Return the derivative of range and bearing by the pose."""
    dx, dy = (landmark - poses[:, :2]).T
    r = np.hypot(dx, dy)
    zero, one = np.zeros_like(r), np.ones_like(r)
    return np.stack([np.stack([-dx / r, -dy / r, zero], 1), np.stack([dy / r**2, -dx / r**2, -one], 1)], axis=1)
