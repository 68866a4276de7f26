from dataclasses import replace

import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS
from chainslam.viz.figures.maps import saved
from chainslam.viz.figures.plots import (
    NeesCurve,
    _dense,
    draw_model_space,
    draw_nees,
    draw_trajectories,
    draw_traversal,
    traversals,
)

SQUARE = (np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]),)


def curve(name):
    return NeesCurve(name, np.linspace(0.0, 9.0, 30), np.linspace(0.1, 30.0, 30), np.tile([[0.2], [9.3]], 30))


def line(*corners):
    return _dense(np.array(corners, dtype=np.float64))


def test_a_way_out_is_driven_once_out_and_back_twice_and_a_pendulum_four_times():
    out, far = (0.0, 0.0), (10.0, 0.0)
    assert set(traversals(line(out, far))) == {1}
    twice = traversals(line(out, far, out))
    assert np.median(twice) == 2
    assert np.median(traversals(line(out, far, out, far, out))) == 4


def test_only_the_crossing_of_an_eight_is_driven_twice():
    places = line((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0))
    near = np.hypot(*(places - 2.0).T)
    times = traversals(places)
    assert set(times[near < 0.1]) == {2}
    assert set(times[near > 0.5]) == {1}


def test_turning_on_the_spot_is_no_second_drive():
    jitter = 0.02 * np.random.default_rng(1).normal(size=(20, 2))
    assert set(traversals(np.concatenate([line((0.0, 0.0), (3.0, 0.0)), np.array([3.0, 0.0]) + jitter]))) == {1}


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_same_picture_is_the_same_bytes(kind):
    path = np.column_stack([np.linspace(1, 3, 30), np.full(30, 1.0), np.zeros(30)])
    draws = (
        lambda: draw_nees([curve(name) for name in BACKENDS]),
        lambda: draw_nees([replace(curve(name), quartiles=np.ones((2, 30))) for name in list(BACKENDS)[:2]]),
        lambda: draw_trajectories(path, {"graph": path}, SQUARE, "title", path),
        lambda: draw_model_space(np.array([[0.0, 1.0]]), 1e-4 * np.eye(2)[None], ["#000000"], "title"),
        lambda: draw_traversal(path, SQUARE, "title"),
    )
    for draw in draws[:: 1 if kind == "svg" else 4]:
        one, two = (saved(draw(), kind) for _ in range(2))
        assert one == two
        assert one.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[kind])


@pytest.mark.parametrize(("degrees", "words"), [(0.2, ", 10 times enlarged"), (5.0, "")])
def test_ellipses_that_would_cross_the_picture_are_not_enlarged_and_the_title_says_so(degrees, words):
    lines = np.array([[0.0, 1.0], [1.5, 2.0], [-1.5, 2.0]])
    covs = np.tile(np.diag([np.deg2rad(degrees), 0.05]) ** 2, (3, 1, 1))
    figure = draw_model_space(lines, covs, ["#000000"] * 3, "title")
    assert figure.get_suptitle() == f"title\n3σ ellipses of the walls{words}"
    across = np.concatenate([path.vertices[:, 0] for path in figure.axes[0].collections[1].get_paths()])
    assert 3.0 < np.ptp(across) < 2.0 * np.pi


def test_walls_that_are_vaguer_than_the_others_are_pale():
    covs = np.tile(np.diag([np.deg2rad(5.0), 0.05]) ** 2, (3, 1, 1))
    covs[0] *= 9.0
    figure = draw_model_space(np.zeros((3, 2)), covs, ["#000000"] * 3, "title")
    pale, firm = figure.axes[0].collections[:2]
    assert (len(pale.get_paths()), len(firm.get_paths())) == (1, 2)
