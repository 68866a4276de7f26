"""What more than one rule asks of a building and of chance: each number stands here once, and reaches all settings."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..geometry.quantities import Angle, Count, Distance, Probability, Sigmas, Size, Spread
from ..robot import STATED


@dataclass(frozen=True)
class SharedConfig:
    """Sizes of what walls are made of, turns, and how sure a refusal has to be."""

    chance: Probability = 1e-6
    """What is rarer than this is ruled out: a pair of segment and wall, honest wheels that look worse than they
    state."""
    beams_m: Size = 0.04
    """Four sigmas of a beam: what lies as near to a line may be on it."""
    resolution_m: Distance = 0.05
    """Ends and crossings of lines are known no better: half of a thin wall."""
    within_m: Distance = 0.07
    """Less than a wall is thick: what stands as near along a line may be one wall, or a corner that was seen."""
    beside_m: Distance = 0.08
    """The same across a line, for faces whose direction is known badly."""
    thickness_m: Distance = 0.1
    """Of a thin wall: ends that are nearer may be one corner; beams that go on so far beyond a line have passed through
    it."""
    beyond_m: Distance = 0.15
    """Beams that go on so far past a gap or a bend lead on: from 4 m one meets a wall every 0.14 m."""
    face_m: Size = 0.2
    """Two thicknesses: a shorter face has no direction of its own (`straightness`)."""
    short_m: Distance = 0.3
    """Shorter segments are too poor in direction for the gate alone; lines of walls so near to each other may meet."""
    door_m: Distance = 0.35
    """No robot passes a narrower gap, and no door is narrower: across it ends may join that were looked at."""
    far_m: Distance = 0.5
    """Beams on a wall stand no farther apart."""
    long_m: Distance = 1.0
    """Walls that lie beside each other over so much of their way are no two faces that meet."""
    known_rad: Spread = float(np.deg2rad(1.0))
    """A turn is known where it is known to this, sigma; a smaller one no scan shows."""
    straight_rad: Angle = float(np.deg2rad(5.0))
    """Walls that turn by less run on straight, or may be one."""
    sharp_rad: Angle = float(np.deg2rad(30.0))
    """Walls that turn by more meet in a corner, and the beams tell where it is."""
    noise_sigmas: Sigmas = 4.0
    """What is off by more is no noise: the surface breaks off, the beam is not the line's, the wall is not straight.
    One of 16,000 beams is that far off by chance."""
    outlier_sigmas: Sigmas = 3.0
    """What is off by more is hardly noise: a beam is better left loose, and a wall has a misfit of its own."""
    scans: Count = 2
    """So many scans that say one thing are believed, and so many beams of one scan."""


def of_shared() -> Any:
    """Return a field of a group of settings that holds what all share: no setting of its own (`slam.robot.fitted`)."""
    return field(default=SharedConfig(), repr=False, metadata={STATED: True})
