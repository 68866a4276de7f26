"""How far a wall may be from the line that stands for it: what no single beam's noise explains.

A face of a decimetre cannot be told from a line across the corners beside it: four beams lie on either. In the mean
over all segments so short, those across corners among them, all beams together tell no more than a single one would
that is off by a centimetre and may lie anywhere along the face (`python -m studies.consistency.extraction`). Of a
long segment nothing is lost: beams of another face would have cut it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..geometry.lines import directions
from .segments import Segments


@dataclass(frozen=True)
class StraightnessConfig:
    """How far short faces are off their lines, sigma."""

    edge_m: float = 0.01
    """The shortest; 0 where every segment is known to be of one face."""
    face_m: float = 0.2
    """A face of this length is half as far off, a longer one falls with the fourth power: two thicknesses of a wall."""


def edge_variances(
    lengths_m: Float[np.ndarray, " n"], config: StraightnessConfig = StraightnessConfig()
) -> Float[np.ndarray, " n"]:
    """Return the variance of faces of these lengths across their lines, m^2."""
    return np.square(config.edge_m / (1.0 + np.square(np.square(lengths_m / config.face_m))))


def edge_cov(
    across_m2: Float[np.ndarray, " n"],
    lengths_m: Float[np.ndarray, " n"],
    middles_m: Float[np.ndarray, " n"],
    least_rad2: Float[np.ndarray, " n"] | float = 0.0,
) -> Float[np.ndarray, "n 2 2"]:
    """Return the covariance of (direction rad, distance m) of lines that are off across themselves by so much.

    It is that of a line through one point of this variance, which may lie anywhere along the wall: 12 / L^2 times as
    much in direction, or `least_rad2`. `middles_m` says how far along the line the wall's middle lies from the point at
    which the distance is taken.
    """
    turn = np.maximum(12.0 * across_m2 / np.square(np.maximum(lengths_m, 1e-3)), least_rad2)
    cov = np.empty((len(turn), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1] = turn, across_m2 + turn * middles_m**2
    cov[:, 0, 1] = cov[:, 1, 0] = turn * middles_m
    return cov


def cov_of_faces(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what the covariances of (alpha, r) of the segments of a scan lack, since some are of several faces."""
    middles = np.vecdot(segments.ends.mean(axis=1), directions(segments.lines[:, 0]))
    lengths = segments.lengths_m
    return edge_cov(edge_variances(lengths, config), lengths, middles)
