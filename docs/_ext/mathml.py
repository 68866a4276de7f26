"""Formulas as MathML, which browsers show without a script and without the network; docutils makes it of TeX."""

import re

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

THIN = "0.17em"
FUNCTION = re.compile(r"<mi[^>]*>(\w+)</mi>\s*<mo>&ApplyFunction;</mo>(\s*(?:<mo[^>]*>[(\[{]|<mi[^>]*>\w{2}))?")
"""A function's name, and a bracket or another function if one follows."""
INDEX_BELOW = re.compile(r'<mo stretchy="false">[^<]*</mo>\s*</munderover>')
"""An accent whose base has an index, which docutils sets below the base and not beside it."""


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula in a line of text."""
    writer.body.append(mathml(node, as_block=False))
    raise nodes.SkipNode


def displayed(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula on lines of its own, which scroll where the screen is narrower."""
    writer.body.append(f'<div class="math">{mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def mathml(node: nodes.math | nodes.math_block, as_block: bool) -> str:
    """Return a formula as MathML; one that docutils cannot read, or sets wrongly, is a warning, and is left out."""
    try:
        found = FUNCTION.sub(spaced, tex2mathml(node.astext(), as_block))
        if INDEX_BELOW.search(found):
            raise MathError("an index after an accent; write it on another symbol")
    except MathError as error:
        logging.getLogger(__name__).warning("expected TeX that docutils can read, found: %s", error, location=node)
        return ""
    return found


def spaced(function: re.Match[str]) -> str:
    """Return a function's name with thin spaces around it, as TeX sets them; docutils leaves none."""
    name, following = function.groups(default="")
    return f'<mo lspace="{THIN}" rspace="{"0" if following else THIN}">{name}</mo>{following}'


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the renderer."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
