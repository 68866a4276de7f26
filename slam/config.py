"""The settings of the seven steps, one group for each part."""

from dataclasses import dataclass, field

from .association.matching import MatchingConfig
from .association.recovery import RecoveryConfig
from .extraction.config import ExtractionConfig
from .map.candidates import CandidatesConfig
from .map.chains import ChainConfig
from .map.change_points import ChangePointsConfig
from .map.extents import WallsConfig
from .map.merging import MergingConfig
from .map.openings import OpeningsConfig
from .map.vertices import VerticesConfig
from .robot import RobotSpec, of_robot


@dataclass(frozen=True)
class MapperConfig:
    """The rules of the seven steps."""

    robot: RobotSpec = of_robot()
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    vertices: VerticesConfig | None = field(default_factory=VerticesConfig)
    """None where no segment is cut at bends that the map knows, and no wall for them."""
    chains: ChainConfig = field(default_factory=ChainConfig)
    walls: WallsConfig = field(default_factory=WallsConfig)
    candidates: CandidatesConfig = field(default_factory=CandidatesConfig)
    openings: OpeningsConfig = field(default_factory=OpeningsConfig)
    change_points: ChangePointsConfig | None = field(default_factory=ChangePointsConfig)
    """None where no wall is cut for bends that only all scans together show; they are never looked for either where
    `vertices` is None."""
    merging: MergingConfig | None = field(default_factory=MergingConfig)
    """None where one wall may stand in the map twice."""
    recovery: RecoveryConfig | None = field(default_factory=RecoveryConfig)
    """None where the robot is taken at its word."""
