"""Is anything lost when a run or a campaign is killed? Each is killed at random moments and goes on till it ends.

What it has left then is held, byte by byte timings excepted, against what it leaves undisturbed. Where it could not
yet write its settings the same command is given again; otherwise `explore --resume`, or the same `compare`. A third
are killed once more while they go on. The moments come from a seed, how far a process is by then does not.
"""

import argparse
import csv
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.results import RUNNING
from chainslam.experiments.campaign.comparison.tables import TIMINGS
from chainslam.experiments.scoring.summary import TIMED

SIGNALS = (*[signal.SIGKILL] * 3, signal.SIGTERM, signal.SIGHUP)
STOPPED, PATIENCE_S = 130, 600.0


@dataclass(frozen=True)
class Subject:
    """A command that is killed."""

    name: str
    words: tuple[str, ...]
    again: Callable[[Path], tuple[str, ...]]
    """How it goes on in a folder, the folder included."""


def subjects(steps: int, jobs: int) -> dict[str, Subject]:
    """Return what is killed, with runs of so many steps and campaigns of so many processes."""
    explore = ("explore", "paper-fig8", "--seed", "3", "--max-steps", str(steps))
    compare = (
        *("compare", "--worlds", "paper-fig4", "--backends", "block-ekf", "--strategies", "nearest-robot"),
        *("--trials", "2", "--max-steps", "12", "--jobs", str(jobs)),
    )
    return {
        "explore": Subject("explore", explore, lambda folder: ("explore", "--resume", str(folder))),
        "compare": Subject("compare", compare, lambda folder: (*compare, "--out", str(folder))),
    }


