"""What a person sees of a run: a progress line while it goes on, one table at its end."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table

from chainslam.explore.step import Step
from chainslam.slam.association.ranges.errors import RangeErrors
from chainslam.slam.evaluation.consistency import verdict_on_noise
from chainslam.slam.extraction.curved_share import MOSTLY, SCANS, curved_beams, few_straight, returns_of_scan

from .answers import found, is_quiet
from .console import plain_console

ALMOST = 0.95
"""A run that takes longer than expected stays at this share of its bar."""


@contextmanager
def progress(title: str, steps: float | None = None) -> Iterator[Callable[[Step], None]]:
    """Show steps on standard error while the block runs; quiet where that is not a terminal.

    `steps` is how many are expected; without it no time left is told.
    """
    with bar_of(title, steps, TextColumn("{task.fields[words]}", table_column=Column(no_wrap=True))) as (bar, task):
        curved, returns = 0, 0

        def watch(step: Step) -> None:
            nonlocal curved, returns
            done = step.index + 1
            if done <= SCANS:
                curved, returns = curved + curved_beams(step.scan, step.segments), returns + returns_of_scan(step.scan)
            if done == SCANS and (words := few_straight(curved, returns)):
                bar.console.print(words)
            open_ends = sum(len(chain.open_ends) for chain in step.chains)
            clock = timedelta(seconds=int(step.time_s))
            words = f"step {done}, {step.path_length_m:.0f} m, {open_ends} open ends, robot clock {clock}"
            bar.update(task, completed=done, total=total_of(steps, done), words=words)

        yield watch


@contextmanager
def bar_of(title: str, total: float | None, *columns: ProgressColumn) -> Iterator[tuple[Progress, TaskID]]:
    """Yield a bar on standard error, and its task, with the computing time so far and what is left of it."""
    console = plain_console(stderr=True)
    left = (
        ()
        if total is None
        else (TextColumn("left"), TimeRemainingColumn(compact=True, table_column=Column(no_wrap=True, min_width=5)))
    )
    shown = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=8),
        *columns,
        TextColumn("computing"),
        TimeElapsedColumn(table_column=Column(no_wrap=True, min_width=7)),
        *left,
    )
    with Progress(*shown, console=console, disable=not console.is_terminal or is_quiet(), transient=True) as bar:
        yield bar, bar.add_task(title, total=total, words="")


def total_of(expected: float | None, done: int) -> float | None:
    """Return what counts as the whole of a run: what was expected, or a little more than is done already."""
    return None if expected is None else max(expected, done / ALMOST)


def duration(seconds: float) -> str:
    """Return a time in words of two units at most."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def print_summary(summary: dict[str, Any]) -> None:
    """Print the one table of a run on standard output."""
    found(summary=summary)
    noise = "errorless" if summary["errorless"] else f"seed {summary['seed']}, P0 {summary['p0']}"
    table = Table(
        title=f"{summary['world']}: {summary['backend']}, {summary['strategy']}, {noise}", title_justify="left"
    )
    table.add_column("measure")
    table.add_column("value", justify="right", overflow="fold")
    for name, value in _rows(summary):
        table.add_row(name, value)
    plain_console().print(table)


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [("status", f"{summary['status']} ({summary['reason']})"), ("steps", str(summary["steps"]))]
    if not summary["steps"]:
        return rows
    ms = summary["step_ms"]
    rows += [
        ("path", f"{summary['path_length_m']:.1f} m"),
        ("driving time of the robot", duration(summary["drive_time_s"])),
        ("computing time of this machine", duration(1e-3 * ms["mean"] * summary["steps"])),
        ("computing time of a step: mean, 95 %", f"{ms['mean']:.1f} ms, {ms['p95']:.1f} ms"),
        ("contours closed", f"{summary['contours_closed']} of {summary['contours_reachable']}"),
        ("coverage", f"{100 * summary['coverage']:.2f} %"),
        *_own_frame(summary),
        ("floor swept", f"{100 * summary['swept']:.2f} %"),
        ("open ends left, set aside", f"{summary['open_ends']}, {len(summary['set_aside'])}"),
        *_way_back(summary["certificate"]["reachable_way"]),
        ("collisions", str(summary["collisions"])),
        ("lines (tentative, duplicate)", _counts(summary)),
        ("false matches", str(summary["false_matches"])),
        ("pose error, rms", f"{100 * summary['pose_rmse_m']:.2f} cm, {57.29578 * summary['heading_rmse_rad']:.3f} deg"),
        ("odometry alone: rms, worst", f"{summary['odometry_rmse_m']:.2f} m, {summary['odometry_max_m']:.2f} m"),
        ("pose ANEES from the start (1 is ideal)", number(summary.get("pose_anees_from_start"))),
        ("pose ANEES (1 is ideal)", number(summary["pose_anees"])),
        ("pose NEES in the 95 % band", number(summary["pose_nees_in_band"])),
        ("map ANEES (1 is ideal)", number(summary["map_anees"])),
        ("NIS (1 is ideal), scans in its band", _innovations(summary)),
        *_faults(summary),
    ]
    if home := summary["return_to_start"]:
        rows.append(("from the start: believed, true", f"{home['distance_m']:.2f} m, {home['distance_true_m']:.2f} m"))
    mapped = {pair: d for pair, d in summary["distances"].items() if d["mapped_m"] is not None}
    rows += [
        (f"distance {pair}", f"{d['mapped_m']:.3f} m (true {d['true_m']:.2f} m)")
        for pair, d in list(mapped.items())[:6]
    ]
    if mapped and len(mapped) < len(summary["distances"]):
        missing = len(summary["distances"]) - len(mapped)
        rows.append(("distances not in the map", str(missing)))
    return rows


