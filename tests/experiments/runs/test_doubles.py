"""A wall that stands in the map twice: sought over seeds within a bound, told either way, shown as in figure 10."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.experiments.reproductions import fig10
from chainslam.experiments.reproductions.runs import doubles
from chainslam.experiments.reproductions.runs.doubles import LASTING, Double, ModelSpace, first_double
from chainslam.experiments.reproductions.runs.drives import drive_by_walls
from chainslam.viz.shapes import ellipses

few = settings(max_examples=25, deadline=None, derandomize=True)


def space(off_sigmas, seed=0):
    """Two walls, the second so many standard deviations of the first away from it."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2, 2)) * np.array([0.01, 0.1])[:, None]
    cov = root @ root.T + 1e-8 * np.eye(2)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    first = np.array([rng.uniform(-3.0, 3.0), rng.uniform(-9.0, 9.0)])
    second = first + off_sigmas * np.linalg.cholesky(cov) @ [np.cos(turn), np.sin(turn)]
    lines = np.array([first, second])
    return ModelSpace(np.array([4, 9]), lines, np.array([cov, 4.0 * cov]), np.zeros((2, 2, 2)))


def double(off_sigmas, steps):
    return Double((4, 9), 0, 3, tuple(range(5, 5 + steps)), space(off_sigmas))


@few
@given(away=st.floats(0.1, 50.0), seed=st.integers(0, 10**6), x=st.floats(-30, 30), y=st.floats(-30, 30))
def test_how_far_a_second_entry_is_does_not_depend_on_the_origin(away, seed, x, y):
    here = space(away, seed)
    there = here.about(np.array([x, y]))
    assert here.sigmas_away((4, 9)) == pytest.approx(away, rel=1e-6)
    # r bends with alpha: to first order the lever arm changes nothing, and the walls differ by hundredths.
    off = here.lines_world[1, 0] - here.lines_world[0, 0]
    if abs(off) < 1e-3:
        assert there.sigmas_away((4, 9)) == pytest.approx(away, rel=0.05, abs=0.5)


@pytest.fixture
def drives(monkeypatch):
    """Drives without a robot: what each seed finds twice."""
    found = {}
    monkeypatch.setattr(doubles, "watched", lambda config: SimpleNamespace(doubles=found.get(config.seed, ())))
    first_double.cache_clear()
    yield found
    first_double.cache_clear()


def test_seeds_are_tried_until_a_wall_stands_twice_for_long_and_outside_the_ellipse(drives):
    drives[7] = (double(9.0, LASTING - 1),)
    drives[8] = (double(2.9, LASTING),)
    drives[9] = (double(9.0, 2), double(5.0, LASTING))
    search = first_double(drive_by_walls("paper-fig9", seed=7))
    assert (search.tried, search.config.seed) == (3, 9)
    assert search.double is drives[9][1]
    assert search.words.startswith("seed 9, number 3 of those tried, ")


def test_a_search_in_vain_ends_and_says_how_many_seeds_it_took(drives):
    search = first_double(drive_by_walls("paper-fig9", seed=7), 5)
    assert (search.tried, search.config.seed, search.double) == (5, 7, None)
    assert search.words.startswith("in none of 5 drives, seeds 7 and on, ")


@pytest.mark.long
def test_figure_10_shows_what_the_papers_shows(monkeypatch):
    monkeypatch.setattr(fig10, "COMPARED", ("block-ekf", "full-ekf"))
    made = fig10.reproduce(1)
    search = first_double(fig10.there_and_back(1))
    trace, model, place = made.figure.axes
    theirs = next(line for line in trace.lines if line.get_label() == "block-ekf")
    assert min(theirs.get_ydata()) < 1.0
    assert made.ours["block-ekf"][fig10.TRIED] == search.tried
    assert search.words in made.notes[0]
    first, second = search.double.space.rows(search.double.ids)
    seen = search.double.space.about(search.double.space.ends_world[first].mean(axis=0))
    (ellipse,) = ellipses(seen.lines_world[[first]], seen.covs[[first]], 1.0, 129)
    assert not shapely.contains_xy(shapely.Polygon(ellipse), *seen.lines_world[second])
    for panel in (model, place):
        assert {"A", "A*"} <= {text.get_text() for text in panel.texts}
    for row in (first, second):
        x, y = seen.lines_world[row]
        assert model.get_xlim()[0] < x < model.get_xlim()[1]
        assert model.get_ylim()[0] < y < model.get_ylim()[1]
