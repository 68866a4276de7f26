"""Logs of real robots by offline refinement alone, as users map them: `replay LOG` without a setting of the log's own.

.venv/bin/python -m studies.logs.refined --logs DIR     # goes on where it was interrupted

DIR holds `NAME.log.gz`, and where others measured something `NAME.relations` and `NAME.ref_gmapping.txt`.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.table import Table

from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.experiments.views.plans.survey import survey_at

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.tables import headed

ROWS = Path("studies/logs/refined.jsonl")
NAMES = ("log",)
REFERENCES = {"--relations": "relations", "--reference": "ref_gmapping.txt"}
MEASURED = """
import json, os, resource, sys
status = os.spawnv(os.P_WAIT, sys.executable, [sys.executable, *sys.argv[1:]])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([status, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))
"""
"""Runs Python and prints its status, processor time and peak memory. A process has at least its parent's peak, so that
the parent is one that has imported nothing."""
HEAD = (
    "log", "drive: m, min", "error of relations, m", "from gmapping, m rms", "loop closures",
    "in the 95 % band: relations, poses", "walls", "dimensions", "times real time", "peak memory, MiB",
)  # fmt: skip


@dataclass(frozen=True)
class RefinedStudy:
    """Map each log by offline refinement alone, each in a process of its own, and print a row for each."""

    logs: Path
    """Folder with the logs."""
    names: tuple[str, ...] = ("intel", "aces", "seattle", "dpslam_loop5", "edmonton", "infinite_corridor")
    """The logs."""
    out: Path = ROWS
    """A line of JSON for each log, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        tasks = [(name, [(name,)]) for name in self.names]
        plain_console(width=150).print(table(list(rows_of(self.out, NAMES, tasks, partial(_one, self.logs), 1))))


def _one(logs: Path, name: str) -> list[Row]:
    """Return the row of a log; raises UsageError where it could not be mapped."""
    beside = {option: logs / f"{name}.{ending}" for option, ending in REFERENCES.items()}
    given = [word for option, path in beside.items() if path.is_file() for word in (option, str(path))]
    with TemporaryDirectory() as home:
        words = "-m", "chainslam.experiments.commands.cli", "replay", str(logs / f"{name}.log.gz"), *given
        program = [sys.executable, "-c", MEASURED, *words, "--out", home]
        told = subprocess.run(program, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()
        status, processor_s, peak_mib = json.loads(told[-1])
        if status:
            raise UsageError(f"expected a map of {name}, found exit status {status}: see what replay says above")
        said, found = json.loads((Path(home) / "summary.json").read_text()), survey_at(Path(home))
    row: Row = {"log": name, "processor_s": processor_s, "peak_mib": peak_mib}
    row |= {key: said[key] for key in ("status", "steps", "path_length_m", "drive_time_s", "lines", "duplicate_lines")}
    row |= {key: said[key] for key in said if key.startswith(("relations", "reference"))}
    firm = sum(each.is_firm for each in found.dimensions)
    return [row | {"closures": said["second_looks"]["closures"], "dimensions": len(found.dimensions), "firm": firm}]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each log; what nobody measured is left out."""
    shown = headed("Logs of real robots by offline refinement alone", HEAD)
    for row in rows:
        relations, path = row.get("relations_smoothed"), row.get("reference_smoothed")
        scored = (row.get(f"{kind}_normalised") for kind in ("relations_smoothed", "reference"))
        held = ", ".join("-" if each is None else f"{each['all']['in_band']:.2f}" for each in scored)
        shown.add_row(
            row["log"],
            f"{row['path_length_m']:.0f}, {row['drive_time_s'] / 60:.0f}",
            f"{relations['at_scans']['all']['translation_m']['mean']:.3f}" if relations else "-",
            f"{path['ate_aligned_m']:.3f}" if path else "-",
            str(row["closures"]),
            held,
            str(row["lines"]),
            str(row["dimensions"]),
            f"{row['drive_time_s'] / row['processor_s']:.0f}",
            f"{row['peak_mib']:.0f}",
        )
    return shown


if __name__ == "__main__":
    run_study(RefinedStudy)
