"""What shells complete: commands, the options of each, and the values that an option takes."""

import shutil
import subprocess

import pytest

from chainslam.experiments.commands.cli import COMMANDS, main
from chainslam.experiments.terminal.parsing import options_of

ASK = """
source {script}
COMP_WORDS=({words}); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 )); COMP_LINE="{words}"; COMP_POINT=${{#COMP_LINE}}
$(complete -p chainslam | sed 's/.*-F \\([^ ]*\\).*/\\1/') chainslam "${{COMP_WORDS[-1]}}" "${{COMP_WORDS[-2]}}"
echo "${{COMPREPLY[@]}}"
"""


def printed(shell, capsys):
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_command_and_every_option_is_known_to_the_shell(shell, capsys):
    script = printed(shell, capsys)
    for name, entry in COMMANDS.items():
        assert name in script
        for option in options_of(entry.load()):
            assert option.removeprefix("--") in script


def test_bash_completes(capsys, tmp_path):
    script = tmp_path / "completion"
    script.write_text(printed("bash", capsys))
    for words, completed in (
        ("chainslam exp", "explore"),
        ("chainslam explore --max", "--max-steps --max-path"),
        ("chainslam explore --p0 s", "small"),
        ("chainslam explore --backend inv", "invariant-ekf"),
        ("chainslam explore --strategy nearest-s", "nearest-start"),
    ):
        done = subprocess.run(
            ["bash", "-c", ASK.format(script=script, words=words)], capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == completed.split()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_names_that_an_option_takes_are_known_and_options_that_no_user_gives_are_not(shell, capsys):
    script = printed(shell, capsys)
    assert "joint-block-ekf" in script
    assert "frontier" in script
    assert "--given" not in script
    assert " -l given" not in script


def test_fish_completes(capsys, tmp_path):
    """Where fish is installed it is asked itself; the lines are held in any case."""
    script = tmp_path / "completion.fish"
    script.write_text(printed("fish", capsys))
    seen = "complete -c chainslam -n '__fish_seen_subcommand_from explore' -l"
    lines = script.read_text().splitlines()
    assert f"{seen} p0 -x -a 'large small zero'" in lines
    assert f"{seen} seed -x" in lines
    assert f"{seen} out -r" in lines
    assert f"{seen} errorless" in lines
    if shutil.which("fish"):
        asked = f"source {script}; complete -C 'chainslam explore --backend inv'"
        done = subprocess.run(["fish", "--no-config", "-c", asked], capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["invariant-ekf"]


def test_the_words_of_fish_are_quoted(capsys):
    for line in printed("fish", capsys).splitlines():
        assert line.replace("\\'", "").count("'") % 2 == 0


def test_an_unknown_shell_is_refused(capsys):
    assert main(["completion", "bsh"]) == 2
    assert "did you mean bash?" in capsys.readouterr().err
