"""Chance from streams keyed by (seed, channel, step): the draws of one channel never shift those of another."""

from enum import IntEnum

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


def standard_normals(seed: int, channel: Channel, step: int, count: int) -> Float[np.ndarray, " count"]:
    """Return `count` standard normal draws (count,), the same for the same (seed, channel, step) on any process.

    A counter-based generator (Philox) needs no warming up, so a fresh one per step costs about 10 microseconds.
    Raises ValueError for a seed or a step out of range.
    """
    if not (0 <= seed <= SEED_MAX and 0 <= step < 2**_STEP_BITS):
        raise ValueError(f"expected 0 <= seed < 2^64 and 0 <= step < 2^{_STEP_BITS}, found seed {seed}, step {step}")
    key = (seed << 64) | (int(channel) << _STEP_BITS) | step
    return np.random.Generator(np.random.Philox(key=key)).standard_normal(count)
