"""Is extraction honest? Recall and NEES of single scans' lines against the true walls, with known poses.

An extracted line is labelled by the wall (faces on one line, seen from one side, are one wall) that most of its beams
came from; below 80 % it is "mixed" and only counted. NEES is e' C^-1 e, stated twice: with e = (alpha, r) as the
filters use it, and with e along and across the line at the middle of the seen piece, which stays calibrated for short
lines (C is the same; only the point of linearisation differs). Both should follow chi-square with 2 degrees of freedom.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int
from rich.console import Console
from rich.table import Table
from scipy.sparse.csgraph import connected_components

from chainslam.experiments.scoring.beam_votes import vote
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.sim.lidar import LidarConfig, RangeFinder, noisy
from chainslam.sim.worlds import WORLDS, World, WorldError, load
from chainslam.slam.evaluation.consistency import nees
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import directions, normals, through
from chainslam.slam.geometry.poses import to_robot, wrap
from chainslam.slam.map.reliability import ReliabilityConfig
from chainslam.slam.robot import Scan

from ..runner.command import run_study

PLANS = Path(__file__).parents[2] / ".." / "shared" / "data" / "plans"
FLAT_RAD, FLAT_M = 1e-3, 2e-3
MIXED_SHARE = 0.8
EXTRACTION = ExtractionConfig()


@dataclass(frozen=True)
class ExtractionStudy:
    """Which scans the study takes."""

    half: Literal["tune", "report"] = "report"
    """Every second plan served to set the thresholds; the others are kept for the report."""
    lines: int = 10_000
    """Stop after the world in which this many labelled lines of 5 beams or more are reached."""
    seed: int = 2
    """Seed of the poses and of the noise."""
    scans_per_world: int = 40
    """Scans taken in each world."""
    plans: Path = PLANS
    """Folder of plan files; the bundled worlds serve in either half."""
    beams: int = 180
    """Beams of the range finder."""
    fov_deg: float = 360.0
    """Its field of view."""
    sigma_m: float = 0.010
    """Its radial noise; stated as it is."""
    errorless: bool = False
    """Exact ranges, the noise still stated: recall and mixed lines only."""

    def run(self) -> int:
        """Take the scans, print the tables and return 0; raises UsageError for a folder without plans."""
        report(*sample(self), plain_console(width=120))
        return 0


Rows = TypeVar("Rows")


@dataclass(frozen=True)
class Lines:
    """Extracted lines joined with the truth, one row a line."""

    error: Float[np.ndarray, "n 2"]
    """Estimated minus true (alpha rad, r m), robot frame."""
    across: Float[np.ndarray, "n 2"]
    """Error of the heading rad and across the line m at its seen piece."""
    cov: Float[np.ndarray, "n 2 2"]
    """Stated covariance of (alpha, r)."""
    along: Float[np.ndarray, "n 2"]
    """Where the seen piece begins and ends along the line, m from the foot of the perpendicular."""
    r: Float[np.ndarray, " n"]
    """Distance m of the line."""
    beams: Int[np.ndarray, " n"]
    """Number of beams fitted."""
    share: Float[np.ndarray, " n"]
    """Share of its beams that came from the wall of its label."""
    is_double: Bool[np.ndarray, " n"]
    """Whether the line before it, with no gap, has the same label."""


@dataclass(frozen=True)
class Walls:
    """Walls that scans met, one row a wall and scan."""

    beams: Int[np.ndarray, " n"]
    """Beams that it returned."""
    is_found: Bool[np.ndarray, " n"]
    """Whether a line carries its label."""


def wall_of_face(faces: Float[np.ndarray, "n 2 2"]) -> Int[np.ndarray, " n"]:
    """Return a wall number for each face; faces on one line with the free side on the same side share it."""
    lines = through(faces)
    one = np.abs(wrap(lines[:, None, 0] - lines[None, :, 0])) < FLAT_RAD
    for end in (0, 1):
        one &= np.abs(faces[:, end] @ normals(lines[:, 0]).T - lines[None, :, 1]) < FLAT_M
    return np.asarray(connected_components(one & one.T, directed=False)[1])


def join(
    segments: Segments,
    face_of_beam: Int[np.ndarray, " k"],
    walls: Int[np.ndarray, " f"],
    faces: Float[np.ndarray, "f 2 2"],
    pose: Float[np.ndarray, "3"],
) -> tuple[Lines, Walls]:
    """Return the extracted lines with their errors, and the walls met, of one scan."""
    wall_of_beam = np.where(face_of_beam >= 0, walls[face_of_beam], -1)
    k = len(face_of_beam)
    votes = [vote(span, face_of_beam, walls) for span in segments.beams.tolist()]
    label, face = np.array([told.winner for told in votes], int), np.array([told.face for told in votes], int)
    share = np.array([told.on_winner / max(len(told.faces), 1) for told in votes])
    truth = through(to_robot(faces[face], pose))
    e1 = wrap(segments.lines[:, 0] - truth[:, 0])
    t0 = segments.cov[:, 0, 1] / segments.cov[:, 0, 0]
    across = segments.lines[:, 1] * np.cos(e1) - t0 * np.sin(e1) - truth[:, 1]
    along = np.einsum("nej,nj->ne", segments.ends, directions(segments.lines[:, 0]))
    gap = (segments.beams[:, 0] - np.roll(segments.beams[:, 1], 1)) % k
    lines = Lines(
        error=np.column_stack([e1, segments.lines[:, 1] - truth[:, 1]]),
        across=np.column_stack([e1, across]),
        cov=segments.cov,
        along=along,
        r=segments.lines[:, 1],
        beams=segments.beam_counts,
        share=share,
        is_double=(label == np.roll(label, 1)) & (gap <= 4) & (len(segments) > 1),
    )
    met, beams = np.unique(wall_of_beam[wall_of_beam >= 0], return_counts=True)
    return lines, Walls(beams, np.isin(met, label))


def poses(world: World, count: int, rng: np.random.Generator) -> Iterator[Float[np.ndarray, "3"]]:
    """Yield random poses that a disc of 0.25 m can reach; none where there is no such place."""
    free = world.reachable(0.25)
    x0, y0, x1, y1 = free.bounds
    shapely.prepare(free)
    while count and free.area > 0.1:
        pose = rng.uniform([x0, y0, -np.pi], [x1, y1, np.pi])
        if shapely.contains_xy(free, *pose[:2]):
            count -= 1
            yield pose


def worlds(config: ExtractionStudy) -> Iterator[World]:
    """Yield the bundled worlds and this half of the plans, in random order; raises UsageError without a plan."""
    plans = sorted(config.plans.glob("*.json"))[{"tune": 0, "report": 1}[config.half] :: 2]
    if not plans:
        raise UsageError(f"expected a folder of plans, found no file *.json in {config.plans}: check it")
    names = [*WORLDS, *map(str, plans)]
    for name in np.random.default_rng(config.seed).permutation(names):
        try:
            yield load(str(name))
        except WorldError as refusal:
            plain_console(stderr=True).print(f"left out: {refusal}")


def sample(config: ExtractionStudy) -> tuple[Lines, Walls]:
    """Return the lines and walls of as many scans as the study needs."""
    lidar = LidarConfig(beams=config.beams, fov_rad=np.deg2rad(config.fov_deg), sigma_m=config.sigma_m)
    rng, noise = np.random.default_rng(config.seed), 0.0 if config.errorless else config.sigma_m
    lines: list[Lines] = []
    met: list[Walls] = []
    total = 0
    for world in worlds(config):
        finder, walls = RangeFinder(world.faces, lidar), wall_of_face(world.faces)
        for pose in poses(world, config.scans_per_world, rng):
            exact, face_of_beam = finder.cast(pose)
            ranges = noisy(exact, noise, rng.standard_normal(config.beams), lidar.range_max_m)
            scan = Scan(finder.bearings_rad, ranges, config.sigma_m, lidar.range_max_m, 0.0)
            face_of_beam = np.where(np.isfinite(ranges), face_of_beam, -1)
            seen, walls_met = join(extract(scan, EXTRACTION), face_of_beam, walls, world.faces, pose)
            lines.append(seen)
            met.append(walls_met)
            total += int(np.sum((seen.beams >= EXTRACTION.sure_beams) & (seen.share >= MIXED_SHARE)))
        if total >= config.lines:
            break
    return stack(Lines, lines), stack(Walls, met)


def stack(kind: type[Rows], parts: list[Rows]) -> Rows:
    """Return the rows of all parts in one."""
    return kind(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in kind.__annotations__})


def both_nees(lines: Lines) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the NEES in (alpha, r), and along and across the seen piece."""
    var_alpha, cov, var_r = lines.cov[:, 0, 0], lines.cov[:, 0, 1], lines.cov[:, 1, 1]
    across = lines.across[:, 0] ** 2 / var_alpha + lines.across[:, 1] ** 2 / (var_r - cov**2 / var_alpha)
    return nees(lines.error, lines.cov), across


