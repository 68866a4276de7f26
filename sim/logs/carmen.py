"""CARMEN logs: `FLASER`, `RLASER`, `ROBOTLASER` and `ODOM` lines of text, and dp-slam's variant of them.

CARMEN's format is that of its `log` module (http://carmen.sourceforge.net/logger_playback.html).
"""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import compose, inverse

from .raw_scan import LogError, RawScan, as_returns
from .text_lines import text_lines

SICK_STEP = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5, 400: 0.25, 401: 0.25}
"""Degrees between two beams, by the number of beams, as in CARMEN, which assumes 180 degrees for any other number."""
SICK_RANGE_M = 40.0
"""`FLASER` lines do not contain the scanner's range. SICK scanners report 50 m or 81.8 m without a return."""
SICK_CODES_M = (8.1825, 8.1915)
"""In its mode of 8 m the same scanner reports 8183 to 8191 mm as error codes, and no larger range."""
SCANS = ("FLASER", "ROBOTLASER1", "Laser", "RLASER", *(f"ROBOTLASER{k}" for k in range(2, 6)))
"""Kinds of lines that contain a scan; of several scanners, the first one in this order is read."""
KNOWN = (*SCANS, "ODOM", "Odometry")
FIRST_LINES = 1000
"""The scanners of a log are known after this many lines."""
EVERY_S = 1.0
"""Time between two scans of a log without times."""
MOST_BEAMS = 10_000


def read_carmen(path: Path, notes: list[str] | None = None) -> Iterator[RawScan | LogError]:
    """Yield the scans of a log, and an error for each unreadable scan; raises OSError and LogError.

    `notes` receives the assumptions that were made, in words.
    """
    said = [] if notes is None else notes
    read = _first_kind(path)
    odom: LogError | np.ndarray = LogError("expected an Odometry line before the first Laser line, found none")
    counts, beams = Counter[str](), Counter[int]()
    for number, words in text_lines(path):
        kind = words[0]
        counts[kind if kind in KNOWN else ""] += 1
        read = read or (kind if kind in SCANS else "")
        try:
            if kind == "Odometry":
                odom = _odometry(words, f"line {number}")
            elif kind == read:
                time_s = (counts[kind] - 1) * EVERY_S
                scan = _scan(words, odom, time_s, f"line {number}")
                beams[len(scan.ranges_m)] += 1
                yield scan
        except LogError as error:
            yield error
    if not any(counts[kind] for kind in KNOWN):
        raise LogError(f"expected lines {', '.join(SCANS[:2])}, or Laser and Odometry, found none of them")
    others = [f"{counts[kind]} of {kind}" for kind in SCANS if counts[kind] and kind != read]
    if others:
        said.append(f"expected the scans of one scanner, found {read} and {', '.join(others)}: {read} is read")
    guessed = sorted(set(beams) - set(SICK_STEP)) if not read.startswith("ROBOT") else []
    if guessed:
        said.append(
            f"expected {', '.join(map(str, SICK_STEP))} beams, found {', '.join(map(str, guessed))}: assumed to cover"
            " 180 degrees, as in CARMEN"
        )


def _first_kind(path: Path) -> str:
    """Return the kind of the scans to read; empty if the first lines have none."""
    found = set()
    with suppress(LogError):  # reported when the scans are read
        for _, words in islice(text_lines(path), FIRST_LINES):
            found.add(words[0])
    return next((kind for kind in SCANS if kind in found), "")


def _scan(words: list[str], odom: LogError | Float[np.ndarray, "3"], time_s: float, place: str) -> RawScan:
    """Return the scan in a line of any scanner; raises LogError."""
    if words[0] != "Laser":
        return _MESSAGES[words[0][:6]](words, place)
    if isinstance(odom, LogError):
        raise LogError(f"{place}: {odom}")
    return _dpslam(words, odom, time_s, place)


def _odometry(words: list[str], place: str) -> LogError | Float[np.ndarray, "3"]:
    """Return the pose in an `Odometry` line, or the error: the scan after it has no pose either."""
    try:
        return _pose(_numbers(words[1:], 3, place, "Odometry"), place)
    except LogError as error:
        return error


def _flaser(words: list[str], place: str) -> RawScan:
    """`FLASER n r_1..r_n x y theta odom_x odom_y odom_theta time host logger_time`."""
    bearings, ranges, rest = _sick(words, place)
    poses = _numbers(rest, 7, place, words[0])
    return RawScan(
        poses[6], bearings, as_returns(ranges, SICK_RANGE_M), SICK_RANGE_M,
        _pose(poses[3:6], place), _pose(poses[:3], place), place,
    )  # fmt: skip


def _rlaser(words: list[str], place: str) -> RawScan:
    """`RLASER`, like `FLASER`, from a scanner that faces backwards, whether its pose says so or not."""
    scan = _flaser(words, place)
    assert scan.robot_odom is not None
    assert scan.scanner_odom is not None
    on_robot = compose(inverse(scan.robot_odom), scan.scanner_odom)
    if np.cos(on_robot[2]) > 0.0:
        on_robot[2] += np.pi
    return replace(scan, scanner_odom=compose(scan.robot_odom, on_robot))


def _dpslam(words: list[str], odom: Float[np.ndarray, "3"], time_s: float, place: str) -> RawScan:
    """`Laser n r_1..r_n` after `Odometry x y theta`."""
    bearings, ranges, _ = _sick(words, place)
    return RawScan(time_s, bearings, as_returns(ranges, SICK_RANGE_M), SICK_RANGE_M, odom, None, place)


def _robotlaser(words: list[str], place: str) -> RawScan:
    """`ROBOTLASER type start fov resolution max accuracy mode n r.. m rem.. laser robot tv rv 3x time ..`."""
    head = _numbers(words[1:], 7, place, words[0])
    start, resolution, most_m = head[1], head[3], head[4]
    count = _count(words[8] if len(words) > 8 else "nothing", place)
    ranges = _ranges(words[9:], count, place)
    rest = words[9 + count :]
    remissions = _count(rest[0], place, least=0) if rest else 0
    poses = _numbers(rest[1 + remissions :], 12, place, words[0])
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


_MESSAGES: dict[str, Callable[[list[str], str], RawScan]] = {
    "FLASER": _flaser,
    "RLASER": _rlaser,
    "ROBOTL": _robotlaser,
}
"""By the first six letters of a line."""


def _sick(words: list[str], place: str) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], list[str]]:
    """Return bearings, ranges and the remaining words of a line that only contains the number of beams."""
    count = _count(words[1] if len(words) > 1 else "nothing", place)
    step = SICK_STEP.get(count, 180.0 / (count - 1))
    bearings = -0.5 * np.pi + np.deg2rad(step) * np.arange(count)
    return bearings, _without_codes(_ranges(words[2:], count, place)), words[2 + count :]


def _without_codes(ranges: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Return ranges with NaN for the error codes of a scanner in its mode of 8 m."""
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
