"""The returns of a scan in the order of their bearings, and where the surface breaks off between them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..geometry.compiled import compiled


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
    settling_rounds: int
    open_gate_sigmas: float
    doubt_sigmas: float


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
    beam = np.flatnonzero((ranges_m > rules.noise_sigmas * sigmas_m) & (ranges_m <= farthest_m))
    m = len(beam)
    step = (bearings_rad[-1] - bearings_rad[0]) / (len(bearings_rad) - 1)
    period = len(ranges_m) if is_full_turn else 0
    # Entry i tells whether the surface breaks off between return i-1 and return i; entry 0 is the seam.
    is_break, steepest = np.zeros(m + 1, np.bool_), _steepest(step, rules)
    for i in range(m):
        gap = beam[i] - beam[i - 1] if i else beam[0] + period - beam[-1] if period else rules.gap_beams + 1
        one_m, other_m = ranges_m[beam[i]], ranges_m[beam[i - 1]]
        leap = max(one_m, other_m) - min(one_m, other_m) * steepest[min(gap, rules.gap_beams + 1)]
        is_break[i] = leap > rules.noise_sigmas * max(sigmas_m[beam[i]], sigmas_m[beam[i - 1]])
    found = np.flatnonzero(is_break)
    is_ring = len(found) == 0
    first = 0
    if m > 0:
        first = int(np.argmax(ranges_m[beam])) if is_ring else found[0]
    breaks = np.append(np.zeros(1, np.int64) if is_ring else found - first, m)
    order = np.roll(beam, -first)
    turn = order.copy()
    turn[m - first :] += period
    theta = bearings_rad[order]
    return Returns(
        np.cos(theta), np.sin(theta), ranges_m[order], sigmas_m[order], order, turn, breaks, is_ring, period, step,
        sigma_share,
    )  # fmt: skip


@compiled
def _steepest(step_rad: float, rules: Rules) -> Float[np.ndarray, " g"]:
    """Return the largest ratio of two ranges on one wall by beams between them; 0, that is a break, beyond the gap."""
    ratios = np.sin(rules.grazing_rad + step_rad * np.arange(rules.gap_beams + 2)) / np.sin(rules.grazing_rad)
    ratios[-1] = 0.0
    return ratios


@compiled
def rolled(returns: Returns, first: int) -> Returns:
    """Return the returns of a ring, beginning with the one at position `first`."""
    turn = np.roll(returns.turn, -first)
    turn[len(turn) - first :] += returns.period
    return Returns(
        np.roll(returns.cos, -first), np.roll(returns.sin, -first), np.roll(returns.ranges_m, -first),
        np.roll(returns.sigmas_m, -first), np.roll(returns.beam, -first), turn, returns.breaks, returns.is_ring,
        returns.period, returns.step_rad, returns.sigma_share,
    )  # fmt: skip


@compiled
def positions_of(bearings_rad: Float[np.ndarray, " b"], first_rad: float, returns: Returns) -> Int[np.ndarray, " b"]:
    """Return the number of returns that come before each bearing; `first_rad` is that of the scan's first beam."""
    at = np.empty(len(bearings_rad), np.int64)
    for i in range(len(bearings_rad)):
        beam = ((bearings_rad[i] - first_rad) % (2.0 * np.pi)) / returns.step_rad
        if returns.period:
            beam = (beam - returns.turn[0]) % returns.period + returns.turn[0]
        at[i] = np.searchsorted(returns.turn, beam)
    return at


@compiled
def turned(returns: Returns, at: int, angle: float) -> tuple[float, float]:
    """Return cosine and sine of the bearing `angle` rad past that of the return `at`."""
    c, s = np.cos(angle), np.sin(angle)
    return returns.cos[at] * c - returns.sin[at] * s, returns.sin[at] * c + returns.cos[at] * s


@compiled
def run_of(position: int, returns: Returns) -> int:
    """Return which unbroken run of returns a position is in."""
    return int(np.searchsorted(returns.breaks, position, side="right"))


@compiled
def turn_of(position: int, returns: Returns) -> int:
    """Return the beam index of a return, counted on past the scan's seam."""
    m = len(returns.beam)
    return returns.turn[position % m] + (returns.period * (position // m) if returns.is_ring else 0)
