"""Mutation testing: how many of the small faults put into a module do its own tests notice?

`python tests/mutants.py [MODULE...]` runs the modules of `mutants.toml` one after another, or those named, and prints
killed over all; `--table` prints the last results of all of them as the table of docs/contributing/testing.md,
`--survivors` what was changed where no test failed. Results stay in `results/mutants`: a run that was stopped goes on
where it was, and where tests or code have changed only new mutants and those that had survived are tried again.
"""

import argparse
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "results" / "mutants"
ROOMS = ("slam", "explore", "sim", "viz", "experiments")
PACKAGE, READ = "chainslam", ("examples",)
"""What tests read beside: it is copied and never changed."""
FAILED, ENDLESS, SURVIVED = {1, 3}, {24, 36, 152, 255, -24, -9, -11}, {0, 5, 33}
"""Exit codes that mutmut keeps: a test failed; none came to its end; none failed, or none comes by."""
KILLED = FAILED | ENDLESS
CONFIG = """
[tool.mutmut]
source_paths = {rooms}
only_mutate = ["{path}"]
also_copy = {read}
pytest_add_cli_args_test_selection = {tests}
timeout_multiplier = 5.0
timeout_constant = 10.0
use_git_change_detection = false
use_setproctitle = false

[tool.pytest.ini_options]
pythonpath = ["."]
addopts = ["--import-mode=importlib", "-p", "no:cacheprovider", "-p", "no:unraisableexception", "-m", "not long"]
filterwarnings = ["error"]
markers = ["long: takes minutes"]
"""
"""What costs more than the tests is off: shape checks (`--jaxtyping-packages` is not among the options), and the ten
collections of garbage at the end of each run that would find exceptions in destructors."""
DIFFS = """
import sys
from mutmut.mutation.diff_apply import get_diff_for_mutant
for name in sys.argv[2:]:
    print("#", name)
    print("\\n".join(get_diff_for_mutant(name, path=sys.argv[1]).splitlines()[2:]))
"""


@dataclass(frozen=True)
class Result:
    """What became of the mutants of one module."""

    module: str
    group: str
    killed: int
    survived: list[str]
    untried: int
    seconds: float

    @property
    def total(self) -> int:
        return self.killed + len(self.survived)

    @property
    def share(self) -> float:
        return self.killed / max(self.total, 1)


def modules() -> dict[str, dict]:
    """Return the group and the tests of each module that is tried."""
    found = {}

    def walk(table: dict, name: str) -> None:
        if "tests" in table:
            found[name] = table
        for key, value in table.items():
            if isinstance(value, dict):
                walk(value, f"{name}.{key}" if name else key)

    walk(tomllib.loads((ROOT / "tests" / "mutants.toml").read_text()), "")
    return found


def run(module: str, group: str, tests: list[str], budget_s: float) -> Result:
    """Try the mutants of one module that have no result yet, for so long."""
    folder, path = RESULTS / module, f"{module.replace('.', '/')}.py"
    folder.mkdir(parents=True, exist_ok=True)
    for part in (PACKAGE, *READ, "tests"):
        copy(ROOT / part, folder / part)
    for room in ROOMS:  # in a checkout, these are links from the package
        copy(ROOT / room, folder / PACKAGE / room)
    lists = {name: json.dumps(each) for name, each in (("rooms", [PACKAGE]), ("read", READ), ("tests", tests))}
    (folder / "pyproject.toml").write_text(CONFIG.format(path=path, **lists))
    forget_survivors(folder, path)
    began = time.monotonic()
    # Forked workers inherit what was imported, but no threads: BLAS must not have started any.
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "JAXTYPING_DISABLE": "1"}
    command = [str(Path(sys.executable).parent / "mutmut"), "run", "--max-children", "1"]
    with (folder / "said.txt").open("w") as said:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=said, stderr=said, start_new_session=True
        )
        try:
            status = process.wait(budget_s)
            if status:
                raise SystemExit(f"mutmut ended with status {status}: see {folder / 'said.txt'}")
        except (subprocess.TimeoutExpired, KeyboardInterrupt) as stopped:
            os.killpg(process.pid, signal.SIGINT)
            process.wait()
            if isinstance(stopped, KeyboardInterrupt):
                raise
    codes = json.loads((folder / "mutants" / f"{path}.meta").read_text())["exit_code_by_key"]
    result = Result(
        module,
        group,
        sum(code in KILLED for code in codes.values()),
        sorted(name for name, code in codes.items() if code in SURVIVED),
        sum(code not in KILLED | SURVIVED for code in codes.values()),
        round(time.monotonic() - began, 1),
    )
    (RESULTS / f"{module}.json").write_text(json.dumps(asdict(result), indent=1))
    return result


