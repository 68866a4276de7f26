"""All that a factor graph was told, as plain numbers: enough to build the graph again."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ...geometry.poses import compose
from ...robot import Odometry
from ..frame.frame import Frame

Seen = tuple[float, float, float, float, float]
"""One observation of a line: alpha rad, r m, C_alpha_alpha, C_alpha_r, C_r_r, in the robot frame."""
FORMAT = 1
"""Number of the form in which a record is stored; others are refused."""


def as_seen(lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"]) -> list[Seen]:
    """Return observations of lines (alpha, r), robot frame, as they are noted."""
    return [
        (alpha, r, along, cross, across)
        for (alpha, r), ((along, cross), (_, across)) in zip(lines.tolist(), cov.tolist(), strict=True)
    ]


@dataclass
class LineRecord:
    """One line and its observations."""

    anchor: Float[np.ndarray, "2"]
    """World frame, m."""
    observations: list[int] = field(default_factory=list)
    """Numbers of the observations that hold for it."""
    shown: bool = True
    """A line that was forgotten after several observations is no longer shown, but what it said of the rest stays."""


@dataclass
class Record:
    """Prior, odometry and observations in the order in which they came."""

    pose_world: Float[np.ndarray, "3"]
    pose_cov: Float[np.ndarray, "3 3"]
    lead: list[Odometry] = field(default_factory=list)
    """How the robot came from its start to pose 0, where its first wall came into sight: no scan says more of it."""
    motions: list[Float[np.ndarray, "3"]] = field(default_factory=list)
    """How the robot came to pose k + 1 from pose k."""
    motion_covs: list[Float[np.ndarray, "3 3"]] = field(default_factory=list)
    steps: list[int] = field(default_factory=lambda: [0])
    """Motions made after each prediction (a rest without any error makes none), none at the start."""
    seen_from: list[int] = field(default_factory=list)
    """Index of the pose of each observation."""
    seen: list[Seen] = field(default_factory=list)
    epsilons: list[float] = field(default_factory=list)
    """By how much each observation departed from its line where it was linearised, rad."""
    lines: dict[int, LineRecord] = field(default_factory=dict)
    """By id, ascending."""
    next_id: int = 0
    frame: Frame = field(init=False)
    """Where pose 0 lies in the world, as far as prior and odometry tell: everything in the map is relative to it."""

    def __post_init__(self) -> None:
        self.frame = Frame(self.pose_world, self.pose_cov)
        for odometry in self.lead:
            self.frame = self.frame.moved(odometry)

    def move(self, odometry: Odometry) -> None:
        """Note a motion; a rest without any error makes no new pose."""
        if np.any(odometry.motion) or np.any(odometry.cov):
            motion, cov = np.array(odometry.motion, dtype=np.float64), np.array(odometry.cov, dtype=np.float64)
            if self.next_id:
                self.motions.append(motion)
                self.motion_covs.append(cov)
            else:
                self.lead.append(Odometry(motion, cov))
                self.frame = self.frame.moved(self.lead[-1])
        self.steps.append(len(self.lead) + len(self.motions))

    def path_world(self, poses: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the pose at the start and after every prediction, given the poses from pose 0 on in its frame."""
        path = [self.pose_world]
        for odometry in self.lead:
            path.append(compose(path[-1], odometry.motion))
        path[-1:] = [compose(self.frame.pose_world, pose) for pose in poses]
        return np.array([path[k] for k in self.steps])

    def see(self, pose: int, line: int, seen: Seen) -> int:
        """Note an observation and return its number."""
        self.seen_from.append(pose)
        self.seen.append(seen)
        self.epsilons.append(0.0)
        self.lines[line].observations.append(len(self.seen) - 1)
        return len(self.seen) - 1

    def forget(self, observations: int, ids: int) -> None:
        """Forget all observations but the first so many, and the lines with larger ids."""
        del self.seen[observations:], self.seen_from[observations:], self.epsilons[observations:]
        self.lines = {line: known for line, known in self.lines.items() if line < ids}
        for known in self.lines.values():
            known.observations = [number for number in known.observations if number < observations]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return everything as plain arrays, fit for `numpy.savez`."""
        owner = np.full(len(self.seen), -1, dtype=np.int64)
        for line, record in self.lines.items():
            owner[record.observations] = line
        return {
            "format": np.array(FORMAT),
            "prior_pose_world": self.pose_world,
            "prior_cov": self.pose_cov,
            "odometry": np.array([o.motion for o in self.lead] + self.motions).reshape(-1, 3),
            "odometry_cov": np.array([o.cov for o in self.lead] + self.motion_covs).reshape(-1, 3, 3),
            "poses_of_steps": np.array(self.steps, dtype=np.int64),
            "first_pose": np.array(len(self.lead)),
            "seen_from": len(self.lead) + np.array(self.seen_from, dtype=np.int64),
            "seen": np.array(self.seen, dtype=np.float64).reshape(-1, 5),
            "seen_line": owner,
            "seen_epsilon": np.array(self.epsilons, dtype=np.float64),
            "line_ids": np.array(list(self.lines), dtype=np.int64),
            "line_anchors": np.array([line.anchor for line in self.lines.values()]).reshape(-1, 2),
            "line_shown": np.array([line.shown for line in self.lines.values()], dtype=bool),
            "next_id": np.array(self.next_id),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> "Record":
        """Return the record that `arrays` was made of; raises ValueError for another format."""
        if int(arrays["format"]) != FORMAT:
            raise ValueError(f"expected a graph saved in format {FORMAT}, found {int(arrays['format'])}: save it again")
        lines = {
            int(line): LineRecord(np.array(anchor), shown=bool(shown))
            for line, anchor, shown in zip(
                arrays["line_ids"], arrays["line_anchors"], arrays["line_shown"], strict=True
            )
        }
        for number, line in enumerate(arrays["seen_line"].tolist()):
            if line >= 0:
                lines[line].observations.append(number)
        first = int(arrays["first_pose"])
        motions, covs = list(np.array(arrays["odometry"])), list(np.array(arrays["odometry_cov"]))
        return cls(
            pose_world=np.array(arrays["prior_pose_world"]),
            pose_cov=np.array(arrays["prior_cov"]),
            lead=[Odometry(*both) for both in zip(motions[:first], covs[:first], strict=True)],
            motions=motions[first:],
            motion_covs=covs[first:],
            steps=arrays["poses_of_steps"].tolist(),
            seen_from=(arrays["seen_from"] - first).tolist(),
            seen=[tuple(row) for row in arrays["seen"].tolist()],
            epsilons=arrays["seen_epsilon"].tolist(),
            lines=lines,
            next_id=int(arrays["next_id"]),
        )
