"""A real robot's log in a building that is mapped already: its own map is placed in the saved one, and both are one.

The log is first refined by itself. If its map has one place in the saved one, the scans of both are mapped together,
with a carried motion to that place between them, as two sessions of a simulated robot are.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.sim.logs.keyframes import RecordedLog
from chainslam.sim.logs.recorded_robot import RecordingError, read_log, recording_of
from chainslam.slam.association.second_looks.agreement import Walls
from chainslam.slam.association.second_looks.placement import FINE, Placement, placements
from chainslam.slam.association.second_looks.refuted import Rays
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.robot import Odometry

from ..artifacts.maps.map_files import read_map
from ..artifacts.results import LOG
from ..replays.real_log import RealRun, looked_over, mapped_real
from ..replays.sources import RealLog
from ..replays.unwitnessed import every_scan
from ..scenario import OFFLINE
from ..usage import UsageError
from .earlier import joined


def placed_real(source: RealLog, folder: Path) -> tuple[RealLog, dict[str, Any]]:
    """Return the log of both sessions as one, and what `summary.json` says of it.

    The log alone where its map has no place in the saved one, or several. Raises UsageError where there is no such map.
    """
    run = source.run
    arrays, saved, start = _saved(folder, run)
    walls = Walls(arrays["anchors"], arrays["lines"], arrays["extents"], arrays["cov"][3:, 3:])
    found = _found(walls, run)
    run = replace(run, trial=replace(run.trial, map=str(folder)))
    told = _told(folder, found, 0)
    if len(found) != 1:
        return RealLog(run), told
    place = found[0]
    carried = Odometry(compose(inverse(arrays["pose"]), place.place), FINE.cov + place.cov + arrays["cov"][:3, :3])
    both = replace(run, log=_both(saved, run.log, carried), start_world=start)
    return RealLog(both), _told(folder, found, len(saved.recording))


def _saved(folder: Path, run: RealRun) -> tuple[dict[str, np.ndarray], RecordedLog, np.ndarray]:
    """Return the arrays of a saved map, its log and its first pose; raises UsageError for another scanner's."""
    arrays = read_map(folder)
    try:
        logged = read_log(folder / LOG)
        recording = recording_of(logged)
    except RecordingError as error:
        raise UsageError(str(error)) from error
    ours = run.log.recording
    same = recording.bearings_rad.shape == ours.bearings_rad.shape and (recording.fans is None) == (ours.fans is None)
    if not same or not np.allclose(recording.bearings_rad, ours.bearings_rad, atol=1e-3):
        raise UsageError(
            f"expected a map made with the same scanner, found one of {len(recording.bearings_rad)} beams in {folder},"
            f" and {len(ours.bearings_rad)} in {run.name}: name another map"
        )
    firm = np.flatnonzero(~arrays["tentative"])
    if not len(firm):
        raise UsageError(f"expected a map with walls, found none in {folder}: name another run")
    rows = np.append(np.arange(3), (3 + 2 * firm[:, None] + np.arange(2)).ravel())
    kept = {name: arrays[name][firm] for name in ("anchors", "lines", "extents")}
    kept |= {"pose": arrays["pose"], "cov": arrays["cov"][np.ix_(rows, rows)]}
    return kept, every_scan(recording), logged.get("start_pose", np.zeros(3))


def _found(saved: Walls, run: RealRun) -> list[Placement]:
    """Return where the refined map of a log may lie in a saved one."""
    alone = looked_over(run, mapped_real(run, OFFLINE))
    refined = alone.smoothed
    if refined is None:
        return []
    belief = refined.map.belief
    own = Walls(belief.anchors, belief.means, refined.map.extents, refined.joint.cov[3:, 3:])
    recording = run.log.recording
    rays = Rays([recording.scan(k) for k in range(len(recording))], run.trial.robot.scanner)
    return placements(saved, own, refined.poses_world, rays)


def _both(saved: RecordedLog, log: RecordedLog, carried: Odometry) -> RecordedLog:
    """Return two logs as one, on the clock of the later one; the earlier one ends before it begins."""
    before, since = saved.recording, log.motion_since
    none = np.zeros(len(before))
    return replace(
        log,
        recording=joined(before, log.recording, carried),
        scan_time_s=np.concatenate([before.time_s - before.time_s[-1] + log.scan_time_s[0], log.scan_time_s]),
        keyframe_of_scan=np.concatenate([np.arange(len(before)), len(before) + log.keyframe_of_scan]),
        motion_since=np.concatenate([np.zeros((len(before), 3)), since]),
        share_since=np.concatenate([none, log.share_since]),
    )


def _told(folder: Path, found: list[Placement], first: int) -> dict[str, Any]:
    """Return what `summary.json` says of a later session: where its first scan was taken, in the saved map."""
    return {
        "map": str(folder),
        "first_step": first,
        "placed_at_step": first if first else None,
        "places_world": [each.place.tolist() for each in found],
        "place_covs": [each.cov.tolist() for each in found],
        "place_walls": [each.pairs for each in found],
    }
