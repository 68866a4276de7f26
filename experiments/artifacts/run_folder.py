"""The folder for a command's results: created, locked for one process, and cleared of an earlier run."""

import fcntl
import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..scenario import TrialConfig
from ..usage import UsageError
from .files import CONFIG, PART, format_fault, json_bytes, write
from .results import REPLAY, RUN_FILES

LOCK = ".lock"


class FolderGoneError(UsageError):
    """The folder for the results was removed during the run."""

    exit_status = 1

    def __init__(self, folder: Path) -> None:
        super().__init__(f"expected the folder {folder} to stay until the end, found it removed: repeat the run")


def unwritable(folder: Path, error: OSError) -> UsageError:
    """Return the error for a folder that cannot be written, before anything is computed."""
    named = Path(error.filename or folder)
    where = str(folder) if folder.is_relative_to(named) else f"{folder / named.name}"
    return UsageError(f"expected a writable folder, found {where} ({error.strerror}): name another with --out")


def prepare(folder: Path) -> None:
    """Create a writable folder; raises UsageError, before anything is computed, if that is impossible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error) from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"expected a writable folder, found {folder} read-only: name another with --out")


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Lock a folder while the block runs; raises UsageError if another process holds it.

    The kernel releases the lock when the process ends, in whatever way. On a file system without locks (some NFS
    servers) one line on standard error warns that nothing prevents another run from writing there.
    """
    path = folder / LOCK
    try:
        lock = _locked(path)
    except BlockingIOError as error:
        raise UsageError(
            f"expected a folder that no other run uses, found a run in {folder}: wait for it or name another --out"
        ) from error
    except OSError as error:
        raise unwritable(folder, error) from error
    try:
        yield
    finally:
        # Unlinked while the lock is held, so that whoever opened it meanwhile sees that it is no longer in the folder.
        with suppress(OSError):
            path.unlink()
        os.close(lock)


def _locked(path: Path) -> int:
    """Return the descriptor of the lock; raises BlockingIOError if another process holds it."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise
        except OSError as error:
            print(
                f"chainslam: {path.parent} cannot be locked ({error.strerror}): make sure no other run writes into it",
                file=sys.stderr,
            )
            return lock
        if _is_at(lock, path):
            return lock
        os.close(lock)


def _is_at(descriptor: int, path: Path) -> bool:
    """Return whether an open file is still the one with this name."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def clear_leftovers(folder: Path, pattern: str = ".*") -> None:
    """Remove half-written files of killed processes; call it with the folder locked."""
    for path in folder.glob(pattern):
        if PART.fullmatch(path.name):
            path.unlink(missing_ok=True)


def refuse_others(folder: Path, config: Mapping[str, Any], force: bool) -> None:
    """Raise UsageError if a locked folder holds anything but the run of this config; `force` permits other runs."""
    clear_leftovers(folder)
    found = sorted(child.name for child in folder.iterdir() if child.name != LOCK)
    other = _other(folder, found, config) if found else ""
    if other == _CAMPAIGN:
        raise UsageError(f"expected a folder for a run, found {other} in {folder}: name another with --out")
    if other and not force:
        raise UsageError(
            f"expected an empty folder or this run's own, found {other} in {folder}: name another with --out,"
            " or let --force replace a run there"
        )


def settle(folder: Path, config: Mapping[str, Any]) -> None:
    """Prepare a locked folder for a new run: delete the results of an earlier one, and write `config.json`.

    Raises UsageError if that is impossible.
    """
    try:
        for name in RUN_FILES:
            if name != CONFIG:
                (folder / name).unlink(missing_ok=True)
        # Written last: until then the folder still belongs to the earlier run.
        write(folder / CONFIG, json_bytes(config))
    except OSError as error:
        raise unwritable(folder, error) from error


_CAMPAIGN = "a campaign"


def _other(folder: Path, found: list[str], config: Mapping[str, Any]) -> str:
    """Return what a folder holds other than this run, in words; empty if it is this run."""
    few = found[0] if len(found) == 1 else f"{found[0]} and {len(found) - 1} more"
    try:
        there = json.loads((folder / CONFIG).read_text())
        if "campaign" in there or "merged" in there:
            return _CAMPAIGN
        if wrong := format_fault(there["format"]):
            return f"a run of {wrong},"
        now = json.loads(json_bytes(config))
        if there.get(REPLAY) != now.get(REPLAY):
            return "a replay of other options" if REPLAY in there and REPLAY in now else "another kind of run"
        different = sorted(key for key in now["trial"] if there["trial"].get(key) != now["trial"][key])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return few
    return f"another run (other {', '.join(different)})" if different else ""


def default_folder(world: str, trial: TrialConfig, preset: str | None = None) -> Path:
    """Return the default folder of a run; the same run always gets the same folder."""
    parts = [world.replace(":", "-"), trial.backend, trial.strategy, str(trial.seed)]
    parts += [preset] if preset else []
    parts += [trial.p0] if trial.p0 != "small" else []
    parts += ["errorless"] if trial.errorless else []
    parts += ["scans"] if trial.odometry == "scans" else []
    return Path("results") / "-".join(parts)


def point_latest_at(folder: Path) -> None:
    """Link results/latest to the newest run; ignored on file systems without links."""
    link = folder.parent / "latest"
    try:
        if link.is_symlink():
            link.unlink()
        link.symlink_to(folder.name, target_is_directory=True)
    except OSError:
        return
