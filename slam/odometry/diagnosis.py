"""What is wrong with a robot whose map had to be rescued: known faults, tried on its last scans.

Two scans one after the other tell how the scanner moved, without any map. The wheels tell it, too, if the scanner sits
where it is stated, its beams run as they should, its scans are of now and the robot drives. Each fault changes in a
known way what the wheels lead to expect. So faults are weighed against what is stated, by their likelihoods over the
last scans; no scan counts for more than a share of the proof, since the robot may have been pushed before it. What no
fault explains is a push, or noise: then the map is rescued, up to a number of times.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..estimation.mounting import odometry_of_scanner
from ..estimation.shared import SharedConfig, of_shared
from ..geometry.poses import J, compose, rotation, wrap
from ..geometry.quantities import Count
from ..robot import Odometry, RobotSpec, Scan, ScannerSpec, of_robot
from .scan_matching import told_by_scans

AT_REST = Odometry(np.zeros(3), np.zeros((3, 3)))
"""The motion between two scans that were taken at one place."""
STILL = 0.01
"""After a smaller motion, m or rad, two scans may be alike."""
MIRROR = np.array([1.0, -1.0, -1.0])
"""What swapping left and right makes of a motion."""
SLIPS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""So many times as far as stated the wheels may slip: not to be taken for a fault."""
APART_M, APART_RAD = 0.1, float(np.deg2rad(10.0))
"""Between the places and turns of the scanner that are tried first."""
FARTHEST_M = 0.5
"""How far from where it is stated the scanner is sought, ahead and to the left."""


@dataclass(frozen=True)
class DiagnosisConfig:
    """How many scans prove a fault, and how often a map is rescued."""

    robot: RobotSpec = of_robot()
    shared: SharedConfig = of_shared()
    window: Count = 20
    """Faults are tried on so many of the last scans, and on the last few of these alone."""
    agree: Count = 5
    """So many scans must speak for a fault, one more for each that speaks against it. It is proved where what is stated
    is so much less likely (`shared.chance`)."""
    rescues: Count = 20
    """A map that was rescued at so many ..."""
    within: Count = 40
    """... of so many steps is given up, whatever the reason."""


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


@dataclass
class _Moved:
    """What the wheels report of one motion of the body, and the scans before and after it."""

    wheels: Odometry
    before: Scan
    after: Scan
    told: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]] | None = None
    """The scanner's by the scans alone, and their information, once it was asked for."""


