"""Logs as they come: other clocks, units, beams and scanners, broken lines, packed files."""

import bz2
import gzip
import io
import lzma
import tarfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.experiments.replays.real_log import RealOptions, RealRun, read_real_run
from chainslam.slam.geometry.poses import compose

from .case import Case, Rng, pick

ROOM = (6.0, 4.0)
SCANS = 12


@dataclass(frozen=True)
class Drive:
    """Scans in a room: when, where by the wheels, and what came back of each beam."""

    time_s: np.ndarray
    poses: np.ndarray
    bearings: np.ndarray
    ranges: np.ndarray

    def flaser(self, kind: str = "FLASER", place: Any = (0.0, 0.0, 0.0)) -> list[str]:
        """Return its lines."""
        lines = []
        for time_s, pose, ranges in zip(self.time_s, self.poses, self.ranges, strict=True):
            laser = compose(pose, np.array(place))
            lines.append(" ".join(map(str, [kind, len(ranges), *ranges, *laser, *pose, time_s, "robot", 0.0])))
        return lines


def drive(rng: Rng, bearings: np.ndarray | None = None, turned: float = 0.0) -> Drive:
    """Return a drive through the room, a scan each half second by the clock of 2001."""
    bearings = np.deg2rad(np.arange(180) - 90.0) if bearings is None else bearings
    poses = np.column_stack(
        [1.0 + 0.15 * np.arange(SCANS), rng.uniform(1.0, 3.0) + 0.01 * np.arange(SCANS), 0.02 * np.arange(SCANS)]
    )
    ranges = np.array([seen_from(pose, bearings + turned) for pose in poses])
    return Drive(9e8 + 0.5 * np.arange(SCANS), poses, bearings, ranges + 0.003 * rng.standard_normal(ranges.shape))


def seen_from(pose: np.ndarray, bearings: np.ndarray) -> np.ndarray:
    """Return the ranges of beams in the room, whose lower left corner is the origin."""
    cosine, sine = np.cos(pose[2] + bearings), np.sin(pose[2] + bearings)
    with np.errstate(divide="ignore"):
        x = np.where(cosine > 0, (ROOM[0] - pose[0]) / cosine, -pose[0] / cosine)
        y = np.where(sine > 0, (ROOM[1] - pose[1]) / sine, -pose[1] / sine)
    return np.asarray(np.minimum(x, y))


def read(folder: Path, lines: list[str], odometry: str = "wheels") -> Callable[[], RealRun]:
    """Write a log and return what reads it."""
    path = folder / "a.log"
    path.write_text("\n".join(lines) + "\n")
    return lambda: read_real_run(path, RealOptions(odometry=odometry), None, {}, {})  # type: ignore[arg-type]


def holds(scans: int, left_out: int = 0, note: str = "", cut: bool = False) -> Callable[[RealRun], str]:
    """Return the check of a log of so many scans, beside which so many are left out, and told with a note.

    A log that is `cut` ends within its last scan.
    """

    def check(run: RealRun) -> str:
        found = len(run.log.scan_time_s), run.log.left_out.count
        if found != (scans, left_out):
            return f"{found} scans read and left out, not {(scans, left_out)}"
        if bool(run.unread) != (left_out > scans):
            return f"unread: {run.unread!r}"
        if bool(run.log.trouble) != cut:
            return f"trouble: {run.log.trouble!r}"
        told = " ".join(run.log.notes)
        return "" if (note in told if note else not told) else f"noted: {told}"

    return check


def times_back(rng: Rng, folder: Path) -> Case:
    """Times go back once, for good, or from the first on."""
    plain = drive(rng)
    times = plain.time_s.copy()
    at, how = int(rng.integers(1, SCANS)), int(rng.integers(4))
    if how == 0:
        times[at] -= rng.uniform(0.6, 1e4)
    elif how == 1:
        times[at:] -= rng.uniform(10.0, 1e4)
    elif how == 2:
        times = times[::-1].copy()
    else:
        times[rng.permutation(SCANS)[:2]] = times[:2]
    newest = np.maximum.accumulate(times)
    left_out = int(np.count_nonzero(times < newest))
    equal = np.any(np.diff(times[times >= newest]) == 0.0)
    note = "with the time of the one before" if equal else ""
    return Case(read(folder, replace(plain, time_s=times).flaser()), holds(SCANS - left_out, left_out, note))