def groups(lines: Lines) -> dict[str, Bool[np.ndarray, " n"]]:
    """Return the rows of the table: what each is called and which lines are in it."""
    clean, long = lines.share >= MIXED_SHARE, lines.beams >= EXTRACTION.sure_beams
    is_sharp = long & (np.sqrt(lines.cov[:, 0, 0]) < np.deg2rad(1.5))
    good = clean & is_sharp
    low, high = lines.along[:, 0], lines.along[:, 1]
    incidence = np.rad2deg(np.arctan2(np.abs(0.5 * (low + high)), lines.r))
    has_foot = (low <= 0.0) & (high >= 0.0)
    rows = {
        "heading sigma < 1.5 deg": good,
        "  centred (holds the foot)": good & has_foot,
        "  off to one side": good & ~has_foot,
    }
    for start, stop in ((0, 30), (30, 60), (60, 75), (75, 90)):
        rows[f"  incidence {start} to {stop} deg"] = good & (incidence >= start) & (incidence < stop)
    for start, stop in ((5, 7), (8, 12), (13, 25), (26, 999)):
        rows[f"  {start} to {stop} beams"] = good & (lines.beams >= start) & (lines.beams <= stop)
    rows["  with mixed lines"] = is_sharp
    rows["all of 5 beams or more"] = clean & long
    rows["lines of 4 beams"] = clean & (lines.beams == 4)
    rows["lines of 3 beams"] = clean & (lines.beams == 3)
    is_known = np.sqrt(lines.cov[:, 0, 0]) < ReliabilityConfig().shared.known_rad
    rows["lines of 3 or 4 beams that may move the estimate"] = clean & ~long & is_known
    return rows


