"""How soon each strategy of a campaign has seen the floor: the metrics of Explore-Bench for one robot."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ...scoring.maps.swept import PERCENTS, SOON
from ...scoring.statistics import estimate
from ..plan import CLOSED
from .comparison import SOUND, Measure, Row, runs_of, select


def exploration(trials: Sequence[Row]) -> list[dict[str, Any]]:
    """Return a row for each strategy and back end in closed loop: means over the runs that saw so much of the floor.

    `reached_90` and `reached_99` are the numbers of these runs, among `sound` ones that did not fail.
    """
    closed = select(trials, arm=CLOSED)
    found = []
    for strategy, backend in dict.fromkeys((row["strategy"], row["backend"]) for row in closed):
        mine = [row for row in select(closed, strategy=strategy, backend=backend) if row["status"] in SOUND]
        means = {name: estimate(runs_of(mine, Measure(name, False))) for name in SOON}
        found.append(
            {"strategy": strategy, "backend": backend, "sound": len(mine)}
            | {f"reached_{of}": sum(row.get(f"swept_{of}_s") is not None for row in mine) for of in PERCENTS}
            | {name: None if mean is None else asdict(mean) for name, mean in means.items()}
        )
    return found