def times_equal(rng: Rng, folder: Path) -> Case:
    """Some scans, or all, say one time."""
    plain = drive(rng)
    times = plain.time_s.copy()
    low, high = sorted(int(k) for k in rng.choice(SCANS + 1, 2, replace=False))
    times[low:high] = times[low]
    times[low:high] = times[max(low - 1, 0)] if high - low == 1 and low else times[low]
    note = "with the time of the one before" if np.any(np.diff(times) == 0.0) else ""
    return Case(read(folder, replace(plain, time_s=times).flaser()), holds(SCANS, 0, note))


def times_begin(rng: Rng, folder: Path) -> Case:
    """A clock begins at 0, before it, in 1970, or any time."""
    plain = drive(rng)
    begin = float(pick(rng, (0.0, -100.0, 1e-3, 1.7e9, rng.uniform(-1e5, 4e9))))
    return Case(read(folder, replace(plain, time_s=begin + 0.5 * np.arange(SCANS)).flaser()), holds(SCANS))


def clock_units(rng: Rng, folder: Path) -> Case:
    """Times count thousandths of a second or less, since 1970 or since the start."""
    plain = drive(rng)
    unit, scale = pick(rng, (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)))
    if rng.random() < 0.5:
        times = np.round(scale * (1.7e9 + 0.5 * np.arange(SCANS)))
        return Case(read(folder, replace(plain, time_s=times).flaser()), refused=f"{unit}? divide them by")
    times = np.round(scale * 0.5 * np.arange(SCANS))
    lines = read(folder, replace(plain, time_s=times).flaser())
    if unit == "milliseconds":
        return Case(lines, holds(SCANS, 0, "found one every 500 s"))
    return Case(lines, refused="expected times in seconds, found a")


def lengths(rng: Rng, folder: Path) -> Case:
    """Ranges or odometry in other units than metres, headings in degrees."""
    plain = drive(rng)
    scale = float(pick(rng, (100.0, 1000.0, 1e6)))
    match int(rng.integers(4)):
        case 0:
            lines = replace(plain, ranges=scale * plain.ranges).flaser()
            return Case(read(folder, lines), refused="expected ranges in metres")
        case 1:
            lines = replace(plain, ranges=plain.ranges / 1000.0).flaser()
            return Case(read(folder, lines), refused="expected ranges in metres")
        case 2:
            moved = plain.poses * [1000.0, 1000.0, 1.0]
            lines = replace(plain, poses=moved).flaser()
            return Case(read(folder, lines), refused="expected odometry in metres")
        case _:
            turned = plain.poses * [1.0, 1.0, 180.0 / np.pi] + np.outer(np.arange(SCANS), [0.0, 0.0, 8.0])
            fast = replace(plain, poses=turned, time_s=plain.time_s[0] + 0.2 * np.arange(SCANS))
            return Case(read(folder, fast.flaser()), refused="expected headings in radians")


def beams(rng: Rng, folder: Path) -> Case:
    """Any number of beams: those of SICK scanners, and others, which CARMEN takes to be spread over 180 degrees."""
    known = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5, 400: 0.25, 401: 0.25}
    count = int(pick(rng, (*known, *rng.integers(20, 1500, 6))))
    step = known.get(count, 180.0 / (count - 1))
    made = drive(rng, np.deg2rad(-90.0 + step * np.arange(count)))

    def check(run: RealRun) -> str:
        wrong = holds(SCANS, 0, "" if count in known else f"found {count}: assumed to cover 180")(run)
        off = np.abs(run.log.recording.bearings_rad - made.bearings).max()
        return wrong or ("" if off < 1e-9 else f"bearings {off:g} rad off")

    return Case(read(folder, made.flaser()), check)


def scanners(rng: Rng, folder: Path) -> Case:
    """A scanner that looks back, one of another number, and several at once: one is read, and the others are told."""
    front, back = drive(rng), drive(rng, turned=np.pi)
    says = bool(rng.random() < 0.5)
    place = (0.0, 0.0, np.pi if says else 0.0)
    number = int(rng.integers(1, 6))
    rows = zip(front.time_s, front.poses, front.ranges, strict=True)
    head = [f"ROBOTLASER{number}", 0, -0.5 * np.pi, np.pi, np.deg2rad(1.0), 20.0, 0.01, 0, 180]
    new = [
        " ".join(map(str, [*head, *ranges, 0, *pose, *pose, 0, 0, 0, 0, 0, time_s, "robot", 0.0]))
        for time_s, pose, ranges in rows
    ]
    sets = {"FLASER": front.flaser(), "RLASER": back.flaser("RLASER", place), f"ROBOTLASER{number}": new}
    taken = [name for name in sets if rng.random() < 0.6] or ["RLASER"]
    best = min(taken, key=("FLASER", "ROBOTLASER1", "RLASER", *(f"ROBOTLASER{k}" for k in range(2, 6))).index)
    lines = [line for row in zip(*(sets[name] for name in taken), strict=True) for line in row]

    def check(run: RealRun) -> str:
        wrong = holds(SCANS, 0, "expected the scans of one scanner" if len(taken) > 1 else "")(run)
        turn = float(run.log.scanner_on_robot[2])
        expected = np.pi if best == "RLASER" else 0.0
        return wrong or ("" if abs(abs(turn) - expected) < 1e-6 else f"{best} looks to {turn:g} rad")

    return Case(read(folder, lines), check)


