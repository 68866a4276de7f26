"""The directive `player`: the player of runs with the films that it names, one a line, as files beside its page."""

import json
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Player(SphinxDirective):
    """The player, as part of the page: no file is fetched."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return its HTML."""
        from chainslam.viz.reports.player import player

        films = [Path(self.env.relfn2path(name)[1]) for name in self.content]
        for film in films:
            self.env.note_dependency(str(film))
        return [nodes.raw("", player([json.loads(film.read_text()) for film in films]), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the directive."""
    app.add_directive("player", Player)
    return {"parallel_read_safe": True}