def begin(words: tuple[str, ...]) -> subprocess.Popen[bytes]:
    """Start the command in a group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "chainslam.experiments.commands.cli", *words],
        start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def complaints(process: subprocess.Popen[bytes]) -> str:
    """Wait for the end and return what was said on standard error."""
    return process.communicate(timeout=PATIENCE_S)[1].decode(errors="replace").strip()


def strike(process: subprocess.Popen[bytes], folder: Path, delay_s: float, early: bool, chosen: int) -> bool:
    """Send a signal after a delay, counted from the first file unless it is to be early; return whether it was in time.

    Every second one goes to the whole group, as from a terminal, the others to the process alone.
    """
    while not early and not (folder / "config.json").exists() and process.poll() is None:
        time.sleep(0.01)
    time.sleep(delay_s)
    if process.poll() is not None:
        return False
    number = SIGNALS[chosen % len(SIGNALS)]
    if chosen % 2:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    return True


def state(folder: Path, status: int) -> str:
    """Return how far a killed command was, in words."""
    if not (folder / "config.json").exists():
        return "before its first file"
    if status == STOPPED:
        return "stopped it"
    if not any(folder.glob("log*")) and not (folder / "summary.json").exists():
        if (folder / "trials.csv").exists():
            return "while the tables were written"
        return "between trials" if (folder / "recordings").exists() else "before its first trial or step"
    if (folder / "summary.json").exists():
        return "while the results were written" if (folder / RUNNING).exists() else "after the last file"
    steps = (folder / RUNNING).stat().st_size if (folder / RUNNING).exists() else 0
    return "under way" if steps > 4096 else "before its first trial or step"


def timeless(folder: Path) -> dict[str, Any]:
    """Return what each file of a folder holds, without the times that anything took."""
    contents: dict[str, Any] = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        contents[str(path.relative_to(folder))] = _timeless(path)
    return contents


def _timeless(path: Path) -> Any:
    content = path.read_bytes()
    if path.name == "summary.json":
        return json_bytes({key: value for key, value in json.loads(content).items() if key not in TIMED})
    if path.suffix == ".csv":
        rows = list(csv.reader(io.StringIO(content.decode())))
        kept = [k for k, column in enumerate(rows[0]) if not column.startswith(TIMINGS.rstrip("_"))]
        return [[row[k] for k in kept] for row in rows]
    if path.name == "trials.parquet":
        return "as trials.csv"
    if path.parent.name != "run" and "trials" in path.parts and path.suffix == ".npz":
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        said = json.loads(str(arrays.pop("summary_json")))
        return {key: value for key, value in said.items() if key not in TIMED}, {
            name: (array.dtype.str, array.shape, array.tobytes()) for name, array in arrays.items()
        }
    return content


def one(subject: Subject, folder: Path, lasts_s: float, draws: np.random.Generator, early: bool) -> dict[str, Any]:
    """Kill a command once or twice, let it go on to its end, and return what happened."""
    twice = bool(draws.random() < 1 / 3)
    words, struck, said = (*subject.words, "--out", str(folder)), list[str](), list[str]()
    while len(struck) < 1 + twice:
        chosen, delay_s = int(draws.integers(2 * len(SIGNALS))), float(draws.uniform(0.0, lasts_s))
        process = begin(words)
        in_time = strike(process, folder, delay_s, early and not struck, chosen)
        said.append(complaints(process))
        if in_time:
            struck.append(f"{SIGNALS[chosen % len(SIGNALS)].name} {state(folder, process.returncode)}")
        elif not struck:
            # It was over before: another moment, from the start.
            shutil.rmtree(folder)
        else:
            break
        if struck:
            words = subject.again(folder) if (folder / "config.json").exists() else words
    status = -1
    for _ in range(2):
        # A campaign's orphans hold no lock; whoever does is given a moment to end.
        process = begin(words)
        said.append(complaints(process))
        if (status := process.returncode) == 0:
            break
    return {"struck": struck, "status": status, "said": [words for words in said if words]}


def main() -> int:
    """Kill, go on, compare, and print a line for each; the exit status is 1 where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--explore", type=int, default=20, help="how many kills of `explore`")
    parser.add_argument("--compare", type=int, default=20, help="how many kills of `compare`")
    parser.add_argument("--steps", type=int, default=60, help="steps of the run that is explored")
    parser.add_argument("--jobs", type=int, default=2, help="processes of the campaign")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    options = parser.parse_args()
    bad = 0
    for subject in subjects(options.steps, options.jobs).values():
        kills = getattr(options, subject.name)
        draws, states = np.random.default_rng([options.seed, len(subject.words)]), Counter[str]()
        for k in range(kills):
            with tempfile.TemporaryDirectory() as place:
                if k == 0:
                    expected, lasts_s = undisturbed(subject, Path(place) / "run")
                    shutil.rmtree(Path(place) / "run")
                folder = Path(place) / "run"
                told = one(subject, folder, lasts_s, draws, early=k % 7 == 6)
                left = timeless(folder)
                same = told["status"] == 0 and left == expected
                traced = any("Traceback" in words for words in told["said"])
                bad += traced or not same
                states.update(word for word in told["struck"])
                different = sorted(name for name in left | expected if left.get(name) != expected.get(name))
                verdict = "the same bytes" if same else f"status {told['status']}, other {', '.join(different)}"
                print(f"{subject.name} {k + 1}: {'; then '.join(told['struck'])}: {verdict}", flush=True)
                if traced or not same:
                    print("\n".join(told["said"]), flush=True)
        for word, count in sorted(states.items()):
            print(f"  {count} x {word}")
    print("nothing was lost" if not bad else f"{bad} did not come to the same bytes in silence")
    return 1 if bad else 0


def undisturbed(subject: Subject, folder: Path) -> tuple[dict[str, Any], float]:
    """Return what a command leaves that nobody kills, and how long it takes from its first file on, s."""
    process = begin((*subject.words, "--out", str(folder)))
    while not (folder / "config.json").exists() and process.poll() is None:
        time.sleep(0.01)
    began = time.monotonic()
    said = complaints(process)
    if process.returncode:
        raise RuntimeError(said)
    return timeless(folder), time.monotonic() - began


if __name__ == "__main__":
    sys.exit(main())