def breezyslam(rng: Rng, folder: Path) -> Case:
    """The .dat files of BreezySLAM, at times with lines cut short."""
    made, scans = drive(rng, np.deg2rad(np.linspace(-120.0, 120.0, 682))), 4
    lines = []
    cut = {int(k) for k in rng.choice(scans, int(rng.integers(0, 3)), replace=False)} - {0}
    for k, (time_s, ranges) in enumerate(zip(made.time_s[:scans], made.ranges, strict=False)):
        words = [round(1e6 * (time_s - 9e8)), 0, 7 * k, 6 * k, *[0] * 20, *np.round(1000 * ranges).astype(int), 0]
        lines.append(" ".join(map(str, words[:300] if k in cut else words)))
    path = folder / "exp.dat"
    path.write_text("\n".join(lines) + "\n")

    def check(run: RealRun) -> str:
        last = scans - 1 in cut and scans - 2 not in cut
        wrong = holds(scans - len(cut), len(cut) - last, "BreezySLAM", last)(run)
        near = run.log.recording.ranges_m[0]
        expected = np.where(made.ranges[0] >= 4.0, np.inf, made.ranges[0])
        with np.errstate(invalid="ignore"):
            off = np.nanmax(np.where(np.isinf(expected) & np.isinf(near), 0.0, np.abs(near - expected)))
        return wrong or ("" if off < 1e-3 else f"ranges {off:g} m off")

    return Case(lambda: read_real_run(path, RealOptions(), None, {}, {}), check)


def broken_lines(rng: Rng, folder: Path) -> Case:
    """Lines that hold no scan: they are left out and counted, and a log that is mostly they has failed."""
    lines = drive(rng).flaser()
    count = int(rng.integers(1, SCANS))
    spoilt = rng.permutation(SCANS)[:count].tolist()
    for k in spoilt:
        words = lines[k].split()
        way = int(rng.integers(4))
        lines[k] = [
            " ".join(words[: int(rng.integers(1, 185))]),
            " ".join([*words[:90], "x", *words[91:]]),
            " ".join([words[0], "-3", *words[2:]]),
            " ".join([*words[:182], "nan", *words[183:]]),
        ][way]
    last = SCANS - 1 in spoilt and SCANS - 2 not in spoilt
    return Case(read(folder, lines), holds(SCANS - count, count - last, "", last))


def packed(rng: Rng, folder: Path) -> Case:
    """Packed by gzip it is read; by anything else it is refused by its name."""
    path, content = folder / "a.log", ("\n".join(drive(rng).flaser()) + "\n").encode()
    tar, archive = io.BytesIO(), io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w") as file:
        info = tarfile.TarInfo("a.log")
        info.size = len(content)
        file.addfile(info, io.BytesIO(content))
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("a.log", content)
    ways = {
        "a zip file": archive.getvalue(),
        "a tar archive": pick(rng, (tar.getvalue(), gzip.compress(tar.getvalue()))),
        "a file packed by bzip2": bz2.compress(content),
        "a file packed by xz": lzma.compress(content),
        "a file packed by zstd": b"\x28\xb5\x2f\xfd" + rng.bytes(50),
        "a 7z archive": b"7z\xbc\xaf\x27\x1c" + rng.bytes(50),
        "a RAR archive": b"Rar!\x1a\x07" + rng.bytes(50),
        "": gzip.compress(content),
    }
    name = pick(rng, sorted(ways))
    path.write_bytes(ways[name])

    def load() -> RealRun:
        return read_real_run(path, RealOptions(odometry="wheels"), None, {}, {})

    return Case(load, refused=f"{name}: unpack it") if name else Case(load, holds(SCANS))
