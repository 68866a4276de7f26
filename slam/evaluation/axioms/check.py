"""Runs the axioms on a back end and returns those that fail: for one's own, and for all in the registry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..consistency import joint_error, nees
from .answers import (
    ANSWERS,
    a_line_seen_again_is_better_known,
    a_wall_seen_twice_in_one_scan_is_taken_in_twice,
    moving_the_world_moves_the_answer,
)
from .beliefs import BELIEFS
from .broken import BrokenError, expect
from .room import P0, Make, journey, see

RUNS, STEPS, LOOKS = 30, 12, 30
REJECTED = 4.0
"""So many standard deviations of the mean over the runs."""


@dataclass(frozen=True)
class Failure:
    """A requirement that a back end does not meet."""

    axiom: str
    """Its name, in words."""
    found: str
    """What was expected and found, or the error that was raised."""


def errors_are_as_large_as_the_covariance_says(make: Make) -> None:
    """Over 30 drives the mean NEES is 1 a dimension, of the pose and of all together, to 4 sigmas of that mean."""
    for what, mean, width in _honesty(make):
        expect(abs(mean - 1.0) < width, f"a mean NEES of the {what} within {width:.2f} of 1 a dimension", f"{mean:.2f}")


def errors_are_no_larger_than_the_bound_says(make: Make) -> None:
    """For a covariance that is a bound it is 1 or less."""
    for what, mean, width in _honesty(make):
        expect(mean < 1.0 + width, f"a mean NEES of the {what} below {1.0 + width:.2f} a dimension", f"{mean:.2f}")


def _honesty(make: Make) -> list[tuple[str, float, float]]:
    """Return the mean NEES of a dimension of the pose, and of pose and map, and how far from 1 chance may take it."""
    found = []
    for seed in range(RUNS):
        rng = np.random.default_rng([31, seed])
        drive = journey(make, rng)
        drive.true = drive.true + np.sqrt(np.diag(P0)) * rng.standard_normal(3)
        walls = np.arange(len(drive.room.lines))
        ids = drive.backend.grow(*drive.room.seen(drive.true, walls, rng))
        drive.ids |= zip(walls.tolist(), ids.tolist(), strict=True)
        drive.drive(STEPS, rng)
        for _ in range(LOOKS):  # From where it stands: who drops correlations takes them for news.
            see(drive.backend, ids, drive.room.seen(drive.true, walls, rng))
        joint = drive.backend.belief.joint(ids)
        error, cov = joint_error(joint, drive.true, drive.room.lines[walls])
        found.append([nees(error[None, :n], cov[None, :n, :n])[0] / n for n in (3, len(error))])
    # That of an ideal mean: 2 / n for each run.
    widths = [REJECTED * np.sqrt(2.0 / n / RUNS) for n in (3, len(error))]
    return list(zip(("pose", "pose and map"), np.mean(found, axis=0).tolist(), widths, strict=True))


def axioms_of(
    covariance: Literal["exact", "blocks", "bound"] = "exact", is_about_origin: bool = False
) -> dict[str, Callable[[Make], None]]:
    """Return the axioms by name that a back end with these properties (see `BackendEntry`) owes."""
    found = [
        *BELIEFS,
        *(each for each in ANSWERS if not is_about_origin or each is not moving_the_world_moves_the_answer),
    ]
    if covariance == "exact":
        found.append(errors_are_as_large_as_the_covariance_says)
    if covariance == "bound":
        # Where all may err alike a second look may say nothing.
        found.remove(a_line_seen_again_is_better_known)
        found.remove(a_wall_seen_twice_in_one_scan_is_taken_in_twice)
        found.append(errors_are_no_larger_than_the_bound_says)
    return {each.__name__.replace("_", " "): each for each in found}


def check_backend(
    make: Make,
    covariance: Literal["exact", "blocks", "bound"] = "exact",
    is_about_origin: bool = False,
) -> tuple[Failure, ...]:
    """Test a back end against the contract of `Backend`, and return the requirements that it does not meet.

    It takes some seconds and needs no test runner. `make` is the class, or a function from a pose (3,) and its
    covariance (3, 3) to a back end. `covariance` and `is_about_origin` are claims as in `BackendEntry`.
    """
    failures = []
    for name, holds in axioms_of(covariance, is_about_origin).items():
        try:
            holds(make)
        except BrokenError as broken:
            failures.append(Failure(name, str(broken)))
        except Exception as error:  # A stranger's class may raise anything, and that is what is told.
            failures.append(Failure(name, f"raised {error!r}"))
    return tuple(failures)
