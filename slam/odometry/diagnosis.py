"""What is wrong with a robot whose map had to be rescued: known faults, tried on its last scans.

Two scans one after the other tell how the scanner moved, without any map. The wheels tell it, too, if the scanner sits
where it is stated, its beams run as they should, its scans are of now and the robot drives. Each fault changes in a
known way what the wheels lead to expect. So faults are weighed against what is stated, by their likelihoods over the
last scans; no scan counts for more than a share of the proof, since the robot may have been pushed before it. What no
fault explains is a push, or noise: then the map is rescued, up to a number of times.
"""

import functools
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..estimation.models import move
from ..estimation.mounting import odometry_of_scanner
from ..estimation.shared import SharedConfig, of_shared
from ..geometry.poses import wrap
from ..geometry.quantities import Count
from ..robot import Odometry, RobotSpec, Scan, ScannerSpec, of_robot
from .robot_faults import APART_M, APART_RAD, Fault, expected, tried_first
from .scan_matching import told_by_scans

AT_REST = Odometry(np.zeros(3), np.zeros((3, 3)))
"""The motion between two scans that were taken at one place."""
STILL = 0.01
"""After a smaller motion, m or rad, two scans may be alike."""
TOGETHER = 4
"""Where the scanner sits is tried on so many motions as one, too: it shows little in each."""
SLIPS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""So many times as far as stated the wheels may slip: not to be taken for a fault."""


@dataclass(frozen=True)
class DiagnosisConfig:
    """How faults of the robot are identified, and when a map is given up."""

    robot: RobotSpec = of_robot()
    shared: SharedConfig = of_shared()
    window: Count = 20
    """Number of the latest scans on which faults are tested."""
    agree: Count = 5
    """Number of scans that must support a fault, and one more for each that contradicts it."""
    rescues: Count = 20
    """A map is given up if the robot had to be relocalised this often within the last `within` steps."""
    within: Count = 40
    """Number of steps over which relocalisations are counted."""


@dataclass
class _Moved:
    """What the wheels report of the motions of the body between two scans, one after the other, and these scans."""

    motions: "Sequence[Odometry] | Sequence[_Moved]"
    before: Scan
    after: Scan
    told: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]] | None = None
    """The scanner's by the scans alone, and their information, once it was asked for."""

    @functools.cached_property
    def wheels(self) -> Odometry:
        """The motions as one."""
        return functools.reduce(composed, (each.wheels if isinstance(each, _Moved) else each for each in self.motions))


class Diagnosis:
    """Keeps the last scans and motions, and says what is wrong with the robot where something surely is."""

    def __init__(self, config: DiagnosisConfig = DiagnosisConfig()) -> None:
        self._config = config
        self._last: deque[_Moved] = deque(maxlen=config.window)
        self._farther: deque[_Moved] = deque(maxlen=config.window)
        self._together: list[_Moved] = []
        self._rescued: deque[bool] = deque(maxlen=config.within)
        self._wheels: list[Odometry] | None = [AT_REST]
        self._scan: Scan | None = None

    def moved(self, odometry: Odometry) -> None:
        """Take note of what the wheels report; where scans have told a motion, there is nothing to judge."""
        before = self._wheels
        self._wheels = None if before is None or odometry.wheels is not None else [*before, odometry]

    def repeats(self, scan: Scan) -> bool:
        """Return whether a scan is the last one again, beam by beam, though the wheels led where it does not fit."""
        if self._scan is None or self._wheels is None or not _are_alike(scan, self._scan):
            return False
        moved = _Moved(self._wheels, self._scan, scan)
        if np.abs(moved.wheels.motion).max() <= STILL:
            return False
        motion, information = self._told(moved)
        off = odometry_of_scanner(moved.wheels, self._config.robot.scanner).motion - motion
        return float(off @ information @ off) > self._config.shared.outlier_sigmas**2

    def see(self, scan: Scan, was_rescued: bool, is_in_doubt: bool) -> str:
        """Take in one scan; return what is wrong with the robot in words, empty where nothing is known to be.

        `was_rescued` says whether the scan fitted the map only after the robot had been moved in it, `is_in_doubt`
        whether it fits badly in any other way. Faults are tried after such scans alone.
        """
        if self._wheels is None:
            self._together.clear()
        elif self._scan is not None:
            self._last.append(_Moved(self._wheels, self._scan, scan))
            self._together.append(self._last[-1])
            if len(self._together) == TOGETHER:
                self._farther.append(_Moved(self._together, self._together[0].before, scan))
                self._together = []
        self._wheels, self._scan = [AT_REST], scan
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
        return self._proved(self._last, 1, tried_first()) or self._proved(
            self._farther, TOGETHER, [each for each in tried_first() if each.ahead_m or each.left_m]
        )

    def _proved(self, last: Sequence[_Moved], steps: int, tried: list[Fault]) -> Fault | None:
        """Return the fault of some that is proved by motions of so many steps each, and best by them."""
        if len(last) < self._config.agree:
            return None
        spec, proof = self._config.robot, -float(np.log(self._config.shared.chance))
        half_m, half_rad = self._window(steps)
        weighed = _Weighed(
            [each.wheels for each in last],
            [self._told(each, steps) for each in last],
            spec.scanner,
            -float(np.log((2.0 * half_m) ** 2 * 2.0 * half_rad)),
        )
        each = proof / self._config.agree
        gains = weighed.gains(tried)
        proved = np.clip(gains, -each, each)[:, ::-1].cumsum(axis=1).max(axis=1)
        best = int(np.argmax(proved))
        if proved[best] < proof * (1.0 - 1e-9):
            return None
        nearby = tried[best].nearby()
        return nearby[int(np.argmax(weighed.gains(nearby)[:, gains[best] > 0.0].sum(axis=1)))]

    def _window(self, steps: int) -> tuple[float, float]:
        """Return how far from where the wheels say a motion of so many steps is sought, m and rad."""
        spec = self._config.robot
        return 2.0 * steps * spec.step_m + APART_M, min(2.0 * steps * spec.turn_rad + APART_RAD, np.pi)

    def _told(self, moved: _Moved, steps: int = 1) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
        """Return what the scans before and after a motion tell of it, and how surely."""
        if moved.told is None:
            guess = odometry_of_scanner(moved.wheels, self._config.robot.scanner).motion
            moved.told = told_by_scans(moved.before, moved.after, guess, *self._window(steps))
        return moved.told


