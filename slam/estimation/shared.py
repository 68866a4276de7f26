"""What more than one rule asks of a building and of chance: each number stands here once, and reaches all settings."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..geometry.quantities import Angle, Count, Distance, Probability, Sigmas, Size, Spread
from ..robot import STATED


@dataclass(frozen=True)
class SharedConfig:
    """Sizes and thresholds."""

    chance: Probability = 1e-6
    """Hypotheses less likely than this are rejected, such as that a segment belongs to a wall or that the wheels are as
    good as stated."""
    beams_m: Size = 0.04
    """Distance from a line within which a beam may belong to it: four standard deviations of a range."""
    resolution_m: Distance = 0.05
    """Accuracy of the ends of walls and of the points where their lines cross."""
    within_m: Distance = 0.07
    """Largest distance along a line between two pieces that may be one wall, or between a corner and its last beam."""
    beside_m: Distance = 0.08
    """Largest distance across a line between two pieces that may be one wall, if one is too short to have a reliable
    direction."""
    thickness_m: Distance = 0.1
    """Thickness of a thin wall: ends closer together may be one corner, and beams this far behind a line have passed
    through it."""
    beyond_m: Distance = 0.15
    """Largest gap between two pieces of one curved obstacle."""
    face_m: Size = 0.2
    """Length below which a face has no reliable direction of its own."""
    short_m: Distance = 0.3
    """Length below which a segment's direction is too uncertain for the gate alone, and reach of a corner from the ends
    of its walls."""
    door_m: Distance = 0.35
    """Gaps narrower than this are no doors: two open ends that were viewed may be joined across them."""
    far_m: Distance = 0.5
    """Largest distance between neighbouring beams on one wall, and between a wall and a segment that is compared with
    it."""
    long_m: Distance = 1.0
    """Overlap from which two walls beside each other may be one, and length from which a wall shows how the map has
    moved."""
    known_rad: Spread = float(np.deg2rad(1.0))
    """Standard deviation up to which the angle between two walls counts as known."""
    straight_rad: Angle = float(np.deg2rad(5.0))
    """Angle below which two walls may be one, or one may continue the other."""
    sharp_rad: Angle = float(np.deg2rad(30.0))
    """Angle below which two walls that cross meet at a bend, and end there."""
    noise_sigmas: Sigmas = 4.0
    """Deviation, in standard deviations, above which a beam does not belong to a line, or to a wall."""
    outlier_sigmas: Sigmas = 3.0
    """Deviation, in standard deviations, above which a beam is not assigned to a line, or a segment has lack of fit."""
    scans: Count = 2
    """Number of scans that must agree before the map is changed on their evidence."""


def of_shared() -> Any:
    """Return a field of a group of settings that holds what all share: no setting of its own (`slam.robot.fitted`)."""
    return field(default=SharedConfig(), repr=False, metadata={STATED: True})
