"""Digests of drives, a line of JSON each: what two versions of the code are compared by (`alike`).

It imports only what it drives, since it is run by older versions of the code, too.
"""

import hashlib
import json
import sys
from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.trial import default_mission
from chainslam.explore.step import Step
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig
from chainslam.slam.backends import BACKENDS

RANDOM = 12
"""Random buildings."""

FRONT = LidarConfig(beams=541, fov_rad=float(np.deg2rad(270.0)), range_max_m=10.0)
"""A scanner that does not see behind it."""


def trials(scans: int, plans: Sequence[str]) -> list[TrialConfig]:
    """Return what is driven: worlds of all kinds and plans, all back ends and strategies, errorless and by scans.

    A drive has so many scans at most, those of one back end or strategy beside others half as many.
    """
    worlds = ("paper-fig4", "paper-fig5", "paper-fig8", "paper-fig9", "rooms", "hall")
    made = [f"random:{k + 1}" for k in range(RANDOM)]
    short: dict[str, Any] = {"max_steps": (scans + 1) // 2}
    return [
        *(TrialConfig(world, "invariant-ekf", max_steps=scans) for world in (*worlds, *made, *plans)),
        *(TrialConfig("paper-fig9", name, **short) for name in BACKENDS),
        *(TrialConfig("rooms", "full-ekf", name, **short) for name in STRATEGIES),
        *(TrialConfig(world, "full-ekf", errorless=True, **short) for world in ("paper-fig8", "rooms")),
        TrialConfig("hall", "full-ekf", p0="large", **short),
        TrialConfig("rooms", "full-ekf", odometry="scans", **short),
        TrialConfig("paper-fig9", "full-ekf", robot=RobotConfig(lidar=FRONT), **short),
    ]


def digest_of(trial: TrialConfig) -> dict[str, Any]:
    """Return what was driven, after how many scans it ended, and a digest of all scans, beliefs, maps and commands."""
    digest, scans = hashlib.sha256(), 0
    for step in islice(default_mission(build(trial)), trial.max_steps):
        digest.update(content(step))
        scans += 1
    named = {"world": trial.world, "backend": trial.backend, "strategy": trial.strategy, "odometry": trial.odometry}
    return named | {"errorless": trial.errorless, "scans": scans, "digest": digest.hexdigest()[:16]}


def content(step: Step) -> bytes:
    """Return what a step sensed, believed, mapped and decided."""
    belief, matches = step.map.belief, step.matches.pairs
    told = (step.scan.ranges_m, belief.pose_world, belief.pose_cov, belief.ids, belief.means, step.map.extents, matches)
    chains = [(chain.walls, chain.corners_world.tolist(), chain.is_closed) for chain in step.chains]
    arrays = b"".join(np.ascontiguousarray(each).tobytes() for each in (*told, step.walls_of_segments))
    return arrays + repr((chains, step.decision.command, step.decision.words)).encode()


if __name__ == "__main__":
    for each in trials(int(sys.argv[1]), sys.argv[2:]):
        print(json.dumps(digest_of(each)), flush=True)
