"""The example node without ROS: a stand-in streams scans at 10 Hz and odometry at 50 Hz, by a clock of its own."""

import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import shapely

from chainslam.slam.geometry.poses import arc, compose, inverse
from chainslam.slam.robot import MotionCommand, RobotError
from chainslam.slam.robot.ros.robot import MessageRobot
from chainslam.slam.robot.streaming import SteppedRobot
from tests.slam.message_base import Message, MessageBase
from tests.slam.streaming_base import ROOM, TICK_S

sys.path.append(str(Path(__file__).parents[2] / "examples"))
EXAMPLE = Path(__file__).parents[2] / "examples" / "ros_node.py"


def started(**about):
    from ros_node import Explorer

    base, grids, frames = MessageBase(**about), [], []
    explorer = Explorer(base.twist, grids.append, lambda pose, time_s: frames.append((pose, time_s)))
    base.hear(explorer.robot)
    base.in_its_time(explorer.robot)
    return explorer, base, grids, frames


def test_the_node_is_short_and_asks_for_ros_only_when_it_is_run():
    lines = EXAMPLE.read_text().splitlines()
    assert len(lines) <= 60
    assert all("rclpy" not in line for line in lines[: lines.index('if __name__ == "__main__":')])


@pytest.mark.long
def test_the_node_explores_a_room_by_messages():
    explorer, base, grids, frames = started(timeout_s=0.3, obeys_late_s=0.05)
    start = base.base.pose.copy()
    run = explorer.run(max_steps=80)
    assert run.summary["status"] == "complete"
    assert len(run.map) == 6
    assert len(frames) == run.summary["steps"]
    found = compose(frames[-1][0], explorer.robot.pose_odom(base.base.now_s))
    np.testing.assert_allclose(found, compose(inverse(start), base.base.pose), atol=0.03)
    _agrees_with_the_room(grids[-1], start)


def _agrees_with_the_room(grid, start):
    room = shapely.Polygon(ROOM)
    rows, columns = np.nonzero(grid.cells == 0)
    x, y = (np.stack([columns, rows]) + 0.5) * grid.resolution_m + np.array(grid.origin)[:, None]
    c, s = np.cos(start[2]), np.sin(start[2])
    inside = shapely.contains_xy(room.buffer(0.1), start[0] + c * x - s * y, start[1] + s * x + c * y)
    assert inside.mean() > 0.995
    assert grid.resolution_m**2 * len(x) == pytest.approx(room.area, rel=0.1)
    assert (grid.cells == 100).any()
    assert (grid.cells == -1).any()


def test_a_cancelled_node_keeps_what_it_has_mapped_and_stands():
    explorer, base, grids, _ = started()
    watch = explorer.publish

    def cancels(step):
        watch(step)
        if len(grids) == 5:
            explorer.robot.cancel()

    explorer.publish = cancels
    run = explorer.run(max_steps=80)
    assert run.summary["reason"] == "interrupted by a cancel"
    assert run.summary["steps"] == 5
    assert len(run.map) >= 4
    origin = Message(position=Message(x=0.0, y=0.0), orientation=Message(w=0.0))
    empty = Message(header=Message(frame_id=""), info=Message(origin=origin), data=[])
    filled = grids[-1].written(empty)
    assert (filled.info.height, filled.info.width) == grids[-1].cells.shape
    np.testing.assert_array_equal(np.reshape(filled.data, (filled.info.height, -1)), grids[-1].cells)
    assert (filled.info.origin.position.x, filled.header.frame_id) == (grids[-1].origin[0], "map")
    base.go_on(10 * TICK_S)
    assert np.all(base.base.moves == 0.0)


def test_a_scanner_that_falls_silent_ends_the_run_as_failed_and_the_robot_stands():
    explorer, base, grids, _ = started()
    send = explorer.robot.on_scan
    explorer.robot.on_scan = lambda message: send(message) if len(grids) < 4 else None
    run = explorer.run(max_steps=80)
    assert run.summary["status"] == "failed"
    assert "expected a new scan, found none within 3 s" in run.summary["reason"]
    base.go_on(0.5)
    assert np.all(base.base.moves == 0.0)


def test_without_a_transform_the_node_does_not_start():
    from ros_node import Explorer

    explorer = Explorer(lambda twist: None, lambda grid: None, lambda *frame: None)
    base = MessageBase()
    base.robot = explorer.robot
    base.in_its_time(explorer.robot)
    with pytest.raises(RobotError, match="expected a transform from base_link to laser, found none in 5 s"):
        explorer.run()


@pytest.mark.long
def test_in_real_time_messages_come_from_another_thread():
    base, ends = MessageBase(timeout_s=0.4), threading.Event()
    robot = MessageRobot(base.twist)
    base.hear(robot)

    def stream():
        began = time.monotonic()
        while not ends.is_set():
            base.go_on(max(time.monotonic() - began - base.base.now_s, 0.0))
            time.sleep(0.005)

    thread = threading.Thread(target=stream)
    thread.start()
    try:
        stepped = SteppedRobot(robot)
        stepped.sense()
        for command in (MotionCommand(0.15, 0.0), MotionCommand(0.0, 0.17), MotionCommand(0.1, 0.1)):
            before = base.base.pose.copy()
            stepped.drive(command)
            motion = compose(inverse(before), base.base.pose)
            np.testing.assert_allclose(motion, arc(command.forward_m, command.turn_rad), atol=0.025)
    finally:
        ends.set()
        thread.join()
