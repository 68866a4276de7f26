"""Words are drawn letter by letter: two dollar signs in a name are no mathematics."""

import warnings

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from chainslam.viz.figures.maps import png, saved
from chainslam.viz.text import literal

WORDS = (r"$\alpha{$", "5 $ and 6 $", r"\$ \\$ $", "$", "$$$", "会议室 $x$")


@pytest.mark.parametrize("words", WORDS)
def test_literal_words_are_never_mathematics(words):
    figure = Figure()
    text = figure.text(0.1, 0.5, literal(words))
    assert text._preprocess_math(text.get_text()) == (words, False)
    assert png(figure)


def test_a_letter_without_a_glyph_costs_no_picture_and_no_word():
    figure = Figure()
    figure.text(0.1, 0.5, "会议室")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert saved(figure, "png")
    assert mpl.rcParams["text.parse_math"]
