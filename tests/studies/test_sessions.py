"""The study of second sessions: what its table says of places that were found, named twice, or not found."""

from studies.plans.sessions import HEAD, table


def row(**more):
    scores = {"map_anees": 1.0, "pose_anees": 0.5}
    placed = {"first_step": 100, "placed_at_step": 109, "places": 1, "off_m": 0.01, "off_rad": 0.0}
    return {"backend": "graph"} | scores | placed | more


def test_places_are_right_wrong_or_not_found_and_maps_of_both_sessions_are_scored():
    lost = {"first_step": 0, "placed_at_step": None, "map_anees": 9.0, "off_m": None, "off_rad": None}
    rows = [
        *(row(map_anees=1.0 + 0.1 * k, off_m=0.01 * k) for k in range(5)),
        row(off_m=0.31, placed_at_step=119),
        row(off_rad=0.1),
        row(places=2, **lost),
        row(places=1, **lost),
        row(places=0, **lost),
    ]
    found = dict(zip(HEAD, (next(iter(column.cells)) for column in table(rows).columns), strict=True))
    assert found["back end"] == "`graph`"
    assert found["plans"] == "10"
    assert found["place: right, wrong"] == "5, 2"
    assert found["several places, none"] == "1, 2"
    assert found["scans until placed, median"] == "10"
    assert found["place off by, cm: median, most"] == "2.0, 4.0"
    assert found["map ANEES of both: mean, median"].startswith("1.14 (")
    assert found["map ANEES of both: mean, median"].endswith("), 1.10")


def test_each_back_end_has_its_own_row_and_a_score_that_is_none_is_left_out():
    rows = [row(pose_anees=each) for each in (0.25, 0.75, None)]
    rows += [row(backend="full-ekf", places=2, map_anees=2.0), row(backend="full-ekf", first_step=0, places=3)]
    one, other = (
        dict(zip(HEAD, cells, strict=True)) for cells in zip(*(c.cells for c in table(rows).columns), strict=True)
    )
    assert (one["back end"], one["plans"], other["back end"], other["plans"]) == ("`graph`", "3", "`full-ekf`", "2")
    assert other["place: right, wrong"] == "1, 0"
    assert other["several places, none"] == "1, 0"
    assert other["map ANEES of both: mean, median"].startswith("2.00 ")
    assert one["pose ANEES of the second: mean, median"].startswith("0.50 (")
    assert one["pose ANEES of the second: mean, median"].endswith(", 0.50")


def test_without_a_place_there_is_nothing_to_score():
    lost = row(first_step=0, places=0)
    assert [next(iter(column.cells)) for column in table([lost]).columns] == [
        "`graph`", "1", "0, 0", "0, 1", "-", "-", "-", "-"
    ]  # fmt: skip
