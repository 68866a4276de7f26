"""The palette in Rerun's colour format."""

import numpy as np
from jaxtyping import Int, UInt32

from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from .. import palette


def packed(colour: str) -> int:
    """Return "#RRGGBB" as the number 0xRRGGBBAA, opaque: the viewer does not blend lines."""
    return int(colour[1:], 16) << 8 | 255


def pale(colours: UInt32[np.ndarray, " k"]) -> UInt32[np.ndarray, " k"]:
    """Return packed colours mixed with three parts of white."""
    channels = colours[:, None] >> np.array([24, 16, 8], dtype=np.uint32) & np.uint32(255)
    red, green, blue = ((channels + 3 * 255) // 4).T
    return red << np.uint32(24) | green << np.uint32(16) | blue << np.uint32(8) | np.uint32(255)


_CLOSED = np.array([packed(colour) for colour in palette.CLOSED], dtype=np.uint32)
_OPEN = np.array([packed(colour) for colour in palette.OPEN_SHADES], dtype=np.uint32)
_TENTATIVE, _CROOKED = packed(palette.TENTATIVE), packed(palette.CROOKED)


class WallColours:
    """Red for a wall with lack of fit, otherwise a colour for each chain: warm while it is open, cool once it is
    closed.

    A chain keeps its colour as long as its oldest wall.
    """

    def __init__(self) -> None:
        self._turn: dict[int, int] = {}
        self._key: object = None
        self._colours: UInt32[np.ndarray, " n"] = np.zeros(0, dtype=np.uint32)
        self._ids: Int[np.ndarray, " n"] = np.zeros(0, dtype=np.int64)

    def of_walls(self, walls: StochasticMap, chains: tuple[Chain, ...]) -> UInt32[np.ndarray, " n"]:
        """Return the colour of each wall; grey for walls in no chain."""
        return np.where(walls.crooked, np.uint32(_CROOKED), self._of_chains(walls.ids, chains))

    def _of_chains(self, ids: Int[np.ndarray, " n"], chains: tuple[Chain, ...]) -> UInt32[np.ndarray, " n"]:
        key = [(chain.walls, chain.is_closed) for chain in chains]
        if key == self._key and np.array_equal(ids, self._ids):
            return self._colours
        colours = np.full(len(ids), _TENTATIVE, dtype=np.uint32)
        for walls, is_closed in key:
            turn = self._turn.setdefault(min(walls), len(self._turn))
            shades = _CLOSED if is_closed else _OPEN
            colours[np.searchsorted(ids, walls)] = shades[turn % len(shades)]
        self._key, self._ids, self._colours = key, ids.copy(), colours
        return colours
