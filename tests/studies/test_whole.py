"""The whole study: every part is run, what it said is in one report, and a part that failed is told."""

import subprocess
from html import escape

import pytest

from chainslam.experiments.artifacts.files import write
from chainslam.experiments.usage import UsageError
from studies.whole import REPORT, WholeStudy


def test_each_part_is_run_in_order_and_its_words_are_in_the_report(tmp_path):
    study, run = WholeStudy(trials=2, out=tmp_path / "study"), []

    def perform(part, said):
        run.append(part.name)
        write(said, f"table of <{part.name}>\n".encode())
        return part.name != "bias"

    assert study.run(perform) == 1
    assert run == [part.name for part in study.parts()]
    page = (study.out / REPORT).read_text()
    for part in study.parts():
        if part.name not in ("campaign", "paper"):
            assert escape(part.title).replace("&#x27;", "&#39;") in page
            assert f"table of &lt;{part.name}&gt;" in page
    assert page.count("This study failed") == 1
    assert "--trials 2" in page


def test_numbers_without_sense_are_refused_before_anything_is_made(tmp_path):
    with pytest.raises(UsageError, match="at least 1 trial"):
        WholeStudy(trials=0, out=tmp_path / "study").run(lambda part, said: True)
    assert not (tmp_path / "study").exists()


@pytest.mark.long
def test_each_part_has_the_options_that_it_is_called_with(tmp_path):
    for part in WholeStudy(out=tmp_path).parts():
        words = [word for word in part.command if not word.startswith("--")]
        command = words[: 4 if "cli" in part.words[0] else 3]
        said = subprocess.run([*command, "--help"], capture_output=True, text=True, check=True).stdout
        for option in (word for word in part.words if word.startswith("--")):
            assert option in said, (part.name, option)
