"""What a caller says of a drawing that its file leaves open: its scale, and which of its parts are walls."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase

from chainslam.slam.geometry.quantities import Factor, Part, fault

from .drawing import WorldError, shorten


@dataclass(frozen=True)
class DrawingOptions:
    """How to read a drawing; what is not given here is taken from the file, or assumed where the file does not say."""

    scale: Factor | None = None
    """Metres per drawing unit or pixel, in place of what the file states."""
    layers: tuple[str, ...] = ()
    """Only these layers, groups or classes of an SVG or DXF file are drawn; `*` matches any letters."""
    ids: tuple[str, ...] = ()
    """Shapes and groups (in a DXF file: blocks) that are drawn by their id, in addition to those of `layers`."""
    without: tuple[str, ...] = ()
    """Layers, groups, classes, ids or blocks that are left out, such as dimensions, furniture and door swings."""
    level: str | None = None
    """Storey to read of a GeoJSON file with several; by default 0, or the lowest above it."""
    threshold: Part | None = None
    """Pixels of a picture darker than this lightness (0 is black, 1 is white) are walls; 0.63 if not given."""
    negate: bool = False
    """In a picture, light pixels are walls and dark ones are free space."""

    def __post_init__(self) -> None:
        """Refuse what means nothing; raises WorldError."""
        if wrong := fault(self):
            raise WorldError(f"expected options of a drawing, found {wrong}: correct it")

    @property
    def given(self) -> tuple[str, ...]:
        """The names of what is said."""
        return tuple(each.name for each in fields(self) if getattr(self, each.name) != each.default)

    def check_only(self, allowed: Iterable[str], what: str) -> None:
        """Raise WorldError where anything else is said than means something for a kind of drawing."""
        for name in self.given:
            if name not in allowed:
                said = getattr(self, name)
                words = " ".join(said) if isinstance(said, tuple) else "" if said is True else said
                raise WorldError(f"expected no --{name} for {what}, found {shorten(words)}: leave --{name} out")

    def shows(self, layers: Iterable[str], ids: Iterable[str]) -> bool:
        """Return whether something on these layers with these ids (its own and those around it) is drawn."""
        layers, ids = tuple(layers), tuple(ids)
        if matches(self.without, (*layers, *ids)):
            return False
        return not (self.layers or self.ids) or matches(self.layers, layers) or matches(self.ids, ids)

    @property
    def chooses(self) -> bool:
        """Whether some of the layers or ids are left out."""
        return bool(self.layers or self.ids or self.without)

    def check_names(self, layers: Iterable[str], ids: Iterable[str]) -> None:
        """Raise WorldError for a name that no part of the drawing has."""
        known, numbered = sorted(set(layers)), set(ids)
        for option, wanted, there in (
            ("layers", self.layers, known), ("ids", self.ids, numbered), ("without", self.without, {*known, *numbered}),
        ):  # fmt: skip
            for name in wanted:
                if not matches((name,), there):
                    few = ", ".join(shorten(each) for each in sorted(there)[:8]) or "none"
                    more = f" and {len(there) - 8} more" if len(there) > 8 else ""
                    raise WorldError(f"expected --{option} of the drawing ({few}{more}), found {shorten(name)}")


AS_DRAWN = DrawingOptions()
"""Nothing is said beside the file."""


def matches(wanted: Iterable[str], names: Iterable[str]) -> bool:
    """Return whether a name is wanted, capitals aside; * in what is wanted stands for any letters."""
    lowered = [name.lower() for name in names]
    return any(fnmatchcase(name, each.lower()) for each in wanted for name in lowered)
