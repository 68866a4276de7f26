"""The plan of a campaign: its trials, their order, and the name of each."""

import shlex
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.worlds import WORLDS, DrawingOptions, is_own
from chainslam.slam.backends import BACKENDS

from ..artifacts.presets import METHODS, backend_of, mapping_of
from ..artifacts.settings import NAVIGATION, nested, options_of, trial_of
from ..replays.replay import Association
from ..scenario import P0, TrialConfig, check_settings
from ..usage import OR_OWN, UsageError, choose, need

CLOSED, RECORDING = "closed", "recording"
ARMS = (CLOSED, "replay-own", "replay-true")
"""Closed loop: what a back end does to behaviour. Replay with its own gate: what overconfidence does to matching.
Replay with the true association: the algebra alone."""
RIDES = "replay-own"
"""The arm of external programs."""
MAX_STEPS = 5000
MOST_TRIALS = 1_000_000
"""Larger campaigns are refused: their list of trials alone would fill the memory of a small machine."""
PAPER_BACKENDS = ("block-ekf", "joint-block-ekf", "relocation-ekf", "full-ekf", "invariant-ekf", "graph")
PAPER_STRATEGIES = ("nearest-robot", "same-chain", "nearest-start")


@dataclass(frozen=True)
class Campaign:
    """All that decides the tables of a campaign: the same values give the same bytes, timings excepted."""

    worlds: tuple[str, ...]
    backends: tuple[str, ...]
    """Names of back ends, and of methods, which bring their own mapper (`METHODS`)."""
    strategies: tuple[str, ...]
    trials: int
    """Number of trials of each combination."""
    arms: tuple[str, ...] = ARMS
    driver: str = "full-ekf"
    """The back end that drives the recordings; replays of a world, strategy and seed share one recording."""
    p0: P0 = "small"
    max_steps: int = MAX_STEPS
    """A trial is stopped, and counts as a failure, after this many scans."""
    first_seed: int = 1
    settings: tuple[tuple[str, Any], ...] = ()
    """Settings of every trial that differ from the defaults: dotted keys of `config.json` and their values."""
    external: tuple[tuple[str, str], ...] = ()
    """Names of those back ends that are external programs, and the command of each."""

    def arms_of(self, backend: str) -> tuple[str, ...]:
        """Return the arms in which a back end runs: an external program has no map to explore by or to match with."""
        return tuple(arm for arm in self.arms if backend not in dict(self.external) or arm == RIDES)

    @property
    def seeds(self) -> range:
        """The seeds of each combination."""
        return range(self.first_seed, self.first_seed + self.trials)


@dataclass(frozen=True, order=True)
class Trial:
    """One row of the table of trials."""

    world: str
    """Name of a bundled world, or a file."""
    strategy: str
    """For a replay, the strategy of its recording."""
    backend: str
    arm: str
    """One of `ARMS`, or `RECORDING` for a drive that only serves replays."""
    seed: int

    @property
    def recording(self) -> "Trial":
        """The recording that a replay uses, whoever drives it."""
        return Trial(self.world, self.strategy, "", RECORDING, self.seed)

    @property
    def association(self) -> Association | None:
        """The data association of a replay; None in a closed loop."""
        return "own" if self.arm == "replay-own" else "true" if self.arm == "replay-true" else None

    @property
    def path(self) -> Path:
        """Path of its result inside the campaign's folder, without a suffix."""
        folder = Path(world_key(self.world)) / self.strategy
        return folder / self.backend / self.arm / f"{self.seed:05d}"


DECIDED = ("world", "backend", "strategy", "seed", "errorless", "start", "map")
"""Settings that the campaign itself decides, or that would invalidate its statistics."""

SETTINGS = (("--driver", "driver"), ("--p0", "p0"), ("--max-steps", "max_steps"), ("--first-seed", "first_seed"))
PRESETS: dict[str, dict[str, Any]] = {
    "smoke": {
        "worlds": ("paper-fig8",),
        "backends": ("block-ekf", "full-ekf"),
        "strategies": ("nearest-robot", "nearest-start"),
        "trials": 3,
    },
    "paper": {
        "worlds": ("paper-fig8", "paper-fig9"),
        "backends": PAPER_BACKENDS,
        "strategies": PAPER_STRATEGIES,
        "trials": 20,
        # Four times the longest run that is not lost; a lost robot would drive on to the default limit.
        "max_steps": 2500,
        "settings": ((NAVIGATION, "visibility"),),
    },
    "paper-method": {
        "worlds": ("paper-fig8", "paper-fig9"),
        "backends": ("paper-method", "block-ekf", "full-ekf", "invariant-ekf"),
        "strategies": ("nearest-robot",),
        "trials": 20,
        # Twice the steps of today's mapper; a robot lost among duplicate walls would drive on to the default limit.
        "max_steps": 1000,
        "settings": METHODS["paper-method"].driving,
    },
    "full": {
        "worlds": tuple(WORLDS),
        "backends": tuple(BACKENDS),
        "strategies": tuple(STRATEGIES),
        "trials": 400,
    },
}
"""The campaigns of `--preset`; other options have priority."""


def trials(campaign: Campaign) -> list[Trial]:
    """Return every trial in the order of the tables: world, strategy, back end, arm, seed."""
    cells = product(campaign.worlds, campaign.strategies, campaign.backends)
    return [Trial(*cell, arm, seed) for cell in cells for arm in campaign.arms_of(cell[2]) for seed in campaign.seeds]


