"""Chance from streams keyed by (seed, channel, step): the draws of one channel never shift those of another."""

from enum import IntEnum
from functools import lru_cache
from threading import get_ident
from typing import Any

import numpy as np
from jaxtyping import Float

_STEP_BITS = 40
SEED_MAX = 2**64 - 1


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


def standard_normals(seed: int, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
    """Return `count` standard normal draws (count,), the same for the same (seed, channel, step) on any process.

    Raises ValueError for a seed or a step out of range.
    """
    return _generator(seed, channel, step).standard_normal(count)


def uniforms(seed: int, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
    """Return `count` draws (count,) even over [0, 1), the same for the same (seed, channel, step) on any process.

    Raises ValueError for a seed or a step out of range.
    """
    return _generator(seed, channel, step).random(count)


def _generator(seed: int, channel: Channel, step: int) -> np.random.Generator:
    """Return a generator that is counter-based (Philox), at the beginning of its stream.

    A new one asks the system for entropy that it then leaves aside, so one is kept and set back: a tenth of the time.
    """
    if not (0 <= seed <= SEED_MAX and 0 <= step < 2**_STEP_BITS):
        raise ValueError(f"expected 0 <= seed < 2^64 and 0 <= step < 2^{_STEP_BITS}, found seed {seed}, step {step}")
    generator = _kept(get_ident())
    key = np.array([(int(channel) << _STEP_BITS) | step, seed], dtype=np.uint64)
    generator.bit_generator.state = _BEGINNING | {"state": {"counter": _NONE, "key": key}}
    return generator


@lru_cache
def _kept(thread: int) -> np.random.Generator:
    """Return the generator of a thread."""
    return np.random.Generator(np.random.Philox(key=thread))


_NONE = np.zeros(4, dtype=np.uint64)
_BEGINNING: dict[str, Any] = {
    "bit_generator": "Philox", "buffer": _NONE, "buffer_pos": len(_NONE), "has_uint32": 0, "uinteger": 0,
}  # fmt: skip
"""A stream of which nothing was drawn: its buffer of four numbers is used up."""
