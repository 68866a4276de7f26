"""Chance from streams keyed by (the world's content, seed, channel, step): no stream shifts or repeats another's draws.

Back ends and strategies in one world on one seed meet the same draws; two worlds on one seed meet different ones.
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
"""What lies closer together than this is the same content: readers of two formats round differently below it."""


class Channel(IntEnum):
    """What a stream of random numbers is for."""

    WHEELS = 1
    LASER = 2
    START = 3
    """The error of the pose that the estimate starts from."""
    ORACLE = 4
    """Noise of lines that an oracle extracts."""
    DROPOUTS = 5
    MIXED = 6
    BUMPS = 7
    MOVING = 8
    """Which scans are taken while the robot still drives."""
    PEOPLE = 9
    """Where people stand at first, and where they turn to."""


@dataclass(frozen=True)
class Chance:
    """All streams of one seed in one world."""

    seed: int
    world_key: int
    """What `world_key` returns for the world."""

    def standard_normals(self, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
        """Return `count` standard normal draws (count,), the same for the same stream on any process.

        Raises ValueError for a seed or a step out of range.
        """
        return self._stream(channel, step).standard_normal(count)

    def uniforms(self, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
        """Return `count` draws (count,) even over [0, 1), the same for the same stream on any process.

        Raises ValueError for a seed or a step out of range.
        """
        return self._stream(channel, step).random(count)

    def _stream(self, channel: Channel, step: int) -> np.random.Generator:
        """Return a generator that is counter-based (Philox), at the beginning of its stream.

        World and seed are its key, channel and step the upper word of its counter: no two streams meet. A new one
        asks the system for entropy that it then leaves aside, so one is kept and set back: a tenth of the time.
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
    """Return the generator of a thread."""
    return np.random.Generator(np.random.Philox(key=thread))


_NONE = np.zeros(4, dtype=np.uint64)
_BEGINNING: dict[str, Any] = {
    "bit_generator": "Philox", "buffer": _NONE, "buffer_pos": len(_NONE), "has_uint32": 0, "uinteger": 0,
}  # fmt: skip
"""A stream of which nothing was drawn: its buffer of four numbers is used up."""
