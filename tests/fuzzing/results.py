"""Broken logs, runs, campaigns, comparisons of two, merged ones: read by every command that reads such a folder."""

import shutil
from pathlib import Path

import numpy as np

from .breaking import broken, pick
from .intact import CAMPAIGN, intact

Commands = list[list[str]]
ENDLESS = ("map.png", "map.svg", "map.dxf", "map.pgm", "map.yaml", ".tum", ".lock")
"""What nothing reads again."""


def _copy(rng: np.random.Generator, name: str, folder: Path) -> str:
    """Copy intact results, break one file of them, and return where they stand, inside `folder`."""
    home = folder / name
    shutil.copytree(intact()[name], home)
    files = [path for path in sorted(home.rglob("*")) if path.is_file() and not path.name.endswith(ENDLESS)]
    broken(rng, pick(rng, files))
    return name


def logs(rng: np.random.Generator, folder: Path) -> Commands:
    """Break the log of a short run."""
    home = folder / "run"
    shutil.copytree(intact()["run"], home)
    broken(rng, home / "log.npz")
    replay = ["replay", "run/log.npz", "--backend", str(pick(rng, ("full-ekf", "block-ekf", "graph"))), "--out", "out"]
    if rng.random() < 0.3:
        replay += ["--association", "true"]
    return [list(pick(rng, [replay, replay, ["explore", "--resume", "run", "--max-steps", "4"]]))]


def runs(rng: np.random.Generator, folder: Path) -> Commands:
    """Break a file of a run."""
    name = _copy(rng, str(pick(rng, ("run", "closed", "closed"))), folder)
    commands = [
        ["measure", name],
        ["measure", name, "0", "1"],
        ["report", name],
        ["view", name],
        ["replay", f"{name}/log.npz", "--out", "out"],
        ["explore", "--resume", name, "--max-steps", "4"],
    ]
    return [list(pick(rng, commands[: 4 if name == "closed" else 6]))]


def replays(rng: np.random.Generator, folder: Path) -> Commands:
    """Break a file of two replays side by side."""
    name = _copy(rng, "replays", folder)
    return [[str(pick(rng, ("report", "view"))), name]]


def campaigns(rng: np.random.Generator, folder: Path) -> Commands:
    """Break a file of a campaign."""
    name = _copy(rng, "campaign", folder)
    later = str(intact()["later"])
    pair = [name, later] if rng.random() < 0.5 else [later, name]
    commands = [
        ["report", name],
        ["view", name],
        ["compare", *CAMPAIGN, "--out", name],
        ["compare", "--merge", *pair, "--out", "out"],
        ["compare", "--against", *pair, "--out", "out"],
    ]
    return [list(pick(rng, commands))]


def contrasts(rng: np.random.Generator, folder: Path) -> Commands:
    """Break a file of two campaigns held against each other."""
    return [["report", _copy(rng, "contrast", folder)]]


def merged(rng: np.random.Generator, folder: Path) -> Commands:
    """Break a file of a merged campaign."""
    name = _copy(rng, "merged", folder)
    again = ["compare", "--merge", name, str(intact()["campaign"]), "--out", "out"]
    return [list(pick(rng, [["report", name], again, ["view", name]]))]
