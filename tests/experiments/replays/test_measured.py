"""`replay --relations` and `--reference`: what others measured scores a drive without truth."""

import json

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.scoring.without_truth.references import References, read_path, read_relations, scored_by
from chainslam.experiments.usage import UsageError
from chainslam.experiments.views.numbers import number
from chainslam.experiments.views.run_page import run_page


def lines(path, rows):
    path.write_text("# a comment\n\n" + "".join(" ".join(map(str, row)) + "\n" for row in rows))
    return path


def a_log(path, scans=12):
    """A robot beside a long wall that its wheels follow exactly, 0.2 m a scan."""
    rows = []
    for k in range(scans):
        angles = np.deg2rad(np.arange(180) - 90.0)
        with np.errstate(divide="ignore"):
            ranges = np.where(np.sin(angles) > 0.05, 2.0 / np.sin(angles), 81.9)
        ranges = ranges + 1e-3 * ((np.arange(180) + k) % 2) * (ranges < 81.9)  # no scanner says the same twice
        rows.append(["FLASER", 180, *ranges, *[0.2 * k, 0, 0] * 2, 10.0 * k, "robot", 0])
    return lines(path, rows)


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("measured")
    relations = lines(
        folder / "a.relations",
        [(0, 20, 0.5, 0, 0, 0, 0, 0), (0, 100, 2.0, 0.3, 0, 0, 0, 0.1), (5, 15, 0.2, 0, 0, 0, 0, 0)],
    )
    reference = lines(folder / "a.txt", [(10.0 * k, 0.2 * k + 1.0, 5.0, 0.0) for k in range(12)])
    log = a_log(folder / "a.log")
    words = ["replay", str(log), "--odometry", "wheels", "--relations", str(relations), "--reference", str(reference)]
    assert main([*words, "--backend", "full-ekf", "graph-batch", "--out", str(folder / "out")]) == 0
    return folder


def test_the_summary_has_the_spread_of_the_errors_at_scans_between_and_far_apart(scored):
    summary = json.loads((scored / "out" / "full-ekf" / "summary.json").read_text())
    at, between = summary["relations"]["at_scans"], summary["relations"]["interpolated"]
    assert (at["all"]["count"], at["far"]["count"], between["all"]["count"]) == (2, 1, 3)
    assert at["all"]["translation_m"]["mean"] == pytest.approx(0.5 * (0.1 + 0.3), abs=0.02)
    assert at["far"]["rotation_rad"]["max"] == pytest.approx(0.1, abs=0.01)
    assert at["far"]["translation_m"]["sd"] == 0.0
    assert summary["reference"]["poses"] == 12
    assert summary["reference"]["ate_m"] == pytest.approx(np.hypot(1.0, 5.0), abs=0.02)
    assert summary["reference"]["ate_aligned_m"] < 0.02
    assert "relations_smoothed" not in summary


def test_errors_are_told_in_units_of_what_is_stated_and_relations_only_where_all_poses_are_kept(scored):
    graph, ekf = (
        json.loads((scored / "out" / name / "summary.json").read_text()) for name in ("graph-batch", "full-ekf")
    )
    relations = graph["relations_normalised"]
    assert (relations["all"]["count"], relations["far"]["count"]) == (2, 1)
    assert relations["far"]["anees"] > 1.0  # off by 0.3 m
    assert relations["measured"]["sigma_m"] is None
    assert "relations_normalised" not in ekf
    for summary in (graph, ekf):
        path = summary["reference_normalised"]["all"]
        assert path["count"] == 11
        assert path["error_m"] < 0.05
        assert path["anees"] > 0.0


def test_a_smoothed_path_is_scored_beside_the_one_of_each_step(scored):
    summary = json.loads((scored / "out" / "graph-batch" / "summary.json").read_text())
    assert summary["relations_smoothed"]["at_scans"]["all"]["count"] == 2
    assert summary["reference_smoothed"]["poses"] == 12
    told = summary["relations_smoothed_normalised"]
    assert (told["all"]["count"], told["far"]["count"]) == (2, 1)
    assert told["far"]["anees"] > 1.0  # off by 0.3 m
    assert (scored / "out" / "graph-batch" / "trajectory_smoothed.tum").is_file()


