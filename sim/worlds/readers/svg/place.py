"""Where an element stands, and what of a walk through a document those need that it refers to."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable
from xml.etree.ElementTree import Element

import shapely
import svgelements
from shapely.geometry.base import BaseGeometry

from .cascade import Style, Styles
from .paint import Paint
from .pieces import Group, Piece
from .shapes import Box, Ring, bounds

DEEPEST = 30
"""Clips of clips, masks in masks, patterns of patterns."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where an element stands: what comes down to it from around."""

    style: Style | None
    frame: Any
    whole: tuple[float, float]
    """Width and height that shares are of."""
    clip: BaseGeometry | None = None
    layers: tuple[str, ...] = ()
    ids: tuple[str, ...] = ()
    size: tuple[str, str] = ("", "")
    """Width and height that a <use> gives to what it copies."""


@dataclass
class Found:
    """What the walk has met beside pieces of paint."""

    marks: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    layers: set[str] = field(default_factory=set)
    ids: set[str] = field(default_factory=set)
    left_out: dict[str, int] = field(default_factory=dict)
    averaged: int = 0
    count: int = 0


@runtime_checkable
class Walk(Protocol):
    """A walk through a document, for what an element refers to."""

    styles: Styles
    named: dict[str, Element]
    found: Found

    def within(self, element: Element, name: str, style: Style, place: Place) -> Place:
        """Return the place that an element makes for what is within it."""
        ...

    def outlines(self, element: Element, style: Style, place: Place) -> list[Ring]:
        """Return the outlines of all shapes of an element, painted or not, in a frame that is its own already."""
        ...

    def plain(self, element: Element, place: Place, depth: int) -> list[Piece | Group]:
        """Return what is painted of an element that serves another: all its layers, and no marks."""
        ...


def box_around(walk: Walk, element: Element, style: Style, place: Place) -> Box | None:
    """Return the box around an element in its own frame."""
    return bounds(walk.outlines(element, style, replace(place, frame=svgelements.Matrix())))


def is_gone(style: Style) -> bool:
    """Return whether an element and all within is not rendered at all."""
    return [getattr(token, "lower_value", "") for token in style.tokens("display")] == ["none"]


def overlaid(pieces: list[Piece], adds: Callable[[Paint], bool], removes: Callable[[Paint], bool]) -> BaseGeometry:
    """Return where the uppermost paint that adds or removes one adds."""
    shown: BaseGeometry = shapely.Polygon()
    for piece in pieces:
        if adds(piece.paint):
            shown = shown.union(piece.area())
        elif removes(piece.paint):
            shown = shown.difference(piece.area())
    return shown


def both(one: BaseGeometry | None, other: BaseGeometry) -> BaseGeometry:
    """Return what both let be seen; None lets all."""
    return other if one is None else one.intersection(other)
