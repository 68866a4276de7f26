"""How far a wall may be from the line that stands for it: what no single beam's noise explains."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..geometry.lines import directions
from .segments import Segments


@dataclass(frozen=True)
class StraightnessConfig:
    """How far walls are off their lines, sigma."""

    bow_rad: float = 0.0
    """How far the direction of a wall of any length is off, where one scan sees another part of it than the next ..."""
    bow_m: float = 0.0
    """... and how far it is off across; 0 where walls are drawn with a ruler."""


def cov_of_faces(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what the covariances of (alpha, r) of the segments of a scan lack, since some are of several faces.

    Of those around a corner that are four beams long a third are: their excess is nearly all of the error that noise
    does not explain (`python -m studies.consistency.extraction`).
    """
    faces = np.zeros((len(segments), 2, 2)) if segments.faces_cov is None else segments.faces_cov
    return faces + cov_of_bows(segments, config) if config.bow_rad or config.bow_m else faces


def cov_of_bows(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what they lack since no wall is straight: any direction and distance is that of the part in sight."""
    middles = middles_of(segments)
    cov = np.empty((len(middles), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1] = config.bow_rad**2, config.bow_m**2 + (config.bow_rad * middles) ** 2
    cov[:, 0, 1] = cov[:, 1, 0] = config.bow_rad**2 * middles
    return cov


def middles_of(segments: Segments) -> Float[np.ndarray, " s"]:
    """Return how far along its line the middle of each segment lies from the foot of the robot."""
    return np.asarray(np.vecdot(segments.ends.mean(axis=1), directions(segments.lines[:, 0])))
