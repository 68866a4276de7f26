"""`audit` as a function: trajectories of any SLAM system, and what can be said of their covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from chainslam.sim.logs.rosbag import is_bag

from ...artifacts.files import json_bytes, stamp, write
from ...artifacts.run_folder import prepare
from ...scoring.without_truth.references import read_relations
from ...usage import UsageError
from .audited import Align, Audited, Options, audited, audited_relations
from .geometry.plane import Frame
from .reading.bags import read_poses
from .reading.graphs import Rotations, is_graph, read_graph
from .reading.stated import TRUTH, Space, Stated, in_space, read_folder, read_text
from .verdicts import Pair, Pooled, compare, pool
from .without.halves import halves_of
from .without.inner import Inner
from .without.inner import pool as pool_inner
from .without.innovations import innovations
from .without.loops import loops
from .without.triangles import closures
from .words import lines, pooled_line

Paths = str | Path | Sequence[str | Path]
GIVE = "give --truth FILE, --reference FILE or --relations FILE, or a second trajectory and --halves"
REPORT, RECORD, TABLES = "report.html", "audit.json", "tables.tex"


@dataclass(frozen=True, repr=False)
class Audit:
    """An audit of one or several trajectories."""

    trajectories: tuple[Audited, ...]
    pooled: Pooled | None
    """Over several runs of one estimator, each with a truth of its own, or all without one."""
    pairs: tuple[Pair, ...]
    """Of several estimators on one drive."""
    asked: tuple[str, ...]
    """The words of the command that makes it."""
    without_truth: tuple[Inner, ...] = ()
    """What runs, graphs or relations show without a truth."""

    @property
    def verdict(self) -> list[str]:
        """The findings, in words: four to six lines for each trajectory."""
        is_told = "--error" in self.asked
        each = [line for found in self.trajectories for line in lines(found, is_told)]
        inner = [line for found in self.without_truth for line in found.lines()]
        return [*each, *inner, *self._pooled(), *(pair.told() for pair in self.pairs)]

    def _pooled(self) -> list[str]:
        if self.pooled is not None:
            return [pooled_line(self.pooled)]
        kinds = list(dict.fromkeys(each.kind for each in self.without_truth))
        return [f"not pooled, since they are of different kinds: {', '.join(kinds)}"] if len(kinds) > 1 else []

    def record(self) -> dict[str, Any]:
        """Return all figures, by name."""
        return {
            "trajectories": [each.record() for each in self.trajectories],
            "pooled": self.pooled and self.pooled.record(),
            "pairs": [
                {"first": pair.first, "second": pair.second, "nees_ratio": pair.ratio,
                 "nees_ratio_interval": pair.interval, "stretches": pair.blocks} for pair in self.pairs
            ],
            "without_truth": [each.record() for each in self.without_truth],
        }  # fmt: skip

    def report(self, folder: str | Path) -> Path:
        """Write audit.json, report.html and tables.tex into a folder, and return the path of the report."""
        from chainslam.viz.reports.report import html, latex

        from .page import page_of
        from .without.page import page_without

        place = Path(folder)
        prepare(place)
        singles = [f"{each.name}: {each.verdict.told()}" for each in self.trajectories]
        singles += [each.lines()[0] for each in self.without_truth]
        told = [*self._pooled(), *singles, *(pair.told() for pair in self.pairs)]
        page = (
            page_without(self.without_truth, told, self.asked) if self.without_truth
            else page_of(self.trajectories, self.pooled, self.pairs, told, self.asked)
        )  # fmt: skip
        write(place / RECORD, json_bytes({**stamp(), "command": list(self.asked), **self.record()}))
        write(place / TABLES, latex(page.all_tables))
        write(place / REPORT, html(page))
        return place / REPORT

    def __repr__(self) -> str:
        return "\n".join(self.verdict)


def audit(
    trajectories: Paths,
    *,
    truth: Paths = (),
    reference: Paths = (),
    relations: str | Path | None = None,
    without_truth: bool = False,
    halves: bool = False,
    space: Space = "plane",
    g2o_rotation: Rotations | None = None,
    error: Frame | None = None,
    align: Align = "none",
    reference_sigma: tuple[float, float] | None = None,
    nearest: float | None = None,
    topic: str | None = None,
    truth_topic: str | None = None,
) -> Audit:
    """Tell whether the covariances of trajectories may be believed, as `chainslam audit` does.

    `trajectories` are files or folders of runs. `truth`, or a `reference` with standard deviations
    `reference_sigma` (m, rad), is one file for each, which are then runs of one estimator, or one for all, which
    are then different estimators. `relations` is a file of measured relations between poses; without a trajectory
    its triangles are audited. Without a truth, the innovations of a run's folder and the loop closures of a graph
    are audited, and pooled if there are several of one back end, or several graphs; `without_truth` asks for that
    although there is a truth. `halves` compares two trajectories with each other, of two halves of the data.
    `space` "space" audits all six axes of poses with position and quaternion, in place of x, y and heading.
    `g2o_rotation` tells whether the rotational information of a graph in space is that of rotation vectors
    ("vector", the default) or of the x, y and z of quaternions ("quaternion"). `error` is the frame that the
    covariances are stated in: "additive" (the default), "body" or "world"; those of a graph, which are of the body
    frame, are converted. `nearest` takes the nearest true pose within so many seconds, which is otherwise
    interpolated. Raises UsageError for bad input.
    """
    paths, true, references = _paths(trajectories), _paths(truth), _paths(reference)
    given: dict[str, Any] = {
        "truth": true, "reference": references, "relations": [] if relations is None else [relations],
        "without-truth": [] if not without_truth else [""], "halves": [] if not halves else [""],
        "space": [] if space == "plane" else [space], "g2o-rotation": [] if g2o_rotation is None else [g2o_rotation],
        "error": [] if error is None else [error], "align": [] if align == "none" else [align],
        "reference-sigma": reference_sigma or [], "nearest": [] if nearest is None else [nearest],
        "topic": [] if topic is None else [topic], "truth-topic": [] if truth_topic is None else [truth_topic],
    }  # fmt: skip
    _check(paths, given)
    asked = ["chainslam", "audit", *map(str, paths)]
    asked += [word for name, values in given.items() if values for word in (f"--{name}", *map(str, values)) if word]
    options = Options(error, align, reference_sigma, nearest)
    if not paths:
        assert relations is not None
        return Audit((), None, (), tuple(asked), (closures(Path(relations), reference_sigma, space),))
    if _judged_alone(paths, given):
        inner = tuple(_named([_inner(each, space, g2o_rotation) for each in paths]))
        are_runs = len(inner) > 1 and len({each.kind for each in inner}) == 1
        return Audit((), pool_inner(inner) if are_runs else None, (), tuple(asked), inner)
    stated = _named([read(path, topic, True, space, g2o_rotation) for path in paths])
    if halves:
        return Audit((halves_of(stated, options),), None, (), tuple(asked))
    if relations is not None:
        measured = read_relations(Path(relations), space == "space")
        found = tuple(audited_relations(each, measured, options) for each in stated)
        return Audit(found, None, _pairs(found, stated[:1] * len(found)), tuple(asked))
    known = true or references or _own(stated)
    if len(known) not in (1, len(paths)):
        raise UsageError(
            f"expected one truth for all or one for each of {len(paths)} trajectories, found {len(known)}: correct it"
        )
    truths = [read(path, truth_topic, False, space, g2o_rotation) for path in known]
    every = truths if len(truths) == len(stated) else truths * len(stated)
    found = tuple(audited(each, against, options) for each, against in zip(stated, every, strict=True))
    estimators = {each.estimator for each in stated} - {None}
    if len(stated) > 1 and len(truths) == len(stated) and (len(estimators) < 2 or true or references):
        return Audit(found, pool([each.pose for each in found]), (), tuple(asked))
    return Audit(found, None, _pairs(found, every), tuple(asked))


def _judged_alone(paths: Sequence[Path], given: dict[str, Any]) -> bool:
    """Return whether trajectories are judged by what they hold themselves."""
    is_compared = any(given[name] for name in ("truth", "reference", "relations", "halves"))
    return bool(given["without-truth"]) or (not is_compared and all(map(_is_alone, paths)))


def _is_alone(path: Path) -> bool:
    """Return whether a graph or the folder of a run has no truth of its own."""
    has_steps = path.is_dir() and (path / "steps.csv").is_file()
    return is_graph(path) or (has_steps and not (path / TRUTH).is_file())


def _inner(path: Path, space: Space, rotation: Rotations | None) -> Inner:
    if is_graph(path):
        return loops(path, space, rotation)
    if not (path / "steps.csv").is_file():
        raise UsageError(f"expected the folder of a run or a g2o graph for --without-truth, found {path}: {GIVE}")
    return innovations(path)


def read(
    path: Path,
    topic: str | None = None,
    needs_covariance: bool = True,
    space: Space = "plane",
    rotation: Rotations | None = None,
) -> Stated:
    """Read a trajectory of whatever format; raises UsageError."""
    if is_graph(path):
        found = read_graph(path, space, rotation)
    elif is_bag(path):
        found = read_poses(path, topic, needs_covariance)
    else:
        found = read_folder(path) if path.is_dir() else read_text(path)
    return in_space(found, needs_covariance) if space == "space" else found


def _paths(given: Paths) -> list[Path]:
    return [Path(given)] if isinstance(given, str | Path) else [Path(each) for each in given]


def _check(paths: Sequence[Path], given: dict[str, Any]) -> None:
    if not paths and not given["relations"]:
        raise UsageError("expected a trajectory with covariances, found none: name a file or the folder of a run first")
    places = [path.resolve() for path in paths]
    if doubles := [path for path, place in zip(paths, places, strict=True) if places.count(place) > 1]:
        raise UsageError(f"expected different trajectories, found {doubles[0]} {len(doubles)} times: name it once")
    against = [f"--{name}" for name in ("truth", "reference", "relations", "without-truth", "halves") if given[name]]
    if len(against) > 1:
        raise UsageError(f"expected one of {', '.join(against)}, found {len(against)}: leave the others out")
    if given["g2o-rotation"] and not (given["space"] and any(map(is_graph, paths))):
        raise UsageError("expected --g2o-rotation beside --space space and a g2o graph, found it alone: leave it out")
    for option, files in (("topic", paths), ("truth-topic", given["truth"] + given["reference"])):
        if given[option] and not any(map(is_bag, files)):
            raise UsageError(f"expected --{option} beside a ROS bag, found none: leave it out")
    are_alone = _judged_alone(paths, given)
    for option in ("align", "nearest"):
        if given[option] and (given["relations"] or are_alone):
            raise UsageError(f"expected --{option} beside --truth or --reference, found none: leave it out")
    if given["error"] and (not paths or are_alone):
        raise UsageError("expected --error beside poses to compare, found none: leave it out")
    sigma = given["reference-sigma"]
    known = given["reference"] or not paths
    if sigma and (not known or not np.all(np.isfinite(sigma)) or min(sigma) < 0.0):
        found = f"{sigma[0]:g} {sigma[1]:g}" if known else "no reference"
        raise UsageError(f"expected --reference-sigma METRES RADIANS of a --reference, found {found}: correct it")
    if given["nearest"] and not 0.0 <= given["nearest"][0] < float("inf"):
        raise UsageError(f"expected --nearest as seconds, found {given['nearest'][0]:g}: correct it")


def _own(stated: Sequence[Stated]) -> list[Path]:
    """Return the truths in the folders of runs; raises UsageError if one has none."""
    for each in stated:
        if each.truth is None:
            raise UsageError(f"expected something to compare {each.name} with, found none: {GIVE}")
    return [each.truth for each in stated if each.truth is not None]


Named = TypeVar("Named", Stated, Inner)


def _named(stated: Sequence[Named]) -> list[Named]:
    """Return trajectories with different names."""
    names = [each.name for each in stated]
    return [
        replace(each, name=f"{each.name} ({k})") if names.count(each.name) > 1 else each
        for k, each in enumerate(stated, 1)
    ]


def _pairs(found: Sequence[Audited], truths: Sequence[Stated]) -> tuple[Pair, ...]:
    """Return the comparison of every two estimates of one drive at the times that both have."""
    pairs = []
    for (one, true), (other, also) in combinations(zip(found, truths, strict=True), 2):
        _, a, b = np.intersect1d(np.round(one.time_s, 3), np.round(other.time_s, 3), return_indices=True)
        if len(a) and np.array_equal(true.poses_world, also.poses_world):
            draws = min(one.pose.draws, other.pose.draws) * len(a) / max(len(one.time_s), len(other.time_s))
            pairs.append(compare((one.name, other.name), one.nees[a], other.nees[b], draws))
    return tuple(pairs)
