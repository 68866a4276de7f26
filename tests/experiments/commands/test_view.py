import csv
import shutil

import numpy as np
import pytest
from rerun.chunk import RrdReader

from chainslam.experiments.commands.cli import main
from chainslam.viz.viewer import ViewerError

WORLD, STEPS = "paper-fig4", 5


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A run, its log through two back ends, and a campaign."""
    home = tmp_path_factory.mktemp("view")
    assert main(["explore", WORLD, "--max-steps", str(STEPS), "--out", str(home / "run")]) == 0
    replay = ["replay", str(home / "run" / "log.npz"), "--out", str(home / "replays")]
    assert main([*replay, "--backend", "block-ekf", "graph"]) == 0
    campaign = ["compare", "--worlds", WORLD, "--backends", "block-ekf", "graph", "--strategies", "nearest-robot"]
    campaign += ["--trials", "2", "--max-steps", str(STEPS), "--modes", "replay", "--association", "own", "--jobs", "1"]
    assert main([*campaign, "--out", str(home / "campaign"), "--rrd", str(home / "film.rrd")]) == 0
    return home


@pytest.fixture
def opened(monkeypatch):
    """What is opened in the place of a viewer."""
    files = []
    monkeypatch.setattr("chainslam.experiments.commands.view.Viewer", files.append)
    monkeypatch.setattr("chainslam.experiments.commands.view.available", lambda: "viewer")
    return files


def curve(rrd, entity):
    """Return a curve by its steps."""
    values = {}
    for chunk in RrdReader(rrd).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if {"step", "Scalars:scalars"} <= set(batch.schema.names):
            pairs = zip(*(batch.column(name).to_pylist() for name in ("step", "Scalars:scalars")), strict=True)
            values |= {step: value[0] for step, value in pairs}
    return values


def rows(table, **wanted):
    with table.open() as stream:
        return [row for row in csv.DictReader(stream) if all(row[key] == value for key, value in wanted.items())]


def text(rrd, entity):
    (words,) = [
        chunk.to_record_batch().column("TextDocument:text").to_pylist()[0][0]
        for chunk in RrdReader(rrd).stream().filter(content=entity)
    ]
    return words


def test_a_recording_of_a_campaign_holds_one_of_its_runs_and_its_tables(home):
    film = home / "film.rrd"
    for backend in ("block-ekf", "graph"):
        (trial,) = rows(home / "campaign" / "trials.csv", backend=backend, seed="1")
        nees = curve(film, f"/plots/nees/{backend}")
        assert len(nees) == int(trial["steps"]) == STEPS
        assert np.mean(list(nees.values())) / 3 == pytest.approx(float(trial["pose_anees"]))
        steps = rows(home / "campaign" / "steps.csv", backend=backend)
        for name, told in (("pose_anees", np.log10), ("pose_error_rms_m", float)):
            drawn = curve(film, f"/campaign/0/curves/{name}/{backend}")
            assert drawn == pytest.approx({int(row["step"]): told(float(row[name])) for row in steps})
        trials = rows(home / "campaign" / "trials.csv", backend=backend)
        complete = sum(row["status"] == "complete" for row in trials)
        anees = np.mean([float(row["pose_anees"]) for row in trials])
        assert f"| {backend} | 2 | {complete} | {anees:.3g} |" in text(film, "/campaign/table")


def test_a_file_is_opened_and_so_are_those_of_a_folder(home, opened, tmp_path):
    shutil.copy(home / "film.rrd", tmp_path / "b.rrd")
    shutil.copy(home / "film.rrd", tmp_path / "a.rrd")
    assert main(["view", str(tmp_path / "b.rrd")]) == main(["view", str(tmp_path)]) == 0
    assert opened == [[tmp_path / "b.rrd"], [tmp_path / "a.rrd", tmp_path / "b.rrd"]]


@pytest.mark.parametrize(
    ("place", "folder", "backends"),
    [
        ("run", "run", {"graph"}),
        ("replays/graph/log.npz", "replays/graph", {"graph"}),
        ("replays", "replays", {"block-ekf", "graph"}),
        ("campaign", "campaign", {"block-ekf", "graph"}),
    ],
)
def test_a_results_folder_is_recorded_and_opened(home, opened, tmp_path, place, folder, backends):
    results = shutil.copytree(home / folder, tmp_path / folder)
    assert main(["view", str(tmp_path / place)]) == 0
    assert opened == [[results / "run.rrd"]]
    curves = {backend: curve(results / "run.rrd", f"/plots/nees/{backend}") for backend in backends}
    assert {len(values) for values in curves.values()} == {STEPS}
    paths = {str(path) for path in RrdReader(results / "run.rrd").store().schema().entity_paths()}
    assert {
        path.rpartition("/")[2] for path in paths if path.startswith("/plots/nees/") and "band" not in path
    } == backends


@pytest.mark.parametrize("place", ["nothing", "nothing.rrd", "empty", "run/summary.json", "several", "unfinished"])
def test_a_place_with_nothing_to_show_is_one_line(home, opened, tmp_path, capsys, place):
    shutil.copytree(home / "run", tmp_path / "run")
    (tmp_path / "empty").mkdir()
    shutil.copytree(home / "run", tmp_path / "several" / "one")
    assert main(["explore", WORLD, "--seed", "2", "--max-steps", "2", "--out", str(tmp_path / "several" / "two")]) == 0
    shutil.copytree(home / "campaign", tmp_path / "unfinished")
    (tmp_path / "unfinished" / "steps.parquet").unlink()
    capsys.readouterr()
    assert main(["view", str(tmp_path / place)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith("chainslam: expected ")
    assert opened == []


def test_without_a_display_nothing_is_made(home, tmp_path, capsys, monkeypatch):
    def none():
        raise ViewerError("expected a display")

    monkeypatch.setattr("chainslam.experiments.commands.view.available", none)
    shutil.copytree(home / "run", tmp_path / "run")
    capsys.readouterr()
    assert main(["view", str(tmp_path / "run")]) == 1
    assert capsys.readouterr().err.splitlines() == ["chainslam: expected a display"]
    assert not (tmp_path / "run" / "run.rrd").exists()


def test_a_replay_is_shown_with_the_association_that_made_it(home, opened, tmp_path):
    words = ["replay", str(home / "run" / "log.npz"), "--association", "true", "--out", str(tmp_path)]
    assert main(words) == 0
    assert main(["view", str(tmp_path)]) == 0
    assert "from the log, true association" in text(tmp_path / "run.rrd", "/legend")


def test_a_browser_is_served_until_ctrl_c_and_told_how_to_come_over_ssh(tmp_path, capsys, monkeypatch):
    class Served:
        page_port, port, url, closed = 9090, 9876, "http://127.0.0.1:9090/?url=x", False

        def __init__(self, files):
            assert files == [tmp_path / "run.rrd"]

        def wait(self):
            raise KeyboardInterrupt

        def close(self):
            Served.closed = True

    (tmp_path / "run.rrd").write_bytes(b"")
    monkeypatch.setattr("chainslam.experiments.commands.view.WebViewer", Served)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert main(["view", str(tmp_path), "--web"]) == 0
    told = capsys.readouterr().out
    assert Served.url in told
    assert "ssh -L 9090:127.0.0.1:9090 -L 9876:127.0.0.1:9876" in told
    assert Served.closed
