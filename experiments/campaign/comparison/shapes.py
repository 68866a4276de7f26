"""What `comparison.json` and `contrast.json` must hold for a page to be made of them; more may be there."""

from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Literal, TypedDict

from msgspec import Struct, defstruct

from ...artifacts.schema import UnfitError, fit, many
from ..plan import ARMS
from ..scores.score import END
from .comparison import AT_MARKS, MEANS, SUMS
from .words import ANSWERS, MEASURE_WORDS

NUMBER = float | None


class Together(Struct, kw_only=True):
    """An object of which some keys have values together, or none of them."""

    together: ClassVar[tuple[tuple[str, str], ...]] = (("low", "high"), ("low_buildings", "high_buildings"))
    """Ends of intervals; fewer than five runs have none by run, fewer than five buildings none for other buildings."""

    def __post_init__(self) -> None:
        """Raise UnfitError where one of them stands alone."""
        for first, second in self.together:
            values = getattr(self, first, None), getattr(self, second, None)
            if (values[0] is None) != (values[1] is None):
                raise UnfitError(f"one of {first} and {second} without the other")


def _one_of(names: Iterable[str]) -> Any:
    return Literal[tuple(names)]


def _of(kinds: Any, *names: str) -> list[tuple[str, Any]]:
    """Return keys of one kind."""
    return [(name, kinds) for name in names]


def _object(name: str, *keys: Any, base: type = Together) -> Any:
    """Return the kind of an object with some keys: name, kind and perhaps default."""
    return defstruct(name, [key for some in keys for key in some], bases=(base,), kw_only=True)


_WITHIN = _of(NUMBER, "low", "high")
_ENDS = [(name, NUMBER, None) for name in ("low_buildings", "high_buildings")]
ESTIMATE = _object("Estimate", [("mean", float), ("runs", int), ("effect_size", NUMBER)], _WITHIN, _ENDS)
_TOLD = [
    *[("value", NUMBER), ("runs", int), ("effect_size", NUMBER, None), ("p", NUMBER, None), *_WITHIN, *_ENDS],
    *[("p_holm", NUMBER, None), ("family", int | None, None)],
    *[("measure", _one_of(MEASURE_WORDS)), ("pairs_without_value", int)],
]
_DIFFERENCE = [*_TOLD, ("kind", Literal["ratio", "difference"]), ("first_better", NUMBER)]
_ARM = [("arm", _one_of(ARMS))]
_STATES = _of(int, "driving", "finished", "failed")
_MEAN = _object("Mean", [("median", float)], base=ESTIMATE)
LATER = ("pose_anees_from_start", "nis", "nis_in_band")
"""Means that not all comparisons have."""
CELL = _object(
    "Cell", _ARM, [("backend", str), ("without", dict[str, int])],
    _of(int, "trials", "complete", "sound", "distances", *SUMS),
    _of(_MEAN | None, *(name for name in MEANS if name not in LATER)), [(name, _MEAN | None, None) for name in LATER],
    _of(ESTIMATE | None, "distances_in_95", "trace_below", "missed_share", "doubles_beyond_gate"),
    _of(NUMBER, "trace_least", "bound_margin", "steps_outside_band"),
)  # fmt: skip
_AT_A_MARK = _object(
    "AtAMark", _of(_object("States", _STATES), "contender", "baseline"),
    _of(_object("Ratio", [("value", NUMBER), ("runs", int | None, None)], _WITHIN),
        "wall_rmse_m", "wall_shape_m", "pose_error_m", "pose_anees_so_far", "uncovered"),
)  # fmt: skip
_SHARES = _object(
    "Shares", [("wrong", int), ("sightings", int), ("share", float), ("next", str), ("next_share", float)]
)
_COUNTED = _object("Counted", _of(int, "sightings"))
_SOUND = _object("Sound", _of(int, "bound_runs_below", "sound"))
_BELOW = _object(
    "Below", _of(float, "bound_margin", "bound_margin_median", "bound_first_m_median", "bound_worst_m_median"),
    base=_SOUND,
)  # fmt: skip
_WITHOUT = _object("Without", _of(int, "without"))
_KEPT = _object("Kept", _of(int, "distances", "replays"))
FOUND: dict[str, Callable[[dict[str, Any]], tuple[Any, ...]]] = {
    "outside": lambda found: (_object("Outside", _of(NUMBER, "share")),),
    "wrong": lambda found: (_COUNTED if found.get("wrong", 0) is None else _SHARES,),
    "trace": lambda found: (_object("Trace", _of(NUMBER, "least", "steps")),),
    "margin": lambda found: (_object("Margin", _of(NUMBER, "margin")),),
    "below": lambda found: (_BELOW if found.get("bound_runs_below") else _SOUND,),
    "anees": lambda found: (_WITHOUT, *((ESTIMATE,) if "mean" in found else ())),
    "held": lambda found: (_KEPT, *((ESTIMATE,) if "mean" in found else ())),
    "doubles": lambda found: (
        _object("Doubles", _of(int, "double_entries", "sightings"), _of(ESTIMATE | None, "beyond_a_run")),
    ),
}
"""What a claim of each kind says was found, by what stands there."""


