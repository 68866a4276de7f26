"""Every mechanism turned off in real plans: copies of the source, edited, and the scores of their runs.

.venv/bin/python -m studies.weights.run --plans ../shared/data/plans --jobs 2
"""

import fcntl
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from chainslam.experiments.usage import UsageError
from chainslam.slam.geometry.compiled import cache

from ..plans.uneven import drawn
from ..runner import rows
from ..runner.command import run_study
from .mechanisms import BASELINE, MECHANISMS, Mechanism
from .table import ROWS, SCORES, newest, scores_of

PlanSet = Literal["apartments", "uneven", "schools"]
MAX_STEPS: dict[PlanSet, int] = {"apartments": 5_000, "uneven": 5_000, "schools": 1_500}
"""After how many scans a run ends: without some mechanisms none ends by itself."""
NAMED = {"apartments": "lifull_*", "schools": "cml_*"}
EVERY = 4
"""Every so manyth plan of a set by name: 40 of 160 apartments, 10 of 39 schools."""
PACKAGES = ("chainslam", "slam", "explore", "sim", "viz", "experiments", "studies")


@dataclass(frozen=True)
class WeightsRun:
    """Run a set of plans with all mechanisms and without each; begun again, it goes on where it was."""

    plans: Path
    """A folder of plans, `lifull_*` and `cml_*`."""
    mechanism: tuple[str, ...] = tuple(each.name for each in MECHANISMS)
    """Which mechanisms are turned off, one at a time."""
    set: PlanSet = "apartments"
    """40 apartments to their ends, 13 uneven ones (`make uneven`), or 1,500 scans of each of ten schools."""
    first: int | None = None
    """Only so many plans of the set."""
    jobs: int = 2
    """Number of processes."""
    out: Path = ROWS
    """A line of JSON for each mechanism and set. Lines of older code go once there are newer ones in their place."""

    def run(self) -> None:
        """Run what the rows lack."""
        if unknown := set(self.mechanism) - {each.name for each in MECHANISMS}:
            raise UsageError(f"expected names of mechanisms, found {', '.join(unknown)}: see studies/weights")
        with copied(cache() / "weights") as folder:
            plans = self._files(folder)
            drop_replaced(self.out)
            for each in (BASELINE, *(each for each in MECHANISMS if each.name in self.mechanism)):
                known = scores_of(rows.read(self.out), each, self.set)
                if any(plan.stem not in known for plan in plans):
                    print(f"{self.set}: {each.name or each.what}", flush=True)
                    worlds = [str(plan.resolve()) for plan in plans]
                    found = driven(folder, each, worlds, MAX_STEPS[self.set], self.jobs)
                    key = {"mechanism": each.name, "edits": each.digest, "set": self.set}
                    rows.append(self.out, [key | {"scores": list(SCORES), "plans": found}])

    def _files(self, folder: Path) -> list[Path]:
        """Return the plans of the set; raises UsageError where there is none."""
        if self.set == "uneven":
            return drawn(self.plans, self.first, folder / "uneven")
        plans = sorted(self.plans.glob(NAMED[self.set]))[::EVERY][: self.first]
        if not plans:
            raise UsageError(f"expected a folder of plans, found no file {NAMED[self.set]} in {self.plans}: check it")
        return plans


def drop_replaced(path: Path) -> None:
    """Drop rows of older code in whose place there are newer ones, and of mechanisms that are gone; say how many."""
    stored = rows.read(path, any_code=True)
    kept = [row for row in stored if row["code"] == rows.fingerprint() or row in newest(stored)]
    if len(kept) < len(stored):
        print(f"dropped {len(stored) - len(kept)} rows of older code from {path}", file=sys.stderr)
        path.write_text("".join(json.dumps(row) + "\n" for row in kept))


@contextmanager
def copied(folder: Path) -> Iterator[Path]:
    """Copy the packages, as they are now, to `today` in a folder; raises UsageError while another run uses it."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UsageError(f"expected {folder} to be free, found another run in it: wait for its end") from error
        shutil.rmtree(folder / "today", ignore_errors=True)
        listed = ("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *PACKAGES)
        names = subprocess.run(listed, cwd=rows.HERE, capture_output=True, check=True).stdout.decode().split("\0")
        for name in names:
            if name and (rows.HERE / name).exists() and not name.endswith(".jsonl"):
                (folder / "today" / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(rows.HERE / name, folder / "today" / name, follow_symlinks=False)
        yield folder


def driven(
    folder: Path, mechanism: Mechanism, worlds: Sequence[str], max_steps: int, jobs: int
) -> dict[str, list[float | None]]:
    """Return the scores of each world, run by the copied source without a mechanism.

    The edited source always stands at one place and has the times of the files that it was copied from: by both,
    compiled loops are found again. What was run before an interruption is kept beside it. Raises UsageError where the
    suite ends by an error.
    """
    source, out = folder / "edited", folder / f"{rows.fingerprint()}-{mechanism.digest}-{max_steps}.jsonl"
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(folder / "today", source, symlinks=True)
    for edit in mechanism.edits:
        path = source / edit.path
        path.write_text(edit.applied(path.read_text()))
        shutil.copystat(folder / "today" / edit.path, path)
    asked = ("--backend", "invariant-ekf", "--max-steps", str(max_steps), "--jobs", str(jobs), "--out", str(out))
    suite = (sys.executable, "-m", "studies.exploration.suite", *asked, "--worlds", *worlds)
    environment = os.environ | {"PYTHONPATH": str(source)}
    if status := subprocess.run(suite, cwd=source, env=environment, stdout=subprocess.DEVNULL).returncode:
        raise UsageError(f"expected the runs without {mechanism.name} to end, found exit status {status}: see above")
    names = {Path(world).name for world in worlds}
    scored = [row for row in map(json.loads, out.read_text().splitlines()) if row["file"] in names]
    return {Path(row["file"]).stem: [_plain(row, score) for score in SCORES] for row in scored}


def _plain(row: rows.Row, score: str) -> float | None:
    """Return a score to five digits: the rows of all mechanisms stay small."""
    value = float(row["status"] == "complete") if score == "complete" else row.get(score)
    return None if value is None else float(f"{value:.5g}")


if __name__ == "__main__":
    run_study(WeightsRun)
