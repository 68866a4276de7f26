"""`import chainslam`: light to import, complete, and the same results as the command line."""

import builtins
import json
import subprocess
import sys

import msgspec
import numpy as np
import pandas
import pytest

import chainslam
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.runs import table_at
from chainslam.experiments.scoring.keys import Words
from chainslam.slam.backends.full_ekf import FullEkf

HEAVY = ("gtsam", "rerun", "matplotlib", "pandas", "numpy")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return chainslam.explore("paper-fig4", seed=2, max_steps=30, out=tmp_path_factory.mktemp("run") / "out")


def test_nothing_heavy_is_loaded_before_it_is_used(tmp_path):
    words = f"import sys, chainslam; print([name for name in {HEAVY} if name in sys.modules], chainslam.__version__)"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.startswith("[] 0.")


def test_every_name_is_there_and_no_other():
    assert all(getattr(chainslam, name) is not None for name in chainslam.__all__)
    assert dir(chainslam) == sorted(chainslam.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'explor'"):
        _ = chainslam.explor


def test_a_run_is_what_the_command_leaves(run, tmp_path):
    assert main(["explore", "paper-fig4", "--seed", "2", "--max-steps", "30", "--out", str(tmp_path)]) == 0
    for name in ("config.json", "map.npz", "log.npz", "trajectory_estimated.tum"):
        assert (tmp_path / name).read_bytes() == (run.folder / name).read_bytes()
    assert chainslam.load(tmp_path).summary["pose_anees"] == run.summary["pose_anees"]


def test_settings_are_those_of_the_command(tmp_path):
    key = "mission.mapper.matching.gate"
    run = chainslam.explore("paper-fig4", max_steps=3, settings={key: 0.95}, robot="turtlebot")
    words = ["--set", f"{key}=0.95", "--robot", "turtlebot", "--max-steps", "3"]
    assert main(["explore", "paper-fig4", *words, "--out", str(tmp_path)]) == 0
    assert (tmp_path / "config.json").read_bytes() == (run.folder / "config.json").read_bytes()


def test_a_preset_and_a_file_of_settings_are_those_of_the_command(tmp_path):
    file = tmp_path / "mine.json"
    file.write_text('{"seed": 5, "p0": "large"}')
    run = chainslam.explore("paper-fig4", preset="paper-method", config=file, max_steps=3)
    words = ["--preset", "paper-method", "--config", str(file), "--max-steps", "3", "--out", str(tmp_path / "run")]
    assert main(["explore", "paper-fig4", *words]) == 0
    assert (tmp_path / "run" / "config.json").read_bytes() == (run.folder / "config.json").read_bytes()
    assert run.summary["seed"] == 5


def test_a_replay_is_held_against_what_others_measured(run, tmp_path):
    reference = run.folder / "trajectory_true.tum"
    replayed = chainslam.replay(run, reference=reference, settings={"mission.mapper.matching.gate": 0.95})
    words = [
        "--reference",
        str(reference),
        "--set",
        "mission.mapper.matching.gate=0.95",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(["replay", str(run.folder), *words]) == 0
    told = chainslam.load(tmp_path / "out").summary
    assert {key for key in told if told[key] != replayed.summary[key]} <= {"step_ms", "planning_ms", "processor_s"}
    assert told["reference"]["poses"] > 0


def test_distances_are_those_of_the_command(run, capsys):
    mapped = run.measure()
    first, second = [k for k, sharp in enumerate(mapped.sharp) if sharp][:2]
    capsys.readouterr()
    assert main(["measure", str(run.folder), str(first), str(second), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert run.measure(first, second).value == pytest.approx(told["distance_m"])
    with pytest.raises(chainslam.UsageError, match="expected a corner from"):
        run.measure(0, 999)


def test_what_a_notebook_shows_says_what_it_is(run, tmp_path):
    assert repr(run.map).startswith(f"Map({len(run.map)} walls of ")
    assert "<svg" in run._repr_html_()
    found = chainslam.compare(
        worlds=["paper-fig4"], backends=["full-ekf"], trials=2, max_steps=3, modes=["closed"], errorless=True, jobs=1
    )
    assert repr(found).startswith("Comparison(paper-fig4 by full-ekf, 2 trials each")
    assert found._repr_html_().count("<p>") > 1
    assert set(found.trials["pose_anees"].isna()) == {True}


def test_the_map_has_ends_lines_and_covariance_of_its_walls(run):
    walls = run.map
    assert len(walls) == len(walls.ids) > 3
    n = np.stack([np.cos(walls.lines_world[:, 0]), np.sin(walls.lines_world[:, 0])], axis=-1)
    off = np.einsum("nd,ned->ne", n, walls.ends_world) - walls.lines_world[:, 1:]
    np.testing.assert_allclose(off, 0.0, atol=1e-9)
    assert walls.cov.shape == (3 + 2 * len(walls),) * 2


def test_the_types_of_a_run_are_those_of_its_files(run):
    assert set(run.summary) == chainslam.Summary.__required_keys__
    assert run.summary == json.loads((run.folder / "summary.json").read_text())
    msgspec.convert(run.summary, chainslam.Summary)
    assert list(run.steps) == list(chainslam.Steps.__annotations__)
    words = {name for name, kind in chainslam.Steps.__annotations__.items() if kind == Words}
    assert {name for name, column in run.steps.items() if column.dtype.kind == "U"} == words == {"behaviour", "reason"}
    assert all(column.dtype == np.float64 for name, column in run.steps.items() if name not in words)


def test_steps_are_an_array_for_each_column(run):
    frame = pandas.read_csv(run.folder / "steps.csv")
    assert len(frame) == run.summary["steps"]
    np.testing.assert_allclose(run.steps["pose_nees"], frame["pose_nees"].to_numpy())
    assert pandas.DataFrame(run.steps)["reason"].tolist() == frame["reason"].tolist()


def test_a_campaign_is_a_table_with_pandas_and_arrays_without(run, monkeypatch):
    frame = table_at(run.folder / "steps.csv")
    imported = builtins.__import__

    def without(name, *more):
        if name == "pandas":
            raise ImportError(name)
        return imported(name, *more)

    monkeypatch.setattr(builtins, "__import__", without)
    plain = table_at(run.folder / "steps.csv")
    assert list(plain) == list(frame.columns)
    np.testing.assert_allclose(plain["pose_nees"], frame["pose_nees"].to_numpy())
    assert plain["reason"][0] == frame["reason"][0]


def test_steps_of_a_table_that_was_cut_short_are_refused(run, tmp_path):
    lines = (run.folder / "steps.csv").read_text().splitlines()
    for kept in ([], [*lines[:3], lines[3][:20]]):
        (tmp_path / "steps.csv").write_text("\n".join(kept))
        with pytest.raises(chainslam.UsageError, match="found another table, or one that was cut short"):
            _ = chainslam.Run(tmp_path).steps


@pytest.mark.parametrize("picture", ["map", "visibility", "paths", "nees", "model", "traversals"])
def test_pictures_are_figures(run, picture):
    assert run.plot(picture).axes


def test_a_run_without_a_folder_keeps_its_files_as_long_as_it_lives():
    made = chainslam.explore("paper-fig4", max_steps=2)
    folder = made.folder
    assert made.summary["steps"] == 2
    assert (folder / "map.npz").is_file()
    del made
    assert not folder.exists()


def test_a_stopped_run_goes_on_as_by_the_command(tmp_path):
    places = [tmp_path / name for name in ("ours", "theirs")]
    for place in places:
        chainslam.explore("paper-fig4", seed=2, max_steps=5, out=place)
    seen = []
    run = chainslam.explore(resume=places[0], max_steps=12, watch=lambda step: seen.append(step.index))
    assert main(["explore", "--resume", str(places[1]), "--max-steps", "12"]) == 0
    assert run.summary["steps"] == 12
    assert seen == list(range(12))
    for name in ("config.json", "map.npz", "log.npz", "trajectory_estimated.tum"):
        assert (places[0] / name).read_bytes() == (places[1] / name).read_bytes()
    elsewhere = chainslam.explore(resume=run, max_steps=14, out=tmp_path / "more")
    assert (elsewhere.summary["steps"], chainslam.load(places[0]).summary["steps"]) == (14, 12)
    seen.clear()
    assert chainslam.explore(resume=run, watch=seen.append).folder == run.folder  # finished: nothing to do
    assert seen == []


def test_a_run_without_a_folder_goes_on_and_is_kept_by_whoever_has_it():
    run = chainslam.explore("paper-fig4", max_steps=3)
    again = chainslam.explore(resume=run, max_steps=4)
    del run
    assert again.summary["steps"] == 4


def test_a_saved_run_has_settled_all_but_its_limits(run, tmp_path):
    for words, said in (
        ("found world", {"world": "paper-fig4"}),
        ("found seed", {"seed": 4}),
        ("found scale", {"scale": 2.0}),
        ("found set", {"settings": {"seed": 3}}),
        ("limits beyond the 30 steps", {"max_steps": 10}),
    ):
        with pytest.raises(chainslam.UsageError, match=words):
            chainslam.explore(resume=run, **said)
    with pytest.raises(chainslam.UsageError, match=r"expected config\.json"):
        chainslam.explore(resume=tmp_path / "nothing")
    with pytest.raises(chainslam.UsageError, match="expected a WORLD or --resume DIR"):
        chainslam.explore()


def test_a_log_goes_through_one_back_end_or_several(run):
    assert chainslam.replay(run, backend="full-ekf").summary["backend"] == "full-ekf"
    runs = chainslam.replay(run.folder / "log.npz", backend=["block-ekf", "fej-ekf"])
    assert {name: made.summary["backend"] for name, made in runs.items()} == {name: name for name in runs}


class Doubting(FullEkf):
    """A back end of one's own."""


def test_processes_of_a_campaign_know_a_back_end_of_ones_own(monkeypatch):
    monkeypatch.setitem(chainslam.BACKENDS, "doubting", chainslam.BackendEntry(Doubting, "for a test"))
    backends = ["doubting", "full-ekf"]
    made = chainslam.compare(worlds=["paper-fig4"], backends=backends, trials=1, max_steps=4, modes=["closed"], jobs=2)
    assert sorted(made.trials["backend"]) == backends
    assert made.trials["status"].tolist() == ["stopped", "stopped"]
    assert made.verdict
    assert "<html" in made.report().read_text()
    assert isinstance(chainslam.load(made.folder), chainslam.Comparison)


class Wrapped:
    """A robot of one's own: it hands on what another one does, and knows no truth."""

    def __init__(self, robot):
        self._robot = robot

    def sense(self):
        return self._robot.sense()

    def drive(self, command):
        return self._robot.drive(command)


def test_a_robot_of_ones_own_explores_and_has_no_scores_of_the_truth():
    from chainslam.experiments.scenario import TrialConfig, build

    robot = Wrapped(build(TrialConfig("paper-fig4", seed=3)).robot)
    run = chainslam.explore(robot, robot=chainslam.RobotSpec(radius_m=0.2), max_steps=25)
    assert run.summary["world"] == "Wrapped"
    assert (run.summary["pose_anees"], run.summary["coverage"]) == (None, None)
    assert len(run.map) > 3
    assert run.plot().axes
    with pytest.raises(chainslam.UsageError, match="whose truth nobody knows"):
        run.plot("nees")
    assert "Wrapped" in run.report().read_text()


def test_the_log_of_a_robot_of_ones_own_goes_through_the_same_back_end_to_the_same_path(tmp_path, capsys):
    from chainslam.experiments.commands.cli import main
    from chainslam.experiments.scenario import TrialConfig, build

    robot = Wrapped(build(TrialConfig("paper-fig4", seed=3)).robot)
    chainslam.explore(robot, robot=chainslam.RobotSpec(radius_m=0.2), max_steps=15, out=tmp_path / "run")
    log = str(tmp_path / "run" / "log.npz")
    assert main(["replay", log, "--backend", "graph", "--second-looks", "--out", str(tmp_path / "again")]) == 0
    ours, theirs = ((tmp_path / folder / "trajectory_estimated.tum").read_bytes() for folder in ("run", "again"))
    assert ours == theirs
    assert len((tmp_path / "again" / "trajectory_smoothed.tum").read_bytes().splitlines()) == 15
    capsys.readouterr()
    assert main(["replay", log, "--association", "true"]) == 2
    assert "leave them out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("did you mean paper-fig4", lambda: chainslam.explore("paper-fig44")),
        ("did you mean full-ekf", lambda: chainslam.explore("paper-fig4", backend="ful-ekf")),
        ("the unknown key 'gate'", lambda: chainslam.explore("paper-fig4", settings={"gate": 1})),
        ("expected a run's summary.json", lambda: chainslam.load("nowhere")),
        ("expected a back end", lambda: chainslam.replay("nowhere/log.npz", backend=["none"])),
    ],
)
def test_bad_input_is_one_line(words, call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(chainslam.UsageError, match=words) as told:
        call()
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []
