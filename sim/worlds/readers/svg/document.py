"""An SVG file's bytes as elements that can be walked within bounds."""

import gzip
import zlib
from math import comb
from xml.etree.ElementTree import Element

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from ...drawing import WorldError, shorten
from ..files import FILE_MAX

SVG = "{http://www.w3.org/2000/svg}"
XLINK = "{http://www.w3.org/1999/xlink}href"
LABELS = (
    "{http://www.inkscape.org/namespaces/inkscape}label",
    "{http://www.serif.com/}id",
    "data-name",
)
"""What drawing programs call a layer or a shape: Inkscape, Affinity, Illustrator."""
SHAPES = 200_000
DEEPEST = 200
WORDS_MAX = 10_000
"""Characters of an attribute that is no path."""
STYLE_MAX = 200_000
COMBINATIONS_MAX = 2**20
"""Ways in which the parts of one selector may be laid over the elements around another."""


def parse(data: bytes) -> Element:
    """Return the root element; raise WorldError for entity tricks and for what is not SVG."""
    try:
        root = defusedxml.ElementTree.fromstring(_unzipped(data))
    except WorldError:
        raise
    except DefusedXmlException:
        raise WorldError("expected an SVG file without entity declarations, found some: save it as plain SVG") from None
    except Exception as error:
        raise WorldError(f"expected an SVG file, found broken XML ({shorten(str(error))}): save it again") from None
    if kind(root) != "svg":
        raise WorldError(f"expected an <svg> element, found <{shorten(root.tag)}>: choose an SVG file")
    _check_words(root)
    if copies(root) > SHAPES:
        raise WorldError(f"expected at most {SHAPES} shapes, found more, counting <use> copies: simplify the drawing")
    return root


def kind(element: Element) -> str:
    """Return an element's name; nothing for a comment and for one of another language than SVG."""
    tag = element.tag if isinstance(element.tag, str) else ""
    return tag.removeprefix(SVG) if tag.startswith(SVG) or not tag.startswith("{") else ""


def link(element: Element) -> str:
    """Return the id that an element refers to; nothing for none, and for one in another file."""
    text = element.get("href") or element.get(XLINK) or ""
    return text.strip()[1:] if text.strip().startswith("#") else ""


def names(element: Element) -> tuple[str, ...]:
    """Return what an element is called, its id first."""
    return tuple(name for key in ("id", *LABELS) if (name := element.get(key)))


def check_selector(text: str, depth: int, beside: int) -> bool:
    """Return whether a selector is matched soon in a document of that depth and so many elements side by side."""
    parts = max(len(text.replace("~", " ").replace(">", " ").replace("+", " ").split()) - 1, 0)
    return comb(max(depth, beside if "~" in text else 0) + parts, parts) <= COMBINATIONS_MAX and text.count("(") < 10


def _unzipped(data: bytes) -> bytes:
    """Return the bytes of an SVG file that may be compressed (.svgz)."""
    if data[:2] != b"\x1f\x8b":
        return data
    opened = zlib.decompressobj(wbits=31)
    try:
        plain = opened.decompress(data, FILE_MAX)
    except (zlib.error, gzip.BadGzipFile) as error:
        raise WorldError(f"expected a compressed SVG file, found {shorten(str(error))}: save it again") from None
    if opened.unconsumed_tail:
        raise WorldError("expected at most 64 MB of SVG, found more behind the compression: simplify the drawing")
    if not opened.eof:
        raise WorldError("expected a compressed SVG file, found one that ends early: save it again")
    return plain


def _check_words(root: Element) -> None:
    """Raise WorldError for attributes and styles on which the parser would work for minutes."""
    for element in root.iter():
        # Paths are read in one pass, embedded pictures and a program's own attributes not at all.
        words = [t for key, t in element.items() if key not in ("d", "points") and key[0] != "{" and t[:5] != "data:"]
        longest = max((len(text) for text in words), default=0)
        style = len(element.text or "") if kind(element) == "style" else 0
        if longest > WORDS_MAX or style > STYLE_MAX:
            raise WorldError(
                f"expected at most {WORDS_MAX} characters in an attribute and {STYLE_MAX} in a <style>,"
                f" found {max(longest, style)}: simplify it"
            )


def copies(root: Element) -> int:
    """Return how many elements there are once every <use> is replaced by what it names; huge for endless loops."""
    named = {element.get("id"): element for element in root.iter() if element.get("id")}
    known: dict[int, int] = {}

    def count(element: Element, depth: int) -> int:
        if id(element) not in known:
            known[id(element)] = SHAPES + 1
            total = 1 + sum(count(child, depth + 1) for child in element) if depth < DEEPEST else SHAPES + 1
            target = named.get(link(element))
            if kind(element) == "use" and target is not None:
                total += count(target, depth + 1)
            known[id(element)] = total
        return known[id(element)]

    return count(root, 0)
