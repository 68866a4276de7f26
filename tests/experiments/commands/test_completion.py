"""What shells complete: commands, the options of each, and the values that an option takes."""

import subprocess

import pytest

from experiments.commands.cli import COMMANDS, main
from experiments.commands.parsing import options_of

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
    ):
        done = subprocess.run(
            ["bash", "-c", ASK.format(script=script, words=words)], capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == completed.split()


def test_the_words_of_fish_are_quoted(capsys):
    for line in printed("fish", capsys).splitlines():
        assert line.replace("\\'", "").count("'") % 2 == 0


def test_an_unknown_shell_is_refused(capsys):
    assert main(["completion", "bsh"]) == 2
    assert "did you mean bash?" in capsys.readouterr().err
