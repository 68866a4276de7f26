"""`chainslam benchmark`: a row of figures for each estimator, on worlds and seeds fixed by version."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from ...artifacts.files import write
from ...campaign.comparison.benchmark import CURRENT, QUICK, read_all, rows_of, table
from ...terminal.answers import found
from ...terminal.console import say
from ...usage import UsageError
from ...views.numbers import markdown
from .compare import Compare

ROWS = "rows.jsonl"


@dataclass(frozen=True)
class Benchmark:
    """Score estimators on worlds and seeds fixed by version, one row of figures each that can be cited.

    Each estimator runs on recorded drives, which are the same for all, and in closed loop. The same command continues
    a benchmark that was stopped.
    """

    backend: tuple[str, ...] = ()
    """Estimators (see `chainslam backends`), or your own by --plugin."""
    external: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=COMMAND")] = ()
    """An estimator of your own that is a program (docs/howto/external.md); it runs on the recorded drives only. May be
    repeated."""
    quick: bool = False
    """Run two worlds and two seeds, as a try; such rows are marked as not citable."""
    jobs: int | None = None
    """Number of processes; all cores by default. It only changes the times."""
    out: Path | None = None
    """Folder for rows.jsonl and the campaign with its comparison; by default results/ and the benchmark's name."""
    table: tuple[Path, ...] = ()
    """Print the rows in these files as one Markdown table, the most consistent first, instead of running any."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        if bool(self.table) == bool(self.backend or self.external):
            given = "both" if self.table else "neither"
            raise UsageError(f"expected either --backend B or --table FILE, found {given}: name one of them")
        if self.table:
            rows = read_all(self.table)
            found(rows=rows)
            _show(rows)
            return 0
        fixed = QUICK if self.quick else CURRENT
        out = Path("results") / fixed.name if self.out is None else self.out
        command = Compare(
            out=out, worlds=fixed.worlds, backends=self.backend, strategies=(fixed.strategy,), trials=fixed.seeds,
            external=self.external, association=("own",), driver=fixed.driver, p0=fixed.p0,
            max_steps=fixed.max_steps, jobs=self.jobs,
        )  # fmt: skip
        status = command.run()
        if status:
            return status
        rows = rows_of(fixed, out, command.campaign)
        write(out / ROWS, b"".join(json.dumps(row, allow_nan=False).encode() + b"\n" for row in rows))
        found(rows=rows)
        _show(rows)
        for reason in {row["not_citable"] for row in rows if row["not_citable"]}:
            say(f"not citable: {reason}")
        say(f"a row for each estimator in {out / ROWS}")
        return 0


def _show(rows: list[dict[str, Any]]) -> None:
    print(f"{rows[0]['benchmark']}: recorded drives, then closed loop; 95 % intervals over worlds\n")
    print(markdown(table(rows)))
