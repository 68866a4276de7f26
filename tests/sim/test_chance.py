"""Streams of chance: the same draws as a new generator's, whatever was drawn before; others in every other world."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from chainslam.experiments.replays.corridor import Loop, drive
from chainslam.experiments.scenario import TrialConfig, build
from chainslam.sim.chance import SEED_MAX, Chance, Channel, world_key
from chainslam.sim.robot import chance_in
from chainslam.sim.worlds import WORLDS, World, load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.robot import MotionCommand

words = st.integers(0, SEED_MAX)
streams = st.tuples(
    st.builds(Chance, words, words),
    st.sampled_from(Channel),
    st.integers(0, 2**40 - 1),
    st.integers(0, 9),
    st.sampled_from([Chance.standard_normals, Chance.uniforms]),
)
SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])


def afresh(chance, channel, step, count, draw):
    """Return the draws of a generator made for this stream alone."""
    counter = ((int(channel) << 40) | step) << 192
    generator = np.random.Generator(np.random.Philox(key=(chance.seed << 64) | chance.world_key, counter=counter))
    return generator.standard_normal(count) if draw is Chance.standard_normals else generator.random(count)


@given(drawn=st.lists(streams, min_size=1, max_size=6))
def test_each_stream_begins_anew_whatever_was_drawn_before(drawn):
    for chance, channel, step, count, draw in drawn:
        found = draw(chance, channel, step, count)
        np.testing.assert_array_equal(found, afresh(chance, channel, step, count, draw))


def test_threads_do_not_draw_from_each_others_streams():
    chance = Chance(1, 5)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda step: chance.standard_normals(Channel.LASER, step, 500), range(200)))
    for step, draws in enumerate(found):
        expected = afresh(chance, Channel.LASER, step, 500, Chance.standard_normals)
        np.testing.assert_array_equal(draws, expected)


@pytest.mark.parametrize(("seed", "step"), [(-1, 0), (SEED_MAX + 1, 0), (0, -1), (0, 2**40)])
def test_a_seed_or_step_out_of_range_is_refused(seed, step):
    with pytest.raises(ValueError, match="expected 0 <= seed"):
        Chance(seed, 0).uniforms(Channel.LASER, step, 1)


def key(corners=SQUARE, start=(1.0, 1.0, 0.0)):
    """Return the key of a room by its corners."""
    return world_key(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), np.array(start))


def test_the_key_of_a_world_is_its_content_and_neither_its_order_nor_its_rounding():
    assert key() == key(np.roll(SQUARE, 2, axis=0)) == key(SQUARE + 1e-10) == key(SQUARE * -1.0 * -1.0)
    others = [key(SQUARE * 1.00001), key(SQUARE[::-1]), key(start=(1.0, 1.0, 0.1)), key(start=(1.0, 1.001, 0.0))]
    assert len({key(), *others}) == 5


def test_the_key_of_a_world_is_the_same_on_every_machine():
    assert key() == 1590661644411381233


def test_no_two_bundled_worlds_share_a_key():
    keys = {chance_in(load(name), 1).world_key for name in (*WORLDS, "random:1", "random:2")}
    assert len(keys) == len(WORLDS) + 2


def test_one_plan_under_two_names_and_in_three_formats_gives_the_same_draws(tmp_path):
    """The SVG has y downwards, and its walls in another order."""
    walls = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0.3, 6.1], [0.3, 6.1, 0, 0], [4, 0, 4.2, 2.5], [4, 3.6, 4, 6]]
    plan = json.dumps({"walls": walls})
    lines = {"type": "MultiLineString", "coordinates": [[[a, b], [c, d]] for a, b, c, d in walls]}
    drawn = "".join(f'<line x1="{a}" y1="{-b}" x2="{c}" y2="{-d}"/>' for a, b, c, d in walls[::-1])
    style = 'fill="none" stroke="black" stroke-width="0.1"'
    files = {
        "one.json": plan,
        "two.json": plan,
        "one.geojson": json.dumps(lines),
        "one.svg": f'<svg xmlns="http://www.w3.org/2000/svg"><g {style}>{drawn}</g></svg>',
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    worlds = [load(tmp_path / name, start=(1.0, 1.0)) for name in files]
    assert len({world.name for world in worlds}) == 2
    assert len({chance_in(world, 3) for world in worlds}) == 1


def first_steps(world, seed=1, backend="full-ekf"):
    """Return the start's error, the first scan's ranges less the true ones, and the first slip, in a world."""
    scenario = build(TrialConfig("unused", backend, seed=seed), world)
    exact = build(TrialConfig("unused", backend, seed=seed, errorless=True), world)
    ranges = np.array([each.robot.sense().ranges_m for each in (scenario, exact)])
    noise = np.subtract(*np.where(np.isfinite(ranges), ranges, np.nan))
    for each in (scenario, exact):
        each.robot.drive(MotionCommand(0.1, 0.0))
    return scenario.start_estimate - world.start, noise, scenario.robot.true_pose - exact.robot.true_pose


def test_every_channel_differs_from_world_to_world_and_is_the_same_for_every_back_end():
    start = np.array([1.0, 1.0, 0.0])
    small, large = (World("room", shapely.Polygon(SQUARE * size), start, {}) for size in (1.0, 1.1))
    for here, there in zip(first_steps(small), first_steps(large), strict=True):
        both = np.isfinite(here) & np.isfinite(there)
        assert both.sum() >= 3
        assert np.all(here[both] != there[both])
    for backend in BACKENDS:
        renamed = replace(small, name="another")
        for here, there in zip(first_steps(small), first_steps(renamed, backend=backend), strict=True):
            np.testing.assert_array_equal(here, there)


def test_rings_of_two_lengths_share_no_draw_of_wheels_or_start():
    short, long = drive(Loop(30.0, after_m=1.0), 1), drive(Loop(40.0, after_m=1.0), 1)
    assert short.chance != long.chance
    assert not np.any(short.odometry[1:20] == long.odometry[1:20])


def test_start_errors_of_one_seed_scatter_over_worlds_as_they_do_over_seeds():
    """160 buildings on one seed are 160 draws: the mean square of the start's error in sigmas is that of chi-square."""
    rooms = [key(SQUARE * (1.0 + 0.01 * n)) for n in range(160)]
    draws = np.array([Chance(1, room).standard_normals(Channel.START, 0, 3) for room in rooms])
    nees = np.sum(draws**2, axis=1) / 3.0
    assert nees.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / 3 / 160))
    assert nees.std() == pytest.approx(np.sqrt(2 / 3), rel=0.3)
