"""One trial: a robot explores a world once, and the estimate is scored against the truth."""

import gc
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from chainslam.explore.certificate import Certificate, certify
from chainslam.explore.limits import limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.sim.logs.keyframes import RecordedLog
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.evaluation.from_start import FromStart, Start, as_it_is, from_start
from chainslam.slam.geometry.compiled import prepare_kernels
from chainslam.slam.mapper import Mapper

from .scenario import KNOWN, Scenario, TrialConfig, build, heard_by, make_backend, sigmas_of
from .scoring.association import Votes
from .scoring.keys import Summary
from .scoring.records import Log, Recorder
from .scoring.summary import Ending, run_keys, summarise
from .scoring.truth import truth_of
from .scoring.without_truth.certificate import certificate_record
from .scoring.without_truth.smoothing import Smoothed, smooth
from .scoring.without_truth.unseen_floor import unseen_now
from .usage import UsageError


@dataclass(frozen=True)
class TrialResult:
    """The result of a trial; everything but the ending is None if it ended before its first step."""

    scenario: Scenario
    ending: Ending
    log: Log | None
    votes: Votes
    last: Step | None
    joint: Joint | None
    """Pose and all lines at the last step."""
    certificate: Certificate | None
    summary: dict[str, Any]
    smoothed: Smoothed | None = None
    """The smoothed solution at the end, if the back end smooths; scores use the estimates available at each step."""
    recorded: RecordedLog | None = None
    """The log of a real robot, without ground truth; None for a simulated run."""


Mission = Callable[[Scenario], Iterator[Step]]


def default_mission(scenario: Scenario) -> Iterator[Step]:
    """Return the closed loop with the simulated robot."""
    assert scenario.strategy is not None, "expected a strategy to explore by"
    rules = scenario.config.mission
    robot = heard_by(scenario.config.odometry, scenario.robot, scenario.config)
    return explore_mission(robot, Mapper(scenario.backend, rules.mapper), scenario.strategy, rules)


def run_trial(
    config: TrialConfig,
    watch: Callable[[Step], None] = lambda step: None,
    world: World | None = None,
    mission: Mission = default_mission,
) -> TrialResult:
    """Run one trial to its end, whatever that is, and return all that was computed.

    `watch` sees every step. A failure or Ctrl-C in the mission becomes the ending; raises UsageError for bad names
    and unusable worlds before anything is computed.
    """
    return run_scenario(build(config, world), watch, mission)


def run_scenario(scenario: Scenario, watch: Callable[[Step], None], mission: Mission) -> TrialResult:
    """Run a scenario to its end, whatever that is, and return all that was computed."""
    truth = truth_of(scenario.world, scenario.config.robot)
    recorder = Recorder(scenario.robot, Votes(truth), relative_to_start(scenario))
    ending = ride(scenario, recorder, watch, mission)
    recorder.close()
    if recorder.last is None:
        summary = bare_summary(scenario, ending)
        return TrialResult(scenario, ending, None, recorder.votes, None, None, None, summary)
    log, last, explorer = recorder.log(), recorder.last, scenario.config.mission.explorer
    way_world = log.estimated_world[:, :2]
    certificate = certify(last, ending.outcome, explorer.following.paths, explorer.sweep, way_world)
    summary = summarise(scenario, log, recorder.votes, last, recorder.joint, ending, recorder.sketches)
    summary |= {"certificate": certificate_record(certificate, unseen_now(last))}
    smoothed = smooth(scenario.backend, last.map, log.unstated_motion, scenario.config.robot.scanner)
    return TrialResult(scenario, ending, log, recorder.votes, last, recorder.joint, certificate, summary, smoothed)


def relative_to_start(scenario: Scenario) -> FromStart:
    """Return the estimator of the pose as if the start had been known; without noise they are the same."""
    config = scenario.config
    if config.errorless or config.p0 == KNOWN:
        return as_it_is
    start = Start(scenario.start_estimate, scenario.start_cov, np.asarray(scenario.world.start, dtype=np.float64))
    known, carries = start.known(sigmas_of(KNOWN)), BACKENDS[config.backend].carries_start
    make = partial(make_backend, config)
    return from_start(scenario.backend, carries, start, known, make, config.robot.scanner)


def ride(scenario: Scenario, recorder: Recorder, watch: Callable[[Step], None], mission: Mission) -> Ending:
    """Run a mission to its end, however it ends, and return the ending; the recorder keeps every step."""
    _prepare_process()
    try:
        for step in limited(mission(scenario), scenario.config.limits):
            recorder.add(step)
            watch(step)
            if step.outcome is not None:
                return Ending(step.outcome, step.decision.words)
    except KeyboardInterrupt as interrupt:
        return Ending(Outcome.INTERRUPTED, f"interrupted by {str(interrupt) or 'Ctrl-C'}")
    except UsageError:
        raise
    except Exception as error:  # a failed run keeps its results so far, with the traceback next to them
        words = " ".join(str(error).split())
        return Ending(Outcome.FAILED, f"{type(error).__name__}: {words}", traceback.format_exc())
    return Ending(Outcome.FAILED, "the mission ended without saying why")


@cache
def _prepare_process() -> None:
    """Do once per process what would otherwise count as the time of a step.

    Import the compiler, and exclude all modules from garbage collection, which took a tenth of a second.
    """
    prepare_kernels()
    gc.freeze()


def bare_summary(scenario: Scenario, ending: Ending) -> dict[str, Any]:
    """Return the summary of a run without a step: null for everything that was not measured."""
    return {
        **dict.fromkeys(key for key in Summary.__annotations__ if key in Summary.__required_keys__ and key != "format"),
        **run_keys(scenario, ending),
        "steps": 0,
        "collisions": scenario.robot.record.collisions,
    }
