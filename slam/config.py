"""The settings of the seven steps, one group for each part."""

from dataclasses import dataclass, field

from .association.ambiguity import TornConfig
from .association.matching import MatchingConfig
from .extraction.config import ExtractionConfig
from .map.candidates import FaintConfig
from .map.chains import ChainConfig
from .map.change_points import KinksConfig
from .map.extents import WallsConfig
from .map.merging import DuplicatesConfig
from .map.openings import GapsConfig
from .map.vertices import BendsConfig


@dataclass(frozen=True)
class MapperConfig:
    """The rules of the seven steps."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    bends: BendsConfig = field(default_factory=BendsConfig)
    chains: ChainConfig = field(default_factory=ChainConfig)
    walls: WallsConfig = field(default_factory=WallsConfig)
    faint: FaintConfig = field(default_factory=FaintConfig)
    gaps: GapsConfig = field(default_factory=GapsConfig)
    torn: TornConfig = field(default_factory=TornConfig)
    kinks: KinksConfig = field(default_factory=KinksConfig)
    duplicates: DuplicatesConfig | None = field(default_factory=DuplicatesConfig)
    """None where one wall may stand in the map twice."""
