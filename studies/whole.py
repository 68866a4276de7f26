"""The whole study by one command: campaign, bias, heading, strategies, intervals, the paper's figures, and one report.

.venv/bin/python -m studies.whole --out results/study             # hours; begun again, it goes on where it was
.venv/bin/python -m studies.whole --trials 2 --out results/try    # to see what it makes
"""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import tyro

from chainslam.experiments.artifacts.files import write
from chainslam.experiments.artifacts.run_folder import prepare
from chainslam.experiments.campaign.pages.campaign_page import campaign_page
from chainslam.experiments.reproductions import REPRODUCTIONS
from chainslam.experiments.usage import UsageError
from chainslam.viz.reports.report import Page, PagePicture, Section, html

from .paper.page import tables_of
from .runner.rows import read

REPORT = "report.html"


@dataclass(frozen=True)
class Part:
    """One study: what it asks, the words of its command, and where its pictures are."""

    name: str
    title: str
    words: tuple[str, ...]
    """The module and its options, or those of `chainslam`."""
    pictures: tuple[tuple[str, str], ...] = ()
    """File and caption."""

    @property
    def command(self) -> list[str]:
        """What is run."""
        return [sys.executable, "-m", *self.words]


@dataclass(frozen=True)
class WholeStudy:
    """Run every study of the paper's question, one after another, and write one report of them all."""

    trials: int = 20
    """Runs in each cell of the campaign and of each study; ten times as many of heading's short rings."""
    first_seed: int = 1
    """The seed of the first run of each."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/study")
    """Folder for what each study stores, and for report.html."""

    def parts(self) -> list[Part]:
        """Return the studies in their order."""
        at, trials, jobs = str(self.out), str(self.trials), ("--jobs", str(self.jobs))
        first = ("--first-seed", str(self.first_seed))
        cli = "chainslam.experiments.commands.cli"
        bias = (
            "studies.consistency.bias",
            "--strategies",
            "nearest-robot",
            "nearest-start",
            "--seeds",
            trials,
            *first,
            *jobs,
        )
        return [
            Part("campaign", "The campaign",
                 (cli, "compare", "--preset", "paper", "--trials", trials, *first, *jobs, "--out", f"{at}/campaign")),
            Part("bias", "Biased wheels and ranges, with the true association", (*bias, "--out", f"{at}/bias.jsonl")),
            Part("bias-own", "Biased wheels and ranges, each back end matches for itself",
                 (*bias, "--association", "own", "--out", f"{at}/bias-own.jsonl")),
            Part("heading", "Heading error and length of the loop",
                 ("studies.consistency.heading", "--seeds", trials, *first, *jobs, "--out", f"{at}/heading.jsonl",
                  "--picture", f"{at}/heading.png"), (("heading.png", "Pose ANEES by ring and heading error"),)),
            Part("strategies", "How far each strategy drives",
                 ("studies.exploration.strategies", "--seeds", trials, *first, *jobs,
                  "--out", f"{at}/strategies.jsonl")),
            Part("intervals", "Intervals of distances between corners",
                 ("studies.consistency.intervals", "--seeds", trials, *first, *jobs, "--out", f"{at}/intervals.jsonl")),
            Part("paper", "The paper's figures",
                 ("studies.paper.study", "--seeds", trials, *first, *jobs, "--out", f"{at}/paper.jsonl")),
            Part("figures", "One drive of each of the paper's figures",
                 (cli, "reproduce", "--out", f"{at}/figures"),
                 tuple((f"figures/{name}.png", entry.about) for name, entry in REPRODUCTIONS.items())),
        ]  # fmt: skip

    def run(self, perform: Callable[[Part, Path], bool]) -> int:
        """Run every study and write the report; return how many failed. Raises UsageError for a bad number."""
        if self.trials < 1 or self.jobs < 1:
            raise UsageError(
                f"expected at least 1 trial and 1 process, found {self.trials} and {self.jobs}: raise them"
            )
        prepare(self.out)
        failed = []
        for number, part in enumerate(self.parts(), start=1):
            print(f"{number} of {len(self.parts())}: {part.title}", file=sys.stderr, flush=True)
            if not perform(part, self.out / f"{part.name}.txt"):
                failed.append(part.name)
                print(f"{part.name} failed: see {self.out / part.name}.txt", file=sys.stderr, flush=True)
            write(self.out / REPORT, html(self.page(failed)))
        print(f"report in {self.out / REPORT}")
        return len(failed)

    def page(self, failed: list[str]) -> Page:
        """Return the report of what has been run so far: that of the campaign, and a section for each other study."""
        sections = []
        for part in self.parts():
            said = self.out / f"{part.name}.txt"
            shown = [(self.out / file, caption) for file, caption in part.pictures]
            if part.name == "campaign" or not said.exists():
                continue
            tables = tables_of(read(self.out / "paper.jsonl")) if part.name == "paper" else ()
            sections.append(
                Section(
                    part.title,
                    ("This study failed; below is what it said.",) if part.name in failed else (),
                    tuple(tables),
                    tuple(PagePicture(path.read_bytes(), caption) for path, caption in shown if path.exists()),
                    printed="" if tables else said.read_text(),
                )
            )
        done = (self.out / "campaign/comparison.json").exists()
        campaign = campaign_page(self.out / "campaign") if done else Page("", ("The campaign is not done.",), "", ())
        return replace(
            campaign,
            title="What neglecting the cross-correlations costs: every study of it",
            command=f"python -m studies.whole --trials {self.trials} --out {self.out}",
            sections=tuple(sections),
        )


def perform(part: Part, said: Path) -> bool:
    """Run a study as a command of its own, keep what it prints, and return whether it ended well."""
    done = subprocess.run(part.command, stdout=subprocess.PIPE, text=True, check=False)
    write(said, done.stdout.encode())
    return done.returncode == 0


if __name__ == "__main__":
    try:
        sys.exit(bool(tyro.cli(WholeStudy, prog="studies.whole").run(perform)))
    except UsageError as error:
        raise SystemExit(f"whole_study: {error}") from error
