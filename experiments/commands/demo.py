"""`chainslam demo`: explores a bundled world, replays its scans through three estimators, and opens the report."""

import os
import sys
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step

from ..library.driving import Watch
from ..library.pages import report_at
from ..library.running import explore, replay
from ..library.runs import Run
from ..scenario import DRIVER
from ..scoring.summary import EXIT_STATUS
from ..terminal.answers import found
from ..terminal.console import say
from ..terminal.interrupts import first_interrupt_waits
from ..terminal.progress import progress
from ..views.run_lines import SCATTER

WORLD, SEED, STEPS = "paper-fig9", 1, 350.0
"""World and seed, and the approximate number of steps."""
ESTIMATORS = tuple(dict.fromkeys(("block-ekf", "full-ekf", DRIVER)))


@dataclass(frozen=True)
class Demo:
    """Explore a bundled world, replay its scans through three estimators, and open a report that compares them."""

    out: Path = Path("results/demo")
    """Folder for the results: the exploration in `run`, the replays and their report in `replays`."""
    open: bool = True
    """Open the report in a web browser. Without a display, or if the output does not go to a terminal, it is only
    written."""
    force: bool = False
    """Replace other runs in these folders: remove the files of a run, and no others."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for a folder that cannot be used."""
        folder, replays = self.out / "run", dict[str, Run]()
        run = last = _watched(
            f"exploring {WORLD}",
            STEPS,
            lambda watch: explore(WORLD, seed=SEED, out=folder, force=self.force, watch=watch),
        )
        for name in ESTIMATORS:
            if not _status(last):
                replays[name] = last = self._replayed(run, name)
        if status := _status(last):
            say(f"chainslam: {last.summary['status']}: {last.summary['reason']}; results in {self.out}", stderr=True)
            return status
        report = report_at(self.out / "replays")[1]
        summaries = {name: each.summary for name, each in replays.items()}
        found(explored=run.summary, replayed=summaries, report=str(report), folder=str(self.out))
        for line in seen(run.summary, summaries, folder / "map.png", report):
            say(line)
        if self.open:
            open_page(report)
        return 0

    def _replayed(self, run: Run, name: str) -> Run:
        return _watched(
            f"replaying with {name}",
            float(run.summary["steps"]),
            lambda watch: replay(run, backend=name, out=self.out / "replays" / name, force=self.force, watch=watch),
        )


def seen(
    run: Mapping[str, Any], replays: Mapping[str, Mapping[str, Any]], picture: Path, report: Path
) -> tuple[str, str, str]:
    """Return three lines: what was explored, how consistent each estimator is, and the verdict with the report."""
    scores = {name: said["pose_anees_from_start"] for name, said in replays.items()}
    scored = {name: score for name, score in scores.items() if score is not None}
    told = ", ".join(f"{name} {'-' if score is None else f'{score:.3g}'}" for name, score in scores.items())
    worst = max(scored, key=lambda name: scored[name], default="")
    verdict = "no estimator was found overconfident"
    if worst and scored[worst] > SCATTER[1]:
        times = scored[worst] ** 0.5
        verdict = f"{worst} is overconfident: its pose errors are {times:.1f} times as large as its covariance states"
    return (
        f"explored {run['world']}: {run['contours_closed']} of {run['contours_reachable']} contours closed after"
        f" {run['steps']} steps and {run['path_length_m']:.1f} m; the map is {picture}",
        f"replayed its scans through {len(replays)} estimators; ANEES of the pose from the start (1 is ideal): {told}",
        f"{verdict}; the report is {report}",
    )


def open_page(page: Path) -> None:
    """Open a page in a web browser if somebody can see it; a browser that cannot be opened is not an error."""
    has_display = sys.platform == "darwin" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")))
    if has_display and sys.stdout.isatty():
        with suppress(OSError, webbrowser.Error):
            webbrowser.open(page.resolve().as_uri())


def _watched(title: str, steps: float, go: Callable[[Watch], Run]) -> Run:
    """Return a run after showing its progress; an interrupt ends it after the current step."""
    with progress(title, steps) as show, first_interrupt_waits() as stop_if_asked:

        def watch(step: Step) -> None:
            show(step)
            stop_if_asked()

        return go(watch)


def _status(run: Run) -> int:
    """Return the exit status for a run; 0 if it ended by itself or at a limit."""
    return EXIT_STATUS.get(Outcome(run.summary["outcome"]), 0)
