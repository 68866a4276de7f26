"""Triangles of relations alone: how large their error is, whether it is as stated, and which do not close."""

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.consistency import OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.auditing import audit
from chainslam.experiments.library.audit.without.triangles import closures
from chainslam.experiments.scoring.without_truth.references import read_relations
from chainslam.experiments.scoring.without_truth.relation_noise import sigmas_of_relations
from chainslam.experiments.usage import UsageError
from chainslam.slam.geometry.poses import compose, inverse

SIGMAS = np.array([0.03, 0.03, 0.01])


def relations(path, groups=60, seed=0, wrong=0.0):
    """Write all relations in groups of four poses each, which close four triangles."""
    rng, rows = np.random.default_rng(seed), []
    for group in range(groups):
        poses = rng.uniform(-2.0, 2.0, (4, 3))
        for i in range(4):
            for j in range(i + 1, 4):
                z = compose(compose(inverse(poses[i]), poses[j]), SIGMAS * rng.standard_normal(3))
                z[0] += wrong * (group == 7 and (i, j) == (0, 3))
                rows.append([10.0 * group + i, 10.0 * group + j, z[0], z[1], 0, 0, 0, z[2]])
    np.savetxt(path, rows, fmt="%.17g")
    return path


def test_a_true_sigma_is_rarely_rejected_and_half_of_it_always(tmp_path):
    outside = []
    for seed in range(40):
        path = relations(tmp_path / "r", seed=seed)
        right, half = closures(path, (0.03, 0.01)), closures(path, (0.015, 0.005))
        low, high = right.interval
        outside.append(low > 1.0 or high < 1.0)
        assert half.verdict.words == OVERCONFIDENT
        assert half.verdict.factor == pytest.approx(2.0, rel=0.2)
        assert right.effective_dof < 3 * 240
    assert sum(outside) <= 6


def test_the_sigma_that_triangles_tell_is_right_in_the_mean_with_a_relation_wrong_or_none(tmp_path):
    for wrong in (0.0, 2.0):
        found = [
            sigmas_of_relations(read_relations(relations(tmp_path / "r", seed=seed, wrong=wrong))) for seed in range(40)
        ]
        assert np.mean([each.translation_m for each in found]) == pytest.approx(0.03, rel=0.017)
        assert np.mean([each.rotation_rad for each in found]) == pytest.approx(0.01, rel=0.017)


def test_the_command_estimates_the_sigma_and_names_what_does_not_close(tmp_path, capsys):
    path = relations(tmp_path / "r", wrong=2.0)
    assert main(["audit", "--relations", str(path), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "estimated from their triangles" in told
    assert "2 triangles do not fit" in told
    assert "70.00, 71.00 and 73.00 s" in told
    assert "consistent" not in told
    [record] = audit([], relations=path).record()["without_truth"]
    assert record["verdict"] is None
    assert record["interval"] is None
    assert "70.00, 72.00 and 73.00 s" in (tmp_path / "out" / "report.html").read_text()
    assert main(["audit", "--relations", str(path), "--reference-sigma", "0.03", "0.01"]) == 0
    assert "estimated from the triangles it is 0.0" in capsys.readouterr().out


def test_relations_without_triangles_are_refused(tmp_path):
    (tmp_path / "r").write_text("0 1 1 0 0 0 0 0\n1 2 1 0 0 0 0 0\n")
    with pytest.raises(UsageError, match=r"at least 10 triangles .* found 0: give a trajectory"):
        audit([], relations=tmp_path / "r")
    (tmp_path / "degrees").write_text("0 1 1 0 0 0 0 90\n")
    with pytest.raises(UsageError, match="in radians in degrees, found 90"):
        audit([], relations=tmp_path / "degrees")
    (tmp_path / "degrees").write_text("0 1 1 0 0 0 0 7\n")
    with pytest.raises(UsageError, match="in radians in degrees, found 7"):
        audit([], relations=tmp_path / "degrees")
    with pytest.raises(UsageError, match="correct it"):
        audit([], relations=tmp_path / "r", reference_sigma=(-1.0, 0.1))
