"""Maps as pictures: drawn in a paint program, or made by a robot (ROS map_server: an image and its YAML).

In a bare picture dark is wall and light is free, transparency lies on white, and a pixel is 0.05 m unless the caller
says otherwise. A picture with much of grey 205 and of 254 is a robot's map without its YAML: 205 is unknown. Unknown is
solid, for nobody can vouch for it. Beyond the border of the picture all is solid.
"""

import io
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from jaxtyping import Bool, Float
from PIL import Image, UnidentifiedImageError
from skimage.measure import find_contours, label

from .drawing import Drawing, WorldError, numbers, shorten
from .files import read_bytes
from .solid import drop_collinear

PIXEL_M = 0.05
PIXELS_MAX = 40_000_000
SIDE_MAX = 20_000
FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF", "TIFF", "WEBP")
WALL_GREY = 160.0
"""Above the middle, so that a one-pixel line whose antialiasing spreads it over two rows stays a wall."""
UNKNOWN_GREY, FREE_GREY = 205, 254
UNKNOWN_SHARE = 0.05
SPECK_PIXELS = 6
STRAIGHT_PIXELS = 1.0
"""Slanted walls are stairs of pixels: what deviates less than this from straight is straight."""


def read_image(path: Path, scale: float | None = None) -> Drawing:
    """Return the drawing in a bare picture, `scale` metres per pixel (0.05 where None), origin at its lower left."""
    grey = _grey(path)
    mapped = np.mean(grey == UNKNOWN_GREY) > UNKNOWN_SHARE and np.mean(grey >= FREE_GREY) > UNKNOWN_SHARE
    return _trace(grey <= UNKNOWN_GREY if mapped else grey < WALL_GREY, scale or PIXEL_M, np.zeros(3))


def read_ros_map(path: Path, scale: float | None = None) -> Drawing:
    """Return the drawing of a ROS map: a YAML file that names an image next to it, in the map's frame."""
    if scale is not None:
        raise WorldError("expected no scale for a ROS map, whose resolution says it, found one: leave it out")
    document = _yaml(read_bytes(path))
    name = document.get("image")
    if not isinstance(name, str) or not name or "\0" in name:
        raise WorldError(f"expected image: to name a picture, found {shorten(name)}: correct the YAML file")
    image = path.parent / name
    if not image.resolve().is_relative_to(path.parent.resolve()):
        raise WorldError(
            f"expected image: in the folder of the YAML file, found {shorten(name)}: move the picture there"
        )
    resolution = numbers([document.get("resolution")], (1,), "resolution", "0.05")[0]
    if not 0 < resolution <= 10:
        raise WorldError(f"expected a resolution of 0 to 10 m per pixel, found {resolution:g}: correct the YAML file")
    origin = numbers(document.get("origin", [0, 0, 0]), (2, 3), "origin", "[x, y, yaw]")
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
    if document.get("negate", 0) not in (0, 1):
        raise WorldError(f"expected negate 0 or 1, found {shorten(document['negate'])}: correct the YAML file")
    grey = _grey(image)
    chance = grey / 255 if document.get("negate", 0) else 1 - grey / 255
    # The second test keeps grey 205 unknown also under a rounded threshold of 0.25, as map_saver means it.
    solid = chance >= free if mode != "raw" else grey >= 100 * free
    if mode == "trinary":
        solid |= grey == UNKNOWN_GREY
    pose = np.array([origin[0], origin[1], origin[2] if len(origin) > 2 else 0.0])
    return _trace(solid, float(resolution), pose)


def _yaml(data: bytes) -> dict[str, Any]:
    try:
        document = yaml.safe_load(data)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise WorldError(f"expected a ROS map YAML, found {shorten(str(error))}: correct the file") from None
    if not isinstance(document, dict):
        raise WorldError(f"expected a ROS map YAML with image: and resolution:, found {shorten(document)}: correct it")
    return document


