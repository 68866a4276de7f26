"""A saved map is used again: where a robot believes itself to be in it, and how two sessions are joined."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from chainslam.experiments.library import earlier, sessions
from chainslam.experiments.library.earlier import SEARCH, Earlier, PlaceSought, driven_m, joined
from chainslam.experiments.library.sessions import LaterRobot
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.usage import UsageError
from chainslam.explore.outcome import Outcome
from chainslam.sim.logs.recorded_robot import Recording
from chainslam.sim.robot import TrueRecord
from chainslam.slam.association.place_search import Place, along
from chainslam.slam.geometry.poses import compose, inverse, to_world
from chainslam.slam.robot import MotionCommand, Odometry, Scan
from tests.slam.association.test_place_search import CROOKED
from tests.slam.map.maps import map_of

HERE = np.array([1.0, 2.0, 0.5])
ELSEWHERE = np.array([6.0, 0.0, 0.5])


def ahead(metres):
    return Odometry(np.array([metres, 0.0, 0.0]), np.zeros((3, 3)))


def step(index, way_m, moved_m=0.0, walls=None, is_lost=False):
    walls = map_of(CROOKED, np.zeros(3)) if walls is None else walls
    localisation = SimpleNamespace(is_lost=is_lost)
    return SimpleNamespace(
        index=index, path_length_m=way_m, odometry=ahead(moved_m), localisation=localisation, map=walls, outcome=None
    )


def sought_along(monkeypatch, places, every_m=0.25):
    """Seek a place once every so many metres, where the searches find these; return the seeker and its answers."""
    left, sought = list(places), PlaceSought(along(CROOKED, 0.05))
    monkeypatch.setattr(earlier, "place_anywhere", lambda *_: left.pop(0))
    answers = [sought.see(step(k, k * every_m, every_m if k else 0.0)) for k in range(len(places))]
    assert not left
    return sought, answers


def shown(k, at=HERE, score=0.9, rival=0.0, every_m=0.25):
    """What the k-th search finds if the robot was at a pose at first, and has gone straight ahead since."""
    pose = compose(at, np.array([k * every_m, 0.0, 0.0]))
    return Place(pose, score, rival, None if rival == 0.0 else ELSEWHERE)


def test_a_place_is_believed_once_searches_half_a_metre_apart_agree_on_it(monkeypatch):
    sought, answers = sought_along(monkeypatch, [shown(k) for k in range(3)])
    assert answers == [False, False, True]
    np.testing.assert_allclose(sought.found, shown(2).pose)
    assert (sought.scans, sought.places) == (3, [sought.found.tolist()])
    _, answers = sought_along(monkeypatch, [shown(k, every_m=0.5) for k in range(2)], every_m=0.5)
    assert answers == [False, True]


@pytest.mark.parametrize(
    "between", [None, shown(1, ELSEWHERE), shown(1, rival=0.85), shown(1, score=0.69)],
    ids=["nothing", "another place", "a rival", "a bad fit"],
)  # fmt: skip
def test_where_a_search_does_not_agree_the_place_is_sought_anew(between, monkeypatch):
    places = [shown(0), between, *(shown(k) for k in range(2, 5))]
    assert sought_along(monkeypatch, places)[1] == [False] * 4 + [True]


@pytest.mark.parametrize(("score", "rival", "found"), [(0.71, 0.0, True), (0.69, 0.0, False), (0.9, 0.82, False)])
def test_a_bad_fit_and_a_place_with_a_rival_are_never_believed(score, rival, found, monkeypatch):
    sought, answers = sought_along(
        monkeypatch, [shown(k, score=score, rival=rival) for k in range(6)][: 3 if found else 6]
    )
    assert any(answers) is found
    assert len(sought.places) == (1 if found else 2 if rival else 0)
    assert sought_along(monkeypatch, [shown(k, rival=0.8) for k in range(3)])[0].places == [shown(2).pose.tolist()]


def test_it_is_sought_once_a_quarter_of_a_metre_unless_the_robot_is_lost_or_has_no_firm_wall(monkeypatch):
    asked, sought = [], PlaceSought(along(CROOKED, 0.05))
    monkeypatch.setattr(earlier, "place_anywhere", lambda surface, points, config: asked.append(points))
    assert sought.places == []
    vague = map_of(CROOKED, np.zeros(3))
    vague = replace(vague, tentative=np.ones(len(CROOKED), dtype=bool))
    ways = [step(0, 0.0), step(1, 0.2), step(2, 0.25), step(3, 0.5, is_lost=True), step(4, 0.5, walls=vague)]
    counts = []
    for each in [*ways, step(5, 0.8)]:
        assert not sought.see(each)
        counts.append(len(asked))
    assert counts == [1, 1, 2, 2, 2, 3]


def test_the_robot_is_found_in_the_frame_of_the_saved_map_from_a_map_in_its_own():
    poses = [np.array([x, 1.0, 0.3]) for x in (1.0, 1.3, 1.6)]
    faces = to_world(CROOKED.reshape(-1, 2), inverse(poses[0])).reshape(-1, 2, 2)
    sought = PlaceSought(along(CROOKED, 0.05))
    for k, pose in enumerate(poses):
        own = compose(inverse(poses[0]), pose)
        motion = np.zeros(3) if k == 0 else compose(inverse(poses[k - 1]), pose)
        seen = step(k, 0.3 * k, walls=map_of(faces, own))
        seen.odometry = Odometry(motion, np.zeros((3, 3)))
        assert sought.see(seen) is (k == 2)
    np.testing.assert_allclose(sought.found, poses[-1], atol=0.02)


def saved(**changes):
    """A run whose map is used again."""
    run = {
        "recording": recording(3),
        "true_faces": CROOKED,
        "true_face_of_beam": np.array([[0, 1], [2, 3], [4, 5]]),
        "true_poses_world": np.arange(9.0).reshape(3, 3),
    }
    return Earlier(SimpleNamespace(**(run | changes)), np.zeros((0, 2)), np.array([3.0, 1.0, 2.0]))


def test_the_motion_between_two_sessions_leads_from_the_end_of_one_to_the_begin_of_the_other():
    way = np.array([[0.3, 0.1, 0.2], [1.0, 0.4, 0.9], [2.0, -1.0, 2.5]])
    carried = saved().carried_to(HERE, way)
    first = compose(saved().last_world, carried.motion)
    np.testing.assert_allclose(compose(first, compose(inverse(way[0]), way[-1])), HERE, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(carried.cov)), [SEARCH.cell_m, SEARCH.cell_m, SEARCH.step_rad])


def test_where_the_building_has_changed_no_beam_of_the_earlier_session_has_a_face():
    faces = saved().run.true_face_of_beam
    np.testing.assert_array_equal(saved().faces_in(SimpleNamespace(faces=CROOKED)), faces)
    for changed, run in ((CROOKED + 0.1, saved()), (CROOKED[1:], saved()), (CROOKED, saved(true_faces=None))):
        np.testing.assert_array_equal(run.faces_in(SimpleNamespace(faces=changed)), np.full_like(faces, -1))


def recording(scans, begin_s=0.0, step_m=0.1, **more):
    return Recording(
        time_s=begin_s + np.arange(float(scans)),
        bearings_rad=np.array([-1.0, 1.0]),
        ranges_m=np.full((scans, 2), 1.0) + begin_s,
        sigma_m=np.full(2, 0.01),
        range_max_m=4.0,
        odometry=np.tile([step_m, 0.0, 0.0], (scans, 1)),
        odometry_cov=np.zeros((scans, 3, 3)),
        **more,
    )


CARRIED = Odometry(np.array([3.0, 4.0, 1.0]), 0.01 * np.eye(3))


def test_two_sessions_are_one_recording_whose_clock_goes_on():
    for begin_s, times in ((0.0, [2.0, 3.0]), (-0.5, [2.0, 3.0]), (5.0, [7.0, 8.0])):
        both = joined(recording(3), recording(2, begin_s, step_m=0.2), CARRIED)
        np.testing.assert_array_equal(both.time_s, [0.0, 1.0, 2.0, *times])
        np.testing.assert_array_equal(both.odometry[:, 0], [0.1, 0.1, 0.1, 3.0, 0.2])
        np.testing.assert_array_equal(both.odometry_cov[3], CARRIED.cov)
        assert not both.odometry_cov[[0, 1, 2, 4]].any()
        np.testing.assert_array_equal(both.ranges_m[:, 0], [1.0] * 3 + [1.0 + begin_s] * 2)
        assert both.carried.tolist() == [False, False, False, True, False]
        assert both.touched is None
        assert both.scan_start_s is None
    twice = joined(both, joined(recording(1), recording(1), CARRIED), CARRIED)
    assert np.flatnonzero(twice.carried).tolist() == [3, 5, 6]


def test_begins_of_scans_and_bumps_are_those_of_both_sessions_or_unknown():
    said = {"touched": np.array([False, True]), "scan_start_s": np.array([-0.1, 0.9])}
    both = joined(recording(2, **said), recording(2, **said), CARRIED)
    np.testing.assert_allclose(both.scan_start_s, [-0.1, 0.9, 0.9, 1.9])
    assert both.touched.tolist() == [False, True, False, True]
    for one, other in ((said, {}), ({}, said)):
        both = joined(recording(2, **one), recording(2, **other), CARRIED)
        assert both.touched is None
        assert both.scan_start_s is None


def test_where_the_robot_was_carried_is_no_path():
    assert driven_m(recording(3)) == pytest.approx(0.3)
    assert driven_m(joined(recording(3), recording(2), CARRIED)) == pytest.approx(0.4)


@dataclass
class Live:
    """A robot that has driven on: at the n-th pose its scan is taken at n seconds."""

    record: TrueRecord

    def sense(self):
        at = len(self.record.poses_world)
        self.record.poses_world.append(np.full(3, float(at)))
        self.record.faces_of_beams.append(np.array([at, at]))
        return Scan(np.array([-1.0, 1.0]), np.full(2, 2.0), 0.01, 4.0, float(at), start_s=at - 0.1)

    def drive(self, command):
        return ahead(command.forward_m)


def test_a_later_robot_plays_both_sessions_and_then_drives_on_with_one_clock_and_one_truth():
    first = recording(3, touched=np.array([False, True, False]))
    then = recording(2, touched=np.array([False, True]))
    live = Live(TrueRecord([np.zeros(3), np.ones(3)], [np.array([0, 0]), np.array([1, 1])], 1, 1.0, 0.1))
    log = SimpleNamespace(
        time_s=then.time_s, true_world=np.array([[0.0] * 3, [1.0] * 3]), face_of_beam=[[0, 0], [1, 1]]
    )
    begun = SimpleNamespace(log=log, scenario=SimpleNamespace(robot=live))
    earlier_run = saved(recording=first).run
    robot = LaterRobot(joined(first, then, CARRIED), earlier_run, earlier_run.true_face_of_beam, begun)
    times, motions = [robot.sense().time_s], []
    for _ in range(5):
        motions.append(robot.drive(MotionCommand(0.7, 0.0)))
        scan = robot.sense()
        times.append(scan.time_s)
        assert len(robot.record.poses_world) == len(robot.record.faces_of_beams) == len(times)
    assert [each.motion[0] for each in motions] == [0.1, 0.1, 3.0, 0.1, 0.7]
    assert [each.carried for each in motions] == [False, False, True, False, False]
    assert times == [0.0, 1.0, 2.0, 2.0, 3.0, 4.0]
    assert scan.start_s == pytest.approx(3.9)
    record = robot.record
    np.testing.assert_array_equal(np.array(record.poses_world)[:, 0], [0.0, 3.0, 6.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(np.array(record.faces_of_beams)[:, 1], [1, 3, 5, 0, 1, 2])
    assert (record.collisions, record.drive_time_s) == (2, 3.0)
    assert record.path_length_m == pytest.approx(0.1 + 0.3)


def test_limits_count_the_later_session_alone():
    run = SimpleNamespace(recording=joined(recording(3), recording(2), CARRIED))
    config = TrialConfig("rooms", "full-ekf", "nearest-robot", max_steps=100, max_path_m=5.0, time_limit_s=60.0)
    beyond = sessions._beyond(run, config)
    assert (beyond.max_steps, beyond.time_limit_s) == (105, 63.0)
    assert beyond.max_path_m == pytest.approx(5.4)
    beyond = sessions._beyond(run, replace(config, max_path_m=None, time_limit_s=None))
    assert (beyond.max_path_m, beyond.time_limit_s) == (None, None)


@dataclass(frozen=True)
class Decided:
    outcome: Outcome | None = None
    words: str = ""


@dataclass(frozen=True)
class Taken:
    index: int
    decision: Decided = Decided()

    @property
    def outcome(self):
        return self.decision.outcome


def test_a_robot_that_seeks_its_place_stops_where_it_is_found_or_where_its_mission_ends(monkeypatch):
    steps = [Taken(0), Taken(1), Taken(2, Decided(Outcome.ALL_CLOSED))]
    monkeypatch.setattr(sessions, "default_mission", lambda _: iter(steps))
    for at, outcome in ((1, Outcome.INTERRUPTED), (2, Outcome.ALL_CLOSED)):
        sought = SimpleNamespace(see=lambda step, at=at: step.index == at)
        *before, last = sessions.seeking(sought)(None)
        assert before == steps[:at]
        assert (last.index, last.outcome) == (at, outcome)


def test_what_is_told_of_a_session_counts_its_steps_among_those_of_both(monkeypatch, tmp_path):
    sought, _ = sought_along(monkeypatch, [shown(0, rival=0.85)])
    told = earlier.told_of(tmp_path, sought, 10)
    assert (told["first_step"], told["placed_at_step"], len(told["places_world"])) == (0, None, 2)
    sought, _ = sought_along(monkeypatch, [shown(k) for k in range(3)])
    told = earlier.told_of(tmp_path, sought, 10)
    assert (told["map"], told["first_step"], told["placed_at_step"]) == (str(tmp_path), 10, 12)
    monkeypatch.setattr(earlier, "pose_nees", lambda log: np.array([99.0] * 10 + [3.0, 6.0]))

    def result(errorless=False, log=()):
        return SimpleNamespace(log=log, scenario=SimpleNamespace(config=SimpleNamespace(errorless=errorless)))

    assert earlier.scored(told, result())["pose_anees"] == pytest.approx(1.5)
    for said, of in ((told, result(errorless=True)), (told, result(log=None)), (told | {"first_step": 0}, result())):
        assert earlier.scored(said, of) == said


def test_a_saved_map_is_that_of_the_same_scanner_and_has_firm_walls(monkeypatch, tmp_path):
    config = TrialConfig("rooms", "full-ekf", "nearest-robot")
    walls = map_of(CROOKED, np.zeros(3))
    arrays = {
        "anchors": walls.belief.anchors, "lines": walls.belief.means, "extents": walls.extents,
        "tentative": np.arange(len(CROOKED)) > 0, "pose": HERE,
    }  # fmt: skip
    monkeypatch.setattr(earlier, "read_run", lambda _: SimpleNamespace(trial=config))
    monkeypatch.setattr(earlier, "read_map", lambda _: arrays)
    found = earlier.read_earlier(tmp_path, config)
    np.testing.assert_array_equal(found.last_world, HERE)
    assert np.abs(found.surface_world[:, 1]).max() < 1e-9, "the first wall alone, on the x axis"
    xs = np.sort([0.0, *found.surface_world[:, 0], 6.0])
    assert np.diff(xs).max() <= 0.5 * SEARCH.cell_m + 1e-9
    for name, value in (("beams", 90), ("fov_rad", 3.0), ("range_max_m", 3.5)):
        lidar = replace(config.robot.lidar, **{name: value})
        with pytest.raises(UsageError, match="the same scanner"):
            earlier.read_earlier(tmp_path, replace(config, robot=replace(config.robot, lidar=lidar)))
    arrays["tentative"] = np.ones(len(CROOKED), dtype=bool)
    with pytest.raises(UsageError, match="a map with walls"):
        earlier.read_earlier(tmp_path, config)
