"""The headline tables of the results: what was asked, from which rows, and what they answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..runner.rows import Row
from .figures import Found
from .plans import apartments, courts, navigation, real_plans, schools, whole_schools
from .shortcut import rides
from .worlds import bundled, intervals, paper, paper_method

STORED = Path("studies/results/rows")
REAL_PLANS, SHORTCUT = "real-plans.md", "shortcut.md"


@dataclass(frozen=True)
class Headline:
    """One table of the page."""

    title: str
    aim: str
    command: str
    """What makes its rows."""
    rows: Path
    make: Callable[[Sequence[Row]], Found]
    page: str = "results.md"
    """Where it stands in `docs`."""
    each: str = ""
    """Rows are of one code; or, for each value under this name, those of one code."""


HEADLINES = (
    Headline(
        "Do the stated intervals hold the truth?",
        "93 to 97 % of the 95 % intervals between corners hold the true distance (`paper-fig8`, closed loop, noise).",
        "make intervals",
        STORED / "intervals.jsonl",
        intervals,
    ),
    Headline(
        "The paper's two worlds, by four estimators on the same scans",
        "Pose and map ANEES near 1. [The paper's figures](paper.md) has every number.",
        "make paper",
        Path("studies/paper/rows.jsonl"),
        paper,
    ),
    Headline(
        "A duplicate wall, as in the paper's figure 9",
        "The paper's method enters a duplicate wall, or the reason why not (`paper-fig9`, the first 200 steps).",
        "make paper-method",
        STORED / "paper-method.jsonl",
        paper_method,
    ),
    Headline(
        "Bundled worlds, errorless",
        "All complete, coverage 1, every contour closed.",
        "make bundled",
        STORED / "bundled-errorless.jsonl",
        bundled,
    ),
    Headline(
        "Bundled worlds with noise",
        "All complete, ANEES near 1 (`full-ekf`).",
        "make bundled",
        STORED / "bundled-noisy.jsonl",
        bundled,
    ),
    Headline(
        "Apartments with noise",
        "95 % complete, mean coverage 0.99; map ANEES 0.9 to 1.15 at the median, mean below 1.5 (160 plans, seed 1).",
        "make apartments",
        STORED / "apartments.jsonl",
        apartments,
        REAL_PLANS,
    ),
    Headline(
        "The paper's question in real plans: several back ends on the same drives",
        "Map ANEES: median 0.9 to 1.15, mean below 1.5; pose ANEES 0.9 to 1.15; 93 to 97 % of the intervals hold.",
        "make real-plans",
        STORED / "real-plans.jsonl",
        real_plans,
        REAL_PLANS,
        "code",
    ),
    Headline(
        "Schools and offices, the first 1,500 steps",
        "No exception in 39 buildings with noise, map ANEES below 1.5 at the median; which back end loses fewest maps?",
        "make schools",
        STORED / "schools.jsonl",
        schools,
        REAL_PLANS,
    ),
    Headline(
        "Schools and offices, to the end",
        "All but one of 39 complete, map ANEES below 1.5 at the median (noise, seed 1).",
        "make schools-whole",
        STORED / "schools-whole.jsonl",
        whole_schools,
        REAL_PLANS,
    ),
    Headline(
        "Courts: a start without a wall in sight",
        "No run ends before its floor is seen (`invariant-ekf`, 3,000 noisy steps, ten buildings, five seeds).",
        "make courts",
        STORED / "courts.jsonl",
        courts,
    ),
    Headline(
        "Navigation over the floor and by sequences of walls, apartments",
        "Both complete every apartment (errorless, `full-ekf`, seed 1).",
        "make navigation-apartments",
        STORED / "navigation.jsonl",
        navigation,
    ),
    Headline(
        "Every back end on the same observations",
        "Which of them know how wrong they are, and how precise are they?",
        "make rivals",
        STORED / "rivals.jsonl",
        rides,
        SHORTCUT,
        "place",
    ),
)
