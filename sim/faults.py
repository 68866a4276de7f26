"""What is true of a simulated robot beyond what it states: beams that get lost, bumps, wheels that slip more.

Only `sim/` reads these. Each has a channel of chance of its own, so that one fault shifts no draw of another.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.geometry.poses import inverse, to_world
from chainslam.slam.geometry.quantities import (
    Angle,
    Body,
    Count,
    Distance,
    Factor,
    Heading,
    Number,
    Offset,
    Share,
    Times,
)

from .chance import Chance, Channel
from .drive import Slip
from .people import PeopleConfig

NEVER = 2**31
MOMENTS = 32
"""The beams of a scan in motion are taken from so many places on its way."""


@dataclass(frozen=True)
class FaultsConfig:
    """Faults of the simulated robot that the software is not told about; by default there are none."""

    dropout: Share = 0.0
    """Share of the beams that return nothing (+inf), whatever is in front of them."""
    clump: Count = 1
    """Number of neighbouring beams that drop out together."""
    mixed: Share = 0.0
    """Share of the beams at a range discontinuity that return a range between its two surfaces (mixed pixels)."""
    edge_m: Distance = 0.2
    """Difference between neighbouring true ranges above which there is a discontinuity for `mixed`."""
    bump: Share = 0.0
    """Share of the drives in which a bump turns the robot by `bump_rad`, with equal probability to either side."""
    bump_rad: Heading = float(np.deg2rad(8.0))
    """Turn caused by a bump, which the wheels do not report."""
    moving: Share = 0.0
    """Share of the scans that are taken during the last part of a drive instead of after it, without correction."""
    slip: Times = 1.0
    """Factor on the stated wheel slip."""
    scanner_ahead_m: Offset = 0.0
    """How far ahead of its stated position the scanner really is."""
    scanner_left_m: Offset = 0.0
    """How far to the left of its stated position the scanner really is."""
    scanner_turned_rad: Heading = 0.0
    """How far the scanner is really turned from its stated direction, counter-clockwise."""
    range_bias_m: Offset = 0.0
    """Constant error added to each range."""
    range_scale: Factor = 1.0
    """Factor on each range."""
    resolution_m: Distance = 0.0
    """Resolution of the ranges that the scanner does not state; 0 for none."""
    mirrored: bool = False
    """Report the beams in reverse order, so that left and right are exchanged."""
    frozen_from: Number = NEVER
    """Index of the scan from which on the scanner repeats the scan before it; the default is never."""
    late: Number = 0
    """Number of steps by which each scan is delayed."""
    stuck_from: Number = NEVER
    """Index of the drive from which on the wheels turn and report motion while the robot stands still; the default is
    never."""
    posts: Number = 0
    """Number of posts of the robot's own body that stand evenly around the scanner and hide part of its view."""
    post_m: Body = 0.15
    """Distance of the robot's own posts from the scanner."""
    post_rad: Angle = float(np.deg2rad(8.0))
    """Angle that each of the robot's own posts hides."""
    people: PeopleConfig = field(default_factory=PeopleConfig)


def with_mixed_pixels(
    ranges: Float[np.ndarray, " k"], config: FaultsConfig, is_full_turn: bool, chance: Chance, step: int
) -> tuple[Float[np.ndarray, " k"], Bool[np.ndarray, " k"]]:
    """Return exact ranges (k,) m with some of the beams at edges between both surfaces, evenly drawn, and which."""
    if config.mixed <= 0.0:
        return ranges, np.zeros(len(ranges), dtype=bool)
    after = np.roll(ranges, -1)
    if not is_full_turn:
        after[-1] = ranges[-1]
    both = np.isfinite(ranges) & np.isfinite(after)
    leap = np.where(both, after, 0.0) - np.where(both, ranges, 0.0)
    at_edge = np.abs(leap) > config.edge_m
    draws = chance.uniforms(Channel.MIXED, step, 2 * len(ranges)).reshape(2, -1)
    taken = at_edge & (draws[0] < config.mixed)
    between = ranges.copy()
    between[taken] += draws[1, taken] * leap[taken]
    return between, taken


