"""Error bars of distances and areas: derivatives against finite differences, and against draws of the map."""

import numpy as np
import pytest

from chainslam.experiments.artifacts.maps.mapped import read_corners
from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.commands.cli import main
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.maps.corners import corners
from chainslam.experiments.scoring.maps.measurements import (
    area,
    corner_jacobian,
    corner_points,
    distance,
    distances,
    perimeter,
)
from chainslam.experiments.trial import run_trial
from chainslam.slam.geometry.line_kernels import intersect
from chainslam.slam.geometry.lines import normals

RNG = np.random.default_rng(8)


def crossing(state, anchors):
    lines = state.reshape(-1, 2)
    r = lines[:, 1] + np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    hessian = np.column_stack([lines[:, 0], r])
    return intersect(hessian[:1], hessian[1:])[0][0]


@pytest.mark.parametrize("turn", [0.06, 0.8, np.pi / 2, -2.4])
def test_a_corner_moves_with_its_walls_as_stated(turn):
    anchors, state = RNG.normal(size=(2, 2)), np.array([0.3, 0.1, 0.3 + turn, -0.2])
    stated, crosses = corner_jacobian(state.reshape(2, 2), anchors, crossing(state, anchors))
    step = 1e-6
    found = [(crossing(state + d, anchors) - crossing(state - d, anchors)) / (2 * step) for d in step * np.eye(4)]
    assert crosses
    np.testing.assert_allclose(stated, np.stack(found, axis=-1), rtol=1e-5, atol=1e-6)


def test_walls_on_one_line_leave_their_corner_unknown_along_them_only():
    lines, anchors = np.array([[0.0, 1.0], [0.01, 1.0]]), np.zeros((2, 2))
    stated, crosses = corner_jacobian(lines, anchors, np.array([1.0, 0.0]))
    assert not crosses
    np.testing.assert_allclose(stated @ [0.0, 1.0, 0.0, 1.0], [1.0, 0.0], atol=0.01)


def polygon_of(n=6, spread=1e-4):
    """A ring of corners that are known jointly, by a random covariance."""
    turns = np.sort(RNG.uniform(0, 2 * np.pi, n))
    points = 3.0 * np.column_stack([np.cos(turns), np.sin(turns)])
    root = spread * RNG.normal(size=(2 * n, 2 * n))
    return corner_points(points, np.eye(2 * n).reshape(n, 2, 2 * n), root @ root.T), root


def test_distances_lengths_and_areas_spread_as_stated():
    points, root = polygon_of()
    n = len(points.positions_world)
    ring = list(range(n))
    drawn = points.positions_world + (RNG.normal(size=(4000, 2 * n)) @ root.T).reshape(-1, n, 2)
    after = np.roll(drawn, -1, axis=1)
    cases = {
        "distance": (distance(points, 0, 3), np.hypot(*(drawn[:, 0] - drawn[:, 3]).T)),
        "perimeter": (perimeter(points, ring), np.hypot(*np.moveaxis(after - drawn, -1, 0)).sum(axis=1)),
        "area": (area(points, ring), 0.5 * (drawn[..., 0] * after[..., 1] - drawn[..., 1] * after[..., 0]).sum(axis=1)),
    }
    for measured, values in cases.values():
        assert measured.value == pytest.approx(values.mean(), rel=1e-3)
        assert measured.sigma == pytest.approx(values.std(), rel=0.05)
        low, high = measured.interval
        assert np.mean((values > low) & (values < high)) == pytest.approx(0.95, abs=0.015)


def test_an_area_is_positive_whichever_way_its_chain_runs():
    points, _ = polygon_of()
    ring = list(range(len(points.positions_world)))
    assert area(points, ring).value == pytest.approx(area(points, ring[::-1]).value)
    assert area(points, ring[::-1]).value > 0.0
    assert area(points, ring).sigma == pytest.approx(area(points, ring[::-1]).sigma)


def test_many_distances_are_the_single_ones():
    points, _ = polygon_of()
    values, sigmas = distances(points, np.array([[0, 1], [2, 5]]))
    assert (values[1], sigmas[1]) == pytest.approx((distance(points, 2, 5).value, distance(points, 2, 5).sigma))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    result = run_trial(TrialConfig("paper-fig4", max_steps=130))
    folder = tmp_path_factory.mktemp("measured")
    assert write_results(result, folder) == []
    return result, folder


def test_the_files_of_a_run_give_the_corners_of_its_map(run):
    result, folder = run
    mapped, found = read_corners(folder), corners(result.last.map, result.last.chains)
    assert len(mapped) == len(found) > 0
    np.testing.assert_allclose(mapped.points.positions_world, [corner.position_world for corner in found], atol=1e-9)
    for k, corner in enumerate(found):
        if corner.jacobian is not None:
            np.testing.assert_allclose(mapped.points.cov[k, :, k], corner.cov(result.joint), rtol=1e-6, atol=1e-15)


def test_measure_prints_a_distance_with_its_interval_or_lists_the_corners(run, capsys):
    _, folder = run
    assert main(["measure", str(folder), "0", "1"]) == 0
    said = capsys.readouterr().out
    mapped = read_corners(folder)
    low, high = mapped.distance(0, 1).interval
    assert f"{mapped.distance(0, 1).value:.3f} m" in said
    assert f"{low:.3f} to {high:.3f} m" in said
    assert "full-ekf" in said
    assert main(["measure", str(folder)]) == 0
    assert "corners of" in capsys.readouterr().out


@pytest.mark.parametrize(
    "names",
    [["0"], ["0", "9" * 5000], ["0", "٣"], ["0", "999"], ["0", "A"], ["0", "-1"], ["0", "1", "2"]],
    ids=lambda names: "-".join(names)[:9],
)
def test_names_that_are_no_corners_get_one_line_and_status_2(run, names, capsys):
    assert main(["measure", str(run[1]), *names]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert len(line) < 1000


def test_a_folder_without_a_map_gets_one_line_and_status_2(tmp_path, capsys):
    (tmp_path / "map.npz").write_bytes(b"no archive")
    for folder in (tmp_path, tmp_path / "nowhere"):
        assert main(["measure", str(folder), "0", "1"]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("chainslam: expected")
        assert "\n" not in said
