"""How far a wall may be from the line that stands for it: what no single beam's noise explains.

A face of a decimetre cannot be told from a line across the corners beside it: four beams lie on either. In the mean
over all segments so short, those across corners among them, all beams together tell no more than a single one would
that is off by a centimetre and may lie anywhere along the face (`python -m studies.consistency.extraction`). Of a
long segment nothing is lost: beams of another face would have cut it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..estimation.shared import SharedConfig, of_shared
from ..geometry.quantities import Angle, Distance
from .segments import Segments
from .straightness_kernels import faces_cov, middles_of


@dataclass(frozen=True)
class StraightnessConfig:
    """Lack of fit of single segments."""

    shared: SharedConfig = of_shared()
    edge_m: Distance = 0.01
    """Standard deviation of the lack of fit of the shortest segments; longer ones have less."""
    bow_rad: Angle = 0.0
    """Standard deviation of a wall's direction from one scan to the next, since no real wall is straight."""
    bow_m: Distance = 0.0
    """Standard deviation of a wall's offset from one scan to the next, since no real wall is straight."""


def cov_of_faces(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what the covariances of (alpha, r) of the segments of a scan lack, since some are of several faces."""
    edges = _faces_cov(segments, config, float(config.edge_m), float(config.shared.face_m))
    return edges + cov_of_bows(segments, config) if config.bow_rad or config.bow_m else edges


def cov_of_misfits(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what they lack where the residuals of a segment show that it is of several faces."""
    return _faces_cov(segments, config, 0.0, 1.0)


def cov_of_bows(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what they lack since no wall is straight: any direction and distance is that of the part in sight."""
    middles = middles_of(segments.lines, segments.ends)
    cov = np.empty((len(middles), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1] = config.bow_rad**2, config.bow_m**2 + (config.bow_rad * middles) ** 2
    cov[:, 0, 1] = cov[:, 1, 0] = config.bow_rad**2 * middles
    return cov


def _faces_cov(
    segments: Segments, config: StraightnessConfig, edge_m: float, face_m: float
) -> Float[np.ndarray, "s 2 2"]:
    fits = segments.cov, segments.chi2, segments.beam_counts, float(config.shared.outlier_sigmas)
    return faces_cov(segments.lines, segments.ends, *fits, edge_m, face_m)
