"""The study of real robots' logs: it tells what its rows hold, and goes on where it was."""

import gzip
import json
import os
from types import SimpleNamespace

import numpy as np
import pytest

from chainslam.experiments.replays.real_log import RealOptions, read_real_run
from chainslam.slam.geometry.poses import compose, inverse
from studies.logs import placing, refined
from studies.logs.placing import half_of
from studies.logs.refined import RefinedStudy
from studies.logs.study import LogsStudy, stored, table
from studies.runner.command import run_study


def cells(rows, table=table):
    shown = table(rows)
    return [[str(cell) for cell in column.cells] for column in shown.columns]


def written(folder):
    """A log of a robot between two walls, with a relation that is 0.1 m off."""
    angles = np.deg2rad(np.arange(180) - 90.0)
    with np.errstate(divide="ignore"):
        ranges = np.minimum(np.where(np.abs(np.sin(angles)) > 0.1, 1.5 / np.abs(np.sin(angles)), 81.9), 81.9)
    lines = [" ".join(map(str, ["FLASER", 180, *ranges, *[0.2 * k, 0, 0] * 2, 10.0 * k, "robot", 0])) for k in range(8)]
    (folder / "hall.log.gz").write_bytes(gzip.compress("\n".join(lines).encode()))
    (folder / "hall.relations").write_text("0 70 1.5 0 0 0 0 0\n")


def test_each_log_has_a_row_for_each_path_and_is_not_run_twice(tmp_path, monkeypatch, capsys):
    written(tmp_path)
    study = LogsStudy(tmp_path, ("full-ekf",), ("hall",), "wheels", out=tmp_path / "rows.jsonl")
    study.run()
    row = json.loads((tmp_path / "rows.jsonl").read_text())
    assert row["relations"]["at_scans"]["far"]["translation_m"]["mean"] == pytest.approx(0.1, abs=0.03)
    assert "reference" not in row
    found = cells([row])
    assert found[1] == ["full-ekf", "offline refinement"]
    assert found[4][0] == f"{row['relations']['at_scans']['all']['translation_m']['mean']:.3f}"
    assert found[8] == ["-", "-"]
    monkeypatch.setattr("studies.logs.study.replay_real", None)
    study.run()
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 1


def test_a_log_has_the_last_refinement_of_its_path_whichever_run_made_it(tmp_path):
    path, run = tmp_path / "rows.jsonl", {"code": "a", "log": "hall", "odometry": "scans", "every": 1}
    rows = [
        run | {"backend": "graph", "steps": 1, "reference_smoothed": 1.0},
        run | {"backend": "full-ekf", "steps": 2, "reference_smoothed": 2.0},
        run | {"backend": "graph", "steps": 3},
        run | {"backend": "graph", "every": 2, "steps": 4},
    ]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert [(row["steps"], row.get("reference_smoothed")) for row in stored(path)] == [(2, 2.0), (3, 2.0), (4, None)]


def test_an_unknown_back_end_is_told_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["study", "--logs", str(tmp_path), "--backends", "none"])
    with pytest.raises(SystemExit, match="2"):
        run_study(LogsStudy)
    assert "found none" in capsys.readouterr().err


def test_a_log_is_mapped_as_a_user_maps_it_by_a_process_whose_time_and_memory_are_its_own(tmp_path, monkeypatch, capfd):
    written(tmp_path)
    study = RefinedStudy(tmp_path, ("hall",), out=tmp_path / "rows.jsonl")
    study.run()
    row = json.loads((tmp_path / "rows.jsonl").read_text())
    assert row["relations_smoothed"]["at_scans"]["all"]["translation_m"]["mean"] == pytest.approx(0.1, abs=0.03)
    assert row["drive_time_s"] == 70.0
    assert row["processor_s"] > 0.5
    assert 50.0 < row["peak_mib"] < os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20
    assert row["lines"] == 2
    found = [column[0] for column in cells([row], refined.table)]
    assert found[:3] == ["hall", "1, 1", f"{row['relations_smoothed']['at_scans']['all']['translation_m']['mean']:.3f}"]
    assert found[3:5] == ["-", "0"]
    monkeypatch.setattr("studies.logs.refined.subprocess", None)
    study.run()
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 1


