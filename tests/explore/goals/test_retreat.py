"""Back along its own way: out of what it touched, and out of where its own floor locks it in."""

from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
import pytest
import shapely

from chainslam.explore.floor.floor_memory import FloorMemory
from chainslam.explore.floor.free_space import FloorTooLargeError, FreeSpace
from chainslam.explore.floor.touches import REACH_M, UNSURE_M, Touches
from chainslam.explore.following.behaviour import Behaviour
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.goals.decider import Decision
from chainslam.explore.goals.retreat import Retreat, RetreatConfig
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.poses import compose
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import MotionCommand, Odometry, RobotSpec, Scan

FACES = np.array(
    [[[0.0, 0.0], [9.0, 0.0]], [[9.0, 0.0], [9.0, 3.0]], [[9.0, 3.0], [0.0, 3.0]], [[0.0, 3.0], [0.0, 0.0]]]
)
STEP = np.array([0.15, 0.0, 0.0])


@dataclass
class Idle:
    """A decider that never knows where to go."""

    started_over: int = 0

    def decide(self, around, chains, graph):
        return Decision(None, "nothing is left", outcome=Outcome.NONE_REACHABLE)

    def interrupt(self, around):
        pass

    def start_over(self):
        self.started_over += 1


class Stubborn(FloorMemory):
    """Cannot make anything of its last scans."""

    def begin_anew(self, pose_world):
        pass


def scan_at(pose):
    finder = RangeFinder(FACES, LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0)


@pytest.fixture
def driven(scene_of):
    """Drive 4 m along a hall; what comes of it."""

    def make(memory=FloorMemory):
        scene, floor = replace(scene_of(0), faces=FACES), memory(FreeSpace())
        retreat = Retreat(Idle(), floor, RetreatConfig(), FollowingConfig())
        pose = np.array([1.0, 1.5, 0.0])
        for step in range(28):
            floor.see(pose, scan_at(pose))
            if step < 27:
                floor.move(Odometry(STEP, np.zeros((3, 3))))
                retreat.moved(MotionCommand(0.15, 0.0), Odometry(STEP, np.zeros((3, 3))))
                pose = compose(pose, STEP)
        around = Surroundings(scene.walls(pose), floor.free_space, scan_at(pose))
        return floor, retreat, around

    return make


def shut(grid, pose):
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    ring = [pose[:2] + r * np.stack([np.cos(angle), np.sin(angle)], axis=-1) for r in (0.1, 0.15, 0.2, 0.25)]
    cells = grid.cells(np.concatenate(ring))
    grid.evidence[tuple(cells.T)] = 6
    grid._mark(*np.array([cells.min(axis=0), cells.max(axis=0) + 1]).T.ravel().tolist())


def way_back(grid, pose):
    return Planner(grid, pose[:2], PathConfig()).to(np.array([[1.5, 1.5]]))


def test_a_robot_locked_in_where_it_drove_begins_its_floor_anew_and_backs_out(driven):
    floor, retreat, around = driven()
    shut(floor.free_space, around.pose_world)
    decisions = [retreat.decide(around, (), nx.DiGraph()) for _ in range(3)]
    assert [decision.command.forward_m for decision in decisions] == pytest.approx([-0.15] * 3)
    assert retreat._inner.started_over == 1
    assert way_back(floor.free_space, around.pose_world) is not None
    assert all("back along its way" in decision.words for decision in decisions)


def test_a_robot_that_cannot_get_back_has_failed_and_says_at_which_step(driven):
    floor, retreat, around = driven(Stubborn)
    shut(floor.free_space, around.pose_world)
    steps = 0
    while (decision := retreat.decide(around, (), nx.DiGraph())).command is not None:
        steps += 1
    assert 5 <= steps <= 8  # a metre back first
    assert decision.outcome is Outcome.FAILED
    assert decision.outcome.status == "failed"
    assert decision.words == f"locked in at step {steps}"


def test_a_robot_far_off_all_bounds_is_told_in_one_line():
    grid, scan = FreeSpace(), Scan(np.linspace(-3.1, 3.1, 180), np.full(180, 1.0), 0.01, 4.0, 0.0)
    grid.integrate(np.zeros(3), scan)
    shape = grid.shape
    for x in (1e4, 2.5e6, 1e300, np.nan):
        with pytest.raises(FloorTooLargeError, match=r"within 500 m by 500 m.*its estimate is lost"):
            grid.integrate(np.array([x, x, 0.0]), scan)
    assert grid.shape == shape
    grid.integrate(np.array([100.0, 100.0, 0.0]), scan)


