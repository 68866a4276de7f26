"""Each rule switched off over plans of real buildings: what gets worse, against the same runs with all rules on.

Of each plan one run is driven with every rule. Where a rule first makes a difference in it the process forks, and the
fork goes on with that rule off: a rule that never makes one costs nothing, and no step is driven twice.

.venv/bin/python -m studies.rules.study --plans ../shared/data/plans --out results/rules.jsonl
"""

import importlib
import os
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from .switches import STATE, fitting, install
from .table import SWITCHES, WHAT
from .verdicts import is_clearly_worse

Row = dict[str, Any]
BASELINE = ""
"""Stands in the place of the rule in a row of a run with all rules."""
SCHOOLS = ("Borchen4", "Franch1", "Lamuniere1", "Milano_1", "Sabadell1")
KEPT = (
    "status reason steps coverage coverage_own_frame contours_closed map_anees pose_anees duplicate_lines"
    " false_matches false_merges collisions path_length_m swept processor_s"
)
"""What is kept of the row of a trial."""


@dataclass(frozen=True)
class RulesStudy:
    """Drive the plans, with all rules and with each of some rules off."""

    plans: Path
    """A folder of plans, `lifull_*` and `cml_*`."""
    out: Path = Path("results/rules.jsonl")
    """A line of JSON for each run. What it holds of the same code already is not run again."""
    rules: tuple[str, ...] = tuple(WHAT)
    """Which rules are switched off."""
    every: int = 4
    """Every so manyth apartment by name."""
    school_steps: int = 2_000
    """A school is left after so many scans."""
    backend: str = "invariant-ekf"
    """The estimator."""
    minutes: float = 1e9
    """No plan is begun after so many minutes of processor time."""

    def trials(self) -> list[tuple[Path, int]]:
        """Return files and limits of steps: apartments, those of few walls first, then schools."""
        apartments = sorted(self.plans.glob("lifull_*"))[:: self.every]
        apartments.sort(key=lambda file: (file.stat().st_size, file.name))
        schools = [self.plans / f"cml_{name}.json" for name in SCHOOLS]
        return [(file, 100_000) for file in apartments] + [(file, self.school_steps) for file in schools]


class Watcher:
    """Forks where one of the wanted rules first changes a value, and counts how often each would have."""

    def __init__(self, wanted: set[str]) -> None:
        self.fires: Counter[str] = Counter()
        self.rule = BASELINE
        """The rule that is off in this process."""
        self._wanted = wanted

    def __call__(self, rule: str) -> bool:
        """Take note that a rule changes a value; return True in the fork that goes on with this rule off."""
        self.fires[rule] += 1
        if rule not in self._wanted:
            return False
        self._wanted.discard(rule)
        sys.stdout.flush()
        child = os.fork()
        if child:
            os.waitpid(child, 0)
            return False
        self.rule = rule
        STATE.off, STATE.watch = frozenset({rule}), None
        return True


def main() -> int:
    """Run what the file lacks and return the exit status."""
    study = tyro.cli(RulesStudy, prog="studies.rules.study")
    install(fitting(SWITCHES))
    read = importlib.import_module("studies.runner.rows").read
    used = 0.0
    for file, steps in study.trials():
        if used > 60.0 * study.minutes:
            break
        used += _drive(study, file, steps, read(study.out, ("rule", "plan")))
    return 0


def _drive(study: RulesStudy, file: Path, max_steps: int, rows: list[Row]) -> float:
    """Drive one plan, with all rules and, forked off, without each of those still in question; return seconds taken."""
    # The switches are put into the sources as these are imported, so only now.
    scenario, trials, runner = (
        importlib.import_module(name)
        for name in ("chainslam.experiments.scenario", "studies.runner.trials", "studies.runner.rows")
    )
    there = {row["rule"]: row for row in rows if row["plan"] == file.stem}
    wanted = {rule for rule in study.rules if rule not in there and not is_clearly_worse(rows, rule)}
    if BASELINE in there:
        wanted &= there[BASELINE]["fires"].keys()
        if not wanted:
            return 0.0
    STATE.off, STATE.watch = frozenset(), (watcher := Watcher(wanted))
    began = _seconds()
    row = trials.one(scenario.TrialConfig(str(file), study.backend, max_steps=max_steps))
    kept: Row = {"rule": watcher.rule, "plan": file.stem} | {key: row.get(key) for key in KEPT.split()}
    if watcher.rule == BASELINE:
        kept["fires"] = dict(watcher.fires)
    if watcher.rule != BASELINE or BASELINE not in there:
        runner.append(study.out, [kept])
    if watcher.rule != BASELINE:
        os._exit(0)
    taken = _seconds() - began
    print(f"{file.stem}: {row.get('steps')} steps, {len(wanted)} rules wanted, {taken:.0f} s", flush=True)
    return taken


def _seconds() -> float:
    """Return the processor time of this process and of those that it forked, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


if __name__ == "__main__":
    sys.exit(main())
