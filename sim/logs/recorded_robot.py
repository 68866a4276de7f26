"""A recorded robot: it returns the recorded scans and odometry, whatever it is commanded."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.robot import MotionCommand, Odometry, Scan

from .archive import ArchiveError, read_archive

FORMAT = 1
"""The format number of every log, and of every other file of a run that is read back."""
NEEDED = {
    "time_s": "float s",
    "bearings_rad": "float k",
    "ranges_m": "float s k",
    "sigma_m": "float k",
    "range_max_m": "float",
    "odometry": "float s 3",
    "odometry_cov": "float s 3 3",
}
TRUTH = {
    "start_pose": "float 3",
    "start_cov": "float 3 3",
    "true_poses": "float s 3",
    "true_faces": "float f 2 2",
    "true_face_of_beam": "int s k",
}
"""Additional arrays of a simulated run."""
LATER = {
    "touched": "bool s",
    "sigma_share": "float",
    "scan_start_s": "float s",
    "fans": "float s 3",
    "resolution_m": "float",
    "carried": "bool s",
}
"""Arrays that older logs lack."""
MOST_M = 1e6
"""Larger values (metres, radians, seconds or square roots of variances) do not occur."""


SAME_RAD = 1e-4
"""Bearings that differ by less are equal."""


class RecordingError(ValueError):
    """A file that is not a recording. The message is one line: what was expected, what was found, what to do."""


@dataclass(frozen=True)
class Recording:
    """The reports of a robot in s scans of k beams."""

    time_s: Float[np.ndarray, " s"]
    bearings_rad: Float[np.ndarray, " k"]
    """Bearings of all scans, or of the one with the most beams if they differ (`fans`)."""
    ranges_m: Float[np.ndarray, "s k"]
    """+inf without a return; NaN for an invalid beam, and after the last beam of a scan with fewer."""
    sigma_m: Float[np.ndarray, " k"]
    range_max_m: float
    odometry: Float[np.ndarray, "s 3"]
    """Motion before each scan, robot frame before the motion, m m rad; zero for the first."""
    odometry_cov: Float[np.ndarray, "s 3 3"]
    touched: Bool[np.ndarray, " s"] | None = None
    """Whether the body touched something before each scan; None if unknown."""
    sigma_share: float = 0.0
    """Part of the standard deviation that grows with the range, as a share of it."""
    scan_start_s: Float[np.ndarray, " s"] | None = None
    """Time of the first beam of each scan, NaN or None if unknown; the scan ended at `time_s`."""

    fans: Float[np.ndarray, "s 3"] | None = None
    """Number of beams of each scan, bearing of the first one and step to the next, rad; None if they are all equal."""
    resolution_m: float = 0.0
    """Resolution of the ranges; 0 for none."""
    carried: Bool[np.ndarray, " s"] | None = None
    """Whether each scan is the first of a later session, to which the robot was carried; None for one session."""

    def __len__(self) -> int:
        return len(self.time_s)

    def scan(self, index: int) -> Scan:
        """Return one of its scans."""
        start_s = np.nan if self.scan_start_s is None else float(self.scan_start_s[index])
        bearings, beams = self.bearings_rad, len(self.bearings_rad)
        if self.fans is not None:
            beams = int(self.fans[index, 0])
            bearings = self.fans[index, 1] + self.fans[index, 2] * np.arange(beams)
        return Scan(
            bearings, self.ranges_m[index, :beams], self.sigma_m[:beams], self.range_max_m, float(self.time_s[index]),
            self.sigma_share, start_s, self.resolution_m,
        )  # fmt: skip


def fan_of(bearings_rad: Float[np.ndarray, " k"]) -> Float[np.ndarray, "3"]:
    """Return the number of beams, the first one's bearing and the mean step to the next, rad."""
    count = len(bearings_rad)
    return np.array([count, bearings_rad[0], (bearings_rad[-1] - bearings_rad[0]) / max(count - 1, 1)])


def differing(fans: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "s 3"] | None:
    """Return the beams of each scan, or None if they are equal up to rounding."""
    return None if np.all(np.ptp(fans, axis=0) <= [0.0, SAME_RAD, SAME_RAD / fans[:, 0].max()]) else fans


def padded(rows: list[Float[np.ndarray, " _"]]) -> Float[np.ndarray, "s k"]:
    """Return rows of ranges, padded with NaN to the longest of them."""
    found = np.full((len(rows), max(map(len, rows))), np.nan)
    for row, ranges in zip(found, rows, strict=True):
        row[: len(ranges)] = ranges
    return found


