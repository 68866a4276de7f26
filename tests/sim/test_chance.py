"""Streams of chance: the same draws as a new generator's, whatever was drawn before and by whom."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.chance import SEED_MAX, Channel, standard_normals, uniforms

streams = st.tuples(
    st.integers(0, SEED_MAX),
    st.sampled_from(Channel),
    st.integers(0, 2**40 - 1),
    st.integers(0, 9),
    st.sampled_from([standard_normals, uniforms]),
)


def afresh(seed, channel, step, count, draw):
    """Return the draws of a generator made for this stream alone."""
    generator = np.random.Generator(np.random.Philox(key=(seed << 64) | (int(channel) << 40) | step))
    return generator.standard_normal(count) if draw is standard_normals else generator.random(count)


@given(drawn=st.lists(streams, min_size=1, max_size=6))
def test_each_stream_begins_anew_whatever_was_drawn_before(drawn):
    for seed, channel, step, count, draw in drawn:
        found = draw(seed, channel, step, count)
        np.testing.assert_array_equal(found, afresh(seed, channel, step, count, draw))


def test_threads_do_not_draw_from_each_others_streams():
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda step: standard_normals(1, Channel.LASER, step, 500), range(200)))
    for step, draws in enumerate(found):
        np.testing.assert_array_equal(draws, afresh(1, Channel.LASER, step, 500, standard_normals))


@pytest.mark.parametrize(("seed", "step"), [(-1, 0), (SEED_MAX + 1, 0), (0, -1), (0, 2**40)])
def test_a_seed_or_step_out_of_range_is_refused(seed, step):
    with pytest.raises(ValueError, match="expected 0 <= seed"):
        uniforms(seed, Channel.LASER, step, 1)
