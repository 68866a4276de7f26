"""Observations with known wall, for a back end without a mapper: the true association is determined beforehand.

With `--association true` the mapper's requests to a back end do not depend on the back end. They are computed once for
a drive and passed to many.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from chainslam.sim.chance import Chance
from chainslam.sim.robot import chance_in
from chainslam.slam.estimation.backend import POSE, Backend, Joint, Observations
from chainslam.slam.estimation.mounting import odometry_of_scanner, scanner_poses
from chainslam.slam.evaluation.consistency import nees, pose_covariances, pose_errors
from chainslam.slam.evaluation.from_start import FromStart, as_it_is
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.extraction.visible_extent import sure_pieces
from chainslam.slam.map.reliability import as_told
from chainslam.slam.map_keeper import seen_centres
from chainslam.slam.robot import Odometry

from ..scenario import load_world
from ..scoring.own_gauge import own_gauge
from ..scoring.truth import truth_of
from .oracles import PerfectExtraction, Witness, begins_a_line, of_true_lines
from .replay import RecordedRun


@dataclass(frozen=True, eq=False)
class ScanObservations:
    """Lines observed in one scan, robot frame."""

    walls: Int[np.ndarray, " m"]
    """The true wall of each line."""
    lines: Float[np.ndarray, "m 2"]
    """(alpha rad, r m)."""
    cov: Float[np.ndarray, "m 2 2"]
    centres: Float[np.ndarray, "m 2"]
    """Middle of each observed piece, m."""

    def __len__(self) -> int:
        return len(self.walls)

    def take(self, index: np.ndarray) -> "ScanObservations":
        """Return the chosen ones (integer or boolean index)."""
        return ScanObservations(self.walls[index], self.lines[index], self.cov[index], self.centres[index])


@dataclass(frozen=True, eq=False)
class DriveObservations:
    """A drive of s scans: what the wheels reported, what was seen again and what for the first time, and the truth."""

    odometry: Float[np.ndarray, "s 3"]
    """Motion that led to each scan, robot frame before the motion, m m rad; the first is not used."""
    odometry_cov: Float[np.ndarray, "s 3 3"]
    again: tuple[ScanObservations, ...]
    """For each scan, the observations of walls seen before."""
    first: tuple[ScanObservations, ...]
    """And those that start a new line."""
    true_poses_world: Float[np.ndarray, "s 3"]
    true_lines_world: dict[int, Float[np.ndarray, "2"]]
    """(alpha rad, r m) of each wall that starts a new line."""
    chance: Chance
    """Random numbers from which its noise was drawn, and the error of the initial estimate is to be drawn."""

    def told(self, share: float) -> "DriveObservations":
        """Return the same observations with their stated covariances scaled by this share."""
        again, first = ([replace(looks, cov=share * looks.cov) for looks in part] for part in (self.again, self.first))
        return replace(self, again=tuple(again), first=tuple(first))


@dataclass(frozen=True, eq=False)
class Ridden:
    """The estimates of a back end along a drive."""

    estimated_world: Float[np.ndarray, "s 3"]
    """Estimate after each scan."""
    estimated_cov: Float[np.ndarray, "s 3 3"]
    joint: Joint
    """Pose and all lines after the last scan."""
    true_poses_world: Float[np.ndarray, "s 3"]
    true_lines_world: Float[np.ndarray, "m 2"]
    from_start_world: Float[np.ndarray, "s 3"]
    """Estimates relative to the start, as in `scoring/from_start.py`."""
    from_start_cov: Float[np.ndarray, "s 3 3"]

    @property
    def pose_nees(self) -> Float[np.ndarray, " s"]:
        """NEES of the invariant pose error after each scan; raises LinAlgError for an invalid covariance."""
        errors = pose_errors(self.estimated_world, self.true_poses_world)
        return nees(errors, pose_covariances(self.estimated_world, self.estimated_cov))

    @property
    def pose_nees_from_start(self) -> Float[np.ndarray, " s"]:
        """NEES of the pose relative to the start after each scan; raises LinAlgError likewise."""
        errors = pose_errors(self.from_start_world, self.true_poses_world)
        return nees(errors, pose_covariances(self.from_start_world, self.from_start_cov))

    @property
    def map_anees(self) -> float:
        """ANEES of all lines after the last scan, after gauge alignment; raises LinAlgError likewise."""
        means, cov = self.joint.mean[POSE:].reshape(-1, 2), self.joint.cov[POSE:, POSE:]
        return own_gauge(means, cov, self.joint.anchors, self.true_lines_world).anees or 0.0


def observations_of(run: RecordedRun, perfect_extraction: bool) -> DriveObservations:
    """Return the observations of a recorded run, as the mapper hands them to any back end with true association.

    Raises UsageError for a world that cannot be loaded.
    """
    trial, recording, scanner = run.trial, run.recording, run.trial.robot.scanner
    poses_world = scanner_poses(run.true_poses_world, trial.robot.true_scanner)
    reported = [
        odometry_of_scanner(Odometry(*each), scanner)
        for each in zip(recording.odometry, recording.odometry_cov, strict=True)
    ]
    world = load_world(trial.world, trial.start, trial.drawing)
    chance = chance_in(world, trial.seed)
    witness = Witness(truth_of(world, trial.robot), poses_world, run.true_face_of_beam)
    extractor = PerfectExtraction(witness, chance) if perfect_extraction else extract
    mapper = of_true_lines(trial.mission.mapper) if perfect_extraction else trial.mission.mapper
    rules, extraction = mapper.walls.reliability, mapper.extraction
    true_lines: dict[int, np.ndarray] = {}
    again, first = [], []
    for k in range(len(recording)):
        scan = recording.scan(k)
        witness.at = k
        segments = sure_pieces(extractor(scan, extraction), scan, extraction)
        faces = witness.faces(segments)
        walls = np.where(faces >= 0, witness.truth.walls[faces], -1)
        known = np.isin(walls, list(true_lines))
        seen = np.flatnonzero(known)
        rest = np.flatnonzero(~known)
        begun = rest[begins_a_line(walls[rest], segments.beam_counts[rest], set(true_lines))]
        begun = begun[~segments.is_tentative[begun]]
        looks = _looks(segments, walls).take(seen)
        again.append(replace(looks, cov=as_told(looks.cov, segments.take(seen), rules)))
        first.append(_looks(segments, walls).take(begun))
        true_lines |= zip(walls[begun].tolist(), witness.truth.lines[faces[begun]], strict=True)
    motions, covs = np.array([each.motion for each in reported]), np.array([each.cov for each in reported])
    return DriveObservations(motions, covs, tuple(again), tuple(first), poses_world, true_lines, chance)


def _looks(segments: Segments, walls: Int[np.ndarray, " n"]) -> ScanObservations:
    return ScanObservations(walls, segments.lines, segments.cov, seen_centres(segments, np.arange(len(segments))))


def ride(backend: Backend, drive: DriveObservations, from_start: FromStart = as_it_is) -> Ridden:
    """Run a back end without lines along a drive and return its estimates."""
    line_of_wall: dict[int, int] = {}
    poses, covs, relative = [], [], []
    for k, (again, first) in enumerate(zip(drive.again, drive.first, strict=True)):
        if k:
            backend.predict(Odometry(drive.odometry[k], drive.odometry_cov[k]))
        ids = np.array([line_of_wall[wall] for wall in again.walls.tolist()], dtype=np.int64)
        seen = Observations(ids, again.lines, again.cov)
        backend.update(seen, seen)
        if len(first):
            new = backend.grow(first.lines, first.cov, first.centres)
            line_of_wall |= zip(first.walls.tolist(), new.tolist(), strict=True)
        belief = backend.belief
        poses.append(belief.pose_world)
        covs.append(belief.pose_cov)
        relative.append(from_start(belief))
    joint = backend.belief.joint(np.array(sorted(line_of_wall.values()), dtype=np.int64))
    wall_of_line = {line: wall for wall, line in line_of_wall.items()}
    truth = np.array([drive.true_lines_world[wall_of_line[line]] for line in sorted(wall_of_line)]).reshape(-1, 2)
    known = (np.array([each[k] for each in relative]) for k in (0, 1))
    return Ridden(np.array(poses), np.array(covs), joint, drive.true_poses_world, truth, *known)
