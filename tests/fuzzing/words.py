"""Command lines with words that nobody should give."""

from pathlib import Path

import numpy as np

from .breaking import pick
from .intact import intact

NUMBERS = (
    *(
        "0",
        "-1",
        "1",
        "2",
        "nan",
        "inf",
        "-inf",
        "1e400",
        "1e-400",
        "9" * 5000,
        "-" + "9" * 30,
        "1000000000000",
        "0x10",
    ),
    *("1_0", "", " ", "one", "1.5", "٣", "\udcff", "é", "NaN", "--help", "None", "-0", "1e3", "18446744073709551616"),
)
OPTIONS = (
    "--seed",
    "--max-path",
    "--time-limit",
    "--scale",
    "--max-steps",
    "--start",
    "--p0",
    "--backend",
    "--strategy",
)
COMPARE = (
    "--trials",
    "--jobs",
    "--first-seed",
    "--max-steps",
    "--worlds",
    "--backends",
    "--strategies",
    "--driver",
    "--p0",
)


def words(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Give options values that they cannot have."""
    del folder
    some = [str(pick(rng, NUMBERS)) for _ in range(int(rng.integers(1, 4)))]
    run, campaign = str(intact()["closed"]), str(intact()["campaign"])
    explore = ["explore", "paper-fig4", "--max-steps", "2", str(pick(rng, OPTIONS)), *some[:2], "--out", "out"]
    compare = [
        *("compare", "--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot"),
        *("--trials", "1", "--max-steps", "2", "--modes", "closed", "--jobs", "1"),
        *(str(pick(rng, COMPARE)), some[0], "--out", "out"),
    ]
    commands = [
        explore,
        explore,
        compare,
        compare,
        ["measure", run, *some],
        ["report", some[0]],
        ["view", some[0]],
        ["replay", some[0]],
        ["compare", "--against", campaign, some[0], "--out", "out"],
        ["compare", "--merge", campaign, some[0], "--out", "out"],
        ["reproduce", some[0], "--out", "out"],
        some,
    ]
    return [list(pick(rng, commands))]
