"""The Gaussian of a frame of the map's own carried into the world: the loops of `frame`."""

import math

import numpy as np
from jaxtyping import Float

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import wrapped


@compiled
def anchors_world(frame_world: Float[np.ndarray, "3"], anchors: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
    """Return anchors of the map's frame, m, in the world frame."""
    c, s = math.cos(frame_world[2]), math.sin(frame_world[2])
    moved = np.empty(anchors.shape)
    for k in range(len(anchors)):
        moved[k, 0] = c * anchors[k, 0] - s * anchors[k, 1] + frame_world[0]
        moved[k, 1] = s * anchors[k, 0] + c * anchors[k, 1] + frame_world[1]
    return moved


@compiled
def means_world(frame_world: Float[np.ndarray, "3"], means: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
    """Return lines (alpha, d) about their anchors in the world frame; a line and its anchor move as one."""
    turned = np.empty(means.shape)
    for k in range(len(means)):
        turned[k, 0], turned[k, 1] = wrapped(means[k, 0] + frame_world[2]), means[k, 1]
    return turned


@compiled
def moving(
    frame_world: Float[np.ndarray, "3"],
    pose_world: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors: Float[np.ndarray, "m 2"],
) -> Float[np.ndarray, "s 3"]:
    """Return how a pose and lines about their anchors, world frame, move with the frame, s = 3 + 2 m.

    With (s, phi) the error of the frame, everything moves as one: dp = s + J (p - o) phi, d_alpha = phi,
    dd = n·(s + J (c - o) phi), o the frame's origin.
    """
    by_frame = np.zeros((3 + 2 * len(means), 3))
    by_frame[0, 0] = by_frame[1, 1] = by_frame[2, 2] = 1.0
    by_frame[0, 2], by_frame[1, 2] = frame_world[1] - pose_world[1], pose_world[0] - frame_world[0]
    for k in range(len(means)):
        nx, ny = math.cos(means[k, 0]), math.sin(means[k, 0])
        by_frame[3 + 2 * k, 2] = 1.0
        by_frame[4 + 2 * k, 0], by_frame[4 + 2 * k, 1] = nx, ny
        x, y = anchors[k, 0] - frame_world[0], anchors[k, 1] - frame_world[1]
        by_frame[4 + 2 * k, 2] = ny * x - nx * y
    return by_frame


@compiled
def joint_world(
    frame_world: Float[np.ndarray, "3"],
    root: Float[np.ndarray, "3 3"],
    mean: Float[np.ndarray, " s"],
    cov: Float[np.ndarray, "s s"],
    anchors: Float[np.ndarray, "m 2"],
) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s s"], Float[np.ndarray, "m 2"]]:
    """Return mean, covariance and anchors of a Gaussian of pose and lines in the world frame.

    Its own error, turned, and the frame's on top: `root` is one of the frame's covariance.
    """
    c, s = math.cos(frame_world[2]), math.sin(frame_world[2])
    lines, points = means_world(frame_world, mean[3:].reshape((-1, 2))), anchors_world(frame_world, anchors)
    world, turned = mean.copy(), cov.copy()
    world[0] = frame_world[0] + c * mean[0] - s * mean[1]
    world[1] = frame_world[1] + s * mean[0] + c * mean[1]
    world[2] = wrapped(frame_world[2] + mean[2])
    for k in range(len(anchors)):
        world[3 + 2 * k] = lines[k, 0]
    for j in range(2, len(mean)):
        turned[0, j] = turned[j, 0] = c * cov[0, j] - s * cov[1, j]
        turned[1, j] = turned[j, 1] = s * cov[0, j] + c * cov[1, j]
    turned[0, 0] = c * c * cov[0, 0] - 2.0 * c * s * cov[0, 1] + s * s * cov[1, 1]
    turned[1, 1] = s * s * cov[0, 0] + 2.0 * c * s * cov[0, 1] + c * c * cov[1, 1]
    turned[0, 1] = turned[1, 0] = c * s * (cov[0, 0] - cov[1, 1]) + (c * c - s * s) * cov[0, 1]
    by_frame = moving(frame_world, world[:3], lines, points)
    moves = np.zeros((len(mean), 3))
    for i in range(len(mean)):
        for j in range(3):
            for k in range(3):
                moves[i, j] += by_frame[i, k] * root[k, j]
    # Entry by entry, so that each is the same whatever else is asked for.
    for i in range(len(mean)):
        for j in range(len(mean)):
            for k in range(3):
                turned[i, j] += moves[i, k] * moves[j, k]
    return world, turned, points