def _own_frame(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return a row where the map began in the blind, so that it is off as a whole by what was lost before."""
    if not summary["map_began_step"]:
        return []
    return [("the same, laid over the truth by its path", f"{100 * summary['coverage_own_frame']:.2f} %")]


def _way_back(share: float | None) -> list[tuple[str, str]]:
    """Return a row where the robot has locked itself in, or its map contradicts the way that it took."""
    return [] if share is None or share > 0.9 else [("of its way it can drive again", f"{100 * share:.0f} %")]


def _faults(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return rows for what the robot noticed of itself; none where nothing was wrong."""
    told = {
        "motions that the odometry did not report": summary.get("unstated_motions"),
        "steps without a place in the map": summary.get("lost_steps"),
    }
    rows = [(words, str(count)) for words, count in told.items() if count]
    rows += [("the scanner's ranges have", words) for words in words_on_ranges(range_errors_of(summary))]
    if (summary.get("curved_share") or 0.0) > MOSTLY:
        rows.append(("few straight walls: share of the first returns on curved ones", f"{summary['curved_share']:.2f}"))
    if beams := summary.get("own_beams"):
        rows.append(("returns of the robot's own body, taken for nothing", str(beams)))
    if (factor := summary.get("wheel_noise_factor", 1.0)) != 1.0:
        rows.append(("noise of the wheels, times as stated", f"{factor:g}"))
    return rows


def words_on_ranges(errors: RangeErrors) -> list[str]:
    """Return what is to be said of a scanner's ranges; nothing where nothing is sure."""
    found = []
    if errors.is_biased():
        found.append(f"a bias of {1e3 * errors.bias_m:+.1f} mm (sigma {1e3 * errors.bias_sigma_m:.1f} mm)")
    if errors.is_scaled():
        grown, sigma = 100.0 * (errors.scale - 1.0), 100.0 * errors.scale_sigma
        found.append(f"a scale of {grown:+.2f} % against the wheels (sigma {sigma:.2f} %)")
    return found


def range_errors_of(summary: dict[str, Any]) -> RangeErrors:
    """Return what a summary says of the scanner's ranges; of one that says nothing, nothing is known."""
    keys = {"bias_m": "range_bias_m", "bias_sigma_m": "range_bias_sigma_m"}
    keys |= {"scale": "range_scale", "scale_sigma": "range_scale_sigma"}
    said = {name: value for name, key in keys.items() if (value := summary.get(key)) is not None}
    return RangeErrors(**said)


def _counts(summary: dict[str, Any]) -> str:
    return f"{summary['lines']} ({summary['lines_tentative']}, {summary['duplicate_lines']})"


def number(value: float | None) -> str:
    """Return a number with three digits after the point, a dash for none."""
    return "-" if value is None else f"{value:.3f}"


def _innovations(summary: dict[str, Any]) -> str:
    """Return the NIS and its verdict."""
    nis, share = summary.get("nis"), summary.get("nis_in_band")
    return "-" if nis is None or share is None else f"{nis:.3f}, {100 * share:.0f} %: {verdict_on_noise(nis, share)}"


def print_comparison(summaries: Sequence[dict[str, Any]], title: str) -> None:
    """Print one column for each of several replays of one recording on standard output."""
    _print_columns(
        summaries,
        title,
        {
            "status": "status",
            "ANEES from the start": "pose_anees_from_start",
            "pose ANEES": "pose_anees",
            "NEES in 95 % band": "pose_nees_in_band",
            "map ANEES": "map_anees",
            "pose error m": "pose_rmse_m",
            "heading error rad": "heading_rmse_rad",
            "lines": "lines",
            "duplicate walls": "duplicate_lines",
            "false matches": "false_matches",
            "computing ms a step": "step_ms",
        },
    )


def print_recorded(summaries: Sequence[dict[str, Any]], title: str) -> None:
    """Print one column for each back end that mapped a real robot's log on standard output."""
    _print_columns(
        summaries,
        title,
        {
            "status": "status",
            "scans mapped": "steps",
            "path by the wheels, m": "path_length_m",
            "walls": "lines",
            "duplicate walls": "duplicate_lines",
            "closed chains": "chains_closed",
            "computing ms a step": "step_ms",
        },
    )


def _print_columns(summaries: Sequence[dict[str, Any]], title: str, keys: dict[str, str]) -> None:
    """Print a column for each summary, of the values under these keys, each under its name."""
    found(summaries={summary["backend"]: summary for summary in summaries})
    table = Table(title=title, title_justify="left")
    table.add_column("", no_wrap=True)
    for summary in summaries:
        table.add_column(summary["backend"], justify="right", overflow="fold")
    for name, key in keys.items():
        table.add_row(name, *(_short(summary.get(key)) for summary in summaries))
    plain_console().print(table)


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return _short(value["mean"])
    return "-" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def print_pooled(rows: Sequence[dict[str, Any]], title: str) -> None:
    """Print one row for each back end of a campaign, pooled over its worlds and strategies, on standard output."""
    found(pooled=rows)
    table = Table(title=title, title_justify="left")
    for name in ("back end", "complete", "ANEES from the start", "map ANEES", "walls cm", "path cm"):
        table.add_column(name, justify="left" if name == "back end" else "right")
    for row in rows:
        anees = [_short(row[name] and row[name]["mean"]) for name in ("pose_anees_from_start", "map_anees")]
        errors = [_short(row[name] and 100.0 * row[name]["mean"]) for name in ("wall_rmse_m", "ate_m")]
        table.add_row(row["backend"], f"{row['complete']} of {row['trials']}", *anees, *errors)
    plain_console().print(table)
