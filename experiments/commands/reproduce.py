"""`chainslam reproduce`: the paper's figures, with its numbers next to ours."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.table import Table

from chainslam.viz.figures import own_look
from chainslam.viz.figures.maps import saved

from ..artifacts.files import json_bytes, replacing, write
from ..artifacts.run_folder import prepare
from ..reproductions import REPRODUCTIONS, Reproduction
from ..reproductions.reproduction import Value
from ..terminal.answers import found
from ..terminal.console import plain_console
from ..terminal.progress import bar_of, duration
from ..usage import UsageError, choose

SEED_LARGEST = 2**32


@dataclass(frozen=True)
class Reproduce:
    """Reproduce the paper's figures: a picture of each, and its numbers next to those of several back ends."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME")] = ()
    """Some of table1, fig4, fig5, fig6, fig8, fig9, fig10, fig11, eq4 and standing; all of them by default."""
    out: Path = Path("results/reproduce")
    """Folder for NAME.png, NAME.svg and NAME.json."""
    seed: int = 1
    """Seed of the noise, or of the first of several drives."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        names = tuple(dict.fromkeys(choose("figure", name, REPRODUCTIONS) for name in self.names)) or (*REPRODUCTIONS,)
        if not 0 <= self.seed < SEED_LARGEST:
            raise UsageError(f"expected a seed from 0 to 2^32 - 1, found {self.seed}: choose another")
        prepare(self.out)
        console = plain_console(width=max(plain_console().width, 130))
        started, records = time.perf_counter(), dict[str, Any]()
        for done, name in enumerate(names):
            began, worked = time.perf_counter(), time.process_time()
            with bar_of(f"{_far(done, len(names), began - started)}{name}: {REPRODUCTIONS[name].about}", None):
                replaced = replacing(self.out / f"{name}.json")
                with own_look():
                    made = REPRODUCTIONS[name].make(self.seed)
                for kind in ("png", "svg"):
                    write(self.out / f"{name}.{kind}", saved(made.figure, kind))
                command = f"chainslam reproduce {name} --seed {self.seed}"
                records[name] = {"name": name, **made.record(command)}
                write(self.out / f"{name}.json", json_bytes(records[name]))
            console.print(table_of(made))
            for note in made.notes:
                console.print(note, style="dim")
            console.print(
                f"{self.out / name}.png, .svg, .json{replaced}; computing time"
                f" {duration(time.process_time() - worked)}\n"
            )
        found(figures=records, folder=str(self.out))
        return 0


def _far(done: int, count: int, seconds: float) -> str:
    """Return the progress, and the remaining time if the other figures take as long as those so far."""
    left = f", about {duration(seconds / done * (count - done))} left" if done else ""
    return f"{done + 1} of {count}{left}: " if count > 1 else ""


def table_of(made: Reproduction) -> Table:
    """Return a row for each quantity: what the paper says, and a column for each back end."""
    table = Table(title=made.title, title_justify="left")
    table.add_column("quantity", overflow="fold")
    for column in ("paper", *made.ours):
        table.add_column(column, justify="right", overflow="fold")
    for quantity in made.quantities:
        table.add_row(
            quantity, _words(made.paper.get(quantity, "")), *(_words(v.get(quantity, "")) for v in made.ours.values())
        )
    return table


def _words(value: Value) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
