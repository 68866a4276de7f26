"""Runs that are explored once and kept, so that every back end and study gets the same scans."""

from pathlib import Path

from chainslam.sim.logs.recorded_robot import Recording

from ..artifacts.files import json_bytes, npz_bytes, write
from ..artifacts.results import config_record, log_arrays
from ..scenario import TrialConfig
from ..trial import TrialResult, run_trial
from ..usage import UsageError
from .replay import RecordedRun, read_run


def recorded(made: TrialResult) -> RecordedRun:
    """Return the recording of a trial; raises UsageError if it ended before its first step."""
    log, scenario = made.log, made.scenario
    if log is None:
        raise UsageError(f"expected a run of at least one step, found none: {made.ending.reason}")
    recording = Recording(
        log.time_s,
        log.bearings_rad,
        log.ranges_m,
        log.sigma_m,
        log.range_max_m,
        log.odometry,
        log.odometry_cov,
        log.touched,
        log.sigma_share,
        log.scan_start_s,
        log.fans,
        log.resolution_m,
        log.carried,
    )
    return RecordedRun(
        scenario.config, recording, scenario.start_estimate, scenario.start_cov, log.true_world, log.face_of_beam
    )


def record(config: TrialConfig, folder: Path | None = None) -> RecordedRun:
    """Return the recording of a run: that in `folder` if it is there, else a new one, kept there.

    Raises UsageError for a run without a step, and where the folder holds the recording of another run.
    """
    if folder is None:
        return recorded(run_trial(config))
    home = folder / f"{Path(config.world).stem}-{config.strategy}-{config.backend}-{config.p0}-{config.seed}"
    if (home / "log.npz").exists():
        kept = read_run(home / "log.npz")
        if (kept.trial.world, kept.trial.seed) != (config.world, config.seed):
            raise UsageError(f"expected the recording of {config.world}, found another in {home}: name another folder")
        return kept
    made = run_trial(config)
    run = recorded(made)
    assert made.log is not None
    home.mkdir(parents=True, exist_ok=True)
    write(home / "config.json", json_bytes(config_record(config)))
    write(home / "log.npz", npz_bytes(log_arrays(made, made.log)))
    return run