class Arm(Struct):
    """A claim of one arm."""

    found: dict[str, Any]
    holds: bool | None


class Finding(Struct):
    """A claim, and what was found in each arm."""

    kind: str
    claim: str
    backend: str
    arms: dict[str, Arm]

    def __post_init__(self) -> None:
        """Raise UnfitError where what was found is not what a claim of the kind says."""
        if self.kind not in FOUND:
            raise UnfitError(f"the kind {self.kind[:40]!r} of a finding")
        for name, arm in self.arms.items():
            for kind in FOUND[self.kind](arm.found):
                fit(kind, arm.found, f"findings.{self.kind}.{name}")


_MARKS = ("10", "20", "33", END)
_typed_dict: Any = TypedDict
_MARKED = _typed_dict("Marks", dict.fromkeys(_MARKS, _AT_A_MARK))
"""Their names are no names of Python."""
_HYPOTHESIS = _object(
    "Hypothesis", [("contender", str), ("baseline", str), ("matches_within", float)],
    [("decisive_mark", _one_of(_MARKS)), ("marks", _MARKED)],
    [("verdict", _one_of(ANSWERS))],
)  # fmt: skip
COMPARISON = _object(
    "Comparison",
    [("counts", _object("Counts", _of(int, "trials", "complete", "stopped", "failed"))), ("pooled", many(CELL))],
    [("backends", many(_object("OfBackend", _ARM, [("first", str)], _DIFFERENCE)))],
    [("strategies", many(_object("OfStrategy", _ARM, _of(str, "backend", "first"), _DIFFERENCE)))],
    [("interaction", many(_object("Interaction", _ARM, _of(str, "backend", "strategy", "kind"), _TOLD)))],
    [("marks", many(_object(
        "Mark", _ARM, _of(str, "world", "strategy", "backend", "metres"), _STATES, [("without", dict[str, int])],
        _of(NUMBER, *AT_MARKS))))],
    [("hypothesis", _HYPOTHESIS | None), ("findings", list[Finding])],
)  # fmt: skip
_TRIAL = [("backend", str), ("mode", Literal["closed", "replay"]), ("association", Literal["own", "true"])]
_SIDES = [
    *_of(NUMBER, "pose_anees", "path_length_m", "wall_rmse_m"), *_of(int | None, "double_entries"), *_of(str, "status"),
]  # fmt: skip
CONTRAST = _object(
    "Contrast", [("first", str), ("second", str), ("settings", dict[str, list[Any]]), ("status", dict[str, int])],
    [("trials", _object("Numbers", _of(int, "shared", "the_same", "different", "only_first", "only_second")))],
    [("differences", many(_object("Difference", _TRIAL, _DIFFERENCE)))],
    [("different_trials", many(_object(
        "Different", _TRIAL, [("world", str), ("strategy", str), ("seed", int)],
        [(f"{name}_{side}", kind) for side in ("first", "second") for name, kind in _SIDES])))],
)  # fmt: skip