def composed(first: Odometry, then: Odometry) -> Odometry:
    """Return two motions one after the other as one, in the frame before the first."""
    step = move(first.motion, then.motion)
    return Odometry(step.pose_world, step.F @ first.cov @ step.F.T + step.noise(then.cov))


def _are_alike(one: Scan, other: Scan) -> bool:
    return one.ranges_m.tobytes() == other.ranges_m.tobytes()


class _Weighed:
    """Motions by the wheels beside those by the scans."""

    def __init__(
        self,
        wheels: Sequence[Odometry],
        told: Sequence[tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]],
        stated: ScannerSpec,
        least: float,
    ) -> None:
        """No motion is less likely than `least`, the logarithm of a density: the robot may have been pushed."""
        self._motions, self._covs = np.array([each.motion for each in wheels]), np.array([each.cov for each in wheels])
        self._scans, information = map(np.array, zip(*told, strict=True))
        self._says = information.any(axis=(1, 2))
        information[~self._says] = np.eye(3)
        self._scans_cov, self._stated, self._least = np.linalg.inv(information), stated, least
        self._misfit = 0.5 * self._squared([Fault()], (1.0,))[0][0, 0]
        sound = self._likelihoods([Fault()], SLIPS)[:, 0]
        self._sound, self._slips = sound.max(axis=0), (1.0, SLIPS[int(np.argmax(sound.sum(axis=1)))])

    def gains(self, faults: Sequence[Fault]) -> Float[np.ndarray, "f n"]:
        """Return by how much each fault raises the log-likelihood of each motion over that of what is stated.

        However far the wheels of each slip; where a motion does not tell, 0. It gains no more than what is stated is
        off: a robot without any noise fits too well, and that is no fault.
        """
        likely = self._likelihoods(faults, self._slips)
        best = np.argmax(np.nansum(likely, axis=2), axis=0)
        gains = np.minimum(likely[best, np.arange(len(faults))] - self._sound, self._misfit)
        return np.where(self._says, np.nan_to_num(gains), 0.0)

    def _likelihoods(self, faults: Sequence[Fault], slips: Sequence[float]) -> Float[np.ndarray, "s f n"]:
        """Return the log-likelihood of each motion by the scans, for wheels that slip some times as far as stated."""
        squared, S = self._squared(faults, slips)
        return np.maximum(-0.5 * (squared + np.log(np.linalg.det(2.0 * np.pi * S))), self._least)

    def _squared(
        self, faults: Sequence[Fault], slips: Sequence[float]
    ) -> tuple[Float[np.ndarray, "s f n"], Float[np.ndarray, "s f n 3 3"]]:
        """Return the squared Mahalanobis distance of each motion by the scans from that by the wheels, and its S."""
        motions, covs = expected(faults, self._motions, self._covs, self._stated)
        off = self._scans - motions
        off[..., 2] = wrap(off[..., 2])
        S = np.square(slips)[:, None, None, None, None] * covs + self._scans_cov
        return np.einsum("...i,...ij,...j->...", off, np.linalg.inv(S), off), S
