"""Recordings of runs with the truth; problems of a recording never affect the run."""

import gc
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from jaxtyping import Float

from chainslam.explore.step import Step
from chainslam.sim.worlds import World
from chainslam.viz.viewer import Viewer, ViewerError

from ..artifacts.files import probe, write_anywhere
from ..replays.replay import RecordedRun, ReplayOptions, replay
from ..scenario import load_world
from ..scoring.summary import nees_of_poses
from ..usage import need

if TYPE_CHECKING:
    from chainslam.viz.timeline import Timeline

PoseOf = Callable[[Step], Float[np.ndarray, "3"]]
Watch = Callable[[Step], None]


class TimelineOutput:
    """A timeline of one or several back ends on its way to a file or a viewer; problems are reported at the end."""

    def __init__(
        self,
        title: str,
        backends: Sequence[str],
        world: World | None,
        errorless: bool,
        rrd: Path | None,
        view: bool = False,
    ) -> None:
        """Start it; without a file or a viewer it does nothing and costs nothing."""
        self._rrd = rrd
        self._problem = ""
        self._timeline: Timeline | None = None
        if rrd is not None or view:
            need("rerun")
            self._try(lambda: self._begin(title, backends, world, errorless, view))

    def watch(
        self,
        backend: str,
        true_pose_of: PoseOf | None,
        also: Watch = lambda step: None,
        wheels_pose_of: PoseOf | None = None,
    ) -> Watch:
        """Return a function that records each step of one back end and passes it on."""

        def add(step: Step) -> None:
            if (timeline := self._timeline) is not None:
                self._try(lambda: timeline.add(backend, step, _told(true_pose_of, step), _told(wheels_pose_of, step)))

        def watch(step: Step) -> None:
            # Recorded first: the other observer may stop the run here, and this step belongs to it.
            add(step)
            also(step)

        return watch

    @property
    def is_on(self) -> bool:
        """Whether anything is recorded."""
        return self._timeline is not None

    def add_campaign(self, trials: Sequence[Mapping[str, Any]], steps: Sequence[Mapping[str, Any]]) -> None:
        """Add the summary of a campaign from its tables, one mapping for each row."""
        if (timeline := self._timeline) is not None:
            self._try(lambda: timeline.add_campaign(trials, steps))

    def close(self) -> list[str]:
        """Write the recording, and return the problems, in words."""
        self._try(self._finish)
        return [self._problem] if self._problem else []

    def _begin(self, title: str, backends: Sequence[str], world: World | None, errorless: bool, view: bool) -> None:
        if self._rrd is not None:
            # Tried before the run, so that nobody waits for a recording that cannot be written.
            probe(self._rrd)
        viewer_url = Viewer().url if view else None
        # Rerun's own messages about a closed viewer would mix with ours; it also raises whatever matters.
        os.environ.setdefault("RUST_LOG", "off")
        from chainslam.viz.timeline import Timeline  # imports rerun, only if a recording is wanted

        # Its modules stay to the end: scanned at every garbage collection, they would cost as much time as the drawing.
        gc.freeze()
        nees_of = None if errorless else nees_of_poses
        self._timeline = Timeline(title, backends, () if world is None else true_rings(world), nees_of, viewer_url)

    def _finish(self) -> None:
        if self._timeline is None:
            return
        try:
            content = self._timeline.close()
        except RuntimeError as error:
            if self._rrd is not None:
                raise
            raise ViewerError(
                "expected the viewer to stay open until the end, found it closed: `chainslam view DIR` shows the run"
            ) from error
        if self._rrd is not None:
            write_anywhere(self._rrd, content)

    def drop(self) -> None:
        """Discard the recording."""
        timeline, self._timeline = self._timeline, None
        if timeline is not None:
            timeline.discard()

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except Exception as error:  # problems of a recording must cost neither the run nor its other results
            self.drop()
            what = "the viewer" if self._rrd is None else str(self._rrd)
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            self._problem = f"{what}: {' '.join(why.split()) or type(error).__name__}"


def _told(pose_of: PoseOf | None, step: Step) -> Float[np.ndarray, "3"] | None:
    return None if pose_of is None else np.asarray(pose_of(step))


def true_rings(world: World) -> tuple[Float[np.ndarray, "_ 2"], ...]:
    """Return the rings of the true floor, the exterior first."""
    return tuple(shapely.get_coordinates(ring)[:-1] for ring in (world.free.exterior, *world.free.interiors))


def record_comparison(
    rrd: Path,
    title: str,
    trials: Sequence[Mapping[str, Any]],
    steps: Sequence[Mapping[str, Any]],
    run: RecordedRun | None,
    backends: Sequence[str],
    options: ReplayOptions,
) -> list[str]:
    """Record a campaign: one of its logs, if any, through all back ends side by side, and the summary of all trials.

    `trials` and `steps` are the campaign's tables, a mapping a row. Returns, in words, what could not be written.
    """
    if run is None:
        recording = TimelineOutput(title, (), None, False, rrd)
    else:
        trial = run.trial
        world = load_world(trial.world, trial.start, trial.drawing)
        recording = TimelineOutput(title, backends, world, trial.errorless, rrd)
        for backend in backends:
            if recording.is_on:
                replay(run, backend, options, recording.watch(backend, lambda step: run.true_poses_world[step.index]))
    recording.add_campaign(trials, steps)
    return recording.close()