def test_the_body_met_something_in_front_and_perhaps_what_is_nearest_on_the_side_to_which_it_moved():
    touches, near = Touches(RobotSpec()), np.array([[0.15, 0.14], [-0.19, 0.0], [0.5, 0.0]])
    touches.move(Odometry(np.zeros(3), np.eye(3), touched=True), MotionCommand(0.1, 0.0))
    assert touches.is_new
    aside = 0.2 * near[0] / np.hypot(*near[0])
    np.testing.assert_allclose(touches.meet(near), [[0.2 - UNSURE_M, 0.0], aside])
    assert not touches.is_new
    touches.move(Odometry(np.array([-0.1, 0.0, 0.0]), np.eye(3), touched=True), MotionCommand(-0.1, 0.0))
    np.testing.assert_allclose(touches.meet(near[:1]), [[UNSURE_M - 0.2, 0.0]])
    np.testing.assert_allclose(touches.meet(np.array([[-0.2 - 1.1 * REACH_M, 0.0]])), [[UNSURE_M - 0.2, 0.0]])
    np.testing.assert_allclose(touches.points_robot[:2], [[0.3 - UNSURE_M, 0.0], aside + np.array([0.1, 0.0])])
    assert len(touches.points_robot) == 4


def test_a_long_body_meets_what_stands_before_its_own_front_and_back():
    touches = Touches(RobotSpec(outline_m=((0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.5, -0.2))))
    touches.move(Odometry(np.zeros(3), np.eye(3), touched=True), MotionCommand(0.1, 0.0))
    beside = np.array([[0.3, 0.22]])
    np.testing.assert_allclose(touches.meet(beside)[0], [0.5 - UNSURE_M, 0.0])
    touches.move(Odometry(np.zeros(3), np.eye(3), touched=True), MotionCommand(-0.1, 0.0))
    np.testing.assert_allclose(touches.meet(beside), [[UNSURE_M - 0.3, 0.0]])


class Glass(SimulatedRobot):
    """Its beams go through some walls that its body does not."""

    def __init__(self, world, glass, seed):
        super().__init__(world, seed)
        self._faces = np.concatenate([self._faces, glass])


@pytest.mark.usefixtures("_unchecked")
@pytest.mark.parametrize("seed", range(3))
def test_after_a_touch_the_robot_moves_away_and_does_not_try_the_same_place_again(seed):
    """In the passage between two rooms stands a post that no beam sees: it is met before it is known."""
    rng = np.random.default_rng(seed)
    gap_m, y = rng.uniform(0.5, 0.9), rng.uniform(0.8, 1.3)
    walls = shapely.union(shapely.box(2.0, 0.0, 2.0 + rng.uniform(0.1, 0.8), y), shapely.box(2.0, y + gap_m, 2.4, 3.0))
    room = shapely.orient_polygons(shapely.box(0, 0, 4.5, 3).difference(walls))
    at = np.array([2.2, y + gap_m * rng.uniform(0.3, 0.7)])
    glass = np.array([[at, at + np.array([0.0, 0.05])]])
    world = World("drawn", room, np.array([0.8, 1.5, rng.uniform(-3, 3)]), {})
    backend = BACKENDS["full-ekf"].make(world.start.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    robot = Glass(world, glass, seed)
    touched, tried, poses, behaviour = [], [], [], None
    for step in limited(explore_mission(robot, Mapper(backend), STRATEGIES["nearest-robot"].make()), Limits(steps=160)):
        poses.append(robot.true_pose[:2])
        if step.odometry.touched:
            touched.append(step.index)
            tried += [] if behaviour is Behaviour.RETREAT else [step.index]  # a wheel may slip on the way back
        behaviour = step.decision.behaviour
    poses = np.array(poses)
    assert touched, "the post was never met"
    assert step.ended is not None
    for k in touched:
        later = poses[k : k + 9]
        away = np.hypot(*(at - later).T) - np.hypot(*(at - poses[k]))
        assert len(later) < 9 or away.max() > 0.05
        assert away.min() > -0.02
    places = poses[tried]
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + np.eye(len(places))
    assert apart.min() > 0.05, f"{len(touched)} touches"
