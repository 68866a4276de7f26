"""What the Kalman filters share of settings."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EkfConfig:
    """Parametrisation and Jacobians of the Kalman filters."""

    at_wall: bool = True
    """Anchor each wall where it was first seen, instead of at the world's origin (the paper's form), where its error
    grows with the distance."""
    relinearise: bool = True
    """Evaluate the measurement Jacobians at the pose corrected by the scan, instead of at the predicted pose."""
