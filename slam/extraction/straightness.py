"""How far a wall may be from the line that stands for it: what no single beam's noise explains.

A face of a decimetre cannot be told from a line across the corners beside it: four beams lie on either. In the mean
over all segments so short, those across corners among them, all beams together tell no more than a single one would
that is off by a centimetre and may lie anywhere along the face (`python -m studies.consistency.extraction`). Of a
long segment nothing is lost: beams of another face would have cut it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .segments import Segments
from .straightness_kernels import faces_cov


@dataclass(frozen=True)
class StraightnessConfig:
    """How far short faces are off their lines, sigma."""

    edge_m: float = 0.01
    """The shortest; 0 where every segment is known to be of one face."""
    face_m: float = 0.2
    """A face of this length is half as far off, a longer one falls with the fourth power: two thicknesses of a wall."""


def cov_of_faces(segments: Segments, config: StraightnessConfig = StraightnessConfig()) -> Float[np.ndarray, "s 2 2"]:
    """Return what the covariances of (alpha, r) of the segments of a scan lack, since some are of several faces."""
    return faces_cov(segments.lines, segments.ends, float(config.edge_m), float(config.face_m))
