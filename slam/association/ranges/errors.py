"""By how much a scanner's ranges are too long, and how sure that is."""

from dataclasses import dataclass

from ...estimation.shared import SharedConfig, of_shared
from ...geometry.quantities import Deviation, Distance, Part, Share, Sigmas, Size


@dataclass(frozen=True)
class RangesConfig:
    """Estimation of a bias and a scale of the ranges."""

    shared: SharedConfig = of_shared()
    bias_m: Deviation = 0.03
    """Standard deviation of the bias before any observation."""
    bow_m: Deviation = 0.1
    """A segment that gives the bias with a larger standard deviation than this is not used."""
    scale: Part = 0.03
    """Standard deviation of the scale before the robot has driven."""
    window_m: Size = 1.0
    """Path length over which the motion by scans is compared with that of the wheels."""
    sigmas: Sigmas = 3.0
    """Significance, in standard deviations, from which a bias or a scale is reported."""
    worth_m: Distance = 0.003
    """Smallest bias that is reported."""
    worth_scale: Share = 0.001
    """Smallest deviation of the scale from 1 that is reported."""


DEFAULTS = RangesConfig()


@dataclass(frozen=True)
class RangeErrors:
    """A measured range is `scale` times the true one and `bias_m`; what has been taken out of it counts as well."""

    bias_m: float = 0.0
    bias_sigma_m: float = RangesConfig.bias_m
    scale: float = 1.0
    """By the wheels: a scanner with a scale is not told from wheels of another size than stated."""
    scale_sigma: float = RangesConfig.scale

    def is_biased(self, config: RangesConfig = DEFAULTS) -> bool:
        """Return whether there is a bias beyond doubt that is worth a word."""
        return abs(self.bias_m) > max(config.sigmas * self.bias_sigma_m, config.worth_m)

    def is_scaled(self, config: RangesConfig = DEFAULTS) -> bool:
        """Return whether there is a scale beyond doubt that is worth a word."""
        return abs(self.scale - 1.0) > max(config.sigmas * self.scale_sigma, config.worth_scale)
