"""Pose graphs in space, as g2o has them."""

import numpy as np
from scipy.spatial.transform import Rotation

from chainslam.experiments.library.audit.geometry import space
from chainslam.experiments.library.audit.reading.graphs import graph_at
from chainslam.experiments.library.audit.reading.linear import optimised

from .spaces import pose

SIGMAS = np.array([0.03, 0.02, 0.04, 0.01, 0.02, 0.015])
UPPER = np.triu_indices(6)
STEP = pose([0.5, 0.0, 0.1], [0.05, -0.02, 0.3])


def relations_of(poses, ends, sigmas, rng):
    """Return the relations between poses, each with an error after it."""
    first, second = (poses[list(rows)] for rows in zip(*ends, strict=True))
    noise = sigmas * rng.standard_normal((len(ends), 6))
    return space.composed(space.between(first, second), space.motions_of(noise))


def written(path, poses, ends=(), seen=(), information=None):
    """Write a graph."""
    lines = [" ".join([f"VERTEX_SE3:QUAT {k}", *map(repr, x)]) for k, x in enumerate(poses.tolist())]
    for (i, j), z in zip(ends, np.asarray(seen).tolist(), strict=True):
        lines.append(" ".join([f"EDGE_SE3:QUAT {i} {j}", *map(repr, [*z, *information[UPPER].tolist()])]))
    path.write_text("\n".join(lines))
    return path


def helix(count):
    """Return poses along a helix."""
    found = [np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])]
    for _ in range(count - 1):
        found.append(space.composed(found[-1][None], STEP[None])[0])
    return np.array(found)


def drive(folder, count=30, told=1.0, seed=0, name="a", noise=1.0):
    """Write the optimised graph of a drive, and its truth; return both paths, the edges, and what they measured."""
    rng, true = np.random.default_rng(seed), helix(count)
    ends = [(k, k + 1) for k in range(count - 1)] + [(k, k + 9) for k in range(0, count - 9, 3)]
    seen = relations_of(true, ends, noise * SIGMAS, rng)
    poses = [true[0]]
    for z in seen[: count - 1]:
        poses.append(space.composed(poses[-1][None], z[None])[0])
    information, path = np.diag(told * SIGMAS**-2.0), folder / f"{name}.g2o"
    written(path, np.array(poses), ends, seen, information)
    best, _, _ = optimised(graph_at(path, "space", "vector"), name)
    written(path, best.poses_world, ends, seen, information)
    return path, written(folder / f"{name}_true.g2o", true), ends, seen


def relations_file(path, poses, ends):
    """Write the relations between poses, as they are, with roll, pitch and yaw."""
    first, second = (poses[list(rows)] for rows in zip(*ends, strict=True))
    return relations_written(path, np.array(ends), space.between(first, second))


def relations_written(path, times, motions):
    """Write measured relations with roll, pitch and yaw."""
    yaw_first = Rotation.from_quat(motions[:, 3:]).as_euler("ZYX")
    np.savetxt(path, np.column_stack([times, motions[:, :3], yaw_first[:, ::-1]]), fmt="%.17g")
    return path
