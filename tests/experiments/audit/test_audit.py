"""`chainslam audit` as a user meets it."""

import json

import numpy as np
import pytest

import chainslam
from chainslam.experiments.campaign.comparison.consistency import OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.verdicts import TOO_FEW
from chainslam.experiments.scoring.without_truth.relation_noise import adjoint_of_inverse
from chainslam.experiments.scoring.without_truth.relations import between
from chainslam.slam.evaluation.consistency import nees

from .drives import Drive, drives
from .written import tum, written

RUNS = drives(3, 400, seed=11)


def test_a_trajectory_gets_a_verdict_in_a_few_lines(tmp_path, capsys):
    estimated, true = written(tmp_path, RUNS[0], covs=RUNS[0].covs / 9.0)
    assert main(["audit", str(estimated), "--truth", str(true)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert 3 <= len(told) <= 6
    assert told[0].startswith("a.tum: overconfident by a factor of ")
    assert "error over stated sigma" in told[0]
    assert "additive error of x, y and heading, by default" in told[2]
    assert main(["audit", str(estimated), "--truth", str(true), "--json"]) == 0
    [record] = json.loads(capsys.readouterr().out)["trajectories"]
    assert record["verdict"] == OVERCONFIDENT
    assert record["factor"] == pytest.approx(3.0, rel=0.15)
    low, high = record["factor_interval"]
    assert low < record["factor"] < high
    assert set(record["coverage"]) == {"0.5", "0.9", "0.95", "0.99"}


def test_the_function_says_what_the_command_says(tmp_path, capsys):
    estimated, true = written(tmp_path, RUNS[0])
    found = chainslam.audit(estimated, truth=true, error="body", align="start")
    words = ["audit", str(estimated), "--truth", str(true), "--error", "body", "--align", "start"]
    assert main(words) == 0
    assert capsys.readouterr().out == repr(found) + "\n"
    assert list(found.asked) == ["chainslam", *words]


def test_the_report_has_all_of_it_and_its_command_makes_it_again(tmp_path, capsys):
    estimated, true = written(tmp_path, RUNS[0])
    words = ["audit", str(estimated), "--truth", str(true)]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    assert "report in" in capsys.readouterr().out
    page = (tmp_path / "out" / "report.html").read_text()
    for part in ("NEES of the pose", "95 % region", "Relative poses", "at least", f"chainslam audit {estimated}"):
        assert part in page
    kept = json.loads((tmp_path / "out" / "audit.json").read_text())
    assert kept["format"] == 1
    assert kept["trajectories"] == json.loads(
        json.dumps(chainslam.audit(estimated, truth=true).record()["trajectories"])
    )
    assert r"\toprule" in (tmp_path / "out" / "tables.tex").read_text()


def test_runs_with_a_truth_each_are_pooled_and_estimators_of_one_drive_compared(tmp_path):
    paths = [written(tmp_path, run, name) for name, run in zip("abc", RUNS, strict=True)]
    pooled = chainslam.audit([path for path, _ in paths], truth=[true for _, true in paths])
    assert pooled.pooled is not None
    assert pooled.pooled.runs == 3
    assert pooled.pooled.mean == pytest.approx(np.mean([each.pose.anees for each in pooled.trajectories]))
    assert pooled.pairs == ()
    assert pooled.verdict[-1].startswith("3 runs together: ")
    half = tum(tmp_path / "half.tum", RUNS[0].time_s, RUNS[0].estimated, 0.5 * RUNS[0].covs)
    [pair] = chainslam.audit([half, paths[0][0]], truth=paths[0][1]).pairs
    assert pair.ratio == pytest.approx(2.0)
    assert pair.interval == pytest.approx((2.0, 2.0))


def test_without_anything_to_compare_with_one_line_says_what_to_give(tmp_path, capsys):
    estimated, true = written(tmp_path, RUNS[0])
    for words, told in (
        ([], "expected a trajectory with covariances, found none"),
        ([str(estimated)], "give --truth FILE, --reference FILE or --relations FILE"),
        ([str(estimated), "--truth", str(true), "--reference", str(true)], "expected one of --truth, --reference"),
        ([str(estimated), "--truth", str(true), str(true), str(true)], "one for each of 1 trajectories, found 3"),
        ([str(estimated), "--truth", str(tmp_path / "none")], "name a file that exists"),
        ([str(true), "--truth", str(true)], "append 6 columns xx xy xt yy yt tt"),
        ([str(estimated), "--truth", str(true), "--reference-sigma", "0.1", "0.1"], "found no reference"),
        ([str(tmp_path), "--truth", str(true)], "without steps.csv"),
        ([str(estimated), str(estimated), "--truth", str(true)], "2 times: name it once"),
        ([str(estimated), "--truth", str(estimated)], "the same poses: name the truth"),
        ([str(estimated), "--truth", str(true), "--topic", "/pose"], "expected --topic beside a ROS bag"),
        ([str(estimated), "--truth", str(true), "--truth-topic", "/pose"], "expected --truth-topic beside a ROS bag"),
        (
            [str(estimated), f"{estimated.parent}/../{estimated.parent.name}/{estimated.name}", "--truth", str(true)],
            "2 times: name it once",
        ),
        ([str(estimated), "--relations", str(true), "--nearest", "0.1"], "expected --nearest beside --truth"),
        ([str(tmp_path / "none.g2o"), "--error", "body"], "expected --error beside poses"),
        ([str(tmp_path / "none.g2o"), "--align", "start"], "expected --align beside --truth"),
        ([str(estimated), "--relations", str(true), "--align", "start"], "expected --align beside --truth"),
        (["--relations", str(true), "--error", "body"], "expected --error beside poses"),
        ([str(tmp_path / "none.bag"), "--truth", str(true)], "expected a bag, found none at"),
    ):
        assert main(["audit", *words]) == 2
        said = capsys.readouterr().err
        assert told in said
        assert len(said.strip().splitlines()) == 1


def test_the_error_of_a_reference_is_added(tmp_path):
    rng, drive = np.random.default_rng(1), RUNS[0]
    estimated, _ = written(tmp_path, drive)
    sigmas = np.array([0.3, 0.3, 0.1])
    measured = drive.true + sigmas * rng.standard_normal(drive.true.shape)
    path = tum(tmp_path / "r.tum", drive.time_s, measured)
    assert chainslam.audit(estimated, reference=path).trajectories[0].verdict.words == OVERCONFIDENT
    told = chainslam.audit(estimated, reference=path, reference_sigma=(0.3, 0.1)).trajectories[0]
    assert told.pose.low < 1.0 < told.pose.high


def test_relations_tell_overconfidence_and_nothing_else_while_the_correlation_of_poses_is_unknown(tmp_path):
    drive = RUNS[0]
    rows = []
    for i in range(0, 380, 5):
        one, other = drive.true[i], drive.true[i + 20]
        c, s = np.cos(one[2]), np.sin(one[2])
        dx, dy = (other - one)[:2]
        rows.append(
            [drive.time_s[i], drive.time_s[i + 20], c * dx + s * dy, c * dy - s * dx, 0, 0, 0, other[2] - one[2]]
        )
    np.savetxt(tmp_path / "relations", rows)
    right, _ = written(tmp_path, drive)
    wrong = tum(tmp_path / "b.tum", drive.time_s, drive.estimated, drive.covs / 100.0)
    found = chainslam.audit([right, wrong], relations=tmp_path / "relations")
    assert [each.verdict.words for each in found.trajectories] == [TOO_FEW, OVERCONFIDENT]
    assert all(each.is_bound for each in found.trajectories)
    assert "at least" in repr(found)


def test_relative_poses_have_twice_the_covariances_of_both(tmp_path):
    drive = RUNS[0]
    estimated, true = written(tmp_path, drive)
    first, second, *_ = chainslam.audit(estimated, truth=true, error="body").trajectories[0].lags
    assert (first.steps, second.steps) == (1, 10)
    assert first.is_bound
    for lag in (first, second):
        k = lag.steps
        motions = between(drive.estimated[:-k], drive.estimated[k:])
        off = between(between(drive.true[:-k], drive.true[k:]), motions)
        A = adjoint_of_inverse(motions)
        bound = 2.0 * (A @ drive.covs[:-k] @ A.swapaxes(1, 2) + drive.covs[k:])
        assert lag.score.anees == pytest.approx(np.mean(nees(off, bound)) / 3.0)
        assert lag.error_m == pytest.approx(np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1))))


