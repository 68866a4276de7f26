"""Pictures as grey pixels, and how much of each shows through."""

import io
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageOps, UnidentifiedImageError

from ..drawing import WorldError, shorten
from .files import read_bytes

PIXELS_MAX = 40_000_000
SIDE_MAX = 20_000
FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF", "TIFF", "WEBP")
STRIP_PIXELS = 4_000_000
"""Pictures are converted in strips of rows of about this size, to hold one copy of a large one and not four."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as far as a map needs it."""

    grey: UInt8[np.ndarray, "h w"]
    """Lightness, on white where something shows through."""
    alpha: UInt8[np.ndarray, "h w"] | None
    """255 where nothing shows through; None where nothing does anywhere."""
    is_jpeg: bool
    is_turned: bool = False
    """Whether it was turned as a camera noted it."""


def read_picture(path: Path, turns: bool = False) -> Picture:
    """Return a picture, turned as it is to be shown if `turns` is set; raise WorldError where it cannot be read."""
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
            is_jpeg = image.format == "JPEG"
            is_turned = turns and image.getexif().get(0x0112, 1) not in (0, 1)
            return Picture(*_converted(ImageOps.exif_transpose(image) if is_turned else image), is_jpeg, is_turned)
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


def _converted(image: Image.Image) -> tuple[UInt8[np.ndarray, "h w"], UInt8[np.ndarray, "h w"] | None]:
    if image.mode == "F":
        raise WorldError("expected grey or colour pixels, found floating point: save the image as PNG")
    if image.mode.startswith("I"):
        return (np.clip(np.asarray(image), 0, 65535) >> 8).astype(np.uint8), None
    width, height = image.size
    rows = max(STRIP_PIXELS // width, 1)
    strips = [image.crop((0, top, width, min(top + rows, height))) for top in range(0, height, rows)]
    is_clear = image.has_transparency_data
    grey, alpha = zip(*(_strip(strip, is_clear) for strip in strips), strict=True)
    shown = np.concatenate(alpha) if is_clear else np.array(255)
    return np.concatenate(grey), None if np.all(shown == 255) else shown


def _strip(strip: Image.Image, is_clear: bool) -> tuple[UInt8[np.ndarray, "h w"], UInt8[np.ndarray, "h w"] | None]:
    alpha = None
    if strip.mode not in ("1", "L") or is_clear:
        rgba = strip.convert("RGBA")
        alpha = np.asarray(rgba.getchannel("A")) if is_clear else alpha
        strip = Image.alpha_composite(Image.new("RGBA", rgba.size, "white"), rgba)
    return np.asarray(strip.convert("L")), alpha
