"""The directive `command-help`: what `chainslam COMMAND --help` prints, for every command, from the code as it is."""

import io
import os
import re
from contextlib import redirect_stdout, suppress
from unittest.mock import patch

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

COLUMNS = "84"


def help_of(words: list[str]) -> str:
    """Return the help of `chainslam` or of one of its commands, without colours and boxes."""
    from chainslam.experiments.commands.cli import main

    said = io.StringIO()
    terminal = {"COLUMNS": COLUMNS, "NO_COLOR": "1", "TERM": "dumb"}
    with patch.dict(os.environ, terminal), redirect_stdout(said), suppress(SystemExit):
        main([*words, "--help"])
    return plain(said.getvalue())


def plain(boxed: str) -> str:
    """Return a help without the boxes around its parts."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", boxed)
    text = re.sub(r"^╭─* (.*?) ─*╮$", r"\1:", text, flags=re.MULTILINE)
    text = re.sub(r"^[╰╭]─*[╯╮]\n?", "", text, flags=re.MULTILINE)
    return "\n".join(re.sub(r"^│ (.*?) *│$", r"  \1", line).rstrip() for line in text.splitlines()).strip()


class CommandHelp(SphinxDirective):
    """A section for each command, with its help."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        from chainslam.experiments.commands.cli import COMMANDS

        found: list[nodes.Node] = []
        for name in COMMANDS:
            section = nodes.section(ids=[f"chainslam-{name}"], names=[f"chainslam {name}"])
            section += nodes.title("", f"chainslam {name}")
            text = help_of([name])
            section += nodes.literal_block(text, text, language="none")
            found.append(section)
        return found


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True}
