"""The bundled worlds, and one way to load any world by name or file."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
import shapely
from jaxtyping import Float

from .drawing import Drawing, WorldError, as_pose, numbers, shorten
from .options import AS_DRAWN, DrawingOptions
from .readers.files import read_bytes, read_json_map
from .readers.foreign import check_foreign
from .solid import build
from .world import World

HERE = Path(__file__).parent / "bundled"


@dataclass(frozen=True)
class Bundled:
    """A world that comes with the software."""

    file: str
    about: str


WORLDS: dict[str, Bundled] = {
    "paper-fig4": Bundled("paper-fig4.svg", "figure 4: one cycle with a dead end, 16 numbered walls"),
    "paper-fig5": Bundled("paper-fig5.svg", "figures 5 and 6: rooms and dead ends off corridors, 20 m x 14 m"),
    "paper-fig8": Bundled("paper-fig8.svg", "figure 8: the cyclic 7 m x 7 m environment with corners A, B and C"),
    "paper-fig9": Bundled("paper-fig9.svg", "figure 9: 12 m x 9 m around a big obstacle, far corners A and B"),
    "rooms": Bundled("rooms.svg", "an apartment of 9 m x 8 m with doors and furniture"),
    "hall": Bundled("hall.svg", "a hall of 16 m x 12 m, larger than the sensor's range, with pillars"),
}


def _lazily(module: str, name: str) -> Callable[..., Drawing]:
    """Return a reader that imports its module (and the library behind it) when first used."""
    return lambda *arguments: getattr(import_module(f".{module}", __package__), name)(*arguments)


@dataclass(frozen=True)
class Family:
    """A family of worlds without a list: NAME:WHICH."""

    read: Callable[[str], Drawing]
    """From WHICH to a drawing."""
    example: str
    about: str


FAMILIES: dict[str, Family] = {
    "random": Family(
        _lazily("random.random_building", "read_seed"),
        "random:1",
        "a randomly generated building; any seed after the colon",
    ),
}

_read_svg = _lazily("readers.svg.reader", "read_svg")
READERS: dict[str, Callable[[Path, DrawingOptions], Drawing]] = {
    **dict.fromkeys((".json", ".geojson"), lambda path, options: read_json_map(read_bytes(path), options)),
    **dict.fromkeys((".svg", ".svgz"), lambda path, options: _read_svg(read_bytes(path), options)),
    ".dxf": _lazily("readers.dxf", "read_dxf"),
    **dict.fromkeys(
        (".png", ".pgm", ".ppm", ".bmp", ".jpg", ".jpeg", ".gif", ".tif", ".tiff", ".webp"),
        _lazily("readers.raster", "read_image"),
    ),
    **dict.fromkeys((".yaml", ".yml"), _lazily("readers.ros_map", "read_ros_map")),
}
"""Reader by file name extension; each takes the path and the drawing options."""
BUILT_IN = frozenset(READERS)
"""The readers of chainslam itself; others are plug-ins, which the workers of a campaign need to load."""


def listing() -> dict[str, str]:
    """Return a description of each world by a name that `load` accepts; a family is listed by an example."""
    families = {family.example: family.about for family in FAMILIES.values()}
    return {name: world.about for name, world in WORLDS.items()} | families


def is_own(name: str) -> bool:
    """Return whether a name is that of a bundled world, or of one of a family, and no file's."""
    return name in WORLDS or (":" in name and name.partition(":")[0] in FAMILIES)


def load(
    name_or_path: str | Path,
    start: tuple[float, ...] | Float[np.ndarray, " k"] | None = None,
    options: DrawingOptions = AS_DRAWN,
) -> World:
    """Return a bundled world, one of a family, or one from a file; raises WorldError.

    `start` (x m, y m, and optionally the heading rad) replaces the drawing's own. `options` say how the file is read.
    """
    pose = None if start is None else as_pose(numbers(list(start), (2, 3), "start", "(x, y, heading)"))
    # Degenerate shapes raise floating-point flags inside GEOS on the way to a valid result.
    with np.errstate(all="ignore"):
        try:
            name, drawing = _read(str(name_or_path), options)
        except shapely.errors.GEOSException as error:
            raise _unmended(error) from None
        try:
            return build(name, drawing, pose)
        except WorldError as error:
            # What was not understood is usually the reason.
            raise WorldError(
                f"{error} (the file: {'; '.join(drawing.notes)})" if drawing.notes else str(error)
            ) from None
        except shapely.errors.GEOSException as error:
            raise _unmended(error) from None


def _unmended(error: Exception) -> WorldError:
    return WorldError(f"expected outlines that can be mended, found {shorten(str(error))}: redraw them")


def _read(text: str, options: DrawingOptions) -> tuple[str, Drawing]:
    if text in WORLDS:
        options.check_only(("layers", "ids", "without"), "a bundled world")
        return text, _read_svg((HERE / WORLDS[text].file).read_bytes(), options)
    if is_own(text):
        family, _, which = text.partition(":")
        options.check_only((), "a random world")
        return text, FAMILIES[family].read(which)
    if not text.isprintable():
        # Results contain the name of their world in many files, which must be readable.
        raise WorldError(f"expected a file name of letters that can be shown, found {shorten(text)}: rename the file")
    path = Path(text)
    check_foreign(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise WorldError(
            f"expected one of {', '.join(listing())} or a file ending in {', '.join(READERS)}, found {shorten(text)}:"
            " choose one of these"
        )
    return path.stem, reader(path, options)