def copy(source: Path, target: Path) -> None:
    """Copy what has changed: mutmut goes by the times of files."""
    for file in source.rglob("*"):
        there = target / file.relative_to(source)
        if not file.is_file() or "__pycache__" in file.parts:
            continue
        if not there.exists() or there.read_bytes() != file.read_bytes():
            there.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, there)


def forget_survivors(folder: Path, path: str) -> None:
    """Have those tried again that survived or did not end, where anything but times has changed since."""
    digest, seen = hashlib.sha256(), folder / "digest"
    for file in sorted(file for room in (PACKAGE, *READ, "tests") for file in (folder / room).rglob("*.*")):
        digest.update(file.read_bytes())
    meta = folder / "mutants" / f"{path}.meta"
    if meta.exists() and (not seen.exists() or seen.read_text() != digest.hexdigest()):
        kept = json.loads(meta.read_text())
        codes = kept["exit_code_by_key"]
        kept["exit_code_by_key"] = {name: code if code in FAILED else None for name, code in codes.items()}
        meta.write_text(json.dumps(kept))
        (folder / "mutants" / "mutmut-stats.json").unlink(missing_ok=True)
    seen.write_text(digest.hexdigest())


def told(result: Result) -> str:
    more = f", {result.untried} not tried" if result.untried else ""
    return f"{result.module}: {result.killed} of {result.total} killed, {100 * result.share:.1f} %{more}"


def stored() -> list[Result]:
    """Return the last result of each module, in the order of `mutants.toml`."""
    files = [RESULTS / f"{module}.json" for module in modules()]
    return [Result(**json.loads(file.read_text())) for file in files if file.exists()]


def table() -> str:
    """Return the last results as a Markdown table, with a row for each group too."""
    results = {result.module: result for result in stored()}
    lines = ["| module | killed | of | % | not tried |", "|---|---|---|---|---|"]
    groups: dict[str, list[str]] = {}
    for module, about in modules().items():
        groups.setdefault(about["group"], []).append(module)
    for group, names in groups.items():
        known = [results[name] for name in names if name in results]
        killed, total = sum(r.killed for r in known), sum(r.total for r in known)
        if known:
            lines.append(f"| **{group}** | {killed} | {total} | {100 * killed / max(total, 1):.1f} | |")
        for name in names:
            r = results.get(name)
            row = f"{r.killed} | {r.total} | {100 * r.share:.1f} | {r.untried}" if r else "| | | not run"
            lines.append(f"| `{name}` | {row} |")
    return "\n".join(lines)


def survivors(result: Result) -> str:
    """Return what was changed in the mutants of a module that survived."""
    path = f"{result.module.replace('.', '/')}.py"
    command = [sys.executable, "-c", DIFFS, path, *result.survived]
    return subprocess.run(command, cwd=RESULTS / result.module, check=True, capture_output=True, text=True).stdout


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", choices=[[], *modules()], metavar="MODULE", default=[])
    parser.add_argument(
        "--budget",
        type=float,
        default=900.0,
        metavar="S",
        help="seconds for a module; what was not tried by then is counted as such, and the next run goes on with it",
    )
    parser.add_argument("--table", action="store_true", help="print the last results as a table")
    parser.add_argument("--survivors", action="store_true", help="print what was changed where no test failed")
    chosen = parser.parse_args()
    if chosen.table:
        print(table())
    elif chosen.survivors:
        for result in stored():
            if result.module in chosen.modules or not chosen.modules:
                print(survivors(result))
    else:
        os.nice(15)
        for module in chosen.modules or modules():
            print(told(run(module, **modules()[module], budget_s=chosen.budget)), flush=True)


if __name__ == "__main__":
    main()
