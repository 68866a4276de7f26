"""Offline refinement of a real robot's log after its drive: path and map from all scans together."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from chainslam.explore.certificate import certify
from chainslam.explore.step import Step
from chainslam.slam.association.second_looks.closures import Drive
from chainslam.slam.association.second_looks.refuted import Rays
from chainslam.slam.association.second_looks.second_looks import Survey, second_looks
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.visible_extent import sure_pieces
from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.chains import connect
from chainslam.slam.odometry.scan_matching import returns_within
from chainslam.slam.robot import Scan

from ..scenario import TrialConfig
from ..scoring.records import Log
from ..scoring.without_truth.certificate import certificate_record
from ..scoring.without_truth.doubles import doubles
from ..scoring.without_truth.smoothing import Smoothed
from ..trial import TrialResult


def looked_again(result: TrialResult) -> TrialResult:
    """Return a result whose smoothed path and map come from offline refinement.

    They only depend on scans and odometry, and are the same for every back end.
    """
    log, last, recorded = result.log, result.last, result.recorded
    if log is None or last is None or recorded is None:
        return result
    scans = [recorded.recording.scan(k) for k in range(len(log))]
    return _mapped(result, last, surveyed(scans, log, result.scenario.config))


def surveyed(scans: Sequence[Scan], log: Log, config: TrialConfig) -> Survey:
    """Return the solution for all scans of a drive, in the frame of its first estimated pose."""
    mission, on_body = config.mission, config.robot.scanner
    rules, reach_m = mission.mapper.extraction, mission.scan_matching.reach_m
    segments = [sure_pieces(extract(scan, rules), scan, rules).on_body(on_body) for scan in scans]
    returns = [to_world(returns_within(scan, reach_m), on_body.pose_robot) for scan in scans]
    drive = Drive(log.heard[1:], log.heard_cov[1:])
    return second_looks(log.estimated_world[0], drive, segments, returns, mission.second_looks, Rays(scans, on_body))


def _mapped(result: TrialResult, last: Step, survey: Survey) -> TrialResult:
    """Return a result with the path and walls of a refined solution and their covariances."""
    mission = result.scenario.config.mission
    walls = survey.walls
    step = replace(last, map=walls, chains=connect(walls, shared=mission.mapper.shared))
    paths, sweep = mission.explorer.following.paths, mission.explorer.sweep
    certificate = certify(step, result.ending.outcome, paths, sweep, survey.poses[:, :2])
    told: dict[str, Any] = {
        "lines": len(walls),
        "duplicate_lines": len(doubles(walls.ends_world)),
        "chains_closed": sum(chain.is_closed for chain in step.chains),
        "closures": survey.closures,
    }
    return replace(
        result,
        last=step,
        joint=survey.joint,
        certificate=certificate,
        smoothed=Smoothed(survey.poses, walls, survey.joint, survey.pair_covs),
        summary=result.summary | {"certificate": certificate_record(certificate), "second_looks": told},
    )
