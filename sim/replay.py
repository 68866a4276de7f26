"""A recorded robot: it senses what was sensed and reports what the wheels reported, whoever listens."""

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from slam.robot import MotionCommand, Odometry, Scan

KEYS = ("time_s", "bearings_rad", "ranges_m", "sigma_m", "range_max_m", "odometry", "odometry_cov")


class RecordingError(ValueError):
    """A file that is no recording, told in one line: what was expected, what was found, what to do."""


@dataclass(frozen=True)
class Recording:
    """What a robot reported in s scans of k beams."""

    time_s: Float[np.ndarray, " s"]
    bearings_rad: Float[np.ndarray, " k"]
    ranges_m: Float[np.ndarray, "s k"]
    sigma_m: float
    range_max_m: float
    odometry: Float[np.ndarray, "s 3"]
    """Motion that led to each scan, robot frame before the motion, m m rad; zero for the first."""
    odometry_cov: Float[np.ndarray, "s 3 3"]

    def __len__(self) -> int:
        return len(self.time_s)


class RecordedRobot:
    """Plays a recording back; commands move nothing."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._at = 0

    def sense(self) -> Scan:
        """Return the scan at the present place of the recording."""
        r = self._recording
        return Scan(r.bearings_rad, r.ranges_m[self._at], r.sigma_m, r.range_max_m, float(r.time_s[self._at]))

    def drive(self, command: MotionCommand) -> Odometry:
        """Go on to the next scan, whatever the command; raises EOFError at the end of the recording."""
        if self._at + 1 >= len(self._recording):
            raise EOFError(f"expected at most {len(self._recording)} scans, found the end of the recording")
        self._at += 1
        return Odometry(self._recording.odometry[self._at], self._recording.odometry_cov[self._at])


def read_log(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a run's own log (`log.npz`), never unpickling; raises RecordingError."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except FileNotFoundError as error:
        raise RecordingError(f"expected a run's log.npz, found no file {path}: name a log that exists") from error
    except (OSError, ValueError, AttributeError, zipfile.BadZipFile, EOFError) as error:
        raise RecordingError(f"expected a run's log.npz, found {path.name}, which is none: name a run's log") from error
    missing = [name for name in KEYS if name not in arrays]
    if missing:
        raise RecordingError(
            f"expected a run's log.npz, found {path.name} without {', '.join(missing)}: name a run's own log"
        )
    return arrays


def recording_of(arrays: dict[str, np.ndarray]) -> Recording:
    """Return the recording in a log's arrays; raises RecordingError where their shapes or numbers make none."""
    steps, beams = len(arrays["time_s"]), len(arrays["bearings_rad"])
    shapes = {"ranges_m": (steps, beams), "odometry": (steps, 3), "odometry_cov": (steps, 3, 3)}
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise RecordingError(f"expected {name} {shape}, found {arrays[name].shape}: record the run anew")
    if not steps or beams < 2 or not all(np.all(np.isfinite(arrays[k])) for k in KEYS if k != "ranges_m"):
        raise RecordingError("expected finite numbers and at least one scan, found none or NaN: record the run anew")
    return Recording(
        arrays["time_s"], arrays["bearings_rad"], arrays["ranges_m"], float(arrays["sigma_m"]),
        float(arrays["range_max_m"]), arrays["odometry"], arrays["odometry_cov"],
    )  # fmt: skip
