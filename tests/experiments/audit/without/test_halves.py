"""Two estimates of one drive against each other: only overconfidence can be told, and no shared error."""

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.consistency import OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.auditing import audit
from chainslam.experiments.library.audit.verdicts import TOO_FEW
from chainslam.experiments.usage import UsageError

from ..written import in_space, tum

COV = np.array([[0.04, 0.01, 0.0], [0.01, 0.02, 0.001], [0.0, 0.001, 0.003]])
T = 0.1 * np.arange(400)
TRUE = np.column_stack([5.0 * np.cos(0.05 * T), 5.0 * np.sin(0.05 * T), 0.05 * T])


def half(path, seed, told=1.0, shared=0.0, times=T):
    rng = np.random.default_rng(seed)
    poses = np.column_stack([np.interp(times, T, axis) for axis in TRUE.T])
    poses = poses + shared + rng.multivariate_normal(np.zeros(3), COV, len(times))
    return tum(path, times, poses, np.tile(told * COV, (len(times), 1, 1)))


def test_only_overconfidence_is_told(tmp_path, capsys):
    right = [half(tmp_path / name, seed) for seed, name in enumerate(("a", "b"))]
    [found] = audit(right, halves=True).trajectories
    assert found.verdict.words == TOO_FEW
    assert found.pose.low < 1.0 < found.pose.high
    assert found.covs[0] == pytest.approx(2.0 * COV)
    wrong = [half(tmp_path / name, seed, told=0.25) for seed, name in enumerate(("c", "d"))]
    assert main(["audit", *map(str, wrong), "--halves"]) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"c against d: {OVERCONFIDENT} by a factor of ")
    assert "ANEES at least" in told
    assert "an error that both share cannot be seen" in told
    assert audit(wrong, halves=True).trajectories[0].verdict.factor == pytest.approx(2.0, rel=0.1)


def test_too_large_covariances_and_shared_errors_are_not_told(tmp_path):
    for words in ({"told": 9.0}, {"shared": 3.0}):
        paths = [half(tmp_path / name, seed, **words) for seed, name in enumerate(("a", "b"))]
        assert audit(paths, halves=True).trajectories[0].verdict.words == TOO_FEW


def test_the_second_is_interpolated(tmp_path):
    paths = half(tmp_path / "a", 0, told=0.25), half(tmp_path / "b", 1, told=0.25, times=T[:-1] + 0.05)
    [found] = audit(paths, halves=True).trajectories
    assert found.verdict.words == OVERCONFIDENT
    assert found.pose.count == 398
    assert "b is interpolated; 2 of 400 poses have no time in it" in found.notes


def test_covariances_that_are_none_are_left_out(tmp_path):
    paths = [half(tmp_path / name, seed) for seed, name in enumerate(("a", "b"))]
    table = np.loadtxt(paths[1])
    table[10:13, 8:] = 0.0
    np.savetxt(paths[1], table)
    assert audit(paths, halves=True).trajectories[0].pose.count == 397


def test_halves_in_space_have_the_same_errors(tmp_path):
    paths = []
    for seed, name in enumerate(("a", "b")):
        table = np.loadtxt(half(tmp_path / name, seed))
        wide = in_space(np.tile(COV, (len(T), 1, 1)))
        wide[:, [2, 3, 4], [2, 3, 4]] = 0.1
        upper = np.triu_indices(6)
        np.savetxt(tmp_path / name, np.column_stack([table[:, :8], wide[:, upper[0], upper[1]]]), fmt="%.17g")
        paths.append(tmp_path / name)
    flat, found = (audit(paths, halves=True, space=each).trajectories[0] for each in ("plane", "space"))
    assert 6.0 * found.pose.anees == pytest.approx(3.0 * flat.pose.anees, rel=1e-6)


def test_other_than_two_are_refused(tmp_path):
    path = half(tmp_path / "a", 0)
    with pytest.raises(UsageError, match="expected two trajectories for --halves, found 1"):
        audit(path, halves=True)
    late = half(tmp_path / "late", 1, times=T + 1000.0)
    with pytest.raises(UsageError, match="expected a common time"):
        audit([path, late], halves=True)
