"""Which test fails when a rule is off: tests run again, in forks, without each near rule that changes a value there.

.venv/bin/python -m studies.rules.held --out results/rules-held.jsonl
"""

import importlib
import json
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from .switches import STATE, fitting, install, is_kernel
from .table import SWITCHES

OPTIONS = (
    "addopts=--import-mode=importlib -p no:cacheprovider",
    "filterwarnings=ignore::pytest.PytestAssertRewriteWarning",
)
NEAR = {
    "accumulated_returns": "accumulated_returns driving",
    "candidate_kernels": "gate matching",
    "joint_kernels": "gate matching extract split_kernels",
    "matching": "matching",
    "matching_kernels": "gate matching hypotheses joint_compatibility",
    "hypothesis_kernels": "gate hypotheses matching",
    "rest_kernels": "gate hypotheses matching joint_compatibility",
    "mapper": "mapper matching vertices change_points splits landmark_candidates merge reliability recovery view",
    "map_keeper": "mapper matching vertices change_points splits landmark_candidates merge reliability straightness",
    "existence": "existence landmark_candidates extents",
    "existence_kernels": "existence extents",
    "view": "view recovery",
    "vertices": "vertices change_points mapper",
    "vertex_kernels": "vertices change_points mapper",
    "change_point_kernels": "change_points splits",
    "splits": "splits",
    "reliability": "reliability",
    "reliability_kernels": "reliability reliability_kernels straightness",
    "straightness": "straightness",
    "straightness_kernels": "straightness reliability",
    "displacement": "displacement",
    "extents": "extents displacement extent_kernels existence mapper merge",
    "extent_kernels": "extents extent_kernels mapper merge ray_evidence",
    "merging": "merging merge same_line change_points",
    "merging_kernels": "merging merge same_line change_points",
    "chains": "chains openings",
    "chain_kernels": "chains chain_kernels openings",
    "ray_kernels": "openings ray_evidence",
    "split_kernels": "extract split_kernels splits",
    "segment_kernels": "extract split_kernels",
    "fit_kernels": "extract noise_of_each_beam line_kernels",
    "loop_search": "where_places_are_sought far_loops loop_search places_of_drives",
    "place_search": "where_places_are_sought loop_search",
    "submaps": "where_places_are_sought loop_search",
    "closures": "where_places_are_sought loop_search second_looks",
    "second_looks": "second_looks refuted",
    "solve": "second_looks",
    "landmarks": "second_looks splits",
    "walls": "second_looks",
    "scan_matching": "scan_matching",
    "messages": "scan streaming",
    "carmen": "carmen",
    "real_log": "real_log",
    "replay_driver": "lost",
    "driving": "driving narrow_doors",
    "motion_kernels": "driving narrow_doors",
    "wall_following": "errands wall_sequence navigation clearance_while_growing ping_pong endings",
    "end_errand": "errands wall_sequence navigation clearance_while_growing ping_pong endings",
    "explorer": "round_things setting_aside patience ends_of_missions endings mission",
    "second_tries": "setting_aside patience what_moved ends_of_missions endings mission",
    "sweep": "sweep coastal_viewpoints unmapped_obstacles ends_of_missions",
    "floor_memory": "floor_memory",
    "free_space": "free_space kernels paths",
    "paths": "paths driving_field free_space",
    "passable": "paths driving_field free_space",
}
"""By the module of a rule: the test files that are about it."""
PYTEST = ("-q", "-m", "not long", *(f"--override-ini={option}" for option in OPTIONS))
"""Shape checks off."""


MODULES = {switch.name: switch.module.rpartition(".")[2] for switch in SWITCHES}


@dataclass(frozen=True)
class Held:
    """Run tests with each rule off, and write which test fails first."""

    tests: tuple[str, ...] = ("tests/slam", "tests/explore")
    out: Path = Path("results/rules-held.jsonl")
    """A line of JSON for each rule that a test holds. Rules that stand in it are not tested again."""
    tries: int = 8
    """Without one rule so many tests of a file are run at most."""
    slowest_s: float = 1.5
    """Tests that take longer are not run again."""
    longest_s: int = 20
    """A test that takes longer with a rule off, in processor time, has failed."""
    plain: bool = False
    """Only the rules outside of kernels, while kernels are machine code: for tests of searches over whole drives."""


class Again:
    """A pytest plugin that runs each test again without each of the rules that no test holds yet."""

    def __init__(self, study: Held, known: set[str]) -> None:
        self._study, self._known = study, known
        self._tried: Counter[tuple[str, str]] = Counter()

    def pytest_pyfunc_call(self, pyfuncitem: Any) -> bool:
        """Run a test in forks only: what it needs was made before and is the same in each."""
        names = pyfuncitem._fixtureinfo.argnames
        given = {name: pyfuncitem.funcargs[name] for name in names}

        def test() -> None:
            pyfuncitem.obj(**given)

        fired = _in_fork(lambda: _fires(test), 10 * self._study.longest_s)
        if fired is None or fired[0] > self._study.slowest_s:
            return True
        stem = pyfuncitem.path.stem.removeprefix("test_")
        about = {rule for rule in fired[1] if stem in NEAR[MODULES[rule]].split()}
        for rule in sorted(about - self._known):
            self._tried[rule, stem] += 1
            if self._tried[rule, stem] > self._study.tries:
                continue
            failure = _in_fork(lambda rule=rule: _without(rule, test), self._study.longest_s)  # type: ignore[misc]
            if failure is None or failure:
                self._known.add(rule)
                row = {"rule": rule, "held_by": pyfuncitem.nodeid, "failure": failure or "it takes far longer"}
                with self._study.out.open("a") as file:
                    file.write(json.dumps(row) + "\n")
        return True


def _fires(test: Callable[[], None]) -> tuple[float, list[str]]:
    """Run a test with all rules; return how long it took, s, and the rules that would have changed a value."""
    found: set[str] = set()

    def watch(rule: str) -> bool:
        found.add(rule)
        return False

    STATE.off, STATE.watch = frozenset(), watch
    began = time.process_time()
    try:
        test()
    except Exception as error:
        print(f"fails with all rules: {error!r}", file=sys.stderr)
        return 0.0, []
    return time.process_time() - began, sorted(found)


def _without(rule: str, test: Callable[[], None]) -> str:
    """Run a test with a rule off; return how it failed, if it did."""
    STATE.off, STATE.watch = frozenset({rule}), None
    try:
        test()
    except BaseException as error:  # pytest's own failures are no Exceptions
        return f"{type(error).__name__}: {' '.join(str(error).split())}"[:120]
    return ""


def _in_fork(work: Callable[[], Any], longest_s: int) -> Any:
    """Return what some work returns, done in a fork; None where it does not end in time."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            signal.setitimer(signal.ITIMER_PROF, longest_s)
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.write(writer, json.dumps(work()).encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        told = pipe.read()
    os.waitpid(child, 0)
    return json.loads(told) if told else None


def main() -> int:
    """Test every rule that the file lacks and return the exit status."""
    study = tyro.cli(Held, prog="studies.rules.held")
    install(switch for switch in fitting(SWITCHES) if not (study.plain and is_kernel(switch)))
    importlib.import_module("chainslam.experiments.trial")
    study.out.parent.mkdir(parents=True, exist_ok=True)
    known = {json.loads(line)["rule"] for line in study.out.read_text().splitlines()} if study.out.exists() else set()
    return int(importlib.import_module("pytest").main([*PYTEST, *study.tests], plugins=[Again(study, known)]))


if __name__ == "__main__":
    sys.exit(main())
