"""How far the ends of what one scan shows can be believed."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from ..geometry.lines import directions, normals
from ..robot import Scan
from .config import ExtractionConfig
from .segments import EndKind, Segments


def beams_of(runs: Int[np.ndarray, "n 2"], beams: int) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Return the beams of segments, each from its first to its last, in a scan of so many, and whose each is."""
    counts = np.mod(runs[:, 1] - runs[:, 0], beams) + 1
    of = np.repeat(np.arange(len(runs)), counts)
    return np.mod(np.arange(len(of)) + (runs[:, 0] - np.cumsum(counts) + counts)[of], beams), of


def owners_of_beams(segments: Segments, owners: Int[np.ndarray, " s"], beams: int) -> Int[np.ndarray, " k"]:
    """Return for each beam of a scan the id of the wall that its segment belongs to, -1 for none."""
    owner = np.full(beams, -1, dtype=np.int64)
    beam, of = beams_of(segments.beams, beams)
    owner[beam] = owners[of]
    return owner


def sure_pieces(segments: Segments, scan: Scan, config: ExtractionConfig) -> Segments:
    """Shorten each segment to where its beams stand close enough together that no door hides between them.

    Beams dtheta apart meet a line at distance r, s beyond the foot of the perpendicular, (r^2 + s^2) dtheta / r
    apart. A segment that lies beyond altogether keeps the end nearer to the foot. Corners far beyond the last
    beam are not believed either.
    """
    segments = _without_leaps(segments, scan, config)
    r = segments.lines[:, 1]
    farthest = np.sqrt(np.maximum(r * config.sure_gap_m / beam_step(scan) - r**2, 0.0))
    t, n = directions(segments.lines[:, 0]), normals(segments.lines[:, 0])
    along = np.vecdot(segments.ends, t[:, None])
    inner = np.where(np.sign(along[:, :1]) == np.sign(along[:, 1:]), np.abs(along).min(axis=1, keepdims=True), 0.0)
    farthest = np.maximum(farthest[:, None], inner)
    clipped = np.clip(along, -farthest, farthest)
    cut = clipped != along
    ends = np.where(cut[..., None], (r[:, None] * n)[:, None] + clipped[..., None] * t[:, None], segments.ends)
    return replace(segments, ends=ends, end_kinds=np.where(cut, int(EndKind.OPEN), segments.end_kinds))


def _without_leaps(segments: Segments, scan: Scan, config: ExtractionConfig) -> Segments:
    """Put ends that lie far beyond the last beam back to where that beam meets the line."""
    off_normal = scan.bearings_rad[segments.beams] - segments.lines[:, :1]
    distance = segments.lines[:, 1:] / np.maximum(np.cos(off_normal), 0.02)
    bearing = scan.bearings_rad[segments.beams]
    last = distance[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    leap = np.hypot(*np.moveaxis(segments.ends - last, -1, 0)) > config.corner_leap_m
    kinds = np.where(leap, int(EndKind.OPEN), segments.end_kinds)
    return replace(segments, ends=np.where(leap[..., None], last, segments.ends), end_kinds=kinds)


def beam_step(scan: Scan) -> float:
    """Return the angle between neighbouring beams, rad."""
    return scan.step_rad


def beam_spacing(scan: Scan, segments: Segments) -> Float[np.ndarray, "n 2"]:
    """Return the distance between neighbouring beams on the wall at each end of each segment, m."""
    distance = np.hypot(segments.ends[..., 0], segments.ends[..., 1])
    cosine = np.clip(segments.lines[:, 1, None] / np.maximum(distance, 1e-9), 0.05, 1.0)
    return beam_step(scan) * distance / cosine
