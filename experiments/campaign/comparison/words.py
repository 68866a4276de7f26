"""Numbers, measures and commands of a campaign in words, as a reader wants them."""

import shlex
from typing import Any

from ...artifacts.settings import options_of
from ...views.numbers import NONE, number, percent
from ..plan import CLOSED, Campaign, is_errorless

ANSWERS = {"matches": "Yes", "does not match": "No", "undecided": "Undecided"}
ARMS_SHORT = {CLOSED: "closed loop", "replay-own": "replay, own gate", "replay-true": "replay, true matches"}
MEASURE_WORDS = {
    "pose_anees_from_start": "pose ANEES from the start",
    "pose_anees": "pose ANEES",
    "map_anees": "map ANEES",
    "ate_m": "error of the path",
    "wall_rmse_m": "error of the walls",
    "wall_shape_m": "error of the map's shape",
    "heading_rmse_rad": "error of the heading",
    "path_length_m": "way driven",
    "duplicate_lines": "walls left twice in the map",
    "double_entries": "duplicate walls",
    "false_matches": "false matches",
    "matches_missed": "missed matches",
}
SETTINGS = (("--driver", "driver"), ("--p0", "p0"), ("--max-steps", "max_steps"), ("--first-seed", "first_seed"))


def interval(found: dict[str, Any], scale: float = 1.0, digits: int = 3) -> str:
    """Return the interval by run and that by building, where there are such; few runs have none."""
    kinds = (("", ("low", "high")), ("for other buildings ", ("low_buildings", "high_buildings")))
    words = [
        what + " to ".join(number(scale * found[end], digits) for end in ends)
        for what, ends in kinds
        if found.get(ends[0]) is not None
    ]
    return "; ".join(words) or NONE


def within(value: str, found: dict[str, Any], scale: float = 1.0, more: str = "") -> str:
    """Return a value with its interval and more words in brackets, as far as there are any."""
    words = interval(found, scale)
    inside = "; ".join(part for part in ("" if words == NONE else words, more) if part)
    return f"{value} ({inside})" if inside else value


def mean(found: dict[str, Any] | None, digits: int = 3, scale: float = 1.0) -> str:
    """Return the mean of an estimate."""
    return NONE if found is None else number(scale * found["mean"], digits)


def share(found: dict[str, Any] | None) -> str:
    """Return an estimated share in per cent, with its interval."""
    return NONE if found is None else within(percent(found["mean"]), found, 100.0)


def left_out(campaign: Campaign, said: dict[str, Any]) -> tuple[str, ...]:
    """Return a line for each measure that complete runs lack, so that its means are those of the others."""
    lines: list[str] = []
    if is_errorless(campaign):
        return ()
    for name, what in (
        ("pose_anees", "pose ANEES"),
        ("pose_anees_from_start", "pose ANEES from the start"),
        ("map_anees", "map ANEES"),
        ("wall_rmse_m", "error of the walls"),
    ):
        count = sum(row["without"].get(name, 0) for row in said["pooled"])
        if count:
            complete = sum(row["complete"] for row in said["pooled"])
            why = "no wall of known truth" if name == "wall_rmse_m" else "a covariance that is not positive definite"
            lines.append(f"{count} of {complete} complete runs have no {what} ({why}): they are in no mean of it")
    return tuple(lines)


def command_of(campaign: Campaign) -> str:
    """Return the command that runs a campaign."""
    modes = [mode for mode in (CLOSED, "replay") if any(arm.startswith(mode) for arm in campaign.arms)]
    association = [name for name in ("own", "true") if f"replay-{name}" in campaign.arms]
    words = ["chainslam", "compare", "--worlds", *campaign.worlds, "--backends", *campaign.backends]
    words += ["--strategies", *campaign.strategies, "--trials", str(campaign.trials), "--modes", *modes]
    words += ["--association", *association] if association else []
    plain = Campaign((), (), (), 0)
    for option, name in SETTINGS:
        value = getattr(campaign, name)
        words += [] if value == getattr(plain, name) else [option, str(value)]
    words += options_of(campaign.settings)
    return shlex.join([*words, "--out", "DIR"])
