"""Required content of `comparison.json` and `contrast.json` for their pages; they may contain more."""

from collections.abc import Iterable
from typing import Any, ClassVar, Literal, TypedDict

from msgspec import Struct, defstruct

from ...artifacts.schema import UnfitError, many
from ...scoring.maps.swept import PERCENTS, SOON
from ..plan import ARMS
from ..scores.score import END
from .comparison import AT_MARKS, MEANS, MEASURES, SUMS

NUMBER = float | None


class Together(Struct, kw_only=True):
    """An object with groups of keys of which all or none have values."""

    together: ClassVar[tuple[tuple[str, str], ...]] = (("low", "high"), ("low_buildings", "high_buildings"))
    """Ends of intervals; with fewer than five runs there are none by run, with fewer than five buildings none by
    building."""

    def __post_init__(self) -> None:
        """Raise UnfitError if only a part of a group has values."""
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
    """Return the kind of an object with some keys: name, kind and optional default."""
    return defstruct(name, [key for some in keys for key in some], bases=(base,), kw_only=True)


_WITHIN = _of(NUMBER, "low", "high")
_ENDS = [(name, NUMBER, None) for name in ("low_buildings", "high_buildings")]
ESTIMATE = _object("Estimate", [("mean", float), ("runs", int), ("effect_size", NUMBER)], _WITHIN, _ENDS)
_TOLD = [
    *[("value", NUMBER), ("runs", int), ("effect_size", NUMBER, None), ("p", NUMBER, None), *_WITHIN, *_ENDS],
    *[("p_holm", NUMBER, None), ("family", int | None, None)],
    *[("measure", _one_of(measure.name for measure in MEASURES)), ("pairs_without_value", int)],
]
_DIFFERENCE = [*_TOLD, ("kind", Literal["ratio", "difference"]), ("first_better", NUMBER)]
_ARM = [("arm", _one_of(ARMS))]
_STATES = _of(int, "driving", "finished", "failed")
_MEAN = _object("Mean", [("median", float)], base=ESTIMATE)
LATER = ("pose_anees_from_start", "nis", "nis_in_band", "path_length_m")
"""Means that not all comparisons have."""
CELL = _object(
    "Cell", _ARM, [("backend", str), ("without", dict[str, int])],
    _of(int, "trials", "complete", "sound"), _of(int | None, *SUMS),
    _of(_MEAN | None, *(name for name in MEANS if name not in LATER)), [(name, _MEAN | None, None) for name in LATER],
    _of(ESTIMATE | None, "distances_in_95", "trace_below", "missed_share", "doubles_beyond_gate"),
    _of(NUMBER, "trace_least", "bound_margin", "steps_outside_band"),
)  # fmt: skip
_AT_A_MARK = _object(
    "AtAMark", _of(_object("States", _STATES), "contender", "baseline"),
    _of(_object("Ratio", [("value", NUMBER), ("runs", int | None, None)], _WITHIN),
        "wall_rmse_m", "wall_shape_m", "pose_error_m", "pose_anees_so_far", "uncovered"),
)  # fmt: skip


class Arm(Struct):
    """A claim in one arm."""

    found: dict[str, Any]
    holds: bool | None


class Finding(Struct):
    """A claim, and what was found in each arm."""

    kind: str
    claim: str
    backend: str
    arms: dict[str, Arm]


_MARKS = ("10", "20", "33", END)
_typed_dict: Any = TypedDict
_MARKED = _typed_dict("Marks", dict.fromkeys(_MARKS, _AT_A_MARK))
"""Keys that are not valid Python names."""
_HYPOTHESIS = _object(
    "Hypothesis", [("contender", str), ("baseline", str), ("matches_within", float)],
    [("decisive_mark", _one_of(_MARKS)), ("marks", _MARKED)],
    [("verdict", Literal["matches", "does not match", "undecided"])],
)  # fmt: skip
_EXPLORED = _object(
    "Explored", _of(str, "strategy", "backend"), _of(int, "sound", *(f"reached_{percent}" for percent in PERCENTS)),
    _of(ESTIMATE | None, *SOON),
)  # fmt: skip
COMPARISON = _object(
    "Comparison",
    [("counts", _object("Counts", _of(int, "trials", "complete", "stopped", "failed"))), ("pooled", many(CELL))],
    [("cells", many(_object("OfCell", _of(str, "world", "strategy"), base=CELL)))],
    [("backends", many(_object("OfBackend", _ARM, [("first", str)], _DIFFERENCE)))],
    [("strategies", many(_object("OfStrategy", _ARM, _of(str, "backend", "first"), _DIFFERENCE)))],
    [("interaction", many(_object("Interaction", _ARM, _of(str, "backend", "strategy", "kind"), _TOLD)))],
    [("marks", many(_object(
        "Mark", _ARM, _of(str, "world", "strategy", "backend", "metres"), _STATES, [("without", dict[str, int])],
        _of(NUMBER, *AT_MARKS))))],
    [("hypothesis", _HYPOTHESIS | None), ("findings", list[Finding]), ("exploration", many(_EXPLORED), [])],
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
