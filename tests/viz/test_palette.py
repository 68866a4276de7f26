"""Colours are told apart with any colour vision: Machado, Oliveira and Fernandes (2009), distances in OKLab."""

import itertools

import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS
from chainslam.viz import palette

OKABE_ITO = ("#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7")
VISIONS = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
LMS = [
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
]
LAB = [
    [0.2104542553, 0.7936177850, -0.0040720468],
    [1.9779984951, -2.4285922050, 0.4505937099],
    [0.0259040371, 0.7827717662, -0.8086757660],
]


def linear(colour):
    channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)


def oklab(rgb):
    return np.array(LAB) @ np.cbrt(np.array(LMS) @ np.clip(rgb, 0, 1))


def nearest(colours, vision):
    seen = [oklab(np.array(VISIONS[vision]) @ linear(colour)) for colour in colours]
    return min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2))


@pytest.mark.parametrize("vision", VISIONS)
def test_back_ends_are_told_apart_as_well_as_okabe_and_itos_colours(vision):
    assert nearest(palette.BACKEND_COLOURS, vision) >= nearest(OKABE_ITO, vision)


def test_every_back_end_has_a_colour_of_its_own_that_stands_out_from_the_page():
    colours = [palette.of_backend(name) for name in BACKENDS]
    assert len(set(colours)) == len(colours)
    assert all(oklab(linear(palette.PAGE))[0] - oklab(linear(colour))[0] > 0.2 for colour in colours)
