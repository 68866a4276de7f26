"""What `comparison.json` and `contrast.json` must hold for a page to be made of them; more may be there."""

from typing import Any

from ...artifacts.reading import All, Each, Maybe, OneOf, Shape, Word
from ..plan import ARMS
from ..scores.score import END
from .comparison import AT_MARKS, MEANS, SUMS
from .words import ANSWERS, MEASURE_WORDS

NUMBER = float | None
ENDS = OneOf(
    {"low_buildings?": float, "high_buildings?": float},
    {"low_buildings?": Word(None), "high_buildings?": Word(None)},
)
WITHIN = OneOf({"low": float, "high": float}, {"low": Word(None), "high": Word(None)})
"""An interval by run; fewer than five runs have none."""
ESTIMATE: Shape = All({"mean": float, "runs": int, "effect_size": NUMBER}, WITHIN, ENDS)
TOLD: Shape = All(
    OneOf(
        {"value": float, "runs": int, "effect_size?": NUMBER, "p?": NUMBER},
        {"value": Word(None), "runs": Word(0)},
    ),
    WITHIN,
    ENDS,
    {"p_holm?": NUMBER, "family?": int},
    {"measure": Word(*MEASURE_WORDS), "pairs_without_value": int},
)
DIFFERENCE: Shape = All(TOLD, {"kind": Word("ratio", "difference"), "first_better": NUMBER})
LATER = ("pose_anees_from_start", "nis", "nis_in_band")
"""Means that comparisons of earlier versions lack."""
ARM = {"arm": Word(*ARMS)}
STATES = dict.fromkeys(("driving", "finished", "failed"), int)
CELL: Shape = All(
    ARM,
    {"backend": str, "without": Each(int), **dict.fromkeys(("trials", "complete", "sound", "distances", *SUMS), int)},
    {name + "?" * (name in LATER): Maybe(All(ESTIMATE, {"median": float})) for name in MEANS},
    dict.fromkeys(("distances_in_95", "trace_below", "missed_share", "doubles_beyond_gate"), Maybe(ESTIMATE)),
    dict.fromkeys(("trace_least", "bound_margin", "steps_outside_band"), NUMBER),
)
_AT_A_MARK = {
    "contender": STATES,
    "baseline": STATES,
    **dict.fromkeys(
        ("wall_rmse_m", "wall_shape_m", "pose_error_m", "pose_anees_so_far", "uncovered"),
        All(OneOf({"value": float, "runs": int}, {"value": Word(None)}), WITHIN),
    ),
}
FOUND: dict[str, Shape] = {
    "outside": {"share": NUMBER},
    "wrong": OneOf(
        {"wrong": int, "sightings": int, "share": float, "next": str, "next_share": float},
        {"wrong": Word(None), "sightings": int},
    ),
    "trace": {"least": NUMBER, "steps": NUMBER},
    "margin": {"margin": NUMBER},
    "below": OneOf(
        {"bound_runs_below": Word(0), "sound": int},
        {"bound_runs_below": int, "sound": int, "bound_margin": float, "bound_margin_median": float,
         "bound_first_m_median": float, "bound_worst_m_median": float},
    ),
    "anees": All(OneOf(ESTIMATE, {"mean!": None}), {"without": int}),
    "held": All(OneOf(ESTIMATE, {"mean!": None}), {"distances": int, "replays": int}),
    "doubles": {"double_entries": int, "sightings": int, "beyond_a_run": Maybe(ESTIMATE)},
}  # fmt: skip
"""What a claim of each kind says was found."""
COMPARISON: dict[str, Any] = {
    "counts": dict.fromkeys(("trials", "complete", "stopped", "failed"), int),
    "pooled": [CELL],
    "backends": [All(ARM, {"first": str}, DIFFERENCE)],
    "strategies": [All(ARM, {"backend": str, "first": str}, DIFFERENCE)],
    "interaction": [All(ARM, {"backend": str, "strategy": str, "kind": str}, TOLD)],
    "marks": [
        All(ARM, dict.fromkeys(("world", "strategy", "backend", "metres"), str), STATES,
            {"without": Each(int), **dict.fromkeys(AT_MARKS, NUMBER)})
    ],
    "hypothesis": Maybe({
        "contender": str,
        "baseline": str,
        "matches_within": float,
        "decisive_mark": Word("10", "20", "33", END),
        "marks": dict.fromkeys(("10", "20", "33", END), _AT_A_MARK),
        "verdict": Word(*ANSWERS),
    }),
    "findings": [
        OneOf(*(
            {"kind": Word(kind), "claim": str, "backend": str, "arms": Each({"found": shape, "holds": bool | None})}
            for kind, shape in FOUND.items()
        ))
    ],
}  # fmt: skip
_SIDES = {
    **dict.fromkeys(("pose_anees", "path_length_m", "wall_rmse_m"), NUMBER),
    "double_entries": int | None,
    "status": str,
}
_TRIAL = {"backend": str, "mode": Word("closed", "replay"), "association": Word("own", "true")}
CONTRAST: dict[str, Any] = {
    "first": str,
    "second": str,
    "settings": Each([Any]),
    "trials": dict.fromkeys(("shared", "the_same", "different", "only_first", "only_second"), int),
    "status": Each(int),
    "differences": [All(_TRIAL, DIFFERENCE)],
    "different_trials": [
        All(_TRIAL, {"world": str, "strategy": str, "seed": int},
            {f"{name}_{side}": kind for side in ("first", "second") for name, kind in _SIDES.items()})
    ],
}  # fmt: skip
