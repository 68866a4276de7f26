"""`chainslam audit`: whether the covariances of a trajectory may be believed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ..artifacts.files import replacing
from ..library.audit.auditing import REPORT, audit
from ..terminal.answers import found
from ..terminal.console import say
from ..terminal.streams import one_line


@dataclass(frozen=True)
class Audit:
    """Check the covariances of trajectories against the truth: consistent, overconfident, or too cautious.

    Several trajectories with a truth for each are runs of one estimator and are pooled; with one truth for all they are
    different estimators and are compared. Without a truth, runs of one back end are pooled, and graphs are.
    """

    trajectories: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="TRAJECTORY")] = ()
    """TUM with 6 more columns xx xy xt yy yt tt (covariance of x, y, heading) or 21 (upper triangle of x y z roll pitch
    yaw), CSV with named columns, a g2o graph, a ROS bag, or the folder of a run."""
    truth: tuple[Path, ...] = ()
    """True trajectories, one for each or one for all; a run's folder holds its own."""
    reference: tuple[Path, ...] = ()
    """Reference trajectories, in place of the truth; exact without --reference-sigma."""
    relations: Path | None = None
    """Measured relations between poses, t1 t2 x y z roll pitch yaw, in place of the truth; without a trajectory,
    whether their triangles close."""
    without_truth: bool = False
    """Judge the innovations of a run's folder or the loop closures of a g2o graph, although there is a truth; without
    one this is done unasked. It cannot judge the pose itself."""
    halves: bool = False
    """Compare two trajectories of one drive that were estimated from two halves of its data, without any truth."""
    space: Literal["plane", "space"] = "plane"
    """Audit x, y and heading, or all six axes of poses with position, quaternion and a 6 x 6 covariance."""
    g2o_rotation: Literal["vector", "quaternion"] | None = None
    """What the rotational information of a g2o graph in space is of: rotation vectors, as GTSAM reads it (used if not
    given), or x y z of quaternions, which are half as large, as g2o itself reads it."""
    error: Literal["additive", "body", "world"] | None = None
    """Frame of the stated covariances: additive error of x, y, heading (used if not given; in space of x y z and the
    turns about these fixed axes), or log(est^-1 true) in the body frame, or log(true est^-1) in the world frame. Those
    of a g2o graph are of the body frame (used if not given), and are converted into another."""
    align: Literal["none", "start", "all"] = "none"
    """Bring the first pose to the true one before comparing, or the whole path nearest to the true path."""
    reference_sigma: Annotated[tuple[float, float] | None, tyro.conf.arg(metavar="M RAD")] = None
    """Standard deviations of a reference's position and heading, or of relations without a trajectory."""
    nearest: Annotated[float | None, tyro.conf.arg(metavar="SECONDS")] = None
    """Take the nearest true pose within so many seconds, instead of interpolating between poses at most 1 s apart."""
    topic: str | None = None
    """Topic of a ROS bag's poses with covariance, if it has several."""
    truth_topic: str | None = None
    """Topic of the true poses in a bag that is given as --truth or --reference."""
    out: Path | None = None
    """Folder for audit.json, report.html and tables.tex."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for bad input."""
        audited = audit(
            self.trajectories, truth=self.truth, reference=self.reference, relations=self.relations,
            without_truth=self.without_truth, halves=self.halves, space=self.space,
            g2o_rotation=self.g2o_rotation, error=self.error, align=self.align, reference_sigma=self.reference_sigma,
            nearest=self.nearest, topic=self.topic, truth_topic=self.truth_topic,
        )  # fmt: skip
        found(**audited.record())
        for line in audited.verdict:
            print(f"{'  ' if line.startswith(' ') else ''}{one_line(line)}")
        if self.out is not None:
            replaced = replacing(self.out / REPORT)
            say(f"report in {audited.report(self.out)}{replaced}")
        return 0
