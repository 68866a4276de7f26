"""What a campaign asks, and the answer, in the words of that campaign: by its back ends and strategies."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...scoring.statistics import FEW_RUNS
from ...views.numbers import NONE, number
from ..plan import CLOSED, Campaign, is_errorless
from ..scores.score import END
from .comparison import BASELINE_BACKEND, BASELINE_STRATEGY
from .words import ANSWERS, ARMS_SHORT, mean, within

TOLD = (("wall_rmse_m", "error of the walls"), ("pose_anees_from_start", "pose ANEES from the start"))
"""Ratios that a verdict names: how wrong, and how honest."""


@dataclass(frozen=True)
class Story:
    """What stands at the head of a report."""

    title: str
    question: str
    verdict: tuple[str, ...]
    """A paragraph each, the answer first."""


def story_of(campaign: Campaign, said: dict[str, Any]) -> Story:
    """Return the story of a campaign, from its `comparison.json`."""
    if said["hypothesis"] is not None:
        return Story(
            "What neglecting the cross-correlations costs",
            "A robot maps a building by following walls. The paper's filter (block-ekf) keeps only the diagonal blocks"
            " of its map's covariance and hopes that a careful exploration strategy (nearest-start) makes up for that."
            " Here the same robot does the same with rigorous estimators.",
            answer(said["hypothesis"]),
        )
    if is_errorless(campaign):
        return _exact(campaign, said)
    where = _listed([world.rpartition("/")[2] for world in campaign.worlds])
    runs = f"{campaign.trials} runs each" if campaign.trials > 1 else "one run each"
    if len(campaign.backends) > 1:
        return Story(
            f"Estimators compared: {_listed(campaign.backends)}",
            f"The same robot maps {where} by {_listed(campaign.strategies)} with each estimator, {runs}. Which one errs"
            " less, and which one knows how wrong it is?",
            (*_backends(campaign, said), *_few(campaign)),
        )
    if len(campaign.strategies) > 1:
        return Story(
            f"Strategies compared: {_listed(campaign.strategies)}",
            f"The same robot explores {where} with {campaign.backends[0]} by each strategy, {runs}. Which one drives"
            " less, and what becomes of the map?",
            (*_strategies(campaign, said), *_few(campaign)),
        )
    return Story(
        f"{campaign.backends[0]} by {campaign.strategies[0]}",
        f"A robot maps {where}, {runs}. How wrong is the map, and does the estimator know it?",
        (*_states_of(campaign, said), *_few(campaign)),
    )


def _exact(campaign: Campaign, said: dict[str, Any]) -> Story:
    """Return the story of trials without noise: whether they end is all that they tell."""
    arm = decisive_arm(campaign)
    rows = [row for row in said["pooled"] if row["arm"] == arm]
    return Story(
        f"Without noise: {_listed(campaign.backends)}",
        "Ranges and wheels are exact: no error hides a fault in how a map is made or a building explored. There is no"
        " NEES, and all seeds are one run.",
        tuple(f"{row['backend']}: {row['complete']} of {row['trials']} runs complete." for row in rows),
    )


def _backends(campaign: Campaign, said: dict[str, Any]) -> list[str]:
    """Return for each back end its errors beside those of the baseline, or what can be said without one."""
    arm = decisive_arm(campaign)
    lines = []
    for backend in campaign.backends:
        ratios = {row["measure"]: row for row in said["backends"] if (row["first"], row["arm"]) == (backend, arm)}
        told = [
            f"{what} {_times(ratios[name])}" for name, what in TOLD if ratios.get(name, {}).get("value") is not None
        ]
        if told:
            pairs = ratios[TOLD[0][0]]["runs"]
            lines.append(
                f"{backend} against {BASELINE_BACKEND}, {ARMS_SHORT[arm]}: {_listed(told)} ({_counted(pairs, 'pair')}"
                " of runs, ratio and 95 % interval; below 1 is better for the error)."
            )
    return lines or _states_of(campaign, said)


def _strategies(campaign: Campaign, said: dict[str, Any]) -> list[str]:
    """Return for each strategy how far it drives and how well it maps, beside the baseline."""
    lines = []
    for strategy in campaign.strategies:
        of = [row for row in said["strategies"] if (row["first"], row["arm"]) == (strategy, decisive_arm(campaign))]
        ratios = {row["measure"]: row for row in of}
        names = (("path_length_m", "way driven"), *TOLD)
        told = [
            f"{what} {_times(ratios[name])}" for name, what in names if ratios.get(name, {}).get("value") is not None
        ]
        if told:
            lines.append(f"{strategy} against {BASELINE_STRATEGY}: {_listed(told)} (ratio and 95 % interval).")
    return lines or _states_of(campaign, said)


def _states_of(campaign: Campaign, said: dict[str, Any]) -> list[str]:
    """Return how many runs of each back end are complete, and their ANEES, in the arm that decides."""
    words = []
    for row in (row for row in said["pooled"] if row["arm"] == decisive_arm(campaign)):
        pose, walls = row.get("pose_anees_from_start"), row["map_anees"]
        anees = within(number(pose["mean"]), pose) if pose else NONE
        words.append(
            f"{row['backend']}: {row['complete']} of {row['trials']} runs complete, pose ANEES from the start {anees},"
            f" map ANEES {mean(walls)}, walls off by {mean(row['wall_rmse_m'], scale=100.0)} cm."
        )
    return words


def _few(campaign: Campaign) -> tuple[str, ...]:
    """Return a warning where the runs are too few to conclude anything."""
    runs = campaign.trials * len(campaign.worlds)
    return (
        () if runs >= FEW_RUNS else (f"{_counted(runs, 'run')} a cell: too few to conclude from ({FEW_RUNS} or more).",)
    )


def decisive_arm(campaign: Campaign) -> str:
    """Return the arm that the words are about: the closed loop where there is one."""
    return CLOSED if CLOSED in campaign.arms else campaign.arms[0]


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def answer(hypothesis: dict[str, Any]) -> tuple[str, ...]:
    """Return the answer, a paragraph each: the error of the map, then whether the estimate knows its own error."""
    mark = hypothesis["decisive_mark"]
    at = hypothesis["marks"][mark]
    wall, shape, honesty = at["wall_rmse_m"], at["wall_shape_m"], at["pose_anees_so_far"]
    contender, baseline = hypothesis["contender"], hypothesis["baseline"]
    where = "at the end of the run" if mark == END else f"after {mark} m driven"
    if wall["value"] is None:
        return (f"Undecided: {where} no pair of runs of {contender} and {baseline} has a map to compare.",)
    says = {
        "matches": f"{contender} matches {baseline}",
        "does not match": f"{contender} does not match {baseline}",
        "undecided": f"these runs do not tell whether {contender} matches {baseline}",
    }
    return (
        f"{ANSWERS[hypothesis['verdict']]}: {where}, {says[hypothesis['verdict']]}: the walls of its map are"
        f" {_times(wall)} as far off, and its shape alone, wherever the map as a whole has drifted to,"
        f" {_times(shape)} ({_counted(wall['runs'], 'pair')} of runs; a match needs both 95 % intervals below"
        f" {hypothesis['matches_within']}).",
        _honesty(honesty),
        f"{_states(at['contender'], contender)}; {_states(at['baseline'], baseline)}. {_covered(at['uncovered'])}",
    )


def _honesty(ratio: dict[str, Any]) -> str:
    if ratio["value"] is None:
        return "How well each knows its own error cannot be told."
    words = f"he NEES of its pose is {_times(ratio)} that of the other."
    if ratio["low"] is not None and ratio["low"] > 1.0:
        return f"The strategy does not mend what it says of itself: t{words}"
    return f"T{words}"


def _times(ratio: dict[str, Any]) -> str:
    """Return a ratio in words, with its interval where it has one."""
    return within(f"{number(ratio['value'])} times", ratio)


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
