"""What one step costs the factor graph in a large building: 750 lines, 5,000 steps, 3.3 lines seen a step.

Times are the process's own, so that a busy machine counts for less (its cold caches still count).
"""

import multiprocessing
import resource
import time
from pathlib import Path

import jaxtyping
import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Backend, Observations
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import compose, to_robot, wrap
from chainslam.slam.robot import Odometry

SIGMAS = np.array([0.01, 0.005])
ODOMETRY_COV = np.diag([0.008, 0.003, 0.01]) ** 2
LANE_M, STEP_M, RANGE_M = 4.0, 0.15, 3.5


def lawnmower(steps: int) -> np.ndarray:
    """Return true motions up and down a square field, along parallel lanes."""
    side = int(np.sqrt(steps * LANE_M / STEP_M)) + 1
    turn, motions, sign = np.pi / 20, list[list[float]](), 1.0
    while len(motions) < steps:
        motions += [[STEP_M, 0.0, 0.0]] * side
        arc = [[LANE_M * np.pi / 40, 0.0, sign * turn]] * 20
        motions += arc
        sign = -sign
    return np.array(motions[:steps])


def drive(backend: Backend, steps: int, lines: int, near: int = 10, seed: int = 1) -> np.ndarray:
    """Drive `steps` steps past `lines` lines; return rows (update s, gating s) of every step."""
    rng = np.random.default_rng(seed)
    motions = lawnmower(steps)
    poses = [np.zeros(3)]
    for motion in motions:
        poses.append(compose(poses[-1], motion + np.sqrt(np.diag(ODOMETRY_COV)) * rng.standard_normal(3)))
    path = np.array(poses)
    at = path[rng.integers(0, len(path), lines), :2] + rng.uniform(-2.5, 2.5, (lines, 2))
    alpha = rng.choice([0.0, 0.5, 1.0, 1.5], lines) * np.pi + rng.normal(0, 0.05, lines)
    ids = np.full(lines, -1)
    spent = np.zeros((steps, 2))
    for k, motion in enumerate(motions):
        true = path[k + 1]
        backend.predict(Odometry(motion, ODOMETRY_COV))
        ahead = at - true[:2]
        seen = np.flatnonzero((np.hypot(*ahead.T) < RANGE_M) & (np.sum(ahead * normals(alpha), axis=-1) > 0.1))
        seen = seen[rng.permutation(len(seen))[: rng.integers(2, 6)]]
        known, new = seen[ids[seen] >= 0], seen[ids[seen] < 0]
        begin = time.process_time()
        belief = backend.belief
        order = np.argsort(np.hypot(*(belief.anchors - belief.pose_world[:2]).T))[:near]
        belief.joint(belief.ids[order])
        spent[k, 1] = time.process_time() - begin
        begin = time.process_time()
        for rows in (known, new):
            if len(rows):
                z, cov, centres = look(true, at[rows], alpha[rows], rng)
                if rows is known:
                    observed = Observations(ids[rows], z, cov)
                    backend.update(observed, observed)
                else:
                    ids[rows] = backend.grow(z, cov, centres)
        assert len(backend.belief.means) == np.count_nonzero(ids >= 0)
        spent[k, 0] = time.process_time() - begin
    error = wrap(backend.belief.pose_world - path[-1])
    print(f"\nlast pose off by {np.hypot(*error[:2]):.3f} m, {np.rad2deg(error[2]):.2f} degrees")
    return spent


def look(
    pose: np.ndarray, at: np.ndarray, alpha: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lines, covariances and centres, robot frame, of lines seen about points `at`."""
    seen = wrap(alpha - pose[2])
    centres = to_robot(at, pose)
    turn = np.repeat(np.eye(2)[None], len(at), axis=0)
    turn[:, 1, 0] = np.sum(centres * directions(seen), axis=-1)
    z = np.stack([seen, np.sum(centres * normals(seen), axis=-1)], axis=-1)
    z += np.einsum("mij,mj->mi", turn * SIGMAS, rng.standard_normal((len(at), 2)))
    return z, (turn * SIGMAS**2) @ turn.swapaxes(1, 2), centres


@pytest.mark.parametrize(("steps", "lines"), [(500, 75), (5000, 750)])
def test_a_step_of_the_graph(benchmark, steps, lines):
    backend = BACKENDS["graph"].make(np.zeros(3), np.diag([0.01, 0.01, 0.002]) ** 2)
    spent = benchmark.pedantic(drive, args=(backend, steps, lines), rounds=1)
    for name, ms in zip(("update", "gating"), 1e3 * spent[-steps // 2 :].T, strict=True):
        mean, p95, worst = ms.mean(), np.quantile(ms, 0.95), ms.max()
        benchmark.extra_info[name] = {"mean_ms": mean, "p95_ms": p95, "max_ms": worst}
        print(f"{lines} lines, {steps} steps, second half: {name} mean {mean:.2f} p95 {p95:.2f} max {worst:.1f} ms")


def _resident_mb(steps: int, lines: int) -> float:
    """Return by how much a drive raises the resident memory, MB: GTSAM's own allocations included."""
    jaxtyping.config.update("jaxtyping_disable", True)
    drive(BACKENDS["graph"].make(np.zeros(3), 1e-4 * np.eye(3)), 20, 5)
    before = _resident_pages()
    backend = BACKENDS["graph"].make(np.zeros(3), 1e-4 * np.eye(3))
    drive(backend, steps, lines)
    return (_resident_pages() - before) * resource.getpagesize() / 2**20


def _resident_pages() -> int:
    """Return what is resident now: the highest so far, which getrusage gives, is inherited from the parent."""
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.parametrize(("steps", "lines"), [(500, 75), (1500, 75), (1500, 225)])
def test_memory_of_the_graph(benchmark, steps, lines):
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        benchmark.extra_info["resident_mb"] = benchmark.pedantic(pool.apply, (_resident_mb, (steps, lines)), rounds=1)
    print(f"\n{lines} lines, {steps} steps: {benchmark.extra_info['resident_mb']:.0f} MB")
