"""BreezySLAM's logs (`.dat`): a line of whole numbers for each scan of a Hokuyo URG-04LX.

The format is that of its examples and of CoreSLAM (Steux and El Hamzaoui, "CoreSLAM: a SLAM algorithm in less than 200
lines of C code", ICARCV 2010): a time in microseconds, the encoder counts of two wheels, and from word 25 on the ranges
in millimetres. It contains neither the geometry of the wheels nor the place of the scanner.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .raw_scan import LogError, RawScan, as_returns
from .text_lines import text_lines

BEFORE = 24
"""Words of a line before its ranges."""
BEAMS = 682
BEARINGS_RAD = np.deg2rad(np.linspace(-120.0, 120.0, BEAMS))
RANGE_M = 4.0
CODES_M = 0.02
"""Values below this are error codes of the scanner."""
NOTE = (
    "a BreezySLAM log holds encoder counts without the geometry of the wheels: scan matching alone gives the motion;"
    " the scanner is assumed to be a URG-04LX, 682 beams over 240 degrees, 4 m"
)


def is_breezyslam(path: Path) -> bool:
    """Return whether the first line of a file consists of more whole numbers than a scan has ranges."""
    try:
        words = next(text_lines(path), (0, []))[1]
    except (OSError, LogError):
        return False
    return len(words) > BEFORE + 2 and all(word.lstrip("-").isdecimal() for word in words)


def read_breezyslam(path: Path, notes: list[str]) -> Iterator[RawScan | LogError]:
    """Yield the scans of a log, and an error for each unreadable scan; raises OSError and LogError."""
    notes.append(NOTE)
    for number, words in text_lines(path):
        place = f"line {number}"
        try:
            yield _scan(words, place)
        except LogError as error:
            yield error


def _scan(words: list[str], place: str) -> RawScan:
    count = len(words) - BEFORE
    if count not in (BEAMS, BEAMS + 1):  # each line ends with one more word
        raise LogError(f"{place}: expected {BEAMS} ranges of a URG-04LX after {BEFORE} words, found {count}")
    try:
        time_us, *ranges_mm = (float(word) for word in (words[0], *words[BEFORE : BEFORE + BEAMS]))
    except ValueError as error:
        raise LogError(f"{place}: expected whole numbers, found other words among them") from error
    ranges = 1e-3 * np.array(ranges_mm)
    returns = as_returns(np.where(ranges < CODES_M, np.nan, ranges), RANGE_M)
    return RawScan(1e-6 * time_us, BEARINGS_RAD, returns, RANGE_M, None, None, place)
