"""BreezySLAM's logs (`.dat`): a line of whole numbers for each scan of a Hokuyo URG-04LX.

The format is that of its examples and of CoreSLAM (Steux and El Hamzaoui, "CoreSLAM: a SLAM algorithm in less than 200
lines of C code", ICARCV 2010): a time in microseconds, the counts of two wheels, and from word 25 on the ranges in
millimetres. Neither the wheels nor the place of the scanner stand in it.
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
"""The scanner says why it measured nothing by numbers below this."""
NOTE = (
    "the wheels of a BreezySLAM log are counts of wheels that it does not describe: the scans alone tell the motion;"
    " the scanner is taken for a URG-04LX, 682 beams over 240 degrees, 4 m"
)


def is_breezyslam(path: Path) -> bool:
    """Return whether the first line of a file is one of whole numbers, more than a scan's."""
    try:
        words = next(text_lines(path), (0, []))[1]
    except (OSError, LogError):
        return False
    return len(words) > BEFORE + 2 and all(word.lstrip("-").isdecimal() for word in words)


def read_breezyslam(path: Path, notes: list[str]) -> Iterator[RawScan | LogError]:
    """Yield the scans of a log, and an error in place of each that cannot be read; raises OSError and LogError."""
    notes.append(NOTE)
    for number, words in text_lines(path):
        place = f"line {number}"
        try:
            yield _scan(words, place)
        except LogError as error:
            yield error


def _scan(words: list[str], place: str) -> RawScan:
    count = len(words) - BEFORE
    if count not in (BEAMS, BEAMS + 1):  # one more word ends each line
        raise LogError(f"{place}: expected {BEAMS} ranges of a URG-04LX after {BEFORE} words, found {count}")
    try:
        time_us, *ranges_mm = (float(word) for word in (words[0], *words[BEFORE : BEFORE + BEAMS]))
    except ValueError as error:
        raise LogError(f"{place}: expected whole numbers, found other words among them") from error
    ranges = 1e-3 * np.array(ranges_mm)
    returns = as_returns(np.where(ranges < CODES_M, np.nan, ranges), RANGE_M)
    return RawScan(1e-6 * time_us, BEARINGS_RAD, returns, RANGE_M, None, None, place)
