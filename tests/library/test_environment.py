"""The environment of Gymnasium, and that its reward cannot be raised by an untrue covariance."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import shapely
from gymnasium.utils.env_checker import check_env

import chainslam.gym  # noqa: F401 (registers the environment)
from chainslam.experiments.library.environment import CELL_M, FREE, OCCUPIED, Exploration
from chainslam.experiments.scoring.maps.coverage import sample
from chainslam.experiments.scoring.maps.information import PITCH_M, WRONG_SHARE, Ruler
from chainslam.experiments.scoring.truth import truth_of
from chainslam.experiments.usage import UsageError
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import load
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.stochastic_map import StochasticMap

ROOT = Path(__file__).parents[2]
RANGE_M = RobotConfig().lidar.range_max_m
SIGMAS = np.array([0.002, 0.006])


def truth():
    world = load("paper-fig4")
    return truth_of(world, RobotConfig())


def map_of(truth, errors, cov, extents=None, share=0.5):
    """Return a map with a wall for each true face, wrong by `errors` (alpha rad, d m), which states `cov` of each."""
    faces, count = truth.faces, len(truth.faces)
    anchors = faces[:, 0] + share * (faces[:, 1] - faces[:, 0])
    along = np.vecdot(faces - anchors[:, None], directions(truth.lines[:, 0])[:, None])
    alpha = truth.lines[:, 0] + errors[:, 0]
    d = truth.lines[:, 1] - np.vecdot(normals(truth.lines[:, 0]), anchors) + errors[:, 1]
    means = np.stack([alpha, d], axis=-1)
    whole = np.eye(3 + 2 * count) * 1e-6
    whole[3:, 3:] = np.kron(np.eye(count), cov)
    mean = np.concatenate([np.zeros(3), means.ravel()])

    def query(ids):
        keep = np.concatenate([np.arange(3), (3 + 2 * ids[:, None] + np.arange(2)).ravel()])
        return Joint(mean[keep], whole[np.ix_(keep, keep)], anchors[ids])

    belief = Belief(np.zeros(3), np.eye(3) * 1e-6, np.arange(count), anchors, means, query)
    no = np.zeros(count, dtype=bool)
    extents = np.sort(along, axis=1) if extents is None else extents
    return StochasticMap(belief, extents, np.full(count, 5), no, no)


def ruler_of(truth):
    return Ruler(sample(truth, PITCH_M), RANGE_M)


def test_a_true_covariance_earns_most():
    true, rng = truth(), np.random.default_rng(3)
    ruler, earned = ruler_of(true), {}
    for factor in (0.1, 0.4, 1.0, 2.5, 10.0):
        draws = [rng.standard_normal((len(true.faces), 2)) * SIGMAS for _ in range(30)]
        maps = [map_of(true, errors, factor * np.diag(SIGMAS**2)) for errors in draws]
        earned[factor] = np.mean([ruler.measure(each).nat_m for each in maps])
    assert max(earned, key=earned.get) == 1.0
    assert earned[0.1] < earned[0.4] < earned[1.0] > earned[2.5] > earned[10.0]


def test_an_exact_map_earns_the_density_at_its_mean_along_the_whole_contour():
    true = truth()
    ruler, cov = ruler_of(true), np.diag([0.0, 0.01**2])
    found = ruler.measure(map_of(true, np.zeros((len(true.faces), 2)), cov))
    nats = np.log(RANGE_M * (1.0 - WRONG_SHARE) / (np.sqrt(2.0 * np.pi) * 0.01) + WRONG_SHARE)
    assert found.coverage == pytest.approx(1.0, abs=0.01)
    assert found.nat_m == pytest.approx(nats * ruler.samples.length_m.sum(), rel=0.01)


def test_a_sure_mistake_costs_no_more_than_what_is_never_sure():
    true = truth()
    wrong = np.tile([0.0, 0.2], (len(true.faces), 1))
    found = ruler_of(true).measure(map_of(true, wrong, np.diag([1e-12, 1e-12])))
    assert found.nat_m == pytest.approx(np.log(0.01) * sample(true).length_m.sum() * found.coverage, rel=0.02)


def test_a_wall_half_a_metre_away_is_another_one():
    true = truth()
    far = np.tile([0.0, 0.5], (len(true.faces), 1))
    assert ruler_of(true).measure(map_of(true, far, np.diag([1e-6, 1e-4]))).coverage < 0.1
    assert ruler_of(true).samples.length_m.max() <= 0.1


def test_the_variance_of_a_point_is_that_of_its_offset_by_differences():
    """With correlated direction and distance, and with what is stated beyond the back end's own covariance."""
    true, cov, more = truth(), np.array([[4e-6, 3e-6], [3e-6, 9e-6]]), np.diag([1e-6, 1e-4])
    walls, ruler = map_of(true, np.zeros((len(true.faces), 2)), cov, share=0.1), ruler_of(true)
    means, anchors = walls.belief.means, walls.belief.anchors

    def information(cov):
        total = 0.0
        for point, normal, length in zip(
            ruler.samples.points_world, ruler.samples.normals_world, ruler.samples.length_m, strict=True
        ):
            gaps = [shapely.LineString(face).distance(shapely.Point(point)) for face in true.faces]
            row = min(np.flatnonzero(normals(means[:, 0]) @ normal > 0.9), key=lambda k: gaps[k])
            ahead, behind = (normals(means[row, 0] + h) @ (point - anchors[row]) for h in (1e-6, -1e-6))
            by = np.array([(ahead - behind) / 2e-6, -1.0])
            density = np.exp(-0.0) / np.sqrt(2.0 * np.pi * (by @ cov @ by))
            total += length * np.log(RANGE_M * (0.99 * density + 0.01 / RANGE_M))
        return total

    assert ruler.measure(walls).nat_m == pytest.approx(information(cov), rel=2e-3)
    crooked = replace(walls, off_line_cov=np.tile(more, (len(walls), 1, 1)))
    assert ruler.measure(crooked).nat_m == pytest.approx(information(cov + more), rel=2e-3)


