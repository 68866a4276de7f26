"""The settings of the seven steps, one group for each part."""

from dataclasses import dataclass, field, fields, is_dataclass

from .association.matching import MatchingConfig
from .association.ranges.errors import RangesConfig
from .association.recovery import RecoveryConfig
from .estimation.shared import SharedConfig
from .extraction.config import ExtractionConfig
from .map.extents import WallsConfig
from .map.merging import MergingConfig
from .map.polylines.change_points import ChangePointsConfig
from .robot import RobotSpec, fitted, of_robot


@dataclass(frozen=True)
class MapperConfig:
    """The rules of the seven steps."""

    robot: RobotSpec = of_robot()
    shared: SharedConfig = field(default_factory=SharedConfig)
    """What more than one of the rules asks for; it reaches all groups below."""
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    vertices: bool = True
    """Whether segments are cut at bends that the map knows, and walls for them."""
    walls: WallsConfig = field(default_factory=WallsConfig)
    change_points: ChangePointsConfig | None = field(default_factory=ChangePointsConfig)
    """None where no wall is cut for bends that only all scans together show; they are never looked for either where
    `vertices` is False."""
    merging: MergingConfig | None = field(default_factory=MergingConfig)
    """None where one wall may stand in the map twice."""
    recovery: RecoveryConfig | None = field(default_factory=RecoveryConfig)
    """None where the robot is taken at its word."""
    ranges: RangesConfig = field(default_factory=RangesConfig)

    def __post_init__(self) -> None:
        """Let every group know what all share."""
        for each in fields(self):
            group = getattr(self, each.name)
            if is_dataclass(group) and each.name not in ("robot", "shared"):
                object.__setattr__(self, each.name, fitted(group, self.shared))
