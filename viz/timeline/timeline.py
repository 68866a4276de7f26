"""A recording of one run or of several back ends side by side, on the timelines `step` and `sim_time`."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from chainslam.explore.step import Step
from chainslam.slam.geometry.lines import through

from .. import palette
from .blueprints import blueprint, comparison, one_run
from .colours import packed
from .lane import Lane
from .layers.campaign import Row, Summary
from .layers.model_plane import Plane
from .layers.truth import NeesOf, TruthLayer
from .layers.wheels import WheelsLayer
from .recording import RerunRecording
from .words import legend

BLOCK = 500
"""Steps that are collected before they are sent."""
LIVE_BLOCK = 10


class Timeline:
    """Receives steps and writes one recording. The truth comes as plain geometry."""

    def __init__(
        self,
        title: str,
        backends: Sequence[str],
        true_rings_world: Sequence[Float[np.ndarray, "_ 2"]] = (),
        nees_of: NeesOf | None = None,
        viewer_url: str | None = None,
    ) -> None:
        """Begin a recording in memory, or in the viewer at `viewer_url`.

        `nees_of` judges estimated poses with their covariances against the true poses.
        """
        self._out = RerunRecording(title, viewer_url)
        self._is_live = viewer_url is not None
        self._rings = tuple(true_rings_world)
        truth = TruthLayer(self._out, self._rings)
        self._lanes = {backend: Lane(self._out, backend, truth, nees_of) for backend in backends}
        self._wheels = WheelsLayer(self._out)
        self._summary: Summary | None = None
        self._fixtures(title)
        if self._is_live:
            self._out.layout(self._layout())

    def add(
        self,
        backend: str,
        step: Step,
        true_pose_world: Float[np.ndarray, "3"] | None = None,
        wheels_pose_world: Float[np.ndarray, "3"] | None = None,
    ) -> None:
        """Add one step of one back end, before it continues; `wheels_pose_world` is by odometry."""
        lane = self._lanes[backend]
        if wheels_pose_world is not None:
            self._wheels.add(step, wheels_pose_world)
        lane.add(step, true_pose_world)
        if len(lane) >= (LIVE_BLOCK if self._is_live else BLOCK):
            lane.flush()
            self._wheels.flush()

    def add_campaign(self, trials: Sequence[Row], steps: Sequence[Row]) -> None:
        """Add a campaign's summary from its tables (see `Summary`)."""
        self._summary = Summary(self._out, trials, steps)

    def close(self) -> bytes:
        """Send the rest, and return the bytes of the .rrd file; none if a viewer received everything."""
        for lane in self._lanes.values():
            lane.flush()
        self._wheels.flush()
        if not self._is_live:
            self._out.layout(self._layout())
        return self._out.finish()

    def discard(self) -> None:
        """Discard the recording; without this, Rerun would print a complaint."""
        if not self._is_live:
            self._out.finish()

    def _fixtures(self, title: str) -> None:
        """Log static data: frames, texts, classes of floor."""
        self._out.fixed("/world", rr.Transform3D(scale=[1.0, -1.0, 1.0]))
        classes: list[tuple[int, str, tuple[int, ...] | int]] = [
            (0, "not seen", (255, 255, 255, 0)),
            (1, "swept", packed(palette.SWEPT)),
        ]
        self._out.fixed("/world", rr.AnnotationContext(classes))
        self._out.fixed(
            "/legend",
            rr.TextDocument(legend(title, len(self._lanes) == 1, bool(self._rings)), media_type="text/markdown"),
        )

    def _layout(self) -> rrb.Blueprint:
        plane = self._plane()
        self._out.fixed("/model", rr.Transform3D(scale=[plane.alpha_units, -1.0, 1.0]))
        self._out.fixed("/model/axes", *plane.axes())
        seen = np.concatenate(self._rings or [np.zeros((0, 2)), *(lane.seen_world for lane in self._lanes.values())])
        backends = list(self._lanes)
        uses: list[rrb.Horizontal | rrb.Vertical] = []
        if len(backends) == 1:
            uses = [one_run(backends[0], seen, plane.bounds(), bool(self._rings))]
        elif backends:
            uses = [comparison(backends, seen, plane.bounds(), bool(self._rings))]
        return blueprint(*uses, *([] if self._summary is None else [self._summary.layout()]))

    def _plane(self) -> Plane:
        """Return the plane that contains the true lines, or those of the maps without ground truth."""
        spans = [lane.r_span for lane in self._lanes.values()]
        for ring in self._rings:
            r = through(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))[:, 1]
            spans.append((float(r.min()), float(r.max())))
        shape = 1.2 if len(self._lanes) == 1 else 2.2
        return (
            Plane(min(low for low, _ in spans), max(high for _, high in spans), shape)
            if spans
            else Plane(0.0, 1.0, shape)
        )