def test_what_is_tentative_or_beyond_its_extent_earns_nothing():
    true = truth()
    walls = map_of(true, np.zeros((len(true.faces), 2)), np.diag(SIGMAS**2))
    nothing = replace(walls, tentative=np.ones(len(walls), dtype=bool))
    assert ruler_of(true).measure(nothing).nat_m == 0.0
    half = map_of(true, np.zeros((len(true.faces), 2)), np.diag(SIGMAS**2), walls.extents * [[1.0, 0.0]])
    assert 0.45 < ruler_of(true).measure(half).coverage < 0.6


@pytest.fixture(scope="module")
def env():
    return Exploration("paper-fig4", max_steps=40)


@pytest.mark.filterwarnings("ignore:.*Box observation space")
def test_it_is_an_environment(env):
    check_env(env, skip_render_check=True)


def test_episodes_repeat_by_their_seed_and_their_rewards_add_up(env):
    episodes = []
    for _ in range(2):
        observation, info = env.reset(seed=7)
        rewards, rng, gained = [], np.random.default_rng(1), info["information_nat_m"]
        over = False
        while not over:
            observation, reward, terminated, over, info = env.step(rng.uniform([0.0, -0.5], [0.4, 0.5]))
            rewards.append(reward)
            assert not terminated
        assert len(rewards) == 40
        touched = 10.0 * info["contacts"]
        assert sum(rewards) == pytest.approx(info["information_nat_m"] - gained - 0.1 * 40 - touched)
        episodes.append((rewards, observation))
    assert episodes[0][0] == episodes[1][0]
    for name, value in episodes[0][1].items():
        np.testing.assert_array_equal(value, episodes[1][1][name])
    assert env.reset(seed=8)[0]["ranges"].tolist() != env.reset(seed=7)[0]["ranges"].tolist()


def test_the_floor_lies_ahead_to_the_right_of_the_picture_and_left_at_its_top(env):
    observation, _ = env.reset(seed=1)
    floor, ranges = observation["floor"], observation["ranges"]
    middle = len(floor) // 2
    bearings = np.linspace(-np.pi, np.pi, len(ranges), endpoint=False)
    hits = 0
    for bearing, reach in zip(bearings, ranges, strict=True):
        row, column = middle - 0.5 - reach * np.sin(bearing) / CELL_M, middle - 0.5 + reach * np.cos(bearing) / CELL_M
        if 2 < row < len(floor) - 3 and 2 < column < len(floor) - 3:
            row, column = round(row), round(column)
            assert np.any(floor[row - 1 : row + 2, column - 1 : column + 2] == OCCUPIED)
            hits += 1
    assert hits > 50
    assert np.all(floor[middle - 1 : middle + 1, middle - 1 : middle + 1] == FREE)


