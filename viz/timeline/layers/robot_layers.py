"""The robot under `/world/BACKEND`: its path, its uncertainty, and its scans."""

import numpy as np
import rerun as rr
from jaxtyping import Float

from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import to_world

from ... import palette
from ...shapes import ellipses, spread
from ..block import REFUSED, Block
from ..colours import packed
from ..recording import RerunRecording, Timestamps
from .map_layers import style, words_only

POSE_TIMES = 10.0
"""Magnification of the robot's ellipse."""
LABEL_M = 0.5
"""Smallest distance between labels of one step, m."""


class RobotLayer:
    """The estimated path, the body, and the ellipse of three standard deviations."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._entity = out, f"/world/{backend}"
        self._colour = palette.of_backend(backend)
        self._before: Float[np.ndarray, "1 3"] | None = None
        self._radius_m = 0.0
        out.fixed(f"{self._entity}/path", style(1.2, 20.0, colors=packed(self._colour)))
        out.fixed(f"{self._entity}/ellipse", style(1.0, 44.0, colors=packed(palette.ALARM)))

    def send(self, block: Block) -> None:
        """Send the pose, its ellipse, and the newest piece of the path."""
        poses, moments, radius_m = block.poses, block.moments, block.rows[0].robot.radius_m
        if radius_m != self._radius_m:
            self._out.fixed(f"{self._entity}/robot/body", body(self._colour, radius_m))
            self._radius_m = radius_m
        covs = np.array([row.pose_cov[:2, :2] for row in block.rows])
        once = np.ones(len(block), dtype=np.int64)
        self._out.poses(f"{self._entity}/robot", moments, poses)
        self._out.strips(f"{self._entity}/ellipse", moments, once, ellipses(poses[:, :2], covs, POSE_TIMES))
        self._before = send_path(self._out, f"{self._entity}/path", moments, poses, self._before)


def body(colour: str, radius_m: float, radius: float = 1.6, order: float = 46.0) -> rr.LineStrips2D:
    """Return the robot's outline and nose in its own frame; `radius` is half its lines' width in screen points."""
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    outline = radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return rr.LineStrips2D(
        [outline, [[0.0, 0.0], [1.6 * radius_m, 0.0]]], radii=rr.Radius.ui_points(radius), colors=packed(colour),
        draw_order=order,
    )  # fmt: skip


def send_path(
    out: RerunRecording,
    entity: str,
    moments: Timestamps,
    poses: Float[np.ndarray, "s 3"],
    before: Float[np.ndarray, "1 3"] | None,
) -> Float[np.ndarray, "1 3"]:
    """Send for each moment only the newest piece of a path; the view shows all pieces so far."""
    places = np.concatenate([poses[:1] if before is None else before, poses])[:, :2]
    out.strips(entity, moments, np.ones(len(poses), dtype=np.int64), np.stack([places[:-1], places[1:]], axis=1))
    return poses[-1:]


class ScanLayer:
    """The content of one scan, in the robot's frame: points, segments, and how each was matched.

    The reason for a refused segment is written beside it, in the world's frame, so that texts do not overlap.
    """

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._entity, self._why = out, f"/world/{backend}/robot", f"/world/{backend}/why_refused"
        out.fixed(
            f"{self._entity}/scan",
            rr.Points2D.from_fields(radii=rr.Radius.ui_points(1.7), colors=packed(palette.SCAN), draw_order=43),
        )
        out.fixed(f"{self._entity}/segments", style(1.7, 40.0, show_labels=False))
        out.fixed(f"{self._entity}/refused", style(3.2, 41.0, colors=packed(palette.REFUSED)))
        out.fixed(self._why, words_only())

    def send(self, block: Block) -> None:
        """Send the scan, the segments (fused or new), and those that were refused, with the reason."""
        self._scan(block)
        kinds, words = block.verdicts
        ends = np.concatenate([row.segments.ends for row in block.rows])
        colours = np.array([packed(palette.UNUSED), packed(palette.FUSED), packed(palette.NEW), 0], dtype=np.uint32)
        used, refused = np.flatnonzero(kinds != REFUSED), np.flatnonzero(kinds == REFUSED)
        self._out.strips(
            f"{self._entity}/segments", block.moments, block.count(used), ends[used], colours[kinds[used]],
            labels=[words[k] for k in used],
        )  # fmt: skip
        counts = block.count(refused)
        when = np.flatnonzero((counts > 0) | np.append(0, counts[:-1] > 0))
        moments = block.moments.take(when)
        self._out.strips(f"{self._entity}/refused", moments, counts[when], ends[refused])
        at = block.row_of_segment[refused]
        (x, y), poses = ends[refused].mean(axis=1).T, block.poses[at]
        places = x[:, None] * normals(poses[:, 2]) + y[:, None] * directions(poses[:, 2]) + poses[:, :2]
        places[:, 1] = spread(places[:, 1], at, LABEL_M)
        self._out.points(self._why, moments, counts[when], places, labels=[f"refused: {words[k]}" for k in refused])

    def _scan(self, block: Block) -> None:
        found = [np.flatnonzero(np.isfinite(row.scan.ranges_m)) for row in block.rows]
        counts = np.array([len(beams) for beams in found])
        scans = [row.scan for row in block.rows]
        ranges = np.concatenate([scan.ranges_m[beams] for scan, beams in zip(scans, found, strict=True)])
        bearings = np.concatenate([scan.bearings_rad[beams] for scan, beams in zip(scans, found, strict=True)])
        along = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
        points = to_world(ranges[:, None] * along, block.rows[0].robot.scanner.pose_robot)
        self._out.points(f"{self._entity}/scan", block.moments, counts, points)
