"""Each generated table of the documentation: the rows it is made from, and the command that makes these."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from chainslam.experiments.campaign.comparison import benchmark

from ..logs import matched_drives, refined, study, surveys
from ..paper import following, following_tables, page
from ..plans import sessions
from ..robots import apartments, bumps, faults
from ..runner.rows import Row, last, newest
from . import benchmarks, plans, worlds
from .figures import Table, of_console
from .rivals import rides

STORED = Path("studies/results/rows")
Made = Table | Mapping[str, Table]
"""A table, or several by what stands above each."""
Read = Callable[[], list[Row]]


@dataclass(frozen=True)
class Source:
    """What one generated table is made from."""

    command: str
    """What makes its rows."""
    make: Callable[[Sequence[Row]], Made]
    read: Read


def _of(*names: str, each: str = "") -> Read:
    """Return what reads stored rows, of each file those of the code that has most of them."""
    return lambda: [row for name in names for row in newest(STORED / f"{name}.jsonl", each)]


def _printed(module: object) -> Callable[[Sequence[Row]], Table]:
    """Return what makes the table that a study prints."""
    return lambda rows: of_console(module.table(rows))  # type: ignore[attr-defined]


RIVALS, DRIVES = _of("rivals", each="place"), partial(last, page.ROWS, page.NAMES)
PLANS, LOGS = _of("apartments", "schools-whole", "schools"), partial(study.stored, study.ROWS)
FOLLOWING, FAULTS = partial(last, following.ROWS, following.NAMES), partial(last, faults.ROWS, faults.NAMES)
SOURCES: Mapping[str, Source] = {
    "benchmark-estimators": Source("make rivals", benchmarks.estimators, RIVALS),
    "benchmark-leaderboard": Source("make leaderboard", benchmarks.leaderboard, _of("leaderboard", each="estimator")),
    "leaderboard": Source("make leaderboard", benchmark.table, _of("leaderboard", each="estimator")),
    "benchmark-exploration": Source("make apartments schools-whole schools", benchmarks.exploration, PLANS),
    "benchmark-paper": Source("make paper", benchmarks.figures, DRIVES),
    "benchmark-logs": Source("make logs", benchmarks.logs, LOGS),
    "benchmark-refined": Source("make logs", _printed(refined), partial(last, refined.ROWS, refined.NAMES)),
    "benchmark-sessions": Source("make sessions", _printed(sessions), _of("sessions")),
    "benchmark-faults": Source("make robots", benchmarks.endings, FAULTS),
    "benchmark-speed": Source(
        "make bundled apartments schools", benchmarks.speed, _of("bundled-noisy", "apartments", "schools")
    ),
    "headlines": Source(
        "make rivals apartments logs", benchmarks.headlines, lambda: [*RIVALS(), *_of("apartments")(), *LOGS()]
    ),
    "rivals": Source("make rivals", rides, RIVALS),
    "real-plans": Source("make real-plans", plans.real_plans, _of("real-plans", each="code")),
    "apartments": Source("make apartments", plans.apartments, _of("apartments")),
    "schools-whole": Source("make schools-whole", plans.whole_schools, _of("schools-whole")),
    "schools": Source("make schools", plans.schools, _of("schools")),
    "intervals": Source("make intervals", worlds.intervals, _of("intervals")),
    "paper-method": Source("make paper-method", worlds.paper_method, _of("paper-method")),
    "bundled": Source("make bundled", worlds.bundled, _of("bundled-noisy")),
    "bundled-errorless": Source("make bundled", worlds.bundled, _of("bundled-errorless")),
    "courts": Source("make courts", plans.courts, _of("courts")),
    "navigation": Source("make navigation-apartments", plans.navigation, _of("navigation")),
    "paper": Source("make paper", page.figures, DRIVES),
    "following": Source("make paper", following_tables.figures, FOLLOWING),
    "following-cost": Source("make paper", following_tables.costs, FOLLOWING),
    "faults": Source("make robots", faults.table, FAULTS),
    "bumps": Source("make bumps", _printed(bumps), _of("in_text/bumps")),
    "scanner-apartments": Source(
        "make scanner-apartments", _printed(apartments), _of("in_text/scanner-apartments", each="world")
    ),
    "logs": Source("make logs", _printed(study), LOGS),
    "matched-drives": Source(
        "python -m studies.logs.matched_drives", _printed(matched_drives),
        partial(last, matched_drives.ROWS, matched_drives.NAMES),
    ),
    "surveys": Source("python -m studies.logs.surveys", _printed(surveys), partial(last, surveys.ROWS, surveys.NAMES)),
}  # fmt: skip
"""By the name that stands in the mark on its page."""
