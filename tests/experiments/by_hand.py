"""A run of three steps made by hand, for scores to be worked out by plain arithmetic."""

from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
from scipy.linalg import logm

from chainslam.experiments.scenario import Scenario, TrialConfig, build
from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.maps.coverage import alignment
from chainslam.experiments.scoring.records import Log, Sketch
from chainslam.experiments.scoring.summary import Ending, summarise
from chainslam.experiments.scoring.truth import truth_of
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.goals.decider import Decision
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.sim.robot import RobotConfig
from chainslam.slam.association.matching import NO_MATCHES
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.poses import inverse, to_world
from chainslam.slam.robot import Odometry, Scan

BEAMS = 36
TRUE = np.array([[1.0, 1.0, 0.0], [1.1, 1.5, 0.5], [1.2, 1.3, 3.1]])
OFF = np.array([[0.3, 0.4, 0.1], [0.0, 0.0, -0.1], [0.6, 0.0, 0.2]])
"""Their mean is far from zero: a score that takes it away tells another number."""
COVS = np.array([np.diag(d) for d in ([0.01, 0.02, 0.03], [0.3, 0.1, 0.2], [0.2, 0.3, 0.1])])
ENDING = Ending(Outcome.STEP_LIMIT, "a limit of 3 steps")
COVS[2, 0, 1] = COVS[2, 1, 0] = 0.05


@dataclass
class Run:
    """All that a summary is made of; a test changes what it is about."""

    scenario: Scenario
    log: Log
    votes: Votes
    step: Step
    joint: Joint | None
    ending: Ending
    sketches: tuple[Sketch, ...] = ()

    def summary(self):
        return summarise(self.scenario, self.log, self.votes, self.step, self.joint, self.ending, self.sketches)


def log_of(estimated=None, **changes):
    estimated = TRUE + OFF if estimated is None else estimated
    kept = {
        "time_s": np.arange(3.0),
        "bearings_rad": np.linspace(-np.pi, np.pi, BEAMS, endpoint=False),
        "ranges_m": np.full((3, BEAMS), 0.5), "sigma_m": np.full(BEAMS, 0.01), "sigma_share": 0.0, "range_max_m": 4.0,
        "resolution_m": 0.0,
        "odometry": np.array([[9.0, 9.0, 9.0], [0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]), "odometry_cov": np.zeros((3, 3, 3)),
        "touched": np.zeros(3, bool),
        "estimated_world": estimated, "estimated_cov": COVS,
        "true_world": TRUE,
        "face_of_beam": np.full((3, BEAMS), -1), "path_length_m": np.array([0.0, 0.1, 0.25]),
        "open_ends": np.array([1, 2, 4]), "lines": np.array([3, 3, 3]), "tentative": np.array([0, 0, 1]),
        "closed_chains": np.array([0, 0, 1]), "set_aside": np.zeros(3, int), "seconds": np.array([0.006, 0.001, 0.002]),
        "planning_seconds": np.array([0.0005, 0.0001, 0.0003]), "nis": np.zeros(3), "nis_dof": np.zeros(3, int),
        "unstated_motion": np.zeros(3, bool), "is_lost": np.zeros(3, bool), "wheel_noise_factor": np.ones(3),
        "route_walls": np.zeros(3, int), "reasons": ("", "", ""), "behaviours": ("look", "look", "look"),
    }  # fmt: skip
    kept |= changes
    kept = {"from_start_world": kept["estimated_world"], "from_start_cov": kept["estimated_cov"]} | kept
    none = np.zeros(len(kept["ranges_m"]), int)
    kept = {"curved_beams": none, "own_beams": none} | kept
    heard = {"heard": kept["odometry"], "heard_cov": kept["odometry_cov"]}
    return Log(scan_start_s=kept["time_s"] - 0.1, **heard, **kept)


def step_of(walls, chains, **changes):
    scan = Scan(np.linspace(-np.pi, np.pi, BEAMS, endpoint=False), np.full(BEAMS, 0.5), 0.01, 4.0, 0.0)
    none = np.zeros((0, 2))
    segments = Segments(none, np.zeros((0, 2, 2)), np.zeros((0, 2, 2)), none.astype(int), np.zeros(0, int),
                        none > 0, np.zeros(0), np.zeros(0, bool))  # fmt: skip
    kept = {
        "index": 2, "time_s": 2.0, "odometry": Odometry(np.zeros(3), np.zeros((3, 3))), "scan": scan,
        "segments": segments, "matches": NO_MATCHES, "walls_of_segments": np.zeros(0, int), "map": walls,
        "chains": chains, "free_space": FreeSpace(), "graph": nx.DiGraph(), "path_length_m": 0.25, "seconds": 0.0,
        "planning_seconds": 0.0, "decision": Decision(None, "", outcome=Outcome.STEP_LIMIT),
    }  # fmt: skip
    return Step(**(kept | changes))


def true_map(world, make_map, make_chains):
    """The true faces as a map, in a frame that is off by the start's error; every line labelled with its own face."""
    truth = truth_of(world, RobotConfig())
    scenario = build(TrialConfig("square", seed=4, p0="large"), world)
    back = inverse(alignment(scenario.start_estimate, TRUE[0]))
    walls = make_map(to_world(truth.faces, back), np.array([1.8, 1.3, -3.0]))
    votes = Votes(truth, {k: 10 * np.eye(len(truth.faces), dtype=np.int64)[k] for k in range(len(truth.faces))})
    chains = make_chains(to_world(truth.faces, back), truth.rings)
    return Run(scenario, log_of(), votes, step_of(walls, chains), walls.belief.joint(walls.ids), ENDING)


def marked(run, **marks):
    """The run with some walls marked as tentative or crooked."""
    walls = run.step.map
    rows = {name: np.isin(np.arange(len(walls)), which) for name, which in marks.items()}
    return replace(run, step=replace(run.step, map=replace(walls, **rows)))


def matrix(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def xi_of(estimated, true):
    """The error of a pose by the logarithm of matrices: X_est = Exp(xi) X_true."""
    log = np.real(logm(matrix(estimated) @ np.linalg.inv(matrix(true))))
    return np.array([log[0, 2], log[1, 2], log[1, 0]])
