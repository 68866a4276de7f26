"""A campaign's folder: one file for each trial, written atomically, so that an interrupted campaign can continue."""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from msgspec import defstruct

from chainslam.sim.logs.archive import regular

from ..artifacts.files import CONFIG, json_bytes, stamp, write
from ..artifacts.reading import read_json, told
from ..artifacts.results import config_record
from ..artifacts.run_folder import LOCK, FolderGoneError, clear_leftovers, held, prepare
from ..artifacts.schema import UnfitError, fit
from ..artifacts.settings import own, plain
from ..usage import UsageError
from .plan import Campaign, Trial, check_campaign, config_of, world_digests
from .scores.score import TrialScores
from .work import Done, unpack

REMEDY = "name the folder of a campaign, as written by `compare --out`"
MERGED = "merged"
"""Key in the config of a merged folder that holds the merged campaigns."""
SEEDS = frozenset({"trials", "first_seed"})
EXTENDABLE = SEEDS | {"worlds", "backends", "strategies", "arms", "worlds_sha256", "external"}
"""Campaigns that differ in nothing else can be merged."""
Worlds = defstruct("Worlds", [("worlds_sha256", dict[str, str])])
Merged = defstruct(
    "Merged", [(MERGED, list[dict[str, Any]]), ("from_", list[dict[str, Any]])], rename={"from_": "from"}
)
MadeBy = defstruct("MadeBy", [("versions", dict[str, str]), ("commit", str | None)])


@dataclass(frozen=True)
class Store:
    """Paths of a campaign's results."""

    folder: Path
    campaign: Campaign

    def path(self, trial: Trial) -> Path:
        """Return the file of a trial, or of a recording."""
        if trial.arm == "recording":
            return self.folder / "recordings" / trial.path.parts[0] / trial.strategy / f"{trial.seed:05d}" / "log.npz"
        return self.folder / "trials" / trial.path.with_suffix(".npz")

    def has(self, trial: Trial) -> bool:
        """Return whether the trial is finished."""
        return self.path(trial).exists()

    def save(self, done: Done) -> None:
        """Write what a job left, the recording before the record: a record means that all is there.

        Raises FolderGoneError where the campaign's folder is no longer there, and OSError.
        """
        if not (self.folder / CONFIG).exists():
            raise FolderGoneError(self.folder)
        if done.log is not None:
            path = self.path(done.trial.recording)
            path.parent.mkdir(parents=True, exist_ok=True)
            # Makes the recording acceptable to `chainslam replay`.
            config = config_of(self.campaign, done.trial.recording)
            write(path.with_name(CONFIG), json_bytes({**stamp(), "trial": own(config)}))
            write(path, done.log)
        if done.trial.arm != "recording":
            path = self.path(done.trial)
            path.parent.mkdir(parents=True, exist_ok=True)
            write(path, done.record)

    def record(self, trial: Trial) -> TrialScores:
        """Return the result of a trial; raises UsageError if its file is invalid."""
        path = self.path(trial)
        with told(path, "delete it and run `compare` again"):
            return unpack(regular(path).read_bytes(), trial)


@contextmanager
def opened_anew(folder: Path, config: bytes | None = None) -> Iterator[None]:
    """Make a folder that must be empty, and keep it to this process; raises UsageError.

    With `config`, which is written first, the folder may also hold what was begun with that very config.
    """
    prepare(folder)
    with held(folder):
        begun = config is not None and (folder / CONFIG).is_file() and (folder / CONFIG).read_bytes() == config
        if begun:
            clear_leftovers(folder, "**/.*")
        elif any(child.name != LOCK for child in folder.iterdir()):
            raise UsageError(f"expected an empty folder, found files in {folder}: name another with --out")
        if config is not None:
            write(folder / CONFIG, config)
        yield


@contextmanager
def opened(folder: Path, campaign: Campaign) -> Iterator[Store]:
    """Make or take up a campaign's folder for as long as the block runs.

    Raises UsageError for a folder of another campaign, and for one that another process is working in.
    """
    prepare(folder)
    with held(folder):
        clear_leftovers(folder, "**/.*")
        _settle(folder, campaign)
        yield Store(folder, campaign)


@dataclass(frozen=True)
class Settled:
    """The content of a campaign's `config.json`."""

    campaigns: tuple[Campaign, ...]
    """Several if it was merged."""
    worlds_sha256: dict[str, str]
    versions: dict[str, str]
    """That of the first campaign if it was merged."""
    commit: str | None
    said: dict[str, Any]
    """As in the file."""


def read_campaigns(folder: Path) -> tuple[Campaign, ...]:
    """Return the campaigns in a folder, several if it was merged; raises UsageError."""
    return read_config(folder).campaigns


def read_config(folder: Path) -> Settled:
    """Return the config of a campaign's folder; raises UsageError without one."""
    said = read_json(folder / CONFIG, Worlds, REMEDY)
    with told(folder / CONFIG, REMEDY):
        if MERGED in said:
            fit(Merged, said)
        campaigns = tuple(fit(Campaign, each, "campaign") for each in said.get(MERGED, [said.get("campaign")]))
        made = said
        while "from" in made:
            if not made["from"]:
                raise UnfitError("a campaign merged from none")
            made = made["from"][0]
        fit(MadeBy, made)
        if not campaigns:
            raise UnfitError("no campaign")
    for campaign in campaigns:
        check_campaign(campaign)
    return Settled(campaigns, said["worlds_sha256"], made["versions"], made["commit"], said)


def _way_out(different: Sequence[str], held: Sequence[Campaign]) -> str:
    """Return how to run a campaign that differs from the one in a folder."""
    if not set(different) <= EXTENDABLE:
        return "name another --out"
    more = ""
    if set(different) <= SEEDS:
        more = f" (more seeds: with --first-seed {max(campaign.seeds.stop for campaign in held)})"
    return f"run it with another --out{more}, and combine both folders with --merge"


def _settle(folder: Path, campaign: Campaign) -> None:
    """Write the config, or compare it with the existing one."""
    path = folder / CONFIG
    held = read_config(folder) if os.path.lexists(path) else None
    before = None if held is None else held.said
    try:
        digests = world_digests(campaign)
    except OSError as error:
        raise UsageError(f"expected readable worlds, found {error.filename} ({error.strerror})") from error
    now = plain({**stamp(), "campaign": asdict(campaign), "worlds_sha256": digests})
    made = config_record(config_of(campaign, Trial(campaign.worlds[0], campaign.strategies[0], "", "closed", 1)))
    made_with = {"versions": made["versions"], "commit": made["commit"]}
    if before is None:
        if any(child.name != LOCK for child in folder.iterdir()):
            raise UsageError(f"expected an empty folder or a campaign's, found {folder} with other files: name another")
        write(path, json_bytes(now | made_with))
        return
    said = {"external": []} | before.get("campaign", {})
    different = [key for key in now["campaign"] if said.get(key) != now["campaign"][key]]
    different += [] if before.get("worlds_sha256") == now["worlds_sha256"] else ["worlds_sha256"]
    if different:
        raise UsageError(
            f"expected the settings of the campaign in {folder}, found other {', '.join(different)}:"
            f" {_way_out(different, held.campaigns if held else ())}"
        )
    if {key: before.get(key) for key in made_with} != plain(made_with):
        print(
            f"chainslam: {folder} was started with another version of the code or its packages;"
            " finished trials are kept",
            file=sys.stderr,
        )
        write(path, json_bytes(before | {"resumed_with": [*before.get("resumed_with", []), made_with]}))
