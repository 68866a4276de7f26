"""Which value of a property applies to an element: style sheets, attributes and inheritance.

Selectors and colours are parsed by cssselect2 and tinycss2. This module implements the order of CSS (Cascading and
Inheritance Level 4, section 6): important before normal, `style` before sheets before attributes, more specific before
less specific, later before earlier. An invalid value is ignored, as CSS demands, and remembered.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any
from xml.etree.ElementTree import Element

import cssselect2
import tinycss2

from .document import check_selector, kind
from .paint import BLACK, Paint, Server, paint_of

INHERITED = {
    *("fill", "stroke", "fill-opacity", "stroke-opacity", "stroke-width", "fill-rule", "clip-rule", "visibility"),
    *("color", "stroke-linecap", "stroke-linejoin", "paint-order"),
}
WORDS: dict[str, tuple[str, ...]] = {
    "fill-rule": ("nonzero", "evenodd"),
    "clip-rule": ("nonzero", "evenodd"),
    "visibility": ("visible", "hidden", "collapse"),
    "stroke-linecap": ("butt", "round", "square"),
    "stroke-linejoin": ("miter", "miter-clip", "round", "bevel", "arcs"),
    "overflow": ("visible", "hidden", "scroll", "auto"),
    "mask-type": ("luminance", "alpha"),
    "vector-effect": ("none", "non-scaling-stroke"),
}
"""Properties whose value is one word; the first is what holds where nothing is said."""
OPACITIES = ("opacity", "fill-opacity", "stroke-opacity", "stop-opacity")
ATTRIBUTES = frozenset((*INHERITED, *WORDS, *OPACITIES, "display", "clip-path", "mask", "stop-color",
                        "marker", "marker-start", "marker-mid", "marker-end", "filter"))  # fmt: skip
"""Attributes that are properties: what stands in them is read as in a style."""
PAINTS: dict[str, Paint] = {"fill": BLACK, "stroke": Paint(1.0, 0.0), "color": BLACK, "stop-color": BLACK}
Tokens = list[Any]


class Styles:
    """The style sheets of a document, laid over its elements."""

    def __init__(self, root: Element) -> None:
        self.unknown: dict[str, int] = {}
        """What was not understood, and how often."""
        self._matcher = cssselect2.Matcher()
        depth, beside = _size(root)
        for sheet in (element for element in root.iter() if kind(element) == "style"):
            if _is_shown(sheet.get("media", "all")) and "css" in sheet.get("type", "text/css").lower():
                rules = tinycss2.parse_stylesheet("".join(sheet.itertext()), True, True)
                self._add(rules, depth, beside)
        wrapped = cssselect2.ElementWrapper.from_xml_root(root).iter_subtree()
        self._rules = {id(each.etree_element): self._matcher.match(each) for each in wrapped}
        self._declared: dict[int, dict[str, list[Tokens]]] = {}

    def _add(self, rules: Iterable[Any], depth: int, beside: int) -> None:
        for rule in rules:
            if rule.type == "at-rule" and rule.lower_at_keyword == "media" and rule.content is not None:
                if _is_shown(tinycss2.serialize(rule.prelude)):
                    self._add(tinycss2.parse_rule_list(rule.content, True, True), depth, beside)
            elif rule.type == "qualified-rule":
                text = tinycss2.serialize(rule.prelude).strip()
                try:
                    if not check_selector(text, depth, beside):
                        raise ValueError
                    for selector in cssselect2.compile_selector_list(rule.prelude):
                        if selector.pseudo_element is None:
                            self._matcher.add_selector(selector, _declarations(rule.content))
                except (cssselect2.SelectorError, ValueError, RecursionError, SyntaxError, MemoryError):
                    self.note(f"the selector {text}")

    def note(self, what: str) -> None:
        """Remember that something was not understood."""
        self.unknown[what] = self.unknown.get(what, 0) + 1

    def of(self, element: Element, around: "Style | None") -> "Style":
        """Return what holds for an element inside another, which a <use> may have put around it."""
        return Style(self, element, self._of(element), around)

    def _of(self, element: Element) -> dict[str, list[Tokens]]:
        """Return the values that are said of each property, the one that holds first."""
        if id(element) not in self._declared:
            said: list[tuple[tuple[bool, int, Any, int], str, Tokens]] = []
            for key, text in element.items():
                if key == "style":
                    for name, tokens, important in _declarations(text):
                        said.append(((important, 2, (0, 0, 0), len(said)), name, tokens))
                elif key in ATTRIBUTES:
                    said.append(((False, 0, (0, 0, 0), 0), key, tinycss2.parse_component_value_list(text, True)))
            for specificity, order, _, declared in self._rules.get(id(element), ()):
                for place, (name, tokens, important) in enumerate(declared):
                    said.append(((important, 1, (specificity, order), place), name, tokens))
            values: dict[str, list[Tokens]] = {}
            for _, name, tokens in sorted(said, key=lambda each: each[0], reverse=True):
                values.setdefault(name, []).append(tokens)
            self._declared[id(element)] = values
        return self._declared[id(element)]


class Style:
    """What holds for one element."""

    def __init__(
        self, styles: Styles, element: Element, said: Mapping[str, list[Tokens]], around: "Style | None"
    ) -> None:
        self._styles, self._element, self._said, self._around = styles, element, said, around
        self._known: dict[str, Any] = {}

    def text(self, name: str) -> str:
        """Return a measure or a transform as text, empty where nothing is said: a style goes before the attribute."""
        tokens = self._said.get(name)
        if tokens is None:
            return self._element.get(name, "").strip()
        return tinycss2.serialize(self._filled(tokens[0]) or []).strip()

    def tokens(self, name: str) -> Tokens:
        """Return the value of a property that is not handed down."""
        said = self._said.get(name)
        return [token for token in (self._filled(said[0]) if said else None) or [] if token.type != "whitespace"]

    def word(self, name: str) -> str:
        """Return the value of a property that is one word."""
        allowed = WORDS[name]
        return str(self._value(name, lambda tokens: _word(tokens, allowed), allowed[0]))

    def opacity(self, name: str) -> float:
        """Return an opacity, 0 to 1."""
        return float(self._value(name, _share, 1.0))

    def paint(self, name: str) -> Paint | Server:
        """Return a paint, or a reference to one."""
        found: Paint | Server = self._value(name, lambda tokens: paint_of(tokens, self._current), PAINTS[name])
        return found

    def inherited(self, name: str, read: Callable[[Tokens], Any], initial: Any) -> Any:
        """Return the value of another property, read from tokens; None from `read` is what it does not understand."""
        return self._value(name, read, initial)

    def _current(self) -> Paint:
        style = self._around if self._known.get("color") is self else self
        found = style.paint("color") if style is not None else BLACK
        return found if isinstance(found, Paint) else BLACK

    def _value(self, name: str, read: Callable[[Tokens], Any], initial: Any) -> Any:
        if name not in self._known:
            self._known[name] = self
            self._known[name] = self._computed(name, read, initial)
        found = self._known[name]
        return initial if found is self else found

    def _computed(self, name: str, read: Callable[[Tokens], Any], initial: Any) -> Any:
        def above() -> Any:
            return initial if self._around is None else self._around._value(name, read, initial)

        for tokens in self._said.get(name, ()):
            filled = self._filled(tokens)
            whole = [token for token in filled or [] if token.type not in ("whitespace", "comment")]
            word = whole[0].lower_value if len(whole) == 1 and whole[0].type == "ident" else ""
            if word == "inherit" or (word in ("unset", "revert", "revert-layer") and name in INHERITED):
                return above()
            if word in ("initial", "unset", "revert", "revert-layer"):
                return initial
            found = read(whole) if whole else None
            if found is not None:
                return found
            self._styles.note(f"{name} {tinycss2.serialize(tokens).strip()}")
            # A value with a variable in it has won before anybody could know that it is none.
            if filled is not tokens:
                break
        return above() if name in INHERITED else initial

    def _filled(self, tokens: Tokens, depth: int = 0) -> Tokens | None:
        """Return a value with its variables filled in; None where one is said nowhere."""
        if not any(_holds_variable(token) for token in tokens):
            return tokens
        result: Tokens = []
        for token in tokens:
            if token.type != "function" or not _holds_variable(token):
                result.append(token)
                continue
            if token.lower_name == "var":
                part = self._variable(token.arguments, depth)
            else:
                inner = self._filled(token.arguments, depth + 1) if depth < 20 else None
                text = None if inner is None else f"{token.name}({tinycss2.serialize(inner)})"
                part = None if text is None else tinycss2.parse_component_value_list(text)
            if part is None or len(result) + len(part) > 1000:
                return None
            result += part
        return result

    def _variable(self, arguments: Tokens, depth: int) -> Tokens | None:
        name = next((each.value for each in arguments if each.type == "ident"), "")
        style: Style | None = self
        while style is not None and depth < 20:
            if name in style._said:
                return style._filled(style._said[name][0], depth + 1)
            style = style._around
        comma = next((i for i, each in enumerate(arguments) if each == ","), None)
        return None if comma is None or depth >= 20 else self._filled(arguments[comma + 1 :], depth + 1)


def _declarations(text: Any) -> list[tuple[str, Tokens, bool]]:
    found = tinycss2.parse_blocks_contents(text, True, True)
    return [
        (each.name if each.name.startswith("--") else each.lower_name, each.value, bool(each.important))
        for each in found
        if each.type == "declaration"
    ]


def _holds_variable(token: Any) -> bool:
    return token.type == "function" and (token.lower_name == "var" or any(map(_holds_variable, token.arguments)))


def _word(tokens: Tokens, allowed: tuple[str, ...]) -> str | None:
    word = tokens[0].lower_value if len(tokens) == 1 and tokens[0].type == "ident" else ""
    return word if word in allowed else None


def _share(tokens: Tokens) -> float | None:
    if len(tokens) != 1 or tokens[0].type not in ("number", "percentage"):
        return None
    value = tokens[0].value / (100 if tokens[0].type == "percentage" else 1)
    return min(max(float(value), 0.0), 1.0)


def _is_shown(media: str) -> bool:
    """Return whether a style of these media holds for a viewer with a light page on a screen."""
    asked = [" ".join(each.lower().replace("only ", "").split()) for each in media.split(",")]
    return any(each in ("", "all", "screen", "(prefers-color-scheme: light)", "(prefers-color-scheme:light)",
                        "screen and (prefers-color-scheme: light)") for each in asked)  # fmt: skip


def _size(root: Element) -> tuple[int, int]:
    """Return how deep a document is, and the most elements side by side."""
    deepest, beside, level = 0, 0, [root]
    while level:
        deepest, beside = deepest + 1, max(beside, *(len(each) for each in level))
        level = [child for each in level for child in each]
    return deepest, beside
