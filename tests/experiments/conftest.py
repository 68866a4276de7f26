"""A square building with a square pillar, and a scripted mission whose map is the truth but for known errors."""

import networkx as nx
import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.goals.decider import Decision
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.sim.worlds import World
from chainslam.slam.association.matching import NO_MATCHES
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.geometry.poses import to_robot
from chainslam.slam.map.chains import Chain, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import MotionCommand, Odometry


def square(low, high):
    return [(low, low), (high, low), (high, high), (low, high)]


@pytest.fixture(scope="session")
def world():
    free = shapely.Polygon(square(0.0, 5.0), [square(2.2, 2.8)[::-1]])
    return World("square", free, np.array([1.0, 1.0, 0.0]), {"A": (0.0, 0.0), "B": (5.0, 0.0)})


def map_of(faces, pose, cov_line=1e-4, tentative=None, ids=None):
    """Return walls that are these faces, one line each, anchored in their middles."""
    lines, anchors = through(faces), faces.mean(axis=1)
    d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    means = np.stack([lines[:, 0], d], axis=-1)
    half = 0.5 * np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    ids = np.arange(len(faces)) if ids is None else ids
    mean = np.concatenate([pose, means.ravel()])
    cov = np.diag(np.concatenate([np.full(3, 1e-4), np.full(2 * len(faces), cov_line)]))

    def query(wanted):
        rows = np.searchsorted(ids, wanted)
        index = np.concatenate([np.arange(3), (3 + 2 * rows[:, None] + np.arange(2)).ravel()])
        return Joint(mean[index], cov[np.ix_(index, index)], anchors[rows])

    belief = Belief(np.asarray(pose), cov[:3, :3], ids, anchors, means, query)
    marks = np.zeros(len(faces), dtype=bool) if tentative is None else tentative
    return StochasticMap(
        belief, np.stack([-half, half], axis=-1), np.full(len(faces), 5), marks, np.zeros(len(faces), bool)
    )


def segments_of(scan, faces_of_beams, faces, pose):
    """Return one segment for each run of five beams or more on one face, and the face of each."""
    breaks = np.flatnonzero(np.diff(faces_of_beams)) + 1
    runs = [run for run in np.split(np.arange(len(faces_of_beams)), breaks) if len(run) >= 5]
    runs = [run for run in runs if faces_of_beams[run[0]] >= 0]
    owners = np.array([faces_of_beams[run[0]] for run in runs], dtype=np.int64)
    ends = to_robot(faces[owners], pose)
    beams = np.array([[run[0], run[-1]] for run in runs], dtype=np.int64).reshape(-1, 2)
    count = beams[:, 1] - beams[:, 0] + 1
    cov = np.tile(1e-6 * np.eye(2), (len(runs), 1, 1))
    apart = np.zeros((len(runs), 2), dtype=bool)
    return Segments(through(ends), cov, ends, beams, count, apart, np.zeros(len(runs)), count < 5), owners


def chains_of(faces, rings, closed=True):
    """Return a chain for each ring."""
    chains = []
    for ring in np.unique(rings):
        rows = np.flatnonzero(rings == ring)
        ids = tuple(int(row) for row in rows)
        if closed:
            chains.append(Chain(ids, faces[rows, 1], ()))
        else:
            ends = (OpenEnd(ids[0], 0, faces[rows[0], 0]), OpenEnd(ids[-1], 1, faces[rows[-1], 1]))
            chains.append(Chain(ids, faces[rows[:-1], 1], ends))
    return tuple(chains)


def scripted(scenario, commands=None, closed=True, fail_at=None, error=RuntimeError):
    """Yield steps of a mission that drives a script; its map is the truth, its pose the odometry's."""
    from chainslam.slam.geometry.poses import compose

    commands = commands or [MotionCommand(0.15, 0.0)] * 18
    faces, rings = scenario.world.faces, scenario.world.face_rings
    pose, odometry, length = scenario.start_estimate.copy(), Odometry(np.zeros(3), np.zeros((3, 3))), 0.0
    for index in range(len(commands) + 1):
        if index == fail_at:
            raise error("the estimator lost its mind")
        scan = scenario.robot.sense()
        beams = scenario.robot.record.faces_of_beams[-1]
        segments, owners = segments_of(scan, beams, faces, pose)
        last = index == len(commands)
        command = None if last else commands[index]
        yield Step(
            index=index, time_s=scan.time_s, odometry=odometry, scan=scan, segments=segments, matches=NO_MATCHES,
            walls_of_segments=owners, map=map_of(faces, pose), chains=chains_of(faces, rings, closed),
            free_space=FreeSpace(), graph=nx.DiGraph(), path_length_m=length, seconds=0.001, planning_seconds=0.0005,
            decision=Decision(command, "as scripted", outcome=Outcome.ALL_CLOSED if last else None),
        )  # fmt: skip
        if not last:
            odometry = scenario.robot.drive(commands[index])
            pose = compose(pose, odometry.motion)
            length += float(np.hypot(*odometry.motion[:2]))


@pytest.fixture
def scripted_mission():
    return scripted


@pytest.fixture
def make_map():
    return map_of


@pytest.fixture
def make_chains():
    return chains_of


@pytest.fixture(scope="module")
def _strict_rerun():
    """Let rerun raise where it would only warn."""
    import rerun as rr

    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)
