"""Does this code drive as an older version of it, bit for bit? Then rows of that version are rows of this one.

.venv/bin/python -m studies.runner.alike --than REVISION --plans ../shared/data/plans
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from chainslam.experiments.usage import UsageError

from . import drives, rows
from .command import run_study

ROOMS = ("chainslam", "slam", "explore", "sim", "viz", "experiments")
EVERY = 16
"""Every so manyth plan of a folder is driven in."""


@dataclass(frozen=True)
class AlikeStudy:
    """Drive with this code and with an older version of it; note that they drive alike, or say where they do not."""

    than: str
    """The older version, as git names it."""
    plans: Path | None = None
    """A folder of plans in which they drive, too."""
    scans: int = 400
    """Scans of a drive, at most."""
    out: Path = rows.ALIKE
    """A line of JSON for each pair of versions that drive alike."""

    def run(self) -> int:
        """Return 1 where a drive differs."""
        plans = [] if self.plans is None else [str(path.resolve()) for path in sorted(self.plans.iterdir())[::EVERY]]
        with tempfile.TemporaryDirectory() as folder:
            older = Path(folder)
            unpack(self.than, older)
            code = rows.fingerprint(older)
            if code == rows.fingerprint():
                print(f"{self.than} is the same code: there is nothing to compare")
                return 0
            theirs, ours = driven([older, rows.HERE], self.scans, plans)
        different = [own for own, other in zip(ours, theirs, strict=True) if own != other]
        for each in different:
            print(f"another drive: {each['world']}, {each['backend']}, {each['strategy']}")
        scans = sum(each["scans"] for each in ours)
        print(f"{len(ours) - len(different)} of {len(ours)} drives are the same, {scans} scans in all")
        if different:
            return 1
        rows.append(self.out, [{"as": code, "drives": len(ours), "scans": scans}])
        return 0


def unpack(revision: str, folder: Path) -> None:
    """Write a version of the code to a folder; raises UsageError for what is none."""
    packed = subprocess.run(("git", "archive", revision, *ROOMS), cwd=rows.HERE, capture_output=True)
    if packed.returncode:
        words = " ".join(packed.stderr.decode().split())
        raise UsageError(f"expected a version of this code, found {revision}: {words}")
    subprocess.run(("tar", "-x", "-C", str(folder)), input=packed.stdout, check=True)


def driven(folders: Sequence[Path], scans: int, plans: Sequence[str]) -> list[list[rows.Row]]:
    """Return the digests of all drives by the code of each folder, side by side.

    Raises UsageError where one cannot drive.
    """
    script = (sys.executable, "-P", drives.__file__, str(scans), *plans)
    running = [
        subprocess.Popen(
            script, cwd=folder, env=os.environ | {"PYTHONPATH": str(folder)}, stdout=subprocess.PIPE, text=True
        )
        for folder in folders
    ]
    with ThreadPoolExecutor() as threads:
        told = [out for out, _ in threads.map(subprocess.Popen.communicate, running)]
    for folder, each in zip(folders, running, strict=True):
        if each.returncode:
            raise UsageError(f"expected drives by the code in {folder}, found exit status {each.returncode}: see above")
    return [[json.loads(line) for line in lines.splitlines()] for lines in told]


if __name__ == "__main__":
    run_study(AlikeStudy)
