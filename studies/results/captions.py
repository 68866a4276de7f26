"""The caption of each picture in docs/pictures, made from what the run behind the picture left.

.venv/bin/python -m studies.results.captions fig9.png --of results/docs/run      # by docs/make-pictures
.venv/bin/python -m studies.results.captions intel.png --words "Intel: ..."      # of a log that is not here

The caption is kept in docs/pictures/captions.json with the checksum of the picture that it is of, and stands on every
page that shows the picture. A test holds all three against each other (tests/docs/test_captions.py).
"""

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from chainslam.experiments.artifacts.files import json_bytes, write
from chainslam.experiments.artifacts.saved import read_config, read_summary
from chainslam.experiments.reproductions import fig4
from chainslam.experiments.usage import UsageError, choose
from chainslam.experiments.views.pictures import read_steps

from ..runner.command import run_study

PICTURES = Path("docs/pictures")
KEPT = "captions.json"
PAGES = ("README.md", "docs/*.md", "docs/*/*.md")


def _where(run: Path) -> str:
    trial = read_config(run / "config.json").trial
    noise = "errorless" if trial.errorless else f"seed {trial.seed}"
    return f"{Path(trial.world).stem}, {trial.backend}, {trial.strategy}, {noise}"


def _closed(run: Path) -> str:
    summary = read_summary(run)
    return f"{summary['contours_closed']} of {summary['contours_reachable']} contours are closed"


def _scans(runs: Sequence[Path]) -> str:
    trial = read_config(runs[0] / "config.json").trial
    return f"the same scans of {Path(trial.world).stem}, seed {trial.seed}"


def _name(run: Path) -> str:
    return read_config(run / "config.json").trial.backend


def _names(runs: Sequence[Path]) -> str:
    return ", ".join(map(_name, runs))


def _map(runs: Sequence[Path]) -> str:
    said = read_summary(runs[0])
    return f"{_where(runs[0])}: the map after {said['steps']} steps, {said['path_length_m']:.1f} m; {_closed(runs[0])}"


def _nees(runs: Sequence[Path]) -> str:
    means = (
        f"{name} {np.nanmean(read_steps(run)[:, 3]) / 3.0:.3g}"
        for run, name in zip(runs, map(_name, runs), strict=True)
    )
    return f"NEES of the pose from the start over {_scans(runs)}, mean over 3 (1 is ideal): {', '.join(means)}"


def _paths(runs: Sequence[Path]) -> str:
    return f"Paths of {_names(runs)} over the true one, and the odometry alone: {_scans(runs)}"


def _model(runs: Sequence[Path]) -> str:
    return f"Walls in the plane of direction and distance, by {_name(runs[0])}: {_scans(runs)}"


def _traversals(runs: Sequence[Path]) -> str:
    metres = read_summary(runs[0])["path_length_m"]
    return f"{_where(runs[0])}: how often each stretch of {metres:.0f} m was driven"


def _one_run(runs: Sequence[Path]) -> str:
    return f"{_where(runs[0])} in the viewer: the map, the state of the estimator, the reasons for each decision"


def _side_by_side(runs: Sequence[Path]) -> str:
    return f"{_names(runs)} in the viewer, side by side on {_scans(runs)}"


def _campaign(runs: Sequence[Path]) -> str:
    return f"A campaign of {len(list(runs[0].glob('trials/**/*.npz')))} trials in the viewer"


def _looked(runs: Sequence[Path]) -> str:
    said = read_summary(runs[0])
    metres, walls = said["path_length_m"], said["second_looks"]["lines"]
    errors = said.get("relations_smoothed")
    error = "" if errors is None else f", {errors['at_scans']['all']['translation_m']['mean']:.3f} m off on average"
    walls_and_path = f"{walls} walls and a path of {metres:.0f} m after offline refinement{error}"
    return f"{_log(runs[0])}: {walls_and_path}; grey: wheel odometry"


def _floor(runs: Sequence[Path]) -> str:
    scans = read_summary(runs[0])["steps"]
    return f"{_log(runs[0])}: the floor that {scans} scans show, at the poses of offline refinement"


