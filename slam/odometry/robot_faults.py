"""What may be wrong with a robot, each a known change of the motions that its wheels lead its scans to expect."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..geometry.poses import J, rotation, wrap
from ..robot import ScannerSpec

MIRROR = np.array([1.0, -1.0, -1.0])
"""What swapping left and right makes of a motion."""
APART_M, APART_RAD = 0.1, float(np.deg2rad(10.0))
"""Between the places and turns of the scanner that are tried first."""
FARTHEST_M = 0.5
"""How far from where it is stated the scanner is sought, ahead and to the left."""


@dataclass(frozen=True)
class Fault:
    """One thing that may be wrong; what is stated, by default."""

    ahead_m: float = 0.0
    """So much farther ahead than stated the scanner sits, ..."""
    left_m: float = 0.0
    """... so much farther to the left, ..."""
    turned_rad: float = 0.0
    """... and it is turned by so much more, counter-clockwise."""
    is_mirrored: bool = False
    late: int = 0
    """Each scan is of so many steps before."""
    stands: bool = False
    """Nothing moves, whatever the wheels report."""

    def nearby(self) -> list["Fault"]:
        """Return the fault and others of its kind, as far as those tried first but closer together."""
        finer = np.linspace(-1.0, 1.0, 21)
        if self.turned_rad:
            return [Fault(turned_rad=self.turned_rad + share * APART_RAD) for share in finer]
        if self.ahead_m or self.left_m:
            return [Fault(self.ahead_m + x * APART_M, self.left_m + y * APART_M) for x in finer for y in finer]
        return [self]

    def __str__(self) -> str:
        """Say what is wrong."""
        if self.stands:
            return "the wheels turn while the robot stands"
        if self.is_mirrored:
            return "left and right are swapped, in the scans or in what the wheels report"
        if self.late:
            return f"the scans are late by {self.late} step{'s' * (self.late > 1)}"
        if self.turned_rad:
            return f"the scanner is turned by about {np.rad2deg(wrap(self.turned_rad)):.0f} degrees more than stated"
        ways = (self.ahead_m, "ahead", "back"), (self.left_m, "to the left", "to the right")
        words = " and ".join(f"{abs(way):.2f} m farther {on if way > 0.0 else back}" for way, on, back in ways)
        return f"the scanner sits about {words} than stated"


def tried_first() -> list[Fault]:
    """Return faults of all kinds, so close to each other that one of them is near any."""
    turns = np.arange(1, round(2.0 * np.pi / APART_RAD)) * APART_RAD
    count = round(FARTHEST_M / APART_M)
    steps = APART_M * np.arange(-count, count + 1)
    return [
        Fault(is_mirrored=True), Fault(stands=True), *(Fault(late=late) for late in (1, 2, 3)),
        *(Fault(turned_rad=float(wrap(turn))) for turn in turns),
        *(Fault(float(x), float(y)) for x in steps for y in steps if x or y),
    ]  # fmt: skip


def expected(
    faults: Sequence[Fault], motions: Float[np.ndarray, "n 3"], covs: Float[np.ndarray, "n 3 3"], stated: ScannerSpec
) -> tuple[Float[np.ndarray, "f n 3"], Float[np.ndarray, "f n 3 3"]]:
    """Return the scanner's motions with each fault, in its frame before each, and their covariances, by the body's.

    NaN where a late scan asks for what was before the first.
    """
    sits = stated.pose_robot + np.array([(each.ahead_m, each.left_m, each.turned_rad) for each in faults])
    cos, sin = np.cos(motions[:, 2]), np.sin(motions[:, 2])
    away = np.einsum("ijn,fj->fni", np.array([[cos, -sin], [sin, cos]]), sits[:, :2])
    backs = np.array([rotation(-turn) for turn in sits[:, 2]])
    A = np.tile(np.eye(3), (len(faults), len(motions), 1, 1))
    A[..., :2, :2] = backs[:, None]
    A[..., :2, 2] = np.einsum("fij,fnj->fni", backs @ J, away)
    told = np.tile(motions, (len(faults), 1, 1))
    told[..., :2] = np.einsum("fij,fnj->fni", backs, motions[:, :2] + away - sits[:, None, :2])
    for k, fault in enumerate(faults):
        if fault.is_mirrored:
            told[k], A[k] = told[k] * MIRROR, MIRROR[:, None] * A[k]
        if fault.stands:
            told[k], A[k] = 0.0, 0.0
    covs = A @ covs @ A.swapaxes(-1, -2)
    for k, fault in enumerate(faults):
        if fault.late:
            told[k], covs[k] = np.roll(told[k], fault.late, axis=0), np.roll(covs[k], fault.late, axis=0)
            told[k, : fault.late] = np.nan
    return told, covs