def with_dropouts(
    ranges: Float[np.ndarray, " k"], config: FaultsConfig, chance: Chance, step: int
) -> Float[np.ndarray, " k"]:
    """Return measured ranges (k,) m, +inf at the beams that were lost, one by one or in runs of `clump`.

    Runs begin anywhere and may overlap; a beam is lost with probability `dropout` whatever the length of a run.
    """
    if config.dropout <= 0.0:
        return ranges
    begins = 1.0 - (1.0 - config.dropout) ** (1.0 / config.clump)
    lost = chance.uniforms(Channel.DROPOUTS, step, len(ranges)) < begins
    lost = np.any([np.roll(lost, k) for k in range(config.clump)], axis=0)
    return np.where(lost, np.inf, ranges)


def with_posts(
    ranges: Float[np.ndarray, " k"], bearings_rad: Float[np.ndarray, " k"], config: FaultsConfig
) -> Float[np.ndarray, " k"]:
    """Return exact ranges (k,) m with those at the robot's own posts cut short; the first straight ahead."""
    if config.posts <= 0:
        return ranges
    apart = 2.0 * np.pi / config.posts
    off = np.abs((bearings_rad + 0.5 * apart) % apart - 0.5 * apart)
    return np.where(off <= 0.5 * config.post_rad, np.minimum(ranges, config.post_m), ranges)


def misread(
    ranges: Float[np.ndarray, " k"], config: FaultsConfig, range_max_m: float, stated_m: float = 0.0
) -> Float[np.ndarray, " k"]:
    """Return measured ranges (k,) m as a scanner with a bias, a scale and a resolution tells them.

    `stated_m` is the resolution that it states, if it has not a coarser one.
    """
    resolution_m = max(stated_m, config.resolution_m)
    if config.range_scale == 1.0 and config.range_bias_m == resolution_m == 0.0:
        return ranges
    told = config.range_scale * ranges + config.range_bias_m
    if resolution_m > 0.0:
        told = resolution_m * np.round(told / resolution_m)
    return np.where(told > range_max_m, np.inf, np.where(told > 0.0, told, np.nan))


def slipped(slip: Slip, config: FaultsConfig) -> Slip:
    """Return the slip that really happens."""
    if config.slip == 1.0:
        return slip
    return replace(
        slip,
        left_m=config.slip * slip.left_m,
        right_m=config.slip * slip.right_m,
        lateral_m=config.slip * slip.lateral_m,
    )


def bump_rad(config: FaultsConfig, chance: Chance, step: int) -> float:
    """Return by how much a bump turns the robot after a drive, rad; 0 for most."""
    if config.bump <= 0.0:
        return 0.0
    share, side = chance.uniforms(Channel.BUMPS, step, 2)
    return 0.0 if share >= config.bump else float(np.copysign(config.bump_rad, side - 0.5))


def is_moving(config: FaultsConfig, chance: Chance, step: int) -> bool:
    """Return whether a scan is taken while the robot still drives."""
    return config.moving > 0.0 and bool(chance.uniforms(Channel.MOVING, step, 1)[0] < config.moving)


def places_of_beams(way: Float[np.ndarray, "n 3"], drive_s: float, scan_s: float) -> Float[np.ndarray, "m 3"]:
    """Return where the robot was at `MOMENTS` moments of a scan that ended with its drive, in the frame of its end.

    `way` are places at even times of the drive, m m rad in the frame of its start, without that.
    """
    before_s = scan_s * (1.0 - (np.arange(MOMENTS) + 0.5) / MOMENTS)
    at_s = np.linspace(0.0, drive_s, len(way) + 1)
    columns = np.vstack([np.zeros(3), way]).T
    places = np.column_stack([np.interp(drive_s - before_s, at_s, column) for column in columns])
    to_end = inverse(way[-1])
    return np.column_stack([to_world(places[:, :2], to_end), places[:, 2] - way[-1, 2]])