def _log_view(runs: Sequence[Path]) -> str:
    panels = "map and wheel odometry, model space, visibility graph, NIS"
    return f"{_log(runs[0])} in the viewer, by {_name(runs[0])}: {panels}"


def _log(run: Path) -> str:
    return Path(read_summary(run)["world"]).name.partition(".")[0].capitalize()


def _record(runs: Sequence[Path], name: str) -> dict[str, Any]:
    record: dict[str, Any] = json.loads((runs[0] / f"{name}.json").read_text())
    return record


def _figure_4(runs: Sequence[Path]) -> str:
    record = _record(runs, "fig4")
    ours = next(iter(record["ours"].values()))
    driven = ours["driven from wall to wall, m"]
    return f"{record['title']}; {fig4.PLANNED}: {ours[fig4.PLANNED]}" + ("" if driven is None else f" ({driven:.1f} m)")


def _figure_10(runs: Sequence[Path]) -> str:
    record = _record(runs, "fig10")
    return f"{record['title']}. {record['notes'][0]}"


CAPTIONS: Mapping[str, Callable[[Sequence[Path]], str]] = {
    "fig9.png": _map, "nees.png": _nees, "paths.png": _paths, "model.png": _model,
    "traversals.png": _traversals, "timeline-run.png": _one_run, "timeline-three.png": _side_by_side,
    "timeline-campaign.png": _campaign, "fig4.png": _figure_4, "fig10.png": _figure_10,
    "intel.png": _looked, "seattle.png": _looked, "intel-floor.png": _floor, "timeline-intel.png": _log_view,
}  # fmt: skip
"""By picture: what makes its caption from the folders of the runs that it shows."""


@dataclass(frozen=True)
class Caption:
    """Write the caption of a picture, beside it and on the pages that show it."""

    picture: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Its file in docs/pictures."""
    of: tuple[Path, ...] = ()
    """Folders of the runs that it shows."""
    words: str = ""
    """The caption itself, of a picture whose runs are not at hand."""
    pictures: Path = PICTURES
    """Where it is."""

    def run(self) -> None:
        """Write the caption; raises UsageError where there is no such picture or nothing that tells its caption."""
        path = self.pictures / self.picture
        if not path.is_file():
            raise UsageError(f"expected a picture, found none at {path}: make it first")
        if bool(self.of) == bool(self.words):
            raise UsageError("expected either --of or --words, found both or none: name one of them")
        caption = self.words or CAPTIONS[choose("picture", self.picture, CAPTIONS)](self.of)
        kept = read_captions(self.pictures)
        kept[self.picture] = {"caption": caption, "sha256": checksum(path)}
        write(self.pictures / KEPT, json_bytes(dict(sorted(kept.items()))))
        for page in (page for pattern in PAGES for page in sorted(Path().glob(pattern))):
            text = page.read_text()
            if (now := with_caption(text, self.picture, caption)) != text:
                write(page, now.encode())


def read_captions(pictures: Path = PICTURES) -> dict[str, dict[str, str]]:
    """Return, by picture, its caption and the checksum of the picture that it is of."""
    path = pictures / KEPT
    kept: dict[str, dict[str, str]] = json.loads(path.read_text()) if path.is_file() else {}
    return kept


def checksum(picture: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(picture.read_bytes()).hexdigest()


def shown(text: str) -> list[tuple[str, str]]:
    """Return the caption and the name of each picture of docs/pictures that a page shows."""
    return re.findall(r"!\[([^]]*)\]\([^)]*\bpictures/([^)/]+)\)", text)


def with_caption(text: str, picture: str, caption: str) -> str:
    """Return a page on which a picture has this caption wherever it is shown."""
    place = rf"!\[[^]]*\](\([^)]*\bpictures/{re.escape(picture)}\))"
    return re.sub(place, lambda found: f"![{caption}]{found[1]}", text)


if __name__ == "__main__":
    run_study(Caption)
