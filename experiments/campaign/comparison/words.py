"""A comparison in plain words: the answer to the paper's hypothesis, and numbers as a reader wants them."""

import shlex
from typing import Any

from ...artifacts.settings import options_of
from ...views.numbers import NONE, number, percent
from ..plan import CLOSED, Campaign
from ..scores.score import END

ANSWERS = {"matches": "Yes", "does not match": "No", "undecided": "Undecided"}
ARMS_SHORT = {CLOSED: "closed loop", "replay-own": "replay, own gate", "replay-true": "replay, true matches"}
MEASURE_WORDS = {
    "pose_anees": "pose ANEES",
    "map_anees": "map ANEES",
    "ate_m": "error of the path",
    "wall_rmse_m": "error of the walls",
    "wall_shape_m": "error of the map's shape",
    "heading_rmse_rad": "error of the heading",
    "path_length_m": "way driven",
    "duplicate_lines": "walls left twice in the map",
    "double_entries": "walls entered twice",
    "false_matches": "false matches",
    "matches_missed": "missed matches",
}
SETTINGS = (("--driver", "driver"), ("--p0", "p0"), ("--max-steps", "max_steps"), ("--first-seed", "first_seed"))


def verdict(hypothesis: dict[str, Any] | None) -> tuple[str, ...]:
    """Return the answer, a paragraph each: the error of the map, then whether the estimate knows its own error."""
    if hypothesis is None:
        return (
            "The hypothesis was not tested: it takes nearest-start with block-ekf beside nearest-robot with full-ekf,"
            " closed loop.",
        )
    mark = hypothesis["decisive_mark"]
    at = hypothesis["marks"][mark]
    wall, shape, honesty = at["wall_rmse_m"], at["wall_shape_m"], at["pose_anees_so_far"]
    contender, baseline = hypothesis["contender"], hypothesis["baseline"]
    where = "at the end of the run" if mark == END else f"after {mark} m driven"
    if wall["value"] is None:
        return (f"Undecided: {where} no pair of runs of {contender} and {baseline} has a map to compare.",)
    answer = ANSWERS[hypothesis["verdict"]]
    says = {
        "matches": f"{contender} matches {baseline}",
        "does not match": f"{contender} does not match {baseline}",
        "undecided": f"these runs do not tell whether {contender} matches {baseline}",
    }
    return (
        f"{answer}: {where}, {says[hypothesis['verdict']]}: the walls of its map are"
        f" {number(wall['value'])} times as far off (95 % interval {interval(wall)}), and its shape alone, wherever the"
        f" map as a whole has drifted to, {number(shape['value'])} times (95 % interval {interval(shape)};"
        f" {wall['runs']} pairs of runs; a match needs both intervals below {hypothesis['matches_within']}).",
        _honesty(honesty),
        f"{_states(at['contender'], contender)}; {_states(at['baseline'], baseline)}. {_covered(at['uncovered'])}",
    )


def _honesty(ratio: dict[str, Any]) -> str:
    if ratio["value"] is None:
        return "How well each knows its own error cannot be told."
    times = f"{number(ratio['value'])} times (95 % interval {interval(ratio)})"
    if ratio["low"] > 1.0:
        return f"The strategy does not mend what it says of itself: the NEES of its pose is {times} that of the other."
    return f"The NEES of its pose is {times} that of the other."


def _states(states: dict[str, int], who: str) -> str:
    total = sum(states.values())
    return (
        f"{who}: {states['driving']} of {total} runs still drive then, {states['finished']} have finished,"
        f" {states['failed']} have failed"
    )


def _covered(uncovered: dict[str, Any]) -> str:
    if uncovered["value"] is None:
        return "How much of the reachable contour each has mapped cannot be told."
    points = f"{abs(100 * uncovered['value']):.1f}"
    if points == "0.0":
        return "Both have mapped the same share of the reachable contour."
    more = "more" if uncovered["value"] >= 0 else "fewer"
    return f"Of the reachable contour the first leaves {points} percentage points {more} uncovered than the second."


def interval(found: dict[str, Any], scale: float = 1.0, digits: int = 3) -> str:
    """Return the interval by run, and that by building where there is one."""
    if found["low"] is None:
        return NONE
    words = " to ".join(number(scale * found[end], digits) for end in ("low", "high"))
    if found.get("low_buildings") is not None:
        wide = " to ".join(number(scale * found[end], digits) for end in ("low_buildings", "high_buildings"))
        words += f"; for other buildings {wide}"
    return words


def mean(found: dict[str, Any] | None, digits: int = 3, scale: float = 1.0) -> str:
    """Return the mean of an estimate."""
    return NONE if found is None else number(scale * found["mean"], digits)


def share(found: dict[str, Any] | None) -> str:
    """Return an estimated share in per cent, with its interval."""
    return NONE if found is None else f"{percent(found['mean'])} ({interval(found, 100.0)})"


def left_out(said: dict[str, Any]) -> tuple[str, ...]:
    """Return a line for each measure that complete runs lack, so that its means are those of the others."""
    lines = []
    for name, what in (("pose_anees", "pose ANEES"), ("map_anees", "map ANEES"), ("wall_rmse_m", "error of the walls")):
        count = sum(row["without"][name] for row in said["pooled"])
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
