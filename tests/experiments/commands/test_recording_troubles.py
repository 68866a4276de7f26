"""What a recording must not cost: results where it cannot be written or shown, and imports where none is asked for."""

import json
import os
import resource
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import rerun as rr

from chainslam.experiments.commands.cli import main
from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.trial import default_mission, run_scenario
from chainslam.experiments.views.timelines import TimelineOutput

WORLD = "paper-fig4"

pytestmark = pytest.mark.usefixtures("_strict_rerun")


@pytest.mark.parametrize("place", ["file/run.rrd", "folder", "/dev/full"])
def test_a_recording_that_cannot_be_written_costs_one_line_and_nothing_else(tmp_path, capsys, place):
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "folder").mkdir()
    target = tmp_path / place
    status = main(["explore", WORLD, "--max-steps", "4", "--out", str(tmp_path / "out"), "--rrd", str(target)])
    said = capsys.readouterr().err.splitlines()
    assert status == 1
    assert len(said) == 1
    assert said[0].startswith(f"chainslam: not written: {target}: ")
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["steps"] == 4
    assert (tmp_path / "out" / "map.png").is_file()


def test_a_trouble_while_recording_is_told_and_the_run_goes_on(tmp_path, monkeypatch):
    from chainslam.viz.timeline import Timeline

    def fail(*_):
        raise RuntimeError("out of\nink")

    monkeypatch.setattr(Timeline, "add", fail)
    scenario = build(TrialConfig(WORLD, max_steps=2))
    recording = TimelineOutput("title", ["full-ekf"], scenario.world, False, tmp_path / "x.rrd")
    seen = []
    watch = recording.watch("full-ekf", lambda step: np.zeros(3), seen.append)
    assert len(run_scenario(scenario, watch, default_mission).log) == len(seen) == 2
    assert recording.close() == [f"{tmp_path / 'x.rrd'}: out of ink"]
    assert not (tmp_path / "x.rrd").exists()


def test_a_viewer_that_went_is_one_line_and_the_results_are_kept(tmp_path, capsys, monkeypatch):
    def severed(*_, **__):
        raise RuntimeError("gRPC connection severed")

    monkeypatch.setattr(
        "chainslam.experiments.views.timelines.Viewer", lambda: SimpleNamespace(url="rerun+http://127.0.0.1:9/proxy")
    )
    monkeypatch.setattr(rr.RecordingStream, "connect_grpc", lambda *_: None)
    monkeypatch.setattr(rr.RecordingStream, "flush", severed)
    status = main(["explore", WORLD, "--max-steps", "2", "--out", str(tmp_path), "--view"])
    (said,) = capsys.readouterr().err.splitlines()
    assert status == 1
    assert "expected the viewer to stay open until the end, found it closed" in said
    assert json.loads((tmp_path / "summary.json").read_text())["steps"] == 2


def test_the_file_may_grow_too_large_for_the_disk_and_costs_one_line(tmp_path, capsys):
    target, out = tmp_path / "run.rrd", tmp_path / "out"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Enough for every other file of a run.
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    try:
        status = main(["explore", WORLD, "--max-steps", "30", "--out", str(out), "--rrd", str(target)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert status == 1
    assert capsys.readouterr().err.splitlines() == [f"chainslam: not written: {target}: File too large"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]
    assert json.loads((out / "summary.json").read_text())["steps"] == 30
    assert (out / "map.png").is_file()


def test_without_a_display_the_viewer_is_one_line_and_the_results_are_kept(tmp_path, capsys, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    status = main(["explore", WORLD, "--max-steps", "3", "--out", str(tmp_path), "--view"])
    said = capsys.readouterr().err.splitlines()
    assert status == 1
    assert len(said) == 1
    assert "expected a display" in said[0]
    assert (tmp_path / "summary.json").is_file()


def test_a_recording_needs_no_pandas_and_leaves_it_as_it_was(tmp_path):
    code = f"""
import io, sys
from pathlib import Path
from chainslam.experiments.scenario import load_world
from chainslam.experiments.views.timelines import TimelineOutput
assert TimelineOutput("t", ["graph"], load_world({WORLD!r}), False, Path({str(tmp_path / "x.rrd")!r})).close() == []
assert "rerun" in sys.modules and "pandas" not in sys.modules
import pandas, pyarrow
table = pandas.DataFrame({{"a": [1.0, None], "b": ["x", None]}})
stream = io.BytesIO()
table.to_parquet(stream)
assert pandas.read_parquet(stream).equals(table)
assert pyarrow.array(table["b"]).null_count == 1
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)


def test_rerun_is_imported_only_when_a_recording_is_asked_for(tmp_path):
    code = (
        "import sys; from chainslam.experiments.commands.cli import main; "
        f"main(['explore', {WORLD!r}, '--max-steps', '2', '--out', {str(tmp_path)!r}]); "
        "sys.exit('rerun' in sys.modules)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    assert subprocess.run([sys.executable, "-c", code], env=environment, stdout=subprocess.DEVNULL).returncode == 0
