"""The study of real plans: what it runs, and what its tables say of rows."""

from studies.consistency.real_plans import STAGES, cells_of, table_of_backends, table_of_stages
from studies.results.plans import real_plans


def row(backend, stage, world="a", pairs=10, **more):
    scores = {"pose_anees": 1.0, "map_anees": 2.0, "pose_rmse_m": 0.01, "held": 0.9, "pairs": pairs}
    return (
        {"backend": backend, "stage": stage, "world": world, "false_matches": 3, "duplicate_lines": 0} | scores | more
    )


def cells(table):
    return list(zip(*(list(column.cells) for column in table.columns), strict=True))


def test_the_driver_is_replayed_at_all_stages_and_the_others_with_both_kinds_of_matches():
    found = cells_of(("invariant-ekf", "graph"), "invariant-ekf")
    assert [stage for backend, stage in found if backend == "invariant-ekf"] == list(STAGES)
    assert [stage for backend, stage in found if backend == "graph"] == ["own", "true matches"]


def test_a_table_has_means_and_medians_over_plans_and_intervals_weighed_by_pairs():
    rows = [
        row("graph", "own", "a", map_anees=1.0, held=1.0, pairs=30),
        row("graph", "own", "b", map_anees=5.0, held=0.6, pairs=10),
        row("graph", "own", "c", map_anees=None, held=None, pairs=0),
        row("graph", "true matches", "a"),
    ]
    first, second = cells(table_of_backends(rows))
    assert first == (
        "graph",
        "own",
        "3",
        "1.00",
        "1.00",
        "3.00",
        "3.00",
        "0.900",
        "10.0",
        "3.00",
        "0.00",
        "-",
        "-",
        "-",
    )
    assert second[:3] == ("graph", "true matches", "1")
    stages = cells(table_of_stages(rows, "graph"))
    assert [each[0] for each in stages] == ["nothing", "true matches"]
    rows = [each | {"code": "new"} for each in rows]
    ((_, found),) = real_plans(rows).items()
    assert found[1] == ["own", "`graph`", "1, 1", "3, 3", "90.0 %", "3.00", "0.00", "-"]
    noise = {"nis": 0.7, "nis_in_band": 0.2, "pose_anees_from_start": 1.5}
    (told,) = cells(table_of_backends([row("graph", "own", "a") | noise]))
    assert told[-3:] == ("1.50", "1.50", "0.70, 20 %: conservative")
    older = [row("block-ekf", "own", plan) | {"code": "old"} for plan in "ab"]
    both = real_plans([*older, *rows])
    assert list(both) == ["#### 1 back ends in 2 apartments", "#### 1 back ends in 3 apartments"]
    assert both["#### 1 back ends in 3 apartments"] == found