def test_the_nearest_ends_come_first_and_all_are_counted():
    told = []
    for ends in (2, 40):
        env = Exploration("paper-fig9", ends=ends)
        env.reset(seed=1)
        told.append([env.step(np.array([0.2, 1.0]))[0] for _ in range(5)][-1])
    few, many = told
    count = int(many["open_end_count"][0])
    assert few["open_end_count"] == many["open_end_count"]
    assert 2 < count < 40
    assert np.all(np.diff(np.hypot(*many["open_ends"][:count].T)) >= 0.0)
    assert not many["open_ends"][count:].any()
    np.testing.assert_array_equal(few["open_ends"], many["open_ends"][:2])


def test_the_start_is_known_and_a_positive_turn_is_to_the_left(env):
    observation, _ = env.reset(seed=1)
    np.testing.assert_allclose(observation["sigmas"], [1e-4, 1e-4, 1e-5], rtol=0.05)
    before = observation["pose"]
    after = env.step(np.array([0.0, 1.0]))[0]["pose"]
    assert after[2] - before[2] == pytest.approx(np.deg2rad(10.0), abs=0.02)


def test_a_robot_that_cannot_reverse_does_not():
    env = Exploration("paper-fig4", settings={"robot.can_reverse": False})
    env.reset(seed=1)
    assert env.step(np.array([-1.0, 0.0]))[4]["path_length_m"] == 0.0
    assert env.step(np.array([1.0, 0.0]))[4]["path_length_m"] > 0.1


def test_a_robot_whose_scans_are_mirrored_has_failed():
    env = Exploration("rooms", settings={"robot.faults.mirrored": True})
    env.reset(seed=1)
    for _ in range(30):
        _, _, terminated, _, info = env.step(np.array([0.3, 1.0]))
        if terminated:
            break
    assert terminated
    assert "swapped" in info["words"]


def test_a_robot_that_pushes_against_a_wall_pays():
    env = Exploration("paper-fig4", max_steps=100, touch_cost=1000.0)
    env.reset(seed=1)
    rewards = [env.step(np.array([1.0, 0.0]))[1] for _ in range(60)]
    assert min(rewards) < -900.0


def test_random_buildings_differ_from_episode_to_episode():
    env = Exploration(max_steps=2)
    env.reset(seed=1)
    first = env._ruler.samples.length_m.sum()
    env.reset()
    assert env._ruler.samples.length_m.sum() != first


def test_several_at_once_by_gymnasiums_own_vectors():
    with_two = gymnasium.make_vec("chainslam/Exploration-v0", num_envs=2, vectorization_mode="sync", world="paper-fig4")
    observations, _ = with_two.reset(seed=3)
    assert observations["ranges"].shape[0] == 2
    _, rewards, *_ = with_two.step(np.zeros((2, 2), dtype=np.float32))
    assert rewards.shape == (2,)
    with_two.close()


def test_without_gymnasium_the_way_to_it_is_told():
    words = "import sys; sys.modules['gymnasium'] = None; import chainslam.gym"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, cwd=ROOT)
    assert "pip install 'chainslam[gym]'" in done.stderr


def test_a_step_without_an_episode_and_bad_input_are_told():
    with pytest.raises(UsageError, match="no-such-world"):
        Exploration("no-such-world")
    with pytest.raises(UsageError, match="expected"):
        Exploration("paper-fig4", backend="no-such-back-end")
    with pytest.raises(UsageError, match="view"):
        Exploration("paper-fig4", view=0)
    with pytest.raises(UsageError, match="ends"):
        Exploration("paper-fig4", ends=0)
    short = Exploration("paper-fig4", max_steps=1)
    with pytest.raises(RuntimeError, match="reset"):
        short.step(np.zeros(2))
    short.reset(seed=1)
    for wrong in ([0.1], [np.nan, 0.0], [[0.0, 0.0]]):
        with pytest.raises(ValueError, match="two finite numbers"):
            short.step(np.array(wrong))
    assert short.step(np.zeros(2))[2:4] == (False, True)
    with pytest.raises(RuntimeError, match="has ended"):
        short.step(np.zeros(2))
