"""Results as the program leaves them, made once; mutators break copies of them."""

import contextlib
import io
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

from chainslam.experiments.commands.cli import main

CAMPAIGN = (
    *("--worlds", "paper-fig4", "--backends", "block-ekf", "full-ekf", "--strategies", "nearest-robot"),
    *("--trials", "2", "--max-steps", "4", "--modes", "closed", "replay", "--association", "own", "--jobs", "1"),
)


@cache
def intact() -> dict[str, Path]:
    """Return the folders, by name; they go when the process does."""
    home = Path(tempfile.mkdtemp(prefix="intact-"))
    owner = os.getpid()

    def gone() -> None:
        if os.getpid() == owner:
            shutil.rmtree(home, ignore_errors=True)

    import atexit

    atexit.register(gone)
    run = str(home / "run")
    commands = [
        ["explore", "paper-fig4", "--max-steps", "3", "--out", run],
        ["explore", "paper-fig4", "--errorless", "--no-sweep", "--max-steps", "120", "--out", str(home / "closed")],
        ["replay", f"{run}/log.npz", "--backend", "block-ekf", "full-ekf", "--out", str(home / "replays")],
        ["compare", *CAMPAIGN, "--out", str(home / "campaign")],
        ["compare", *CAMPAIGN, "--first-seed", "2", "--out", str(home / "later")],
        ["compare", "--against", str(home / "campaign"), str(home / "later"), "--out", str(home / "contrast")],
        ["compare", "--merge", str(home / "campaign"), str(home / "later"), "--out", str(home / "merged")],
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        for words in commands:
            assert main(words) == 0, words
        for name in ("campaign", "contrast", "closed"):
            # Whatever is imported at the first use only, every child of this process has then.
            assert main(["report", str(home / name)]) == 0
            (home / name / "report.html").unlink()
    return {path.name: path for path in home.iterdir()}
