"""Maps made by a robot, in the format of ROS map_server: an image, and a YAML file that defines its greys.

Transparent pixels are unknown in every mode, as in map_saver; unknown pixels are solid. Quoted values are read as in
yaml-cpp. If the picture is not at the path in the YAML file, it is searched for next to that file.
"""

import os.path
from dataclasses import replace
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ..drawing import Drawing, WorldError, numbers, shorten
from ..options import AS_DRAWN, DrawingOptions
from ..text import printable
from .files import read_bytes
from .foreign import check_yaml
from .outlines import outlines
from .picture import Picture, read_picture
from .plain_yaml import as_number, plain_mapping

UNKNOWN_GREY = 205
JPEG = "JPEG blurs greys, so that unknown cells may be read as free or as walls: save the map as PNG or PGM"


def read_ros_map(path: Path, options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing of a ROS map: a YAML file that names an image next to it, in the map's frame."""
    options.check_only((), "a ROS map, whose YAML says it")
    data = read_bytes(path)
    check_yaml(data)
    document = plain_mapping(data)
    image, notes = _image_beside(path, document.get("image"))
    resolution = numbers([as_number(document.get("resolution"))], (1,), "resolution", "0.05")[0]
    if not 0 < resolution <= 10:
        raise WorldError(f"expected a resolution of 0 to 10 m per pixel, found {resolution:g}: correct the YAML file")
    pose, turned = _origin(document.get("origin", [0.0, 0.0, 0.0]))
    means = _meaning(document)
    picture = read_picture(image)
    drawing = outlines(_solid(picture, means), float(resolution), pose)
    notes += [*turned, *([JPEG] if picture.is_jpeg else [])]
    words = "occupied and unknown pixels as walls"
    scale = f"{resolution:g} m a pixel, as {path.name} says"
    return replace(drawing, understood=words, scale=scale, notes=tuple(notes))


def map_beside(picture: Path) -> Path | None:
    """Return the YAML file of a ROS map beside a picture, of the same name, that names this picture; None for none."""
    for suffix in (".yaml", ".yml"):
        path = picture.with_suffix(suffix)
        try:
            if path.is_file():
                named = plain_mapping(read_bytes(path)).get("image")
                if isinstance(named, str) and _last(named) == picture.name:
                    return path
        except (WorldError, OSError, ValueError):
            continue
    return None


def _solid(picture: Picture, means: Bool[np.ndarray, "256"]) -> Bool[np.ndarray, "h w"]:
    solid = means[picture.grey]
    return solid if picture.alpha is None else solid | (picture.alpha < 255)


def _meaning(document: dict[str, Any]) -> Bool[np.ndarray, "256"]:
    """Return which of the 256 greys are solid."""
    occupied, free = (
        numbers([as_number(document.get(key, default))], (1,), key, str(default))[0]
        for key, default in (("occupied_thresh", 0.65), ("free_thresh", 0.196))
    )
    if not 0 <= free <= occupied <= 1:
        raise WorldError(
            f"expected 0 <= free_thresh <= occupied_thresh <= 1, found {free:g}, {occupied:g}: correct them"
        )
    mode = document.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise WorldError(f"expected mode trinary, scale or raw, found {shorten(mode)}: correct the YAML file")
    negate = as_number(document.get("negate", 0.0))
    if negate not in (0.0, 1.0):
        raise WorldError(f"expected negate 0 or 1, found {shorten(negate)}: correct the YAML file")
    # Greys are 256 values: what each of them means is looked up, pixel by pixel, without another picture in floats.
    grey = np.arange(256)
    chance = grey / 255 if negate else 1 - grey / 255
    # The second test keeps grey 205 unknown also under a rounded threshold of 0.25, as map_saver means it.
    solid: Bool[np.ndarray, 256] = chance >= free if mode != "raw" else grey >= 100 * free
    if mode == "trinary":
        solid |= grey == UNKNOWN_GREY
    return solid


def _origin(said: Any) -> tuple[Float[np.ndarray, "3"], list[str]]:
    """Return the pose of the picture's lower left corner; a yaw that is no number, which map_saver writes, is 0."""
    values = [as_number(value) for value in said] if isinstance(said, list) else said
    notes = []
    if isinstance(values, list) and len(values) == 3 and str(values[2]).strip().lower().lstrip("+-.") == "nan":
        notes = [f"the yaw {shorten(values[2])} of the origin is no number, and read as 0"]
        values = [*values[:2], 0.0]
    origin = numbers(values, (2, 3), "origin", "[x, y, yaw]")
    return np.array([origin[0], origin[1], origin[2] if len(origin) > 2 else 0.0]), notes


def _image_beside(path: Path, name: object) -> tuple[Path, list[str]]:
    """Return the picture that a YAML file names, in its folder or below, and what was done to find it, in words."""
    if not isinstance(name, str) or not name or name != printable(name):
        raise WorldError(f"expected image: to name a picture, found {shorten(name)}: correct the YAML file")
    image = path.parent / name
    home, there = (os.path.realpath(place) for place in (path.parent, image))
    is_within = os.path.commonpath([home, there]) == home
    beside = path.parent / _last(name)
    if not (is_within and image.exists()) and name != _last(name) and beside.is_file() and not beside.is_symlink():
        return beside, [f"{_last(name)} beside the YAML, for {shorten(name)} is not there"]
    if not is_within:
        raise WorldError(
            f"expected image: in the folder of the YAML file, found {shorten(name)}: move the picture there"
        )
    return image, []


def _last(name: str) -> str:
    """Return the last part of a path as Linux or as Windows writes it."""
    return PureWindowsPath(name).name