def test_path_and_map_of_second_looks_are_the_same_whichever_back_end_ran(scored, tmp_path):
    words = ["replay", str(scored / "a.log"), "--relations", str(scored / "a.relations"), "--out", str(tmp_path)]
    assert main([*words, "--second-looks", "--backend", "full-ekf", "block-ekf"]) == 0
    one, other = tmp_path / "full-ekf", tmp_path / "block-ekf"
    for name in ("trajectory_smoothed.tum", "map.npz", "map.geojson"):
        assert (one / name).read_bytes() == (other / name).read_bytes()
    assert (one / "steps.csv").read_bytes() != (other / "steps.csv").read_bytes()
    summary = json.loads((one / "summary.json").read_text())
    assert summary["relations_smoothed"]["at_scans"]["all"]["count"] == 2
    assert summary["second_looks"] == {"lines": 1, "duplicate_lines": 0, "chains_closed": 0, "closures": 0}
    path = np.loadtxt(one / "trajectory_smoothed.tum")
    assert len(path) == 12
    walls, [way] = (
        [each["geometry"]["coordinates"] for each in json.loads((one / "map.geojson").read_text())["features"]
         if each["properties"]["kind"] == kind]
        for kind in ("wall", "trajectory")
    )  # fmt: skip
    np.testing.assert_allclose(way, path[:, 1:3], atol=1e-6)
    np.testing.assert_allclose(np.array(walls)[0, :, 1], 2.0, atol=0.02)


def test_scores_are_told_in_a_line_and_stand_in_the_report(scored, capsys):
    words = ["replay", str(scored / "a.log"), "--relations", str(scored / "a.relations")]
    words += ["--backend", "full-ekf", "--out"]
    assert main([*words, str(scored / "again"), "--reference", str(scored / "a.txt")]) == 0
    summary = json.loads((scored / "again" / "summary.json").read_text())
    at_scans = summary["relations"]["at_scans"]["all"]
    said = capsys.readouterr().out
    assert f"{at_scans['count']} relations {number(at_scans['translation_m']['median'])} m" in said
    tables = run_page(scored / "again").tables
    relations = [dict(zip(tables["relations"].header, row, strict=True)) for row in tables["relations"].rows]
    assert [row["relations"] for row in relations] == [
        "at scans", "at scans, 60 s apart", "interpolated", "interpolated, 60 s apart",
    ]  # fmt: skip
    assert relations[0]["m, max"] == number(at_scans["translation_m"]["max"])
    assert relations[0]["degrees, mean"] == number(np.degrees(at_scans["rotation_rad"]["mean"]))
    (reference,) = tables["reference"].rows
    assert reference[2:] == (
        number(summary["reference"]["poses"]), number(summary["reference"]["ate_m"]),
        number(summary["reference"]["ate_aligned_m"]),
    )  # fmt: skip
    (stated,) = tables["stated"].rows
    assert stated[3] == number(summary["reference_normalised"]["all"]["anees"])


def test_the_report_of_a_refined_map_tells_both_maps(scored, tmp_path):
    words = ["replay", str(scored / "a.log"), "--second-looks", "--backend", "full-ekf", "--out", str(tmp_path)]
    assert main(words) == 0
    assert main(["report", str(tmp_path)]) == 0
    numbers = dict(run_page(tmp_path).tables["numbers"].rows)
    assert numbers["walls after offline refinement"] == "1"
    assert "walls" in numbers


def test_no_relation_at_a_scan_leaves_null(tmp_path):
    relations = read_relations(lines(tmp_path / "r", [(3, 4, 0, 0, 0, 0, 0, 0)]))
    scores = scored_by(References(relations), np.array([0.0, 10.0]), np.zeros((2, 3)))["relations"]
    assert scores["at_scans"]["all"] == {"count": 0, "translation_m": None, "rotation_rad": None}
    assert scores["interpolated"]["all"]["translation_m"]["max"] == 0.0


def test_both_kinds_of_paths_say_the_same_in_the_order_of_their_times(tmp_path):
    tum = lines(tmp_path / "tum", [(2, 1, 2, 0, 0, 0, np.sin(0.5), np.cos(0.5)), (1, 0, 0, 0, 0, 0, 0, 1)])
    planar = lines(tmp_path / "planar", [(1, 0, 0, 0), (2, 1, 2, 1.0)])
    for mine, theirs in zip(read_path(tum), read_path(planar), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-12)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ("1 2 3\n", "found 3 numbers in line 1"),
        ("1 2 3 4\n1 2 3 4 5 6 7 8\n", "found 8 numbers in line 2"),
        ("1 2 x 4\n", "found in line 1 of p other words"),
        ("1 2 nan 4\n", "numbers that are none"),
        ("# nothing\n", "found none in p"),
        (None, "No such file"),
    ],
)
def test_a_file_of_something_else_is_refused_in_one_line(tmp_path, content, found):
    if content is not None:
        (tmp_path / "p").write_text(content)
    with pytest.raises(UsageError) as caught:
        read_path(tmp_path / "p")
    assert found in str(caught.value)
    assert "\n" not in str(caught.value)
