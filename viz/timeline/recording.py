"""A Rerun recording written by columns: many moments of one entity in one call, from flat arrays without copies.

Colours are packed 0xRRGGBBAA numbers; a negative radius is in screen points, independent of the zoom.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Bool, Float, Int, UInt32

from .arrow import settle

APPLICATION = "chainslam"
STEP, SIM_TIME = "step", "sim_time"
PATIENCE_S = 30.0
"""Time limit for a viewer to take what it was sent last."""
_VEC2 = pa.list_(pa.field("item", pa.float32(), nullable=False), 2)
_STRIP = pa.list_(pa.field("item", _VEC2, nullable=False))


@dataclass(frozen=True)
class Timestamps:
    """Times of the rows of some columns."""

    step: Int[np.ndarray, " n"]
    seconds: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.step)

    def take(self, index: Int[np.ndarray, " k"] | Bool[np.ndarray, " n"] | list[int] | slice) -> "Timestamps":
        """Return the chosen moments."""
        return Timestamps(self.step[index], self.seconds[index])


class RerunRecording:
    """One Rerun recording in memory, or in a viewer as it goes on."""

    def __init__(self, name: str, viewer_url: str | None = None) -> None:
        settle()
        self._stream = rr.RecordingStream(APPLICATION, recording_id=f"{APPLICATION} {name}")
        self._stream.set_log_tick_enabled(False)
        self._stream.set_log_time_enabled(False)
        self._memory = self._stream.memory_recording() if viewer_url is None else None
        if viewer_url is not None:
            self._stream.connect_grpc(viewer_url)
        self._stream.send_recording_name(name)

    def layout(self, blueprint: rrb.Blueprint) -> None:
        """Set the layout in the viewer."""
        self._stream.send_blueprint(blueprint, make_active=True, make_default=True)

    def finish(self) -> bytes:
        """Wait until everything has arrived, and return the bytes of an .rrd file; none with a viewer.

        Raises RuntimeError if a viewer was closed or does not answer.
        """
        self._stream.flush(timeout_sec=PATIENCE_S)
        return b"" if self._memory is None else self._memory.drain_as_bytes()

    def fixed(self, entity: str, *archetypes: Any) -> None:
        """Log static data: styles, texts, frames, true walls."""
        self._stream.log(entity, *archetypes, static=True)

    def strips(
        self,
        entity: str,
        moments: Timestamps,
        counts: Int[np.ndarray, " n"],
        points: Float[np.ndarray, "k v 2"],
        colors: UInt32[np.ndarray, " k"] | None = None,
        labels: Sequence[str] | None = None,
    ) -> None:
        """Send strips of v points each, `counts` of them at each moment."""
        offsets = np.arange(len(points) + 1, dtype=np.int32) * points.shape[1]
        strips = pa.ListArray.from_arrays(_plain(offsets, pa.int32()), _vectors(points), type=_STRIP)
        columns = rr.LineStrips2D.columns(strips=strips, colors=_colors(colors), labels=_words(labels))
        self._send(entity, moments, columns.partition(counts))

    def points(
        self,
        entity: str,
        moments: Timestamps,
        counts: Int[np.ndarray, " n"],
        positions: Float[np.ndarray, "k 2"],
        labels: Sequence[str] | None = None,
    ) -> None:
        """Send points, `counts` of them at each moment."""
        columns = rr.Points2D.columns(positions=_vectors(positions), labels=_words(labels))
        self._send(entity, moments, columns.partition(counts))

    def circles(
        self,
        entity: str,
        moments: Timestamps,
        counts: Int[np.ndarray, " n"],
        centres: Float[np.ndarray, "k 2"],
        radii_m: Float[np.ndarray, " k"],
        colors: UInt32[np.ndarray, " k"],
    ) -> None:
        """Send circles, `counts` of them at each moment."""
        halves = np.repeat(radii_m[:, None], 2, axis=1)
        columns = rr.Ellipses2D.columns(centers=_vectors(centres), half_sizes=_vectors(halves), colors=_colors(colors))
        self._send(entity, moments, columns.partition(counts))

    def poses(self, entity: str, moments: Timestamps, poses: Float[np.ndarray, "n 3"]) -> None:
        """Send the frame of an entity: position m and heading rad in the frame above it."""
        half = 0.5 * poses[:, 2]
        zero = np.zeros_like(half)
        translation = np.column_stack([poses[:, :2], zero])
        quaternion = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
        self._send(entity, moments, rr.Transform3D.columns(translation=translation, quaternion=quaternion))

    def values(self, entity: str, moments: Timestamps, values: Float[np.ndarray, " n"]) -> None:
        """Send a curve."""
        self._send(entity, moments, rr.Scalars.columns(scalars=_plain(values.astype(np.float64), pa.float64())))

    def words(self, entity: str, moments: Timestamps, texts: Sequence[str], levels: Sequence[str]) -> None:
        """Send lines of a log."""
        self._send(entity, moments, rr.TextLog.columns(text=_words(texts), level=_words(levels)))

    def grids(
        self,
        entity: str,
        moments: Timestamps,
        grids: Sequence[Bool[np.ndarray, "_ _"]],
        corners: Float[np.ndarray, "n 2"],
        cell: float,
    ) -> None:
        """Send grids of classes, lowest row first, with their lower left corner and the size of a cell, m."""
        corner = np.column_stack([corners, np.zeros(len(corners))])
        scale = np.tile([cell, cell, 1.0], (len(corners), 1))
        columns = [
            *rr.SegmentationImage.columns(
                buffer=[grid.astype(np.uint8).ravel() for grid in grids],
                format=[
                    rr.components.ImageFormat(grid.shape[1], grid.shape[0], channel_datatype=rr.ChannelDatatype.U8)
                    for grid in grids
                ],
            ),
            *rr.Transform3D.columns(translation=corner, scale=scale),
        ]
        self._send(entity, moments, columns)

    def graph(
        self,
        entity: str,
        moments: Timestamps,
        nodes: Sequence[tuple[Sequence[str], Float[np.ndarray, "_ 2"], UInt32[np.ndarray, " _"]]],
        edges: Sequence[Sequence[tuple[str, str]]],
    ) -> None:
        """Send directed graphs: at each moment the names, places and colours of nodes, and pairs of names."""
        counts = np.array([len(names) for names, _, _ in nodes])
        names = [name for some, _, _ in nodes for name in some]
        columns = [
            *rr.GraphNodes.columns(
                node_ids=_words(names),
                positions=_vectors(np.concatenate([places for _, places, _ in nodes])),
                colors=_colors(np.concatenate([colors for _, _, colors in nodes])),
                labels=_words(names),
            ).partition(counts),
            *rr.GraphEdges.columns(edges=_pairs([pair for some in edges for pair in some])).partition(
                [len(some) for some in edges]
            ),
            *rr.GraphEdges.columns(graph_type=["directed"] * len(edges)),
        ]
        self._send(entity, moments, columns)

    def _send(self, entity: str, moments: Timestamps, columns: Any) -> None:
        if not len(moments):
            return
        indexes = [_Times(STEP, moments.step, pa.int64()), _nanoseconds(moments.seconds)]
        self._stream.send_columns(entity, indexes=indexes, columns=columns)


@dataclass(frozen=True)
class _Times:
    """A column of times as in Rerun's own `TimeColumn`, but made without Python objects."""

    name: str
    values: Int[np.ndarray, " n"]
    type: pa.DataType

    def timeline_name(self) -> str:
        """Return the name of the timeline."""
        return self.name

    def as_arrow_array(self) -> pa.Array:
        """Return the times."""
        return _plain(self.values, self.type)


def _nanoseconds(seconds: Float[np.ndarray, " n"]) -> _Times:
    return _Times(SIM_TIME, np.round(1e9 * seconds).astype(np.int64), pa.duration("ns"))


def _plain(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Return an arrow array that shares the memory."""
    flat = np.ascontiguousarray(values)
    return pa.Array.from_buffers(kind, flat.size, [None, pa.py_buffer(flat)])


def _vectors(points: Float[np.ndarray, "*n 2"]) -> pa.Array:
    return pa.FixedSizeListArray.from_arrays(_plain(points.astype(np.float32), pa.float32()), type=_VEC2)


def _colors(colors: UInt32[np.ndarray, " k"] | None) -> pa.Array | None:
    return None if colors is None else _plain(colors.astype(np.uint32), pa.uint32())


def _words(texts: Sequence[str] | None) -> pa.Array | None:
    return None if texts is None else pa.array(texts, type=pa.utf8())


def _pairs(pairs: Sequence[tuple[str, str]]) -> pa.Array:
    halves = [_words([pair[side] for pair in pairs]) for side in (0, 1)]
    return pa.StructArray.from_arrays(
        halves, fields=[pa.field(name, pa.utf8(), nullable=False) for name in ("first", "second")]
    )
