"""The settings of the factor graph, apart from it: to read them one needs no gtsam."""

from dataclasses import dataclass

from ...geometry.quantities import Angle, Distance, Factor, Number, Probability, Weight


@dataclass(frozen=True)
class GraphConfig:
    """How closely iSAM2 follows the least-squares solution, and when its solution is rejected."""

    relinearise_angle_rad: Angle = 0.005
    """A pose or a wall is relinearised once it has turned by more than this."""
    relinearise_place_m: Distance = 0.2
    """A pose or a wall is relinearised once it has moved by more than this."""
    closure: Factor = 4.0
    """Multiple of the two relinearisation thresholds above which walls are relinearised at once instead of in the next
    step."""
    passes: Number = 5
    """Largest number of rounds of relinearisation in one step."""
    wildfire: Weight = 1e-4
    """Changes smaller than this (m and rad) are not propagated to other parts of the map."""
    near: Number = 60
    """Walls whose joint covariance was asked for are kept last in the elimination order, if they are no more than
    this."""
    careful: bool = False
    """Eliminate by QR instead of Cholesky: a fifth slower, but accurate if some directions are known 10,000 times
    better than others."""
    most_turn_rad: Angle = 1.2
    """A solution in which a wall turns by more than this from where it is linearised is rejected."""
    diverged_chance: Probability = 1e-9
    """A solution whose pose is less likely than this, given its prediction, is repeated with damped steps."""
