"""Offline refinement of a real robot's log after its drive: path and map from all scans together."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from chainslam.explore.certificate import certify
from chainslam.explore.step import Step
from chainslam.slam.association.matching import NO_MATCHES
from chainslam.slam.association.second_looks.closures import Drive
from chainslam.slam.association.second_looks.refuted import Rays
from chainslam.slam.association.second_looks.second_looks import Survey, second_looks, to_the_end
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.visible_extent import sure_pieces
from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.chains import connect
from chainslam.slam.map_keeper import MapUpdate
from chainslam.slam.mapper import Mapper
from chainslam.slam.odometry.scan_matching import returns_within
from chainslam.slam.robot import Scan

from ...scenario import OFFLINE, TrialConfig
from ...scoring.records import Log
from ...scoring.without_truth.certificate import certificate_record
from ...scoring.without_truth.doubles import doubles
from ...scoring.without_truth.smoothing import Smoothed
from ...scoring.without_truth.unwitnessed import summarise_unwitnessed
from ...trial import TrialResult


class PathMapper(Mapper):
    """A mapper that keeps no walls: offline refinement finds them in all scans at once."""

    def step(self, scan: Scan, set_aside: Collection[tuple[int, int]] = ()) -> MapUpdate:
        """Return the segments of a scan, the path so far, and no wall."""
        heard = self._ranges.hear(scan)
        segments = self._pieces(heard.scan)
        nobody = np.full(len(segments), -1, dtype=np.int64)
        update = MapUpdate(segments, NO_MATCHES, nobody, self._keeper.map(), (), (), heard=heard)
        return update.told(self.config.robot.scanner, self._ranges.told)


def looked_again(result: TrialResult, goes_on: Callable[[float], bool] = to_the_end) -> TrialResult:
    """Return a result whose smoothed path and map come from offline refinement.

    They only depend on scans and odometry, and are the same for every back end. `goes_on` hears of the share that is
    done, and may end the search for loops and the rounds of association early.
    """
    log, last, recorded = result.log, result.last, result.recorded
    if log is None or last is None or recorded is None:
        return result
    scans = [recorded.recording.scan(k) for k in range(len(log))]
    return _mapped(result, log, last, surveyed(scans, log, result.scenario.config, goes_on))


def surveyed(
    scans: Sequence[Scan], log: Log, config: TrialConfig, goes_on: Callable[[float], bool] = to_the_end
) -> Survey:
    """Return the solution for all scans of a drive, in the frame of its first estimated pose."""
    mission, on_body = config.mission, config.robot.scanner
    rules, reach_m = mission.mapper.extraction, mission.scan_matching.reach_m
    segments = [sure_pieces(extract(scan, rules), scan, rules).on_body(on_body) for scan in scans]
    returns = [to_world(returns_within(scan, reach_m), on_body.pose_robot) for scan in scans]
    carried = () if log.carried is None else np.flatnonzero(log.carried).tolist()
    drive = Drive(log.heard[1:], log.heard_cov[1:], carried=carried)
    rays = Rays(scans, on_body)
    return second_looks(log.estimated_world[0], drive, segments, returns, mission.second_looks, rays, goes_on)


def _mapped(result: TrialResult, log: Log, last: Step, survey: Survey) -> TrialResult:
    """Return a result with the path and walls of a refined solution and their covariances.

    Without a back end there is no other estimate, and the refined path is the estimated one as well.
    """
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
    summary = result.summary
    if result.scenario.config.backend == OFFLINE:
        log = _of_all_scans(log, step, survey)
        summary = summary | summarise_unwitnessed(result.scenario, log, result.votes, step, result.ending)
    return replace(
        result,
        log=log,
        last=step,
        joint=survey.joint,
        certificate=certificate,
        smoothed=Smoothed(survey.poses, walls, survey.joint, survey.pair_covs),
        summary=summary | {"certificate": certificate_record(certificate), "second_looks": told},
    )


def _of_all_scans(log: Log, last: Step, survey: Survey) -> Log:
    """Return a log whose estimate at each step is the refined one."""
    steps = len(log)
    return replace(
        log,
        estimated_world=survey.poses,
        estimated_cov=survey.pose_covs(),
        lines=np.full(steps, len(last.map)),
        open_ends=np.full(steps, sum(len(chain.open_ends) for chain in last.chains)),
        closed_chains=np.full(steps, sum(chain.is_closed for chain in last.chains)),
    )
