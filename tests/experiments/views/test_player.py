"""The film of runs for the player: its figures are those of the runs' files, its walls those of their maps."""

import csv
import json
import re

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.replays.replay import ReplayOptions, read_run, replay
from chainslam.experiments.views.player import FRAMES, MOVED_MM, deviations, film_of, shown_steps
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.slam.map.kernels import wall_kernels
from chainslam.viz.reports.player import player

BACKENDS = ("block-ekf", "full-ekf")


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A drive whose start is known, so that its estimate is the one relative to the start."""
    folder = tmp_path_factory.mktemp("drive")
    assert main(["explore", "paper-fig4", "--p0", "zero", "--max-steps", "40", "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def runs(drive, tmp_path_factory):
    out = tmp_path_factory.mktemp("replays")
    assert main(["replay", str(drive / "log.npz"), "--backend", *BACKENDS, "--out", str(out)]) == 0
    return [out / name for name in BACKENDS]


@pytest.fixture(scope="module")
def film(runs):
    return json.loads(json.dumps(film_of(runs), allow_nan=False))


def table(home):
    with (home / "steps.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return lambda name: np.array([float(row[name]) for row in rows])


def test_every_figure_is_that_of_the_files(runs, film):
    assert [run["backend"] for run in film["runs"]] == list(BACKENDS)
    for home, run in zip(runs, film["runs"], strict=True):
        summary, steps, shown = json.loads((home / "summary.json").read_text()), table(home), film["steps"]
        nees = steps("pose_nees_from_start")
        low, high = chi2_band(3)
        assert run["nees"] == pytest.approx(nees[shown], rel=5e-4)
        assert run["anees"] == pytest.approx(summary["pose_anees_from_start"], rel=5e-4)
        assert run["in_band"] == pytest.approx(np.mean((nees >= low) & (nees <= high)), rel=5e-4)
        assert run["coverage"][-1] == pytest.approx(summary["coverage"], rel=5e-4)
        assert run["coverage"] == sorted(run["coverage"])
        assert film["band"] == pytest.approx([low, high], rel=5e-4)
        assert film["path_m"] == pytest.approx(steps("path_length_m")[shown], abs=0.006)
        for poses, names in ((run["poses"], ("x_m", "y_m", "heading_rad")), (film["true"], ("true_x_m", "true_y_m"))):
            for k, name in enumerate(names):
                assert np.array(poses)[:, k] == pytest.approx(1e3 * steps(name)[shown], abs=0.6)
        for k, name in enumerate(("cov_xx", "cov_xy", "cov_yy")):
            assert np.array(run["covs"])[:, k] == pytest.approx(1e6 * steps(name)[shown], rel=5e-4, abs=1e-9)


def maps_of(run):
    """The walls at each step that is shown, by their ids, as the player puts them together."""
    now = {}
    for changes in run["walls"]:
        for wall, *row in changes:
            now.pop(wall, None)
            now |= {wall: row} if row else {}
        yield dict(now)


def test_walls_told_by_their_changes_are_those_of_the_map(runs, film):
    run = film["runs"][1]
    maps, log, told = list(maps_of(run)), read_run(runs[1] / "log.npz"), []

    def compare(step):
        shown = maps[step.index]
        assert sorted(shown) == step.map.ids.tolist()
        far = 1e3 * step.map.ends_world.reshape(-1, 4) - np.array([shown[wall][:4] for wall in sorted(shown)])
        # The start is known to 0.1 mm, by which map and truth differ.
        assert np.abs(far).max() < (MOVED_MM + 1.5 if step.index < film["steps"][-1] else 1.5)
        told.append(len(shown))

    replay(log, "full-ekf", ReplayOptions(), compare)
    assert len(told) == len(film["steps"]) == 40
    assert sum(map(len, run["walls"])) < 0.5 * sum(told)
    saved = np.load(runs[1] / "map.npz")
    assert [maps[-1][wall][6] for wall in saved["ids"]] == saved["tentative"].tolist()


def test_the_band_of_a_wall_is_that_of_its_ends_under_the_stated_covariance():
    mean, anchors, extents = np.array([[0.7, 0.2]]), np.array([[1.0, 2.0]]), np.array([[-1.5, 3.0]])
    cov = np.diag([1.0, 1.0, 1.0, 4e-6, 9e-6])
    cov[3, 4] = cov[4, 3] = 5e-6
    draws = np.random.default_rng(1).multivariate_normal(mean[0], cov[3:, 3:], 20_000)
    ends = np.array([wall_kernels.ends_world(anchors, draw[None], extents)[0] for draw in draws])
    across = (ends - wall_kernels.ends_world(anchors, mean, extents)[0]) @ [np.cos(0.7), np.sin(0.7)]
    joint = Joint(np.zeros(5), cov, anchors)
    assert deviations(joint, extents)[0] == pytest.approx(across.std(axis=0), rel=0.02)


def test_a_drive_without_noise_has_no_nees(tmp_path):
    assert main(["explore", "paper-fig4", "--errorless", "--max-steps", "5", "--out", str(tmp_path)]) == 0
    (run,) = film_of([tmp_path])["runs"]
    assert (run["anees"], run["in_band"], run["nees"]) == (None, None, [None] * 5)


def test_a_long_drive_has_no_more_than_two_hundred_pictures():
    assert 150 < len(shown_steps(12_345)) <= 200


def test_few_steps_are_shown_and_the_last_always():
    assert shown_steps(0) == []
    assert shown_steps(3) == [0, 1, 2]
    for count in (FRAMES - 1, FRAMES, FRAMES + 1, 4999):
        shown = shown_steps(count)
        assert (shown[0], shown[-1]) == (0, count - 1)
        assert len(shown) <= FRAMES
        assert len(set(np.diff(shown[:-1]))) == 1


def test_runs_of_two_drives_and_files_that_do_not_belong_together_are_refused(drive, runs, tmp_path, capsys):
    other = tmp_path / "other"
    assert main(["explore", "paper-fig4", "--seed", "2", "--max-steps", "5", "--out", str(other)]) == 0
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    for name, home in (("a", runs[0]), ("b", other)):
        (mixed / name).symlink_to(home)
    assert main(["report", str(mixed), "--play"]) == 2
    said = (other / "steps.csv").read_text().splitlines()
    at = said[0].split(",").index("x_m")
    cells = said[3].split(",")
    cells[at] = str(float(cells[at]) + 0.01)
    (other / "steps.csv").write_text("\n".join([*said[:3], ",".join(cells), *said[4:]]) + "\n")
    assert main(["report", str(other), "--play"]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("chainslam: expected")]
    assert len(errors) == 2
    assert "repeat the run" in errors[1]


def test_a_report_shows_the_player_in_place_of_the_curve(runs, film):
    folder = runs[0].parent
    pages = []
    for more in ([], ["--play"]):
        assert main(["report", str(folder), *more]) == 0
        pages.append((folder / "report.html").read_text())
    assert pages[0].count("<img") - pages[1].count("<img") == 1
    assert 'class="player"' not in pages[0]
    (held,) = re.findall('class="player"><script type="application/json">(.*?)</script>', pages[1])
    assert json.loads(held)["films"] == [film]
    assert not re.findall(r'(?:src|href)="(?!data:)', pages[1])


def test_a_title_cannot_end_the_script():
    page = player([{"title": "</script><b>"}])
    assert page.count("</script>") == 2
    assert "<b>" not in page
