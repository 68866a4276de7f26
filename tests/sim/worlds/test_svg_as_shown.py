"""What the reader takes for walls is what an independent renderer (resvg) shows as dark."""

import io

import numpy as np
import pytest
import resvg_py
import shapely
from PIL import Image
from scipy.ndimage import binary_dilation, binary_erosion

from chainslam.sim.worlds import WorldError
from chainslam.sim.worlds.readers.svg.reader import read_svg
from chainslam.sim.worlds.rooms import WALL_M
from chainslam.sim.worlds.solid import solid_of
from tests.fuzzing.drawn_svg import drawn_svg, plain

PIXELS = 60
"""A metre: a wall of 0.1 m is broader than what edges may differ by."""
EDGE = 2
"""Pixels: ends and corners of walls are squares, those of strokes are not."""


def shown(data: bytes) -> np.ndarray:
    """Return where a viewer shows something dark."""
    png = resvg_py.svg_to_bytes(
        svg_string=data.decode(), width=10 * PIXELS, height=8 * PIXELS, skip_system_fonts=True, background="white"
    )
    grey = np.asarray(Image.open(io.BytesIO(png)).convert("L"))
    return grey < 0.7 * 255


def read(data: bytes) -> np.ndarray:
    """Return where the reader finds walls."""
    x, y = np.meshgrid((np.arange(10 * PIXELS) + 0.5) / PIXELS, 8 - (np.arange(8 * PIXELS) + 0.5) / PIXELS)
    try:
        solid = solid_of(read_svg(data))
    except WorldError as error:
        if "found none" not in str(error):
            raise
        return np.zeros(x.shape, dtype=bool)
    shapely.prepare(solid)
    return shapely.contains_xy(solid, x, y)


def differing(data: bytes) -> int:
    """Return how many pixels are dark and no wall, beyond the edges, or wall with nothing dark within its width.

    Of a stroke that is hidden in part a viewer shows the rest, and the wall stands whole.
    """
    dark, wall, cross = shown(plain(data)), read(data), np.ones((3, 3))
    missing = binary_erosion(dark & ~wall, iterations=EDGE, structure=cross)
    near = binary_dilation(dark, iterations=round(WALL_M * PIXELS), structure=cross)
    invented = binary_erosion(wall & ~near, iterations=EDGE, structure=cross)
    return int(missing.sum() + invented.sum())


@pytest.mark.parametrize("seed", range(20))
def test_walls_are_what_a_viewer_shows_as_dark(seed):
    assert differing(drawn_svg(np.random.default_rng(seed))) == 0


@pytest.mark.long
def test_walls_are_what_a_viewer_shows_in_a_thousand_drawings():
    assert [seed for seed in range(1000) if differing(drawn_svg(np.random.default_rng(seed)))] == []
