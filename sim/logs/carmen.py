"""CARMEN logs: `FLASER`, `ROBOTLASER1` and `ODOM` lines of text, and dp-slam's variant of them.

CARMEN's format is that of its `log` module (http://carmen.sourceforge.net/logger_playback.html).
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from .raw_scan import LogError, RawScan, as_returns
from .text_lines import text_lines

SICK_BEAMS = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5}
"""Beams of a scanner of 180 degrees, the first of them to the right, and the degrees between two."""
SICK_RANGE_M = 40.0
"""`FLASER` lines do not tell the scanner's range. SICK's scanners say 50 m or 81.8 m where nothing came back."""
SICK_CODES_M = (8.1825, 8.1915)
"""In its mode of 8 m the same scanner says 8183 to 8191 mm where it measured nothing, and no range is larger."""
KNOWN = ("FLASER", "ROBOTLASER1", "ODOM", "Laser", "Odometry")
EVERY_S = 1.0
"""Between two scans of a log without times."""
MOST_BEAMS = 10_000


def read_carmen(path: Path) -> Iterator[RawScan]:
    """Yield the scans of a log; raises OSError, and LogError at the first line that cannot be read."""
    known = False
    odom: np.ndarray | None = None
    count = 0
    for number, words in text_lines(path):
        kind = words[0]
        if kind not in KNOWN:
            continue
        known = True
        place = f"line {number}"
        if kind == "ODOM":
            _numbers(words[1:], 3, place, kind)
        elif kind == "Odometry":
            odom = _pose(_numbers(words[1:], 3, place, kind), place)
        elif kind == "Laser":
            if odom is None:
                raise LogError(f"{place}: expected an Odometry line before the first Laser line, found none")
            yield _dpslam(words, odom, count * EVERY_S, place)
            count += 1
        else:
            yield _MESSAGES[kind](words, place)
    if not known:
        raise LogError(f"expected lines {', '.join(KNOWN[:3])}, or Laser and Odometry, found none of them")


def _flaser(words: list[str], place: str) -> RawScan:
    """`FLASER n r_1..r_n x y theta odom_x odom_y odom_theta time host logger_time`."""
    bearings, ranges, rest = _sick(words, place)
    poses = _numbers(rest, 7, place, "FLASER")
    return RawScan(
        poses[6], bearings, as_returns(ranges, SICK_RANGE_M), SICK_RANGE_M,
        _pose(poses[3:6], place), _pose(poses[:3], place), place,
    )  # fmt: skip


def _dpslam(words: list[str], odom: Float[np.ndarray, "3"], time_s: float, place: str) -> RawScan:
    """`Laser n r_1..r_n` after `Odometry x y theta`."""
    bearings, ranges, _ = _sick(words, place)
    return RawScan(time_s, bearings, as_returns(ranges, SICK_RANGE_M), SICK_RANGE_M, odom, None, place)


def _robotlaser(words: list[str], place: str) -> RawScan:
    """`ROBOTLASER1 type start fov resolution max accuracy mode n r.. m rem.. laser robot tv rv 3x time ..`."""
    head = _numbers(words[1:], 7, place, "ROBOTLASER1")
    start, resolution, most_m = head[1], head[3], head[4]
    count = _count(words[8] if len(words) > 8 else "nothing", place)
    ranges = _ranges(words[9:], count, place)
    rest = words[9 + count :]
    remissions = _count(rest[0], place, least=0) if rest else 0
    poses = _numbers(rest[1 + remissions :], 12, place, "ROBOTLASER1")
    if not (resolution > 0.0 and count * resolution < 2.0 * np.pi + resolution and most_m > 0.0):
        raise LogError(
            f"{place}: expected beams over one turn at most and a range, found {count} beams {resolution:g} rad apart"
            f" and {most_m:g} m"
        )
    bearings = start + resolution * np.arange(count)
    return RawScan(
        poses[11], bearings, as_returns(ranges, most_m), most_m,
        _pose(poses[3:6], place), _pose(poses[:3], place), place,
    )  # fmt: skip


_MESSAGES: dict[str, Callable[[list[str], str], RawScan]] = {"FLASER": _flaser, "ROBOTLASER1": _robotlaser}


def _sick(words: list[str], place: str) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], list[str]]:
    """Return bearings, ranges and the words behind them of a line that tells only the number of beams."""
    count = _count(words[1] if len(words) > 1 else "nothing", place)
    if count not in SICK_BEAMS:
        raise LogError(f"{place}: expected {', '.join(map(str, SICK_BEAMS))} beams, found {count}")
    bearings = -0.5 * np.pi + np.deg2rad(SICK_BEAMS[count]) * np.arange(count)
    return bearings, _without_codes(_ranges(words[2:], count, place)), words[2 + count :]


def _without_codes(ranges: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Return ranges with NaN where a scanner in its mode of 8 m says why it measured nothing."""
    low, high = SICK_CODES_M
    return np.where(ranges >= low, np.nan, ranges) if ranges.max(initial=0.0) < high else ranges


def _count(word: str, place: str, least: int = 2) -> int:
    if not word.isdecimal() or not least <= int(word[:9]) <= MOST_BEAMS:
        raise LogError(f"{place}: expected a number of beams, found {word[:20]}")
    return int(word)


def _ranges(words: list[str], count: int, place: str) -> Float[np.ndarray, " k"]:
    try:
        ranges = np.array(words[:count], dtype=np.float64)
    except ValueError as error:
        raise LogError(f"{place}: expected {count} ranges, found other words among them") from error
    if len(ranges) < count:
        raise LogError(f"{place}: expected {count} ranges, found {len(ranges)}")
    return ranges


def _numbers(words: list[str], count: int, place: str, kind: str) -> list[float]:
    """Return the first `count` words as finite numbers."""
    try:
        numbers = [float(word) for word in words[:count]]
    except ValueError as error:
        raise LogError(f"{place}: expected {count} numbers in {kind}, found other words among them") from error
    if len(numbers) < count:
        raise LogError(f"{place}: expected {count} numbers in {kind}, found {len(numbers)}")
    if not np.all(np.isfinite(numbers)):
        raise LogError(f"{place}: expected finite numbers in {kind}, found NaN or infinity")
    return numbers


def _pose(numbers: list[float], place: str) -> Float[np.ndarray, "3"]:
    pose = np.array(numbers)
    if np.abs(pose).max() > 1e6:
        raise LogError(f"{place}: expected a pose in metres and radians, found {numbers[0]:g}, {numbers[1]:g}")
    return pose
