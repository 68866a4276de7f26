"""A streaming robot explores; one that stops obeying ends the run in words, and its map is kept."""

import sys
from pathlib import Path

import chainslam

sys.path.append(str(Path(__file__).parents[2] / "examples"))


def test_a_robot_that_no_longer_moves_fails_with_its_map_kept():
    from streaming_robot import StreamingDisc

    class Stalls(StreamingDisc):
        sent = 0

        def send(self, twist):
            self.sent += 1
            super().send(twist if self.sent <= 60 else chainslam.Twist(0.0, 0.0))

    spec = chainslam.RobotSpec(radius_m=0.2)
    run = chainslam.explore(chainslam.SteppedRobot(Stalls()), robot=spec, max_steps=20)
    assert run.summary["status"] == "failed"
    assert "expected a robot that moves, found one that stood still at 3 commands in turn" in run.summary["reason"]
    assert 3 < run.summary["steps"] < 20
    assert len(run.map) >= 4