def report(lines: Lines, walls: Walls, console: Console) -> None:
    """Print the table of NEES (ideal: median 1.39, 95th percentile 5.99) and the counts."""
    table = Table("lines", "n", "median", "95 %", "median", "95 %", title="NEES in (alpha, r), then along and across")
    values = both_nees(lines)
    for name, rows in groups(lines).items():
        numbers = [f"{np.percentile(v[rows], q):.2f}" if rows.any() else "" for v in values for q in (50, 95)]
        table.add_row(name, str(int(rows.sum())), *numbers)
    console.print(table)
    counts = Table("walls by beams", "seen", "recall")
    for low, high in ((5, 999), (5, 5), (6, 9), (10, 999), (4, 4), (3, 3)):
        rows = (walls.beams >= low) & (walls.beams <= high)
        counts.add_row(f"{low} to {high}", str(int(rows.sum())), f"{walls.is_found[rows].mean():.4f}")
    console.print(counts)
    few = lines.beams < EXTRACTION.sure_beams
    for name, rows in {"5 beams or more": ~few, "3 or 4 beams": few}.items():
        mixed, double = rows & (lines.share < MIXED_SHARE), rows & lines.is_double
        console.print(
            f"{rows.sum()} lines of {name}: mixed {mixed.sum()} ({mixed.sum() / max(rows.sum(), 1):.2%}),"
            f" double {double.sum()} ({double.sum() / max(rows.sum(), 1):.2%})"
        )


if __name__ == "__main__":
    run_study(ExtractionStudy)
