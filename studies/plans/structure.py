"""How often a relation of walls that is taken for sure is false, and what the sure ones do to a map.

.venv/bin/python -m studies.plans.structure --plans DIR     # goes on where it was interrupted
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from rich.table import Table

from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.views.plans.faces import Faces, read_faces
from chainslam.experiments.views.plans.measuring import Kind, across, main_direction
from chainslam.experiments.views.plans.structure import DIRECTIONS, Hypothesis, Relation, structure_of
from chainslam.sim.worlds import World
from chainslam.slam.estimation.backend import columns_of
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import wrap

from ..runner.command import run_study
from ..runner.scores import interval_words
from .runs import as_drawn, explored, plans_in
from .skewed_walls import as_masons_do, sheared, with_turned
from .truth import with_truth

SQUARE_RAD, PLACE_M = float(np.deg2rad(0.3)), 0.005
"""A relation is false if the true walls are off it by more."""
BUILT: dict[str, Callable[[World], World]] = {
    "as drawn": as_drawn,
    "walls off by 0.1 degrees (sigma)": partial(as_masons_do, sigma_deg=0.1),
    "walls turned by 0.5 to 3 degrees": partial(with_turned, least_deg=0.5, most_deg=3.0),
    "skewed by 1.5 degrees": partial(sheared, degrees=1.5),
}
Pair = tuple[float, float]
HOMES = ("plans", "plans-masons", "plans-skewed", "plans-sheared")


@dataclass(frozen=True)
class Scored:
    """One map, without and with its sure relations."""

    built: str
    told: tuple[tuple[Hypothesis, bool], ...]
    """All relations between true walls, and whether they are true."""
    square: float
    """Share of the walls that surely have the main direction or are square to it."""
    main: Pair
    """Standard deviation of the main direction, rad."""
    main_own: Pair
    """The same without the uncertainty of the start."""
    walls_own: Pair
    """Median of those of the walls that are surely square; NaN without any."""
    angles: Pair
    """The same against the mean of these walls: of the angles between walls."""
    anees: Pair


@dataclass(frozen=True)
class StructureStudy:
    """Explore apartments as drawn and with walls askew, and print which relations are found and what they do."""

    plans: Path = Path("../shared/data/plans")
    """A folder of maps."""
    named: str = "lifull_*"
    """Which files of the folder, as the shell would write it."""
    count: int = 20
    """How many of them, in alphabetical order."""
    backend: str = "invariant-ekf"
    """The estimator."""
    seed: int = 1
    """Seed of each run."""
    jobs: int = 2
    """Number of processes."""
    runs: Path = Path("results")
    """Folder of the folders of runs. What they hold is measured, and not driven, again."""

    def run(self) -> None:
        """Explore what is to be explored and print the tables; raises UsageError."""
        plans, rows = plans_in(self.plans, self.named, self.count), list[Scored]()
        for home, (name, built) in zip(HOMES, BUILT.items(), strict=True):
            folders = explored(plans, self.backend, self.seed, self.runs / home, self.jobs, built)
            rows += [scores(name, folder) for folder in folders]
        plain_console(width=150).print(relations(rows), maps(rows))


def scores(built: str, folder: Path) -> Scored:
    """Return what is told of the relations of a map with the truth, and its sigmas and ANEES with and without them."""
    faces = read_faces(folder)
    with np.load(folder / "map.npz") as walls, np.load(folder / "log.npz") as log:
        of = dict(zip(walls["ids"].tolist(), walls["true_faces_of_lines"].tolist(), strict=True))
        true_faces, labels, start = log["true_faces"], log["true_wall_of_face"], float(log["start_cov"][2, 2])
    face_of = np.array([of[wall] for wall in faces.ids.tolist()], dtype=np.int64)
    truth, found = with_truth(faces, face_of, true_faces, labels), structure_of(faces)
    told = [(each, is_true(each, truth)) for each in found.hypotheses if all(face_of[row] >= 0 for row in each.walls)]
    both, mains = (faces, found.faces), (main_direction(faces), main_direction(found.faces, found.square))
    square = [] if found.square is None else np.flatnonzero(found.square).tolist()
    own, angles = zip(*(_spreads(each, square, start) for each in both), strict=True)
    return Scored(
        built, tuple(told), len(square) / len(faces), (mains[0].sigma, mains[1].sigma),
        (_beyond(mains[0].sigma**2, start), _beyond(mains[1].sigma**2, start)),
        (own[0], own[1]), (angles[0], angles[1]),
        (anees(both[0], truth, np.flatnonzero(face_of >= 0)), anees(both[1], truth, np.flatnonzero(face_of >= 0))),
    )  # fmt: skip


def _spreads(faces: Faces, rows: Sequence[int], start: float) -> Pair:
    """Return the median sigma of the directions of some walls without that of the start, and against their mean."""
    if not len(rows):
        return np.nan, np.nan
    columns = columns_of(np.array(rows))[3::2]
    cov = faces.cov[np.ix_(columns, columns)]
    centred = cov - cov.mean(axis=0) - cov.mean(axis=1)[:, None] + cov.mean()
    own = [_beyond(float(variance), start) for variance in np.diag(cov)]
    return float(np.median(own)), float(np.sqrt(np.median(np.diag(centred))))


def _beyond(variance: float, start: float) -> float:
    """Return the sigma of a direction without the uncertainty of the start, which all directions share."""
    return float(np.sqrt(max(variance - start, 0.0)))


def is_true(each: Hypothesis, truth: Faces) -> bool:
    """Return whether the true walls have a relation, to within what no map could tell."""
    first, second, *other = each.walls
    match each.relation:
        case Relation.PARALLEL | Relation.RIGHT_ANGLE:
            turn = (
                truth.means[first, 0] - truth.means[second, 0] - 0.5 * np.pi * (each.relation is not Relation.PARALLEL)
            )
            return bool(abs(DIRECTIONS.off(turn)) <= SQUARE_RAD)
        case Relation.COLLINEAR:
            alpha, r = truth.lines_world[second]
            return bool(abs(truth.stops_world[first].mean(axis=0) @ normals(alpha) - r) <= PLACE_M)
        case Relation.THICKNESS:
            thick = [
                across(truth, Kind.THICKNESS, a, b, truth.stops_world[[a, b]].mean(axis=(0, 1))).value
                for a, b in ((first, second), (other[0], other[1]))
            ]
            return abs(thick[0] - thick[1]) <= PLACE_M


def anees(faces: Faces, truth: Faces, rows: Int[np.ndarray, " n"]) -> float:
    """Return the ANEES of the lines of walls, all of them jointly."""
    off = faces.means[rows] - truth.means[rows]
    error = np.stack([wrap(off[:, 0]), off[:, 1]], axis=-1).ravel()
    columns = columns_of(rows)[3:]
    return float(error @ np.linalg.solve(faces.cov[np.ix_(columns, columns)], error) / len(error))


def relations(rows: Sequence[Scored]) -> Table:
    """Return how many relations were taken for sure, and how many of them are false: in fact, and as stated."""
    shown = Table(title="relations of walls", title_justify="left")
    for column in ("built", "relation", "sure", "false", "false by their probabilities", "not sure", "of these true"):
        shown.add_column(column, justify="left" if column in ("built", "relation") else "right")
    for built in dict.fromkeys(row.built for row in rows):
        for relation in (*Relation, None):
            told = [
                pair for row in rows if row.built == built for pair in row.told
                if relation is None or pair[0].relation is relation
            ]  # fmt: skip
            sure = [(each.probability, is_so) for each, is_so in told if each.is_used]
            other = [is_so for each, is_so in told if not each.is_used]
            shown.add_row(
                built, str(relation or "all"), str(len(sure)), str(sum(not is_so for _, is_so in sure)),
                f"{sum(1.0 - probability for probability, _ in sure):.1f}", str(len(other)),
                f"{np.mean(other):.3f}" if other else "-",
            )  # fmt: skip
    return shown


def maps(rows: Sequence[Scored]) -> Table:
    """Return the sigmas of directions and the ANEES of maps without and with the sure relations, mean over plans."""
    shown = Table(
        title="maps without and with the sure relations, mean (95 %) over plans; own: beyond the start's uncertainty",
        title_justify="left",
    )
    for column in (
        "built", "plans", "square walls", "main direction deg", "ratio, own", "walls, ratio, own", "angles, ratio",
        "ANEES without", "with",
    ):  # fmt: skip
        shown.add_column(column, justify="left" if column == "built" else "right")
    for built in dict.fromkeys(row.built for row in rows):
        mine = [row for row in rows if row.built == built]
        main = np.array([row.main for row in mine])
        sigmas = [
            np.array([row.main_own for row in mine]),
            np.array([row.walls_own for row in mine]),
            np.array([row.angles for row in mine]),
        ]
        ratios = [(each[:, 1] / each[:, 0])[each[:, 0] > 0.0] for each in sigmas]
        scored = np.array([row.anees for row in mine])
        shown.add_row(
            built, str(len(mine)), f"{np.mean([row.square for row in mine]):.2f}",
            f"{np.rad2deg(main[:, 0].mean()):.3f} to {np.rad2deg(main[:, 1].mean()):.3f}",
            *(_mean(each) for each in (*ratios, *scored.T)),
        )  # fmt: skip
    return shown


def _mean(values: Float[np.ndarray, " n"]) -> str:
    return f"{values.mean():.2f} {interval_words(values, 2)}" if len(values) else "-"


if __name__ == "__main__":
    run_study(StructureStudy)