class RecordedRobot:
    """Plays a recording; commands have no effect."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._at = 0

    def sense(self) -> Scan:
        """Return the scan at the present position of the recording."""
        return self._recording.scan(self._at)

    def drive(self, command: MotionCommand) -> Odometry:
        """Go to the next scan, whatever the command; raises EOFError at the end of the recording."""
        if self._at + 1 >= len(self._recording):
            raise EOFError(f"expected at most {len(self._recording)} scans, found the end of the recording")
        self._at += 1
        r = self._recording
        touched = r.touched is not None and bool(r.touched[self._at])
        carried = r.carried is not None and bool(r.carried[self._at])
        return Odometry(r.odometry[self._at], r.odometry_cov[self._at], touched, carried=carried)


def read_log(source: Path | bytes) -> dict[str, np.ndarray]:
    """Return the arrays of a run's own log (`log.npz`), with the truth if it is there; raises RecordingError."""
    name, where = (source.name, str(source)) if isinstance(source, Path) else ("log.npz", "log.npz")
    try:
        said = read_archive(source, {"format": "int"})["format"]
        if said != FORMAT:
            raise ArchiveError(f"format {said} of another version, where this one reads {FORMAT}")
        return read_archive(source, NEEDED, {**TRUTH, **LATER})
    except FileNotFoundError as error:
        raise RecordingError(f"expected a run's log.npz, found no file {where}: name a log that exists") from error
    except ArchiveError as error:
        raise RecordingError(f"expected a run's log.npz, found {name} with {error}: record the run anew") from error
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise RecordingError(f"expected a run's log.npz, found {name} ({reason}): name a run's log") from error


def knows_truth(source: Path) -> bool:
    """Return whether a run's own log contains the truth; also for an invalid file, which its reader refuses."""
    try:
        return any(name.startswith("true_") for name in read_log(source))
    except RecordingError:
        return True


def recording_of(arrays: Mapping[str, np.ndarray]) -> Recording:
    """Return the recording in a log's arrays; raises RecordingError if their values are invalid."""
    recording = Recording(
        arrays["time_s"], arrays["bearings_rad"], arrays["ranges_m"], arrays["sigma_m"],
        float(arrays["range_max_m"]), arrays["odometry"], arrays["odometry_cov"], arrays.get("touched"),
        float(arrays.get("sigma_share", 0.0)), arrays.get("scan_start_s"), arrays.get("fans"),
        float(arrays.get("resolution_m", 0.0)), arrays.get("carried"),
    )  # fmt: skip
    for wrong, words in _faults(recording):
        if wrong:
            raise RecordingError(f"expected the log of a robot, found {words}: record the run anew")
    return recording


def _faults(r: Recording) -> Iterator[tuple[bool, str]]:
    """Yield, in order, whether a recording is invalid in some way, and this way in words."""
    yield len(r) < 1 or len(r.bearings_rad) < 2, f"{len(r)} scans of {len(r.bearings_rad)} beams"
    for name in ("time_s", "bearings_rad", "sigma_m", "sigma_share", "range_max_m", "odometry", "odometry_cov"):
        yield not within(getattr(r, name), MOST_M), f"{name} with NaN or beyond {MOST_M:g}"
    least = float(r.sigma_m.min(initial=np.inf))
    noise = not least > 0 or not r.range_max_m > 0 or r.sigma_share < 0
    yield noise, f"sigma_m {least:g}, sigma_share {r.sigma_share:g}, range_max_m {r.range_max_m:g}"
    yield bool(np.any(np.diff(r.time_s) < 0)), "times that decrease"
    late = r.scan_start_s is not None and bool(np.any(r.scan_start_s > r.time_s))
    yield late, "scans that end before they begin"
    if r.fans is not None:
        count, first, step = r.fans.T
        within_turn = np.all((step > 0) & (step * (count - 1) < 2 * np.pi) & np.isfinite(first))
        yield not (np.all((count >= 2) & (count <= len(r.bearings_rad))) and within_turn), "invalid ranges of bearings"
    steps = np.diff(r.bearings_rad)
    even = np.allclose(steps, steps.mean(), rtol=1e-3, atol=1e-6)
    yield not even or not 0 < steps.sum() < 2 * np.pi, "bearings that are not evenly spaced over at most one turn"
    far = bool(np.any((r.ranges_m <= 0) | (np.isfinite(r.ranges_m) & (r.ranges_m > r.range_max_m))))
    yield far, f"ranges of 0 m or less or beyond {r.range_max_m:g} m"
    yield not are_covariances(r.odometry_cov), "odometry_cov that is not a covariance"


def within(values: Float[np.ndarray, "..."] | float, most: float) -> bool:
    """Return whether all values are finite and none is beyond `most`."""
    return bool(np.all(np.abs(values) <= most))


def are_covariances(covs: Float[np.ndarray, "*n d d"]) -> bool:
    """Return whether all are symmetric and positive semidefinite up to rounding."""
    largest = np.abs(covs).max(initial=0.0)
    symmetric = np.allclose(covs, np.swapaxes(covs, -1, -2), rtol=1e-6, atol=1e-9 * largest)
    return symmetric and bool(np.linalg.eigvalsh(covs).min(initial=0.0) >= -1e-9 * largest)
