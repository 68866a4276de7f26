"""Random numbers from streams keyed by world content, seed, channel and step, so that draws of one never affect
another.

All back ends and strategies meet the same draws in one world with one seed; other worlds have other draws.
"""

import hashlib
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from threading import get_ident
from typing import Any

import numpy as np
from jaxtyping import Float

_STEP_BITS = 40
SEED_MAX = 2**64 - 1
GRID_M = 1e-6
"""Coordinates closer than this count as equal: readers of two formats round differently below it."""


class Channel(IntEnum):
    """The purpose of a stream of random numbers."""

    WHEELS = 1
    LASER = 2
    START = 3
    """Error of the initial pose estimate."""
    ORACLE = 4
    """Noise of lines that an oracle extracts."""
    DROPOUTS = 5
    MIXED = 6
    BUMPS = 7
    MOVING = 8
    """Which scans are taken while the robot is still driving."""
    PEOPLE = 9
    """Where people start, and where they turn to."""


@dataclass(frozen=True)
class Chance:
    """All random streams of one seed in one world."""

    seed: int
    world_key: int
    """Result of `world_key` for the world."""

    def standard_normals(self, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
        """Return `count` standard normal draws (count,), identical in every process.

        Raises ValueError for a seed or a step out of range.
        """
        return self._stream(channel, step).standard_normal(count)

    def uniforms(self, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
        """Return `count` uniform draws (count,) in [0, 1), identical in every process.

        Raises ValueError for a seed or a step out of range.
        """
        return self._stream(channel, step).random(count)

    def _stream(self, channel: Channel, step: int) -> np.random.Generator:
        """Return a counter-based generator (Philox) at the beginning of its stream.

        World and seed are its key, channel and step the upper word of its counter, so that streams never overlap.
        Creating a generator asks the system for entropy that is not used; one is therefore kept and reset, which takes
        a tenth of the time.
        """
        if not (0 <= self.seed <= SEED_MAX and 0 <= step < 2**_STEP_BITS):
            raise ValueError(
                f"expected 0 <= seed < 2^64 and 0 <= step < 2^{_STEP_BITS}, found seed {self.seed}, step {step}"
            )
        generator = _kept(get_ident())
        counter = np.array([0, 0, 0, (int(channel) << _STEP_BITS) | step], dtype=np.uint64)
        key = np.array([self.world_key, self.seed], dtype=np.uint64)
        generator.bit_generator.state = _BEGINNING | {"state": {"counter": counter, "key": key}}
        return generator


def world_key(faces: Float[np.ndarray, "n 2 2"], start: Float[np.ndarray, "3"]) -> int:
    """Return a number below 2^64 for what a simulated robot meets: the set of directed faces m, and the start m m rad.

    Neither the world's name, nor its file, nor the order of its faces matters. Numbers are taken to `GRID_M`; the key
    is BLAKE2b over them as little-endian 64-bit integers, the start first, then the faces in lexical order.
    """
    on_grid = np.rint(np.asarray(faces, dtype=np.float64).reshape(-1, 4) / GRID_M).astype("<i8")
    ordered = on_grid[np.lexsort(on_grid.T[::-1])]
    begin = np.rint(np.asarray(start, dtype=np.float64) / GRID_M).astype("<i8")
    digest = hashlib.blake2b(begin.tobytes() + ordered.tobytes(), digest_size=8)
    return int.from_bytes(digest.digest(), "little")


@lru_cache
def _kept(thread: int) -> np.random.Generator:
    """Return the generator of the thread."""
    return np.random.Generator(np.random.Philox(key=thread))


_NONE = np.zeros(4, dtype=np.uint64)
_BEGINNING: dict[str, Any] = {
    "bit_generator": "Philox", "buffer": _NONE, "buffer_pos": len(_NONE), "has_uint32": 0, "uinteger": 0,
}  # fmt: skip
"""State of a fresh stream: its buffer of four numbers is used up."""
