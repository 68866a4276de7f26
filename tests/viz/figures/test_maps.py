from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.map.chains import Chain, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz.figures.maps import Picture, draw_map, png


def picture(closed, size=2.0):
    alpha = np.array([-np.pi / 2, 0.0, np.pi / 2, np.pi])
    anchors = 0.5 * size * np.array([[1.0, 0.0], [2.0, 1.0], [1.0, 2.0], [0.0, 1.0]])
    means = np.stack([alpha, np.zeros(4)], axis=-1)
    belief = Belief(
        np.array([0.5, 0.5, 0.3]), np.diag([1e-4, 4e-4, 1e-4]), np.arange(4), anchors, means,
        lambda ids: Joint(np.zeros(3), np.eye(3), np.zeros((0, 2))),
    )  # fmt: skip
    extents = np.tile([-0.5 * size, 0.5 * size], (4, 1))
    walls = StochasticMap(belief, extents, np.full(4, 3), np.zeros(4, dtype=bool), np.zeros(4, dtype=bool))
    corners = size * np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    ends = () if closed else (OpenEnd(0, 0, corners[3]), OpenEnd(3, 1, corners[3]))
    chain = Chain((0, 1, 2, 3), corners if closed else corners[:3], ends)
    path = np.array([[0.4, 0.4, 0.0], [0.5, 0.5, 0.3]])
    return Picture(walls, (chain,), path, "title", true_path_world=path, true_floor=(corners,))


def labels(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_names_what_is_drawn():
    assert "closed chain, 4 walls" in labels(draw_map(picture(closed=True)))
    open_labels = labels(draw_map(picture(closed=False)))
    assert {"chain with open ends", "open end"} <= set(open_labels)


@pytest.mark.parametrize("size", [2.0, 80.0])
def test_the_picture_is_a_png_and_the_same_bytes_again(size):
    one, two = (png(draw_map(picture(closed=True, size=size))) for _ in range(2))
    assert one.startswith(b"\x89PNG")
    assert one == two


@pytest.mark.parametrize(("sigma_m", "words"), [(0.005, ", 10 times enlarged"), (0.1, "")])
def test_ellipses_of_corners_that_could_not_be_seen_are_enlarged_and_the_legend_says_so(sigma_m, words):
    plain = picture(closed=True)
    corners = plain.chains[0].corners_world
    assert not any("of a corner" in label for label in labels(draw_map(plain)))
    covs = np.tile(sigma_m**2 * np.eye(2), (len(corners), 1, 1))
    shown = labels(draw_map(replace(plain, corners_world=corners, corner_covs=covs)))
    assert f"3σ ellipse of a corner{words}" in shown


def test_open_ends_of_a_drive_that_others_chose_are_not_circled():
    assert "open end" in labels(draw_map(picture(closed=False)))
    assert "open end" not in labels(draw_map(replace(picture(closed=False), was_explored=False)))


def test_the_grid_lies_on_the_floor_and_below_the_paths():
    (axes,) = draw_map(picture(closed=True)).axes
    floor, paths = max(patch.zorder for patch in axes.patches[:2]), min(line.zorder for line in axes.lines)
    assert floor < axes.xaxis.zorder == axes.yaxis.zorder < paths


@pytest.mark.parametrize(("width", "height"), [(1.0, 20.0), (20.0, 1.0), (6.0, 6.0), (80.0, 60.0)])
def test_all_that_is_written_lies_on_the_page(width, height):
    """A tall narrow map under a long title, with every kind of thing in the legend."""
    plain = picture(closed=False)
    floor = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    marks = np.array([True, False, False, False])
    shown = replace(
        plain, title="lifull_02bed7e3b70b_0002   invariant-ekf, nearest-robot, seed 1",
        subtitle="words and words, " * 12, true_floor=(floor,),
        map=replace(plain.map, tentative=marks, crooked=marks[::-1]), corners_world=floor,
        corner_covs=np.tile(1e-6 * np.eye(2), (4, 1, 1)),
    )  # fmt: skip
    figure = draw_map(shown)
    assert {"tentative wall", "wall with lack of fit: unreliable"} <= set(labels(figure))
    renderer = figure.canvas.get_renderer()
    for artist in (*figure.axes[0].texts, figure.legends[0]):
        assert all(figure.bbox.fully_contains(*corner) for corner in artist.get_window_extent(renderer).corners()), (
            artist
        )


@pytest.mark.parametrize(("size", "length_m"), [(2.0, 1.0), (20.0, 5.0), (80.0, 20.0), (6000.0, 1000.0)])
def test_the_scale_bar_is_as_long_as_it_says(size, length_m):
    figure = draw_map(picture(closed=True, size=size))
    (axes,) = figure.axes
    figure.canvas.draw()
    boxes = [patch.get_window_extent() for patch in axes.patches if isinstance(patch, Rectangle)]
    inverse = axes.transData.inverted()
    (left, _), (right, _) = (
        inverse.transform((edge, 0.0)) for edge in (min(box.x0 for box in boxes), max(box.x1 for box in boxes))
    )
    assert right - left == pytest.approx(length_m)
    assert f"{length_m:g} m" in [text.get_text() for text in axes.texts]


def test_the_ellipses_of_corners_lie_on_the_sheet_but_for_those_of_which_nearly_nothing_is_known():
    plain = picture(closed=True)
    corners = plain.map.ends_world[:, 0][:4]
    covs = np.stack([0.3**2 * np.eye(2)] * 3 + [100.0**2 * np.eye(2)])
    (axes,) = draw_map(replace(plain, corners_world=corners, corner_covs=covs)).axes
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    assert np.all(corners[:3] - 0.89 >= low)
    assert np.all(corners[:3] + 0.89 <= high)
    assert np.all(high - low < 15.0)


@pytest.mark.parametrize(("size", "grid"), [(2.0, "grid 1 m"), (80.0, "grid 5 m"), (6000.0, "grid 500 m")])
def test_a_map_of_any_size_fits_a_page_with_a_grid_that_can_be_told_apart(size, grid):
    figure = draw_map(picture(closed=True, size=size))
    (axes,) = figure.axes
    figure.canvas.draw()
    assert max(figure.get_size_inches()) < 36.0
    assert grid in " ".join(text.get_text() for text in axes.texts)
    assert len(axes.xaxis.get_ticklocs()) < 50
