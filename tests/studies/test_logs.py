"""The study of real robots' logs: it tells what its rows hold, and goes on where it was."""

import gzip
import json

import numpy as np
import pytest

from chainslam.experiments.replays.real_log import RealOptions, read_real_run
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
    assert row["peak_mib"] > 50.0
    assert row["lines"] == 2
    found = [column[0] for column in cells([row], refined.table)]
    assert found[:3] == ["hall", "1, 1", f"{row['relations_smoothed']['at_scans']['all']['translation_m']['mean']:.3f}"]
    assert found[3:5] == ["-", "0"]
    monkeypatch.setattr("studies.logs.refined.subprocess", None)
    study.run()
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 1


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