def test_position_errors_are_those_of_evo(tmp_path):
    from evo.core.metrics import APE, PoseRelation, StatisticsType
    from evo.tools.file_interface import read_tum_trajectory_file

    estimated, true = written(tmp_path, RUNS[0])
    plain = tum(tmp_path / "plain.tum", RUNS[0].time_s, RUNS[0].estimated)
    ape = APE(PoseRelation.translation_part)
    ape.process_data((read_tum_trajectory_file(true), read_tum_trajectory_file(plain)))
    theirs = ape.get_statistic(StatisticsType.rmse)
    [record] = chainslam.audit(estimated, truth=true).record()["trajectories"]
    assert record["rms_position_m"] == pytest.approx(theirs, rel=1e-9)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    chainslam.explore("paper-fig4", seed=2, max_steps=40, backend="full-ekf", out=folder / "full-ekf")
    chainslam.replay(folder / "full-ekf", backend=["block-ekf", "full-ekf"], out=folder / "replay")
    return folder


def test_a_folder_of_ours_is_audited_against_its_own_truth(runs):
    [found] = chainslam.audit(runs / "full-ekf").trajectories
    summary = chainslam.load(runs / "full-ekf").summary
    assert found.from_start == summary["pose_anees_from_start"]
    assert found.pose.anees == pytest.approx(summary["pose_anees"], rel=0.02)
    assert found.pose.count == summary["steps"]


def test_back_ends_on_one_drive_are_compared_and_not_pooled(runs):
    found = chainslam.audit([runs / "replay" / name for name in ("block-ekf", "full-ekf")])
    assert found.pooled is None
    assert [(pair.first, pair.second) for pair in found.pairs] == [("block-ekf", "full-ekf")]


def test_a_drive_of_a_few_poses_is_refused(tmp_path):
    short = Drive(*(part[:5] for part in (RUNS[0].time_s, RUNS[0].true, RUNS[0].estimated, RUNS[0].covs)))
    estimated, true = written(tmp_path, short)
    with pytest.raises(chainslam.UsageError, match="expected at least 10 poses"):
        chainslam.audit(estimated, truth=true)
