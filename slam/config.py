"""The settings of the seven steps, one group for each part."""

from dataclasses import dataclass, field, fields, is_dataclass

from .association.matching import MatchingConfig
from .association.ranges.errors import RangesConfig
from .association.recovery import RecoveryConfig
from .estimation.shared import SharedConfig
from .extraction.config import ExtractionConfig
from .map.extents import WallsConfig
from .map.merging import MergingConfig
from .robot import RobotSpec, fitted, of_robot


@dataclass(frozen=True)
class MapperConfig:
    """Settings of the mapper as a whole; its parts follow."""

    robot: RobotSpec = of_robot()
    shared: SharedConfig = field(default_factory=SharedConfig)
    """Used by several of the groups below."""
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    walls: WallsConfig = field(default_factory=WallsConfig)
    merging: MergingConfig | None = field(default_factory=MergingConfig)
    """Without it, one wall may be in the map twice, and walls run on past the place where they bend."""
    recovery: RecoveryConfig | None = field(default_factory=RecoveryConfig)
    """Without it, the odometry is always believed."""
    ranges: RangesConfig = field(default_factory=RangesConfig)

    def __post_init__(self) -> None:
        """Let every group know what all share."""
        for each in fields(self):
            group = getattr(self, each.name)
            if is_dataclass(group) and each.name not in ("robot", "shared"):
                object.__setattr__(self, each.name, fitted(group, self.shared))
