"""A comparison in plain words: the answer to the paper's hypothesis, and numbers as a reader wants them."""

import shlex
from typing import Any

from .plan import CLOSED, Campaign
from .score import END

ANSWERS = {"matches": "Yes", "does not match": "No", "undecided": "Undecided"}
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
    wall, honesty = at["wall_rmse_m"], at["pose_anees_so_far"]
    contender, baseline = hypothesis["contender"], hypothesis["baseline"]
    where = "at the end of the run" if mark == END else f"after {mark} m driven"
    if wall["value"] is None:
        return (f"Undecided: {where} no pair of runs of {contender} and {baseline} has a map to compare.",)
    answer = ANSWERS[hypothesis["verdict"]]
    verb = {"matches": "matches", "does not match": "does not match", "undecided": "may or may not match"}
    return (
        f"{answer}: {where}, {contender} {verb[hypothesis['verdict']]} {baseline}: the walls of its map are"
        f" {number(wall['value'])} times as far off (95 % interval {interval(wall)}; {wall['runs']} pairs of runs;"
        f" a match is an interval below {hypothesis['matches_within']}).",
        _honesty(honesty),
        f"{_states(at['contender'], contender)}; {_states(at['baseline'], baseline)}. Of the reachable contour the"
        f" first leaves {_percent_points(at['uncovered'])} than the second.",
    )


def _honesty(ratio: dict[str, Any]) -> str:
    if ratio["value"] is None:
        return "How well each knows its own error cannot be told."
    times = f"{number(ratio['value'])} times (95 % interval {interval(ratio)})"
    if ratio["low"] > 1.0:
        return f"No strategy mends what it says of itself: the NEES of its pose is {times} that of the other."
    return f"The NEES of its pose is {times} that of the other."


def _states(states: dict[str, int], who: str) -> str:
    total = sum(states.values())
    return (
        f"{who}: {states['driving']} of {total} runs still drive then, {states['finished']} have finished,"
        f" {states['failed']} have failed"
    )


def _percent_points(uncovered: dict[str, Any]) -> str:
    if uncovered["value"] is None:
        return "an unknown share more or less uncovered"
    more = "more" if uncovered["value"] >= 0 else "fewer"
    return f"{abs(100 * uncovered['value']):.1f} percentage points {more} uncovered"


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, never in powers of ten; a dash for none."""
    if value is None:
        return "–"
    if isinstance(value, int) or value == 0:
        return str(int(value)) if float(value).is_integer() else str(value)
    short = f"{value:.{digits}g}"
    return f"{float(short):,.0f}" if "e+" in short or abs(value) >= 1000 else short


def interval(found: dict[str, Any], scale: float = 1.0) -> str:
    """Return the interval by run, and that by building where there is one."""
    if found["low"] is None:
        return "–"
    words = f"{number(scale * found['low'])} to {number(scale * found['high'])}"
    if found.get("low_buildings") is not None:
        wide = f"{number(scale * found['low_buildings'])} to {number(scale * found['high_buildings'])}"
        words += f"; for other buildings {wide}"
    return words


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
    return shlex.join([*words, "--out", "DIR"])
