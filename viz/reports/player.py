"""The player of films of runs, as a piece of HTML that fetches nothing: truth, estimate and NEES, step by step."""

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from .. import palette


def player(films: Sequence[Mapping[str, Any]]) -> Markup:
    """Return a player of films (`experiments.views.player.film_of`) that offers one at a time."""
    data = json.dumps({"films": list(films), "colours": palette.backends()}, separators=(",", ":"))
    style, script = (files(__package__).joinpath(f"player.{kind}").read_text("utf-8") for kind in ("css", "js"))
    # Within a script element only "</script" and "<!--" would be read as HTML.
    held = data.replace("<", "\\u003c")
    return Markup(
        f'<style>\n{style}</style>\n<div class="player"><script type="application/json">{held}</script></div>\n'
        f"<script>\n{script}</script>\n"
    )
