"""Maps as pictures, drawn in a paint program or made by a robot.

In a plain picture dark is wall and light is free, and a pixel is 0.05 m unless the caller gives a scale. Transparent
pixels are unknown if other pixels are light, and background if there are only dark ones. A picture with much of grey
205 and 254 is treated as a robot's map without its YAML file: 205 is unknown. Unknown pixels are solid, since nothing
is known about them, and so is everything outside of the picture.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from ..drawing import Drawing
from ..options import AS_DRAWN, DrawingOptions
from .outlines import outlines
from .picture import Picture, read_picture
from .ros_map import UNKNOWN_GREY, map_beside, read_ros_map

PIXEL_M = 0.05
WALL_GREY = 160
"""Above the middle, so that a one-pixel line whose antialiasing spreads it over two rows stays a wall."""
FREE_GREY = 254
UNKNOWN_SHARE = 0.05
CLEAR = 128
"""Of 255: less than half of a pixel is there."""


def read_image(path: Path, options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing in a picture, its scale in metres per pixel (0.05 where None), origin at its lower left.

    A ROS map's YAML file beside it that names this picture is read instead, unless the caller says something else.
    """
    options.check_only(("scale", "threshold", "negate"), "a picture")
    beside = map_beside(path) if options == AS_DRAWN else None
    if beside is not None:
        drawing = read_ros_map(beside)
        return replace(drawing, notes=(f"read with {beside.name} beside it (--scale ignores that)", *drawing.notes))
    picture = read_picture(path, turns=True)
    metres = options.scale or PIXEL_M
    said = "given" if options.scale else "assumed (--scale METRES says another)"
    solid, words, notes = _walls(picture, options)
    drawing = outlines(solid, metres, np.zeros(3))
    return replace(drawing, understood=words, scale=f"{metres:g} m a pixel, {said}", notes=tuple(notes))


def _walls(picture: Picture, options: DrawingOptions) -> tuple[Bool[np.ndarray, "h w"], str, list[str]]:
    """Return the solid pixels of a bare picture, what was taken for a wall, and what else was done, in words."""
    grey = picture.grey
    notes = ["rotated according to its EXIF orientation"] if picture.is_turned else []
    if options.negate:
        grey = (
            255 - grey if picture.alpha is None else np.where(picture.alpha < CLEAR, 255, 255 - grey).astype(np.uint8)
        )
    mapped = np.mean(grey == UNKNOWN_GREY) > UNKNOWN_SHARE and np.mean(grey >= FREE_GREY) > UNKNOWN_SHARE
    mapped = bool(mapped) and options.threshold is None
    least = WALL_GREY if options.threshold is None else 255 * options.threshold
    solid: Bool[np.ndarray, "h w"] = grey <= UNKNOWN_GREY if mapped else grey < least
    if picture.is_jpeg:
        notes.append("JPEG blurs greys: edges are rough, and unknown cells of a robot's map are lost")
    if picture.alpha is not None:
        clear = picture.alpha < CLEAR
        # Ink on a clear sheet has no other paper; where some is white, what is clear was never seen.
        if np.mean(~clear & ~solid) > UNKNOWN_SHARE:
            solid = solid | clear
            notes.append("transparent pixels are unknown, and as walls")
    words = "dark pixels and unknown ones as walls" if mapped else "dark pixels as walls"
    return solid, words.replace("dark", "light") if options.negate else words, notes