def _grey(path: Path) -> Float[np.ndarray, "h w"]:
    """Return a picture's lightness, 0 to 255, transparency on white; raise WorldError where it cannot be read."""
    data = read_bytes(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data), formats=FORMATS)
            width, height = image.size
            if min(width, height) < 2 or max(width, height) > SIDE_MAX or width * height > PIXELS_MAX:
                raise WorldError(
                    f"expected an image of 2 to {SIDE_MAX} pixels a side and at most {PIXELS_MAX / 1e6:g} megapixels,"
                    f" found {width} x {height}: shrink it"
                )
            return _lightness(image)
    except WorldError:
        raise
    except Image.DecompressionBombError:
        raise WorldError(f"expected at most {PIXELS_MAX / 1e6:g} megapixels, found far more: shrink it") from None
    except UnidentifiedImageError:
        raise WorldError(
            f"expected a PNG or PGM image, found another or a broken one: save {path.name} again"
        ) from None
    except Exception as error:
        # Decoders raise whatever a broken file makes them meet; to the user all of it is one bad file.
        raise WorldError(f"expected a PNG or PGM image, found {shorten(str(error))}: save {path.name} again") from None


def _lightness(image: Image.Image) -> Float[np.ndarray, "h w"]:
    if image.mode.startswith("I"):
        values = np.asarray(image).astype(float)
        return np.clip(values / 65535 * 255, 0, 255)
    if image.mode == "F":
        raise WorldError("expected grey or colour pixels, found floating point: save the image as PNG")
    rgba = image.convert("RGBA")
    flat = Image.alpha_composite(Image.new("RGBA", rgba.size, "white"), rgba)
    return np.asarray(flat.convert("L")).astype(float)


def _trace(solid: Bool[np.ndarray, "h w"], metres: float, origin: Float[np.ndarray, "3"]) -> Drawing:
    """Return the outlines of solid pixels as polygons in the frame of the map's origin (x, y, yaw)."""
    height, width = solid.shape
    clusters = label(solid, connectivity=2)  # type: ignore[no-untyped-call]
    keep = np.bincount(clusters.ravel()) >= SPECK_PIXELS
    keep[0] = False
    mask = np.pad(keep[clusters], 1)
    if not mask.any():
        raise WorldError("expected dark walls on a light ground, found no dark line in the image: draw the walls")
    if keep[clusters].all():
        raise WorldError("expected light free space, found only dark or unknown pixels: check the image's greys")
    found = find_contours(mask.astype(float), 0.5, fully_connected="high")  # type: ignore[no-untyped-call]
    rings = [_square(ring[:-1]) for ring in found if len(ring) > 4]
    outlines = [shapely.LinearRing(_to_world(ring, height, metres, origin)) for ring in rings]
    area = shapely.build_area(shapely.geometrycollections(outlines))
    corners = np.array([[-0.5, -0.5], [-0.5, width - 0.5], [height - 0.5, width - 0.5], [height - 0.5, -0.5]]) + 1
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    sheet = shapely.Polygon(_to_world(corners, height, metres, origin))
    return Drawing(solids=tuple(parts), sheet=sheet, simplify_m=STRAIGHT_PIXELS * metres)


def _square(ring: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """Return a ring of pixel outlines (row, column) whose right angles, cut by the tracing, are corners again."""
    ring = drop_collinear(ring)
    after = np.roll(ring, -1, axis=0)
    edge = after - ring
    before, behind = np.roll(edge, 1, axis=0), np.roll(edge, -1, axis=0)
    length = np.abs(edge).sum(axis=1)
    chamfer = (np.abs(np.abs(edge) - 0.5) < 1e-9).all(axis=1) & (np.abs(np.sum(before * behind, axis=1)) < 1e-9)
    chamfer &= (np.roll(length, 1) >= 1) & (np.roll(length, -1) >= 1)
    chamfer &= (np.abs(before).min(axis=1) < 1e-9) & (np.abs(behind).min(axis=1) < 1e-9)
    corner = ring + np.where(np.abs(before) > 1e-9, edge, 0.0)
    squared: Float[np.ndarray, "m 2"] = np.where(chamfer[:, None], corner, ring)[~np.roll(chamfer, 1)]
    return squared


def _to_world(
    pixels: Float[np.ndarray, "n 2"], height: int, metres: float, origin: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n 2"]:
    """Return (row, column) of the padded picture in the world frame, m; the origin is the lower left pixel's corner."""
    x, y = (pixels[:, 1] - 0.5) * metres, (height - pixels[:, 0] + 0.5) * metres
    c, s = math.cos(origin[2]), math.sin(origin[2])
    return np.stack([origin[0] + c * x - s * y, origin[1] + s * x + c * y], axis=1)
