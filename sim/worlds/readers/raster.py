"""Maps as pictures: drawn in a paint program, or made by a robot.

In a bare picture dark is wall and light is free, transparency lies on white, and a pixel is 0.05 m unless the caller
says otherwise. A picture with much of grey 205 and of 254 is a robot's map without its YAML: 205 is unknown. Unknown is
solid, for nobody can vouch for it. Beyond the border of the picture all is solid.
"""

import io
import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int, UInt8
from PIL import Image, UnidentifiedImageError
from skimage.measure import find_contours, label

from ..drawing import Drawing, WorldError, shorten
from ..options import DrawingOptions
from ..solid import drop_collinear
from .files import read_bytes

PIXEL_M = 0.05
PIXELS_MAX = 40_000_000
SIDE_MAX = 20_000
EDGES_MAX = 1_000_000
"""Sides of pixels between wall and free floor: 50 km of them at 0.05 m; noise and patterns have more."""
FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF", "TIFF", "WEBP")
WALL_GREY = 160
"""Above the middle, so that a one-pixel line whose antialiasing spreads it over two rows stays a wall."""
UNKNOWN_GREY, FREE_GREY = 205, 254
UNKNOWN_SHARE = 0.05
SPECK_PIXELS = 6
STRAIGHT_PIXELS = 1.0
"""Slanted walls are stairs of pixels: what deviates less than this from straight is straight."""
STRIP_PIXELS = 4_000_000
"""Pictures are converted in strips of rows of about this size, to hold one copy of a large one and not four."""


def read_image(path: Path, options: DrawingOptions = DrawingOptions()) -> Drawing:
    """Return the drawing in a bare picture, `scale` metres per pixel (0.05 where None), origin at its lower left."""
    scale = options.scale
    grey = read_grey(path)
    mapped = np.mean(grey == UNKNOWN_GREY) > UNKNOWN_SHARE and np.mean(grey >= FREE_GREY) > UNKNOWN_SHARE
    said = "given" if scale else "assumed (--scale METRES says another)"
    words = "dark pixels and unknown ones as walls" if mapped else "dark pixels as walls"
    drawing = outlines(grey <= UNKNOWN_GREY if mapped else grey < WALL_GREY, scale or PIXEL_M, np.zeros(3))
    return replace(drawing, understood=words, scale=f"{scale or PIXEL_M:g} m a pixel, {said}")


def read_grey(path: Path) -> UInt8[np.ndarray, "h w"]:
    """Return a picture's lightness, transparency on white; raise WorldError where it cannot be read."""
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


def _lightness(image: Image.Image) -> UInt8[np.ndarray, "h w"]:
    if image.mode == "F":
        raise WorldError("expected grey or colour pixels, found floating point: save the image as PNG")
    if image.mode.startswith("I"):
        return (np.clip(np.asarray(image), 0, 65535) >> 8).astype(np.uint8)
    width, height = image.size
    rows = max(STRIP_PIXELS // width, 1)
    strips = [image.crop((0, top, width, min(top + rows, height))) for top in range(0, height, rows)]
    return np.concatenate([_strip_lightness(strip) for strip in strips])


def _strip_lightness(strip: Image.Image) -> UInt8[np.ndarray, "h w"]:
    if strip.mode not in ("1", "L") or "transparency" in strip.info:
        rgba = strip.convert("RGBA")
        strip = Image.alpha_composite(Image.new("RGBA", rgba.size, "white"), rgba)
    return np.asarray(strip.convert("L"))


def outlines(solid: Bool[np.ndarray, "h w"], metres: float, origin: Float[np.ndarray, "3"]) -> Drawing:
    """Return the outlines of solid pixels as polygons in the frame of the map's origin (x, y, yaw).

    Raises WorldError where there is no wall, no free floor, or so much outline that this is no plan of a building.
    """
    height = len(solid)
    solid, corner = _about_the_free(solid)
    kept = _without_specks(solid)
    if not kept.any():
        raise WorldError("expected dark walls on a light ground, found no dark line in the image: draw the walls")
    edges = sum(int(np.count_nonzero(np.diff(kept, axis=axis))) for axis in (0, 1))
    if edges > EDGES_MAX:
        raise WorldError(
            f"expected at most {EDGES_MAX} sides of pixels between wall and free floor, found {edges}: this is noise"
            " or a pattern; smooth the picture, or shrink it"
        )
    found = find_contours(np.pad(kept, 1), 0.5, fully_connected="high")  # type: ignore[no-untyped-call]
    rings = [_square(ring[:-1]) for ring in found if len(ring) > 4]
    moved = [_to_world(ring + corner, height, metres, origin) for ring in rings]
    area = shapely.build_area(shapely.geometrycollections([shapely.LinearRing(ring) for ring in moved]))
    corners = 0.5 + np.array([(0, 0), (0, kept.shape[1]), kept.shape, (kept.shape[0], 0)])
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    sheet = shapely.Polygon(_to_world(corners + corner, height, metres, origin))
    return Drawing(solids=tuple(parts), sheet=sheet, simplify_m=STRAIGHT_PIXELS * metres)


def _about_the_free(solid: Bool[np.ndarray, "h w"]) -> tuple[Bool[np.ndarray, "i j"], Int[np.ndarray, "2"]]:
    """Return the part of a picture around its free pixels, a solid pixel about it, and where it begins.

    A robot's map is mostly unknown: what lies about the floor is solid, however much of it there is.
    """
    spans = []
    for axis in (1, 0):
        free = np.flatnonzero(~solid.all(axis=axis))
        if not len(free):
            raise WorldError("expected light free space, found only dark or unknown pixels: check the image's greys")
        spans.append((max(int(free[0]) - 1, 0), int(free[-1]) + 2))
    (top, bottom), (left, right) = spans
    return solid[top:bottom, left:right], np.array([top, left])


def _without_specks(solid: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Return the solid pixels without clusters too small to be a thing that stands there."""
    clusters = label(solid, connectivity=2)  # type: ignore[no-untyped-call]
    count = int(clusters.max()) + 1
    sizes = np.zeros(count, dtype=np.int64)
    for strip in np.array_split(clusters, clusters.size // STRIP_PIXELS + 1):
        sizes += np.bincount(strip.ravel(), minlength=count)
    keep = sizes >= SPECK_PIXELS
    keep[0] = False
    kept: Bool[np.ndarray, "h w"] = keep[clusters]
    return kept


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