def test_a_mapped_log_has_what_its_row_holds_in_each_column():
    row = {"log": "hall", "path_length_m": 12.4, "drive_time_s": 600.0, "closures": 3, "lines": 7, "dimensions": 11}
    row |= {"firm": 5, "processor_s": 40.0, "peak_mib": 321.0, "reference_smoothed": {"ate_aligned_m": 0.25}}
    row |= {
        f"relations{tail}": {"at_scans": {"all": {"translation_m": {"mean": m}}}}
        for tail, m in (("", 9.0), ("_smoothed", 0.5))
    }
    row |= {"reference": {"ate_aligned_m": 9.0}}
    row |= {
        f"{kind}_normalised": {"all": {"in_band": b, "median": 9.0}}
        for kind, b in (("relations_smoothed", 0.875), ("reference", 0.625))
    }
    assert [column[0] for column in cells([row], refined.table)] == [
        "hall", "12, 10", "0.500", "0.250", "3", "0.88, 0.62", "7", "11", "15", "321"
    ]  # fmt: skip


def test_a_log_that_cannot_be_mapped_is_told_in_one_line(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(
        "sys.argv", ["refined", "--logs", str(tmp_path), "--names", "none", "--out", str(tmp_path / "a")]
    )
    with pytest.raises(SystemExit, match="2"):
        run_study(RefinedStudy)
    assert "expected a map of none, found exit status 2" in capfd.readouterr().err


def test_a_log_is_cut_at_its_middle_scan(tmp_path):
    written(tmp_path)
    whole = read_real_run(tmp_path / "hall.log.gz", RealOptions(), None, {}, {}).log.scan_time_s
    halves = [half_of(tmp_path / "hall.log.gz", number, tmp_path).log.scan_time_s for number in (0, 1)]
    assert [each.tolist() for each in halves] == [whole[:4].tolist(), whole[4:].tolist()]


def placed(folder, monkeypatch, log, places, cov=None):
    """Return the row of a pair whose halves lie along known paths in maps that begin elsewhere."""
    path = np.column_stack([np.arange(40.0) * 0.3, np.sin(np.arange(40.0)), 0.1 * np.arange(40.0)])
    np.savetxt(folder / "a.ref_gmapping.txt", np.column_stack([np.arange(40.0), path]))
    origins = np.array([[1.0, 2.0, 0.5], [-3.0, 1.0, -1.0]])
    smoothed = [np.array([compose(inverse(origin), pose) for pose in path]) for origin in origins]

    def replayed(number, _):
        return SimpleNamespace(log=number, smoothed=number)

    told = {"places_world": [compose(compose(inverse(origins[0]), origins[1]), OFF)] * places, "place_covs": [cov]}
    for name, stand_in in (
        ("half_of", lambda path, number, home: number),
        ("replay_real", replayed),
        ("RealLog", lambda number: SimpleNamespace(config=lambda offline: None)),
        ("write_results", lambda *given: None),
        ("placed_real", lambda *given: (None, told)),
        ("smoothed_path", lambda half, log, poses: (np.arange(40.0), smoothed[poses])),
    ):
        monkeypatch.setattr(placing, name, stand_in)
    [row] = placing._one(folder, ("a", log))
    return row


OFF = np.array([0.3, -0.4, 0.1])


def test_a_place_is_compared_with_where_the_halves_lie_by_the_reference(tmp_path, monkeypatch):
    row = placed(tmp_path, monkeypatch, "a", 1, np.diag([0.01, 0.04, 0.0001]))
    assert row["off"] == pytest.approx(OFF.tolist(), abs=1e-6)
    assert row["sigma"] == pytest.approx([0.1, 0.2, 0.01])
    assert row["fit_m"] == pytest.approx([0.0, 0.0], abs=1e-6)
    for log, places in (("b", 1), ("a", 2), ("a", 0)):
        assert placed(tmp_path, monkeypatch, log, places) == {"map": "a", "log": log, "places": places}


def test_a_place_is_off_from_where_another_estimate_has_it_and_in_another_building_there_is_none():
    own = {
        "map": "a",
        "log": "a",
        "places": 1,
        "off": [0.3, -0.4, -0.1],
        "sigma": [0.1, 0.2, 0.01],
        "fit_m": [0.5, 0.25],
    }
    rows = [own, {"map": "a", "log": "b", "places": 0}]
    assert list(zip(*cells(rows, placing.table), strict=True)) == [
        ("a", "a", "1", "0.50, 5.7", "0.10, 0.20, 0.6", "0.50, 0.25"), ("a", "b", "0", "-", "-", "-")
    ]  # fmt: skip
