"""The study of drives whose odometry scans tell: a row for each kind, by hand."""

from studies.logs.matched_drives import MatchedStudy, table

PLAIN = {
    "world": "hall", "backend": "full-ekf", "status": "complete", "contours_closed": 1, "contours_reachable": 2,
    "pose_nees_in_band": 0.9, "map_anees": 1.0, "false_matches": 1, "path_length_m": 10.0,
}  # fmt: skip


def test_the_kinds_of_odometry_stand_apart():
    rows = [
        PLAIN | {"odometry": "wheels", "seed": 1, "pose_anees": 1.0, "pose_rmse_m": 0.3},
        PLAIN | {"odometry": "wheels", "seed": 2, "pose_anees": 3.0, "pose_rmse_m": 0.4, "status": "stopped"},
        PLAIN | {"odometry": "scans", "seed": 1, "pose_anees": 0.5, "pose_rmse_m": 0.1},
    ]
    columns = [list(map(str, column.cells)) for column in table(rows).columns]
    assert columns[2] == ["scans", "wheels"]
    assert [columns[k][1] for k in range(3, 10)] == ["2", "1", "2.00", "1.00", "2.00", "0.90", "0.354"]
    assert columns[6] == ["-", "1.00"]


def test_a_drive_by_scans_has_its_scores(tmp_path, capsys):
    MatchedStudy(("paper-fig8",), seeds=1, out=tmp_path / "rows.jsonl").run()
    shown = capsys.readouterr().out
    assert shown.count("paper-fig8") == 2
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 2
