"""What becomes of walls that stand in the map twice, where they are merged and where not.

.venv/bin/python -m experiments.duplicates_study --world paper-fig8 --seeds 2 --backends full-ekf block-ekf

Nature is too kind to tell: a run enters a wall twice once in fifty times. So one recording is replayed, and matching is
blind in a few scans, in which all that is in sight is entered again.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import tyro
from rich.table import Table

from slam.backend import Joint
from slam.mapper import MapperConfig, Matcher
from slam.matching import NO_MATCHES, KnownWalls, Matches, MatchingConfig
from slam.segments import Segments

from .console import plain_console
from .replay import RecordedRun, replay, run_of
from .results import log_arrays
from .scenario import TrialConfig, UsageError, load_world
from .trial import run_trial

BLIND = frozenset({30, 31, 60, 61, 90, 91, 120, 121})
"""Numbers of the scans, from 1, that are matched to nothing; two in turn, so that what they enter is trusted."""
COLUMNS = ("duplicate_lines", "merges", "false_merges", "false_matches", "lines", "pose_anees")


@dataclass(frozen=True)
class Study:
    """Replay recordings with matching blind in a few scans, and print a row with and without merging."""

    world: str = "paper-fig8"
    """A bundled name or a file."""
    seeds: int = 2
    """Recordings, with seeds 1 to this, driven by the full EKF."""
    backends: tuple[str, ...] = ("full-ekf", "block-ekf")
    """The estimators."""


class BlindMatcher:
    """Matches nothing in some scans."""

    def __init__(self, matcher: Matcher) -> None:
        self._matcher = matcher
        self._scan = 0

    def __call__(
        self, segments: Segments, walls: KnownWalls, joint: Joint, config: MatchingConfig, *, clear_only: bool = False
    ) -> Matches:
        """Match one scan; a mapper asks for clear matches first, once more with a wider gate, then for the rest."""
        self._scan += clear_only and config.gate < config.doubt
        if self._scan not in BLIND:
            return self._matcher(segments, walls, joint, config, clear_only=clear_only)
        return replace(NO_MATCHES, unmatched=np.arange(len(segments)))


def ways(config: MapperConfig) -> dict[str, MapperConfig]:
    """Return the ways of dealing with duplicates, by name."""
    return {"kept": replace(config, duplicates=None), "merged": config}


def record(config: TrialConfig) -> RecordedRun:
    """Drive once and return the recording; raises UsageError where nothing was recorded."""
    made = run_trial(config)
    if made.log is None:
        raise UsageError(f"expected a run of at least one step, found none: {made.ending.reason}")
    arrays = {name: np.asarray(value) for name, value in log_arrays(made, made.log).items()}
    return run_of(arrays, lambda: config)


def main() -> int:
    """Run the study that the command line names and return the exit status."""
    study = tyro.cli(Study, prog="experiments.duplicates_study")
    table = Table(title=f"{study.world}, matching blind in {len(BLIND)} scans", title_justify="left")
    for column in ("seed", "back end", "duplicates", *COLUMNS):
        table.add_column(column, justify="right")
    around: Callable[[Matcher], Matcher] = BlindMatcher
    try:
        world = load_world(study.world)
        for seed in range(1, study.seeds + 1):
            run = record(TrialConfig(study.world, seed=seed))
            for backend in study.backends:
                for name, mapper in ways(run.trial.mission.mapper).items():
                    trial = replace(run.trial, mission=replace(run.trial.mission, mapper=mapper))
                    summary = replay(replace(run, trial=trial), backend, world=world, around=around).summary
                    table.add_row(str(seed), backend, name, *(f"{summary[key]:.4g}" for key in COLUMNS))
    except UsageError as error:
        print(f"duplicates_study: {error}", file=sys.stderr)
        return 2
    plain_console(width=None if sys.stdout.isatty() else 140).print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
