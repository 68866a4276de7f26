"""What the Kalman filters share of settings."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EkfConfig:
    """How a filter states its lines and takes its Jacobians."""

    at_wall: bool = True
    """Lines are anchored where they were seen; without, at the world's origin (the paper's form), where the error of a
    line grows with its way there."""
    relinearise: bool = True
    """A joint update takes its Jacobian at the pose that corrects the odometry; filters that relocate first have no use
    for it."""
