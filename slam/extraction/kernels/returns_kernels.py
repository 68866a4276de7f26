"""The returns of a scan in the order of their bearings, and where the surface breaks off between them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled


class Rules(NamedTuple):
    """The numbers of `ExtractionConfig` that say how a scan becomes segments."""

    noise_sigmas: float
    gap_beams: int
    grazing_rad: float
    scales: Int[np.ndarray, " s"]
    candidate_gain: float
    sure_gain: float
    segment_cost: float
    least_beams: int
    sure_beams: int
    outlier_sigmas: float
    doubt_sigmas: float
    end_share: float


class Returns(NamedTuple):
    """The returns of one scan in counter-clockwise order, rolled so that no straight piece crosses the ends."""

    cos: Float[np.ndarray, " m"]
    """Of the bearing."""
    sin: Float[np.ndarray, " m"]
    ranges_m: Float[np.ndarray, " m"]
    sigmas_m: Float[np.ndarray, " m"]
    """Standard deviation of each range, at the measured range."""
    beam: Int[np.ndarray, " m"]
    """Beam index in the scan."""
    turn: Int[np.ndarray, " m"]
    """Beam index counted on past the scan's seam, hence increasing."""
    breaks: Int[np.ndarray, " b"]
    """Positions between returns where the surface breaks off, from 0 to m; a scan without returns has none."""
    is_ring: bool
    """Whether the surface goes on from the last return to the first."""
    period: int
    """Beams of a full turn; 0 when the scan is not one."""
    step_rad: float
    """Angle between neighbouring beams."""
    sigma_share: float
    """What of the noise grows with the range, as a share of the range."""


@compiled
def returns_of(
    bearings_rad: Float[np.ndarray, " k"],
    ranges_m: Float[np.ndarray, " k"],
    sigmas_m: Float[np.ndarray, " k"],
    sigma_share: float,
    farthest_m: float,
    is_full_turn: bool,
    rules: Rules,
) -> Returns:
    """Return the returns and their breaks, rolled to begin after a break, or at the farthest in a closed room."""
    m, beam = 0, np.empty(len(ranges_m), np.int64)
    for i in range(len(ranges_m)):
        if rules.noise_sigmas * sigmas_m[i] < ranges_m[i] <= farthest_m:
            beam[m] = i
            m += 1
    step = (bearings_rad[-1] - bearings_rad[0]) / (len(bearings_rad) - 1)
    period = len(ranges_m) if is_full_turn else 0
    steepest = _steepest(step, rules)
    # Break i tells that the surface breaks off between return i-1 and return i; 0 is the seam.
    count, breaks, farthest = 0, np.empty(m + 2, np.int64), 0
    for i in range(m):
        before = (i - 1) % m
        gap = beam[i] - beam[before] if i else beam[0] + period - beam[before] if period else rules.gap_beams + 1
        one_m, other_m = ranges_m[beam[i]], ranges_m[beam[before]]
        leap = max(one_m, other_m) - min(one_m, other_m) * steepest[min(gap, rules.gap_beams + 1)]
        if leap > rules.noise_sigmas * max(sigmas_m[beam[i]], sigmas_m[beam[before]]):
            breaks[count] = i
            count += 1
        if one_m > ranges_m[beam[farthest]]:
            farthest = i
    is_ring = count == 0
    first = farthest if is_ring else breaks[0]
    for k in range(count):
        breaks[k] -= first
    count = max(count, 1)
    breaks[0], breaks[count] = 0, m
    cos, sin, ranges, sigmas = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    for i in range(m):
        cos[i], sin[i] = np.cos(bearings_rad[beam[i]]), np.sin(bearings_rad[beam[i]])
        ranges[i], sigmas[i] = ranges_m[beam[i]], sigmas_m[beam[i]]
    returns = Returns(
        cos, sin, ranges, sigmas, beam[:m], beam[:m], breaks[: count + 1], is_ring, period, step, sigma_share
    )
    return rolled(returns, first)


@compiled
def _steepest(step_rad: float, rules: Rules) -> Float[np.ndarray, " g"]:
    """Return the largest ratio of two ranges on one wall by beams between them; 0, that is a break, beyond the gap."""
    ratios = np.zeros(rules.gap_beams + 2)
    for gap in range(rules.gap_beams + 1):
        ratios[gap] = np.sin(rules.grazing_rad + step_rad * gap) / np.sin(rules.grazing_rad)
    return ratios


@compiled
def rolled(returns: Returns, first: int) -> Returns:
    """Return the returns of a ring, beginning with the one at position `first`."""
    m = len(returns.beam)
    cos, sin, ranges, sigmas = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    beam, turn = np.empty(m, np.int64), np.empty(m, np.int64)
    for i in range(m):
        at = (i + first) % m
        cos[i], sin[i], ranges[i], sigmas[i] = (
            returns.cos[at],
            returns.sin[at],
            returns.ranges_m[at],
            returns.sigmas_m[at],
        )
        beam[i], turn[i] = returns.beam[at], returns.turn[at] + (returns.period if at < first else 0)
    return Returns(
        cos, sin, ranges, sigmas, beam, turn, returns.breaks, returns.is_ring, returns.period, returns.step_rad,
        returns.sigma_share,
    )  # fmt: skip


@compiled
def count_below(values: Int[np.ndarray, " m"], limit: float) -> int:
    """Return how many of some increasing values are below a limit."""
    low, high = 0, len(values)
    while low < high:
        middle = (low + high) // 2
        if values[middle] < limit:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def turned(returns: Returns, at: int, angle: float) -> tuple[float, float]:
    """Return cosine and sine of the bearing `angle` rad past that of the return `at`."""
    c, s = np.cos(angle), np.sin(angle)
    return returns.cos[at] * c - returns.sin[at] * s, returns.sin[at] * c + returns.cos[at] * s


@compiled
def run_of(position: int, returns: Returns) -> int:
    """Return which unbroken run of returns a position is in."""
    return count_below(returns.breaks, position + 0.5)


@compiled
def turn_of(position: int, returns: Returns) -> int:
    """Return the beam index of a return, counted on past the scan's seam."""
    m = len(returns.beam)
    return returns.turn[position % m] + (returns.period * (position // m) if returns.is_ring else 0)