class Diagnosis:
    """Keeps the last scans and motions, and says what is wrong with the robot where something surely is."""

    def __init__(self, config: DiagnosisConfig = DiagnosisConfig()) -> None:
        self._config = config
        self._last: deque[_Moved] = deque(maxlen=config.window)
        self._rescued: deque[bool] = deque(maxlen=config.within)
        self._wheels: Odometry | None = AT_REST
        self._scan: Scan | None = None

    def moved(self, odometry: Odometry) -> None:
        """Take note of what the wheels report; where scans have told a motion, there is nothing to judge."""
        before = self._wheels
        if before is None or odometry.wheels is not None:
            self._wheels = None
        else:
            R = np.eye(3)
            R[:2, :2] = rotation(before.motion[2])
            self._wheels = Odometry(compose(before.motion, odometry.motion), before.cov + R @ odometry.cov @ R.T)

    def repeats(self, scan: Scan) -> bool:
        """Return whether a scan is the last one again, beam by beam, though the wheels have turned."""
        if self._scan is None or self._wheels is None or not np.isfinite(scan.ranges_m).any():
            return False
        return bool(np.abs(self._wheels.motion).max() > STILL) and _are_alike(scan, self._scan)

    def see(self, scan: Scan, was_rescued: bool, is_in_doubt: bool) -> str:
        """Take in one scan; return what is wrong with the robot in words, empty where nothing is known to be.

        `was_rescued` says whether the scan fitted the map only after the robot had been moved in it, `is_in_doubt`
        whether it fits badly in any other way. Faults are tried after such scans alone.
        """
        if self._wheels is None:
            self._last.clear()
        elif self._scan is not None:
            self._last.append(_Moved(self._wheels, self._scan, scan))
        self._wheels, self._scan = AT_REST, scan
        self._rescued.append(was_rescued)
        if fault := self._fault() if was_rescued or is_in_doubt else None:
            repeats = fault.stands and _are_alike(self._last[-1].before, scan)
            return "the scanner repeats one scan while the wheels turn" if repeats else str(fault)
        if not was_rescued or sum(self._rescued) < self._config.rescues:
            return ""
        words = (
            f"{sum(self._rescued)} of the last {len(self._rescued)} scans show motions that the wheels do not report"
        )
        return f"{words}, and no fault that is known explains them"

    def _fault(self) -> Fault | None:
        """Return the fault that is proved by the last scans, and best by them."""
        if len(self._last) < self._config.agree:
            return None
        spec, proof = self._config.robot, -float(np.log(self._config.shared.chance))
        half_m, half_rad = 2.0 * spec.step_m + APART_M, 2.0 * spec.turn_rad + APART_RAD
        for moved in self._last:
            if moved.told is None:
                guess = odometry_of_scanner(moved.wheels, spec.scanner).motion
                moved.told = told_by_scans(moved.before, moved.after, guess, half_m, half_rad)
        weighed = _Weighed(self._last, spec.scanner, -float(np.log((2.0 * half_m) ** 2 * 2.0 * half_rad)))
        each, tried = proof / self._config.agree, tried_first()
        gains = weighed.gains(tried)
        proved = np.clip(gains, -each, each)[:, ::-1].cumsum(axis=1).max(axis=1)
        best = int(np.argmax(proved))
        if proved[best] < proof * (1.0 - 1e-9):
            return None
        nearby = tried[best].nearby()
        return nearby[int(np.argmax(weighed.gains(nearby)[:, gains[best] > 0.0].sum(axis=1)))]


def _are_alike(one: Scan, other: Scan) -> bool:
    return bool(np.array_equal(one.ranges_m, other.ranges_m, equal_nan=True))


class _Weighed:
    """Motions by the wheels beside those by the scans."""

    def __init__(self, last: Sequence[_Moved], stated: ScannerSpec, least: float) -> None:
        """No motion is less likely than `least`, the logarithm of a density: the robot may have been pushed."""
        told = [(each.wheels.motion, each.wheels.cov, *each.told) for each in last if each.told is not None]
        self._motions, self._covs, self._scans, information = map(np.array, zip(*told, strict=True))
        self._says = information.any(axis=(1, 2))
        information[~self._says] = np.eye(3)
        self._scans_cov, self._stated, self._least = np.linalg.inv(information), stated, least
        sound = self._likelihoods([Fault()], SLIPS)[:, 0]
        self._sound, self._slips = sound.max(axis=0), (1.0, SLIPS[int(np.argmax(sound.sum(axis=1)))])

    def gains(self, faults: Sequence[Fault]) -> Float[np.ndarray, "f n"]:
        """Return by how much each fault raises the log-likelihood of each motion over that of what is stated.

        However far the wheels of each slip; where a motion does not tell, 0.
        """
        likely = self._likelihoods(faults, self._slips)
        best = np.argmax(np.nansum(likely, axis=2), axis=0)
        gains = likely[best, np.arange(len(faults))] - self._sound
        return np.where(self._says, np.nan_to_num(gains), 0.0)

    def _likelihoods(self, faults: Sequence[Fault], slips: Sequence[float]) -> Float[np.ndarray, "s f n"]:
        """Return the log-likelihood of each motion by the scans, for wheels that slip some times as far as stated."""
        motions, covs = expected(faults, self._motions, self._covs, self._stated)
        off = self._scans - motions
        off[..., 2] = wrap(off[..., 2])
        S = np.square(slips)[:, None, None, None, None] * covs + self._scans_cov
        squared = np.einsum("...i,...ij,...j->...", off, np.linalg.inv(S), off)
        return np.maximum(-0.5 * (squared + np.log(np.linalg.det(2.0 * np.pi * S))), self._least)
