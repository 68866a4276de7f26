"""A run as an animated GIF, made by replaying its log in the same way, so that nothing is driven again."""

from pathlib import Path

import numpy as np
import shapely

from chainslam.explore.floor.accumulated_returns import returns
from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.step import Step
from chainslam.slam.geometry.poses import inverse, to_world
from chainslam.viz.figures.animation import Frame, animated, shown_steps

from ..artifacts.results import LOG
from ..replays.replay import read_options, read_run, replay
from ..scenario import load_world
from ..scoring.maps.coverage import alignment
from ..terminal.progress import progress
from ..usage import UsageError

EVERY_SCAN = 2
"""Every n-th scan is drawn into the seen floor."""


def gif_of(folder: Path) -> bytes:
    """Return the GIF of the run in a folder; raises UsageError without one."""
    log = folder / LOG
    if not log.is_file():
        raise UsageError(f"expected a run with a {LOG}, found none in {folder}: name the folder of one run")
    run, options = read_run(log), read_options(folder / "config.json")
    trial = run.trial
    world = load_world(trial.world, trial.start, trial.drawing)
    to_estimate = inverse(alignment(run.start_pose, run.true_poses_world[0]))
    rings = (world.free.exterior, *world.free.interiors)
    floor = [to_world(shapely.get_coordinates(ring)[:-1], to_estimate) for ring in rings]
    film = _Film(len(run.recording))
    with progress(f"{world.name}: GIF", float(len(run.recording))) as show:

        def watch(step: Step) -> None:
            show(step)
            film.add(step)

        replay(run, trial.backend, options, watch, world)
    noise = "errorless" if trial.errorless else f"seed {trial.seed}"
    if not film.frames:
        raise UsageError(f"expected a run of at least one step, found none in {folder}: name another")
    return animated(film.frames, floor, f"{world.name}   {trial.backend}, {trial.strategy}, {noise}")


class _Film:
    """Keeps what is drawn of the selected steps."""

    def __init__(self, count: int) -> None:
        self.frames: list[Frame] = []
        self._shown = set(shown_steps(count))
        self._poses: list[np.ndarray] = []
        self._floor: FreeSpace | None = None

    def add(self, step: Step) -> None:
        pose = step.pose_world.copy()
        self._poses.append(pose)
        floor = self._floor = self._floor or FreeSpace(FreeSpaceConfig(step.robot))
        is_shown = step.index in self._shown
        if is_shown or step.index % EVERY_SCAN == 0:
            floor.integrate(pose, step.scan)
        if not is_shown:
            return
        walls = step.map
        self.frames.append(
            Frame(
                step=step.index,
                time_s=step.time_s,
                path_length_m=step.path_length_m,
                path_world=np.array(self._poses),
                ids=tuple(walls.ids.tolist()),
                ends_world=walls.ends_world.copy(),
                chains=step.chains,
                hits_world=to_world(returns(step.scan, step.robot.scanner), pose),
                seen=floor.evidence < 0,
                seen_origin_world=floor.origin_world.copy(),
                cell_m=floor.config.cell_m,
                radius_m=step.robot.radius_m,
            )
        )
