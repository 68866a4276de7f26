"""By how much a scanner's ranges are too long, and how sure that is."""

from dataclasses import dataclass

from ...estimation.shared import SharedConfig, of_shared
from ...geometry.quantities import Deviation, Distance, Part, Share, Sigmas, Size


@dataclass(frozen=True)
class RangesConfig:
    """When a bias or a scale of ranges is worth a word, and what is taken for granted of them."""

    shared: SharedConfig = of_shared()
    bias_m: Deviation = 0.03
    """Standard deviation of a bias before anything is seen."""
    bow_m: Deviation = 0.1
    """A piece of wall that alone tells the bias to no better than this is left out: what is round bows, too."""
    scale: Part = 0.03
    """Standard deviation of a scale before the robot has driven."""
    window_m: Size = 1.0
    """Over so long a way the scans' motion is held against that of the wheels: where one scan leaves an error of a few
    millimetres, it is a small share of this."""
    sigmas: Sigmas = 3.0
    """An error of more than so many sigmas is told ..."""
    worth_m: Distance = 0.003
    """... if a bias is larger than this, ..."""
    worth_scale: Share = 0.001
    """... or a scale: it makes as much of 3 m."""


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