def recordings(campaign: Campaign) -> list[Trial]:
    """Return the recordings that the replays of a campaign need, in order."""
    if not any(arm != CLOSED for arm in campaign.arms):
        return []
    drives = product(campaign.worlds, campaign.strategies, campaign.seeds)
    return [Trial(world, strategy, "", RECORDING, seed) for world, strategy, seed in drives]


def config_of(campaign: Campaign, trial: Trial) -> TrialConfig:
    """Return the settings of one trial; those of a recording are its driver's."""
    decided = {
        "world": trial.world,
        "backend": backend_of(trial.backend) or campaign.driver,
        "strategy": trial.strategy,
        "seed": trial.seed,
        "p0": campaign.p0,
        "max_steps": campaign.max_steps,
    }
    return trial_of(mapping_of(trial.backend), nested(campaign.settings), decided)


def drawing_of(campaign: Campaign) -> DrawingOptions:
    """Return how the files of a campaign's worlds are read."""
    return trial_of(nested(campaign.settings)).drawing


def is_errorless(campaign: Campaign) -> bool:
    """Return whether all trials of a campaign run without noise."""
    return trial_of(nested(campaign.settings)).errorless


def gate_of(campaign: Campaign) -> float:
    """Return the level of the gate that all trials of a campaign use."""
    return trial_of(nested(campaign.settings)).mission.mapper.matching.gate


def world_key(world: str) -> str:
    """Return the name of a world in tables and folders: its own name, or a file's name without its suffix."""
    return world if is_own(world) else Path(world).stem


def check_campaign(campaign: Campaign) -> None:
    """Raise UsageError, in one line, for a campaign that cannot be run as it stands."""
    lists = {
        "worlds": campaign.worlds,
        "backends": campaign.backends,
        "strategies": campaign.strategies,
        "arms": campaign.arms,
    }
    for name, given in lists.items():
        if not given:
            raise UsageError(f"expected at least one of the {name}, found none: name some with --{name}")
        doubles = sorted({item for item in given if given.count(item) > 1})
        if doubles:
            raise UsageError(f"expected each of the {name} once, found {doubles[0]} twice: drop one")
    for arm in campaign.arms:
        choose("arm", arm, ARMS)
    external = dict(campaign.external)
    if external and RIDES not in campaign.arms:
        raise UsageError("expected replays with the estimators' own association for --external, found none: add --modes"
                         " replay and --association own")  # fmt: skip
    if campaign.driver in external:
        raise UsageError(f"expected a back end as --driver, found {campaign.driver}, which maps no walls: name another")
    keys = [world_key(world) for world in campaign.worlds]
    if len(set(keys)) < len(keys):
        raise UsageError(f"expected worlds of different names, found {', '.join(keys)}: rename a file")
    if campaign.trials < 1:
        raise UsageError(f"expected at least 1 trial, found --trials {campaign.trials}: raise it")
    cells = len(campaign.worlds) * len(campaign.strategies) * len(campaign.backends) * len(campaign.arms)
    if cells * campaign.trials > MOST_TRIALS:
        raise UsageError(
            f"expected at most {MOST_TRIALS:,} trials in a campaign, found {cells} cells of {campaign.trials:,}: run"
            " several with other --first-seed and put them together with --merge"
        )
    for world, strategy, backend in product(campaign.worlds, campaign.strategies, campaign.backends):
        for seed in (campaign.first_seed, campaign.seeds[-1]):
            check_settings(config_of(campaign, Trial(world, strategy, backend, CLOSED, seed)))


def check_parts(campaign: Campaign) -> None:
    """Raise UsageError where a back end or strategy is not there: trials need it, what they left does not."""
    need("pyarrow")
    choose("back end (--driver)", campaign.driver, BACKENDS, OR_OWN)
    for backend in campaign.backends:
        choose("back end", backend_of(backend), BACKENDS, OR_OWN)
    for strategy in campaign.strategies:
        choose("strategy", strategy, STRATEGIES, OR_OWN)


def world_digests(campaign: Campaign) -> dict[str, str]:
    """Return the SHA-256 of each world that is a file: the same name with other walls is another campaign."""
    files = [Path(world) for world in campaign.worlds if not is_own(world)]
    return {path.stem: sha256(path.read_bytes()).hexdigest() for path in files}


def command_of(campaign: Campaign) -> str:
    """Return the command that runs a campaign."""
    modes = [mode for mode in (CLOSED, "replay") if any(arm.startswith(mode) for arm in campaign.arms)]
    association = [name for name in ("own", "true") if f"replay-{name}" in campaign.arms]
    external = dict(campaign.external)
    backends = [name for name in campaign.backends if name not in external]
    words = ["chainslam", "compare", "--worlds", *campaign.worlds, "--backends", *backends]
    words += [word for name, command in external.items() for word in ("--external", f"{name}={command}")]
    words += ["--strategies", *campaign.strategies, "--trials", str(campaign.trials), "--modes", *modes]
    words += ["--association", *association] if association else []
    plain = Campaign((), (), (), 0)
    for option, name in SETTINGS:
        value = getattr(campaign, name)
        words += [] if value == getattr(plain, name) else [option, str(value)]
    words += options_of(campaign.settings)
    return shlex.join([*words, "--out", "DIR"])
