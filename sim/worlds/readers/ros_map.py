"""Maps made by a robot, as ROS map_server keeps them: an image, and a YAML file that says what its greys mean."""

import os.path
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..drawing import Drawing, WorldError, numbers, shorten
from ..options import DrawingOptions
from ..text import printable
from .files import read_bytes
from .plain_yaml import plain_mapping
from .raster import UNKNOWN_GREY, outlines, read_grey


def read_ros_map(path: Path, options: DrawingOptions = DrawingOptions()) -> Drawing:
    """Return the drawing of a ROS map: a YAML file that names an image next to it, in the map's frame."""
    options.check_only((), "a ROS map, whose YAML says it")
    document = plain_mapping(read_bytes(path))
    image = _image_beside(path, document.get("image"))
    resolution = numbers([document.get("resolution")], (1,), "resolution", "0.05")[0]
    if not 0 < resolution <= 10:
        raise WorldError(f"expected a resolution of 0 to 10 m per pixel, found {resolution:g}: correct the YAML file")
    origin = numbers(document.get("origin", [0.0, 0.0, 0.0]), (2, 3), "origin", "[x, y, yaw]")
    occupied, free = (
        numbers([document.get(key, default)], (1,), key, str(default))[0]
        for key, default in (("occupied_thresh", 0.65), ("free_thresh", 0.196))
    )
    if not 0 <= free <= occupied <= 1:
        raise WorldError(
            f"expected 0 <= free_thresh <= occupied_thresh <= 1, found {free:g}, {occupied:g}: correct them"
        )
    mode = document.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise WorldError(f"expected mode trinary, scale or raw, found {shorten(mode)}: correct the YAML file")
    negate = document.get("negate", 0.0)
    if negate not in (0.0, 1.0):
        raise WorldError(f"expected negate 0 or 1, found {shorten(negate)}: correct the YAML file")
    # Greys are 256 values: what each of them means is looked up, pixel by pixel, without another picture in floats.
    grey = np.arange(256)
    chance = grey / 255 if negate else 1 - grey / 255
    # The second test keeps grey 205 unknown also under a rounded threshold of 0.25, as map_saver means it.
    solid = chance >= free if mode != "raw" else grey >= 100 * free
    if mode == "trinary":
        solid |= grey == UNKNOWN_GREY
    pose = np.array([origin[0], origin[1], origin[2] if len(origin) > 2 else 0.0])
    drawing = outlines(solid[read_grey(image)], float(resolution), pose)
    words = "occupied and unknown pixels as walls"
    return replace(drawing, understood=words, scale=f"{resolution:g} m a pixel, as the file says")


def _image_beside(path: Path, name: object) -> Path:
    """Return the picture that a YAML file names, which lies in its folder or below."""
    if not isinstance(name, str) or not name or name != printable(name):
        raise WorldError(f"expected image: to name a picture, found {shorten(name)}: correct the YAML file")
    image = path.parent / name
    home, there = (os.path.realpath(place) for place in (path.parent, image))
    if os.path.commonpath([home, there]) != home:
        raise WorldError(
            f"expected image: in the folder of the YAML file, found {shorten(name)}: move the picture there"
        )
    return image
