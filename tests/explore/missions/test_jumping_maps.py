"""A robot whose map moves with it, as a map does that began in the blind and meets its first walls."""

from dataclasses import replace

import numpy as np

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.mapper import Mapper


class Jumping:
    """A back end that moves robot and walls as one at some of its predictions."""

    def __init__(self, inner, at, jump):
        self._inner, self._at, self._jump, self._steps = inner, np.array(at), np.array(jump), 0

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def predict(self, odometry):
        self._steps += 1
        self._inner.predict(odometry)

    @property
    def belief(self):
        belief = self._inner.belief
        moved = np.count_nonzero(self._at <= self._steps) * self._jump

        def query(ids):
            joint = belief.query(ids)
            return Joint(joint.mean + np.pad(moved, (0, len(joint.mean) - 2)), joint.cov, joint.anchors + moved)

        pose = belief.pose_world + np.append(moved, 0.0)
        return replace(belief, pose_world=pose, anchors=belief.anchors + moved, query=query)


def test_a_mission_does_not_end_because_its_map_has_jumped():
    """At step 302 it said complete, eight open ends left, each out of reach: it believed to stand in a wall."""
    scenario = build(TrialConfig("rooms", seed=1))
    jumping = Jumping(scenario.backend, [100, 200, 300], [0.6, 0.4])
    *_, last = limited(explore_mission(scenario.robot, Mapper(jumping), scenario.strategy), Limits(steps=310))
    assert last.ended == "stopped", last.decision.words
    assert len(last.set_aside) < 4
