"""Trajectories written as users have them."""

import numpy as np

UPPER = np.triu_indices(3)


def tum(path, time_s, poses, covs=None, order=range(6)):
    """Write poses, and covariances as 6 columns (3 x 3) or 21 (6 x 6), in the TUM format."""
    half = 0.5 * poses[:, 2]
    zeros = np.zeros(len(poses))
    columns = [time_s, *poses[:, :2].T, zeros, zeros, zeros, np.sin(half), np.cos(half)]
    if covs is not None:
        upper = np.triu_indices(covs.shape[1])
        cells = covs[:, upper[0], upper[1]]
        columns += list(cells[:, list(order)].T if covs.shape[1] == 3 else cells.T)
    np.savetxt(path, np.column_stack(columns), fmt="%.17g")
    return path


def written(folder, drive, name="a", covs=None, **more):
    """Write a drive and its truth, and return both paths."""
    return (
        tum(folder / f"{name}.tum", drive.time_s, drive.estimated, drive.covs if covs is None else covs, **more),
        tum(folder / f"{name}_true.tum", drive.time_s, drive.true),
    )


def in_space(covs):
    """Return covariances of x, y and heading as those of x y z roll pitch yaw of a robot that stays in the plane."""
    wide = np.zeros((len(covs), 6, 6))
    wide[:, [[0], [1], [5]], [0, 1, 5]] = covs
    return wide
