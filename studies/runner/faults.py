"""Faults that no model states, put into a recording: the wheels' or the range finder's bias, or another range noise.

A fault changes what the robot reported, never where it went, so that all faults and all back ends share one drive.
"""

from dataclasses import dataclass, replace

import numpy as np

from chainslam.experiments.replays.replay import RecordedRun
from chainslam.experiments.scenario import load_world
from chainslam.sim.chance import Channel
from chainslam.sim.lidar import RangeFinder, noisy
from chainslam.sim.robot import chance_in

KINDS = ("none", "wheel-scale", "heading", "range", "range-noise")
"""Share by which the wheels report too much; degrees of heading that they gain in a metre; metres by which ranges are
too long; standard deviation of a range in metres, which the models are told."""


@dataclass(frozen=True, order=True)
class Fault:
    """One fault and its size, in the unit of its kind."""

    kind: str = "none"
    size: float = 0.0

    @property
    def title(self) -> str:
        """What it is, for tables."""
        unit = {"wheel-scale": f"{self.size:+.1%}", "heading": f"{self.size:+g} degrees/m", "none": ""}
        return f"{self.kind} {unit.get(self.kind, f'{1e3 * self.size:g} mm')}".strip()


def faulty(run: RecordedRun, fault: Fault) -> RecordedRun:
    """Return a recording with a fault; raises ValueError for a kind that is none of `KINDS`."""
    recording = run.recording
    if fault.kind == "none":
        return run
    if fault.kind == "wheel-scale":
        return replace(run, recording=replace(recording, odometry=(1.0 + fault.size) * recording.odometry))
    if fault.kind == "heading":
        motions = recording.odometry.copy()
        motions[:, 2] += np.deg2rad(fault.size) * np.hypot(motions[:, 0], motions[:, 1])
        return replace(run, recording=replace(recording, odometry=motions))
    if fault.kind == "range":
        ranges = recording.ranges_m + fault.size
        kept = np.where((ranges > 0.0) & (ranges <= recording.range_max_m), ranges, np.nan)
        return replace(run, recording=replace(recording, ranges_m=kept))
    if fault.kind == "range-noise":
        return _noisier(run, fault.size)
    raise ValueError(f"expected a fault out of {', '.join(KINDS)}, found {fault.kind!r}: choose one of these")


def _noisier(run: RecordedRun, sigma_m: float) -> RecordedRun:
    """Return the recording with its ranges measured again from the true poses, the same draws a different size."""
    trial, recording = run.trial, run.recording
    world, lidar = load_world(trial.world, trial.start, trial.drawing), trial.robot.lidar
    finder, chance = RangeFinder(world.faces, lidar), chance_in(world, trial.seed)
    ranges, faces = np.empty_like(recording.ranges_m), np.empty_like(run.true_face_of_beam)
    for k, pose in enumerate(run.true_poses_world):
        true, hit = finder.cast(pose)
        draws = chance.standard_normals(Channel.LASER, k, len(true))
        ranges[k] = noisy(true, sigma_m, draws, lidar.range_max_m)
        faces[k] = np.where(np.isfinite(ranges[k]), hit, -1)
    told = replace(recording, ranges_m=ranges, sigma_m=np.full_like(recording.sigma_m, sigma_m))
    return replace(run, recording=told, true_face_of_beam=faces)
