"""What a person reads in the help, and what is told of a word that is nearly one that there is."""

import re

import pytest

from chainslam.experiments.commands.cli import COMMANDS, main
from chainslam.experiments.terminal.parsing import options_of

WORLD = ["explore", "rooms"]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_has_no_word_of_pythons(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    told = capsys.readouterr().out
    assert not re.findall(r"None|default: (?:True|False|\))|\b(?:INT|FLOAT|STR)\b|-- ?PATH", told)
    for option in options_of(COMMANDS[name].load()):
        assert option in told


def test_the_help_says_what_a_value_is_and_what_holds_without_it(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        main(["explore", "--help"])
    told = capsys.readouterr().out
    for words in ("--seed N ", "(default: 1)", "--max-path METRES", "--set KEY=VALUE", "--out DIR", "--rrd FILE",
                  "--start X Y [HEADING]", "(default: on)", "(default: off)", "(default: graph)",
                  "--p0 {zero,small,large}"):  # fmt: skip
        assert words in told
    assert "driving and scanning, not computing" in " ".join(told.replace("│", "").split())


@pytest.mark.parametrize(
    ("words", "near"),
    [
        (["explor"], "explore"),
        (["explore", "romms"], "rooms"),
        ([*WORLD, "--sede", "3"], "--seed"),
        ([*WORLD, "--no-swep"], "--no-sweep"),
        ([*WORLD, "--strategys=frontier"], "--strategy"),
        ([*WORLD, "--backend", "fulekf"], "full-ekf"),
        ([*WORLD, "--strategy", "nearest-robot,nearest-strat@10"], "nearest-start"),
        ([*WORLD, "--preset", "paper-metod"], "paper-method"),
        ([*WORLD, "--navigation", "flor"], "floor"),
        ([*WORLD, "--p0", "Large"], "large"),
        (["replay", "log.npz", "--backend", "invariant"], "invariant-ekf"),
        (["compare", "--preset", "smok", "--out", "c"], "smoke"),
        (["compare", "--worlds", "halle", "--backends", "graph", "--strategies", "frontier", "--trials", "1",
          "--out", "c"], "hall"),
        (["reproduce", "fig55"], "fig5"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value)[:50],
)  # fmt: skip
def test_what_is_nearly_a_name_is_asked_for(words, near, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    told = capsys.readouterr().err
    assert f"(did you mean {near}?)" in told
    assert len(told.strip().splitlines()) == 1


@pytest.mark.parametrize("words", [["zebra"], [*WORLD, "--xyzzy"], [*WORLD, "--backend", "magic"], ["explore", "?"]])
def test_what_is_near_to_nothing_is_not_guessed(words, capsys):
    assert main(words) == 2
    assert "did you mean" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([*WORLD, "--seed", "x"], "expected a whole number for --seed, found 'x'"),
        ([*WORLD, "--max-path", "far"], "expected a number for --max-path, found 'far'"),
        ([*WORLD, "--max-steps", "1.5"], "expected a whole number for --max-steps, found '1.5'"),
        (["compare"], "--out DIR"),
        ([*WORLD, "hall"], "expected no more words for explore, found 'hall'"),
        ([], "expected a command, found none"),
    ],
)
def test_bad_usage_is_told_in_words_of_the_command(words, told, capsys):
    assert main(words) == 2
    said = capsys.readouterr().err
    assert told in said
    assert f"see `chainslam {words[0]} --help`" in said if words else "see `chainslam --help`" in said


@pytest.mark.parametrize("words", [["--version"], ["-V"], ["version"]])
def test_the_version_is_told(words, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(words)
    assert leaving.value.code == 0
    assert capsys.readouterr().out.startswith("chainslam ")


SIZES = {
    "far too small": ('<rect width="0.02" height="0.02"/>', ""),
    "in centimetres": ('<rect width="800" height="600"/>', ""),
    "a scale that makes it far too large": ('<rect width="8" height="6"/>', "5000"),
}


@pytest.mark.parametrize(("shape", "scale"), SIZES.values(), ids=SIZES)
def test_every_message_about_size_names_the_option(shape, scale, capsys, tmp_path):
    drawing = tmp_path / "plan.svg"
    drawing.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" fill="none" stroke="black">{shape}</svg>')
    assert main(["explore", str(drawing), *(["--scale", scale] if scale else [])]) == 2
    assert "--scale" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["report", "PLACE"], "found no folder PLACE"),
        (["view", "PLACE.rrd"], "found no PLACE.rrd"),
        (["replay", "PLACE/log.npz"], "found no file PLACE/log.npz"),
        (["explore", "rooms", "--set", "mission.maper.matching.gate=0.9"], "(is it mission.mapper?)"),
        (["explore", "rooms", "--set", "mision.mapper.x=1"], "(is it mission?)"),
    ],
)
def test_a_line_names_what_is_missing_or_meant(words, told, tmp_path, capsys):
    place = str(tmp_path / "nothing")
    assert main([word.replace("PLACE", place) for word in words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told.replace("PLACE", place) in line
