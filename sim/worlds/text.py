"""Text that comes with a world, made safe for terminals, file names, JSON, XML and pictures."""

LONGEST = 80
"""Longest name or label, in characters."""
JOINERS = "\u200c\u200d"
"""Not printable by themselves, but part of words in Persian and Hindi, and of emoji."""
STRANGE = "\N{REPLACEMENT CHARACTER}"


def printable(text: str) -> str:
    """Return text on one line, with U+FFFD for every character that cannot be shown.

    Such are control characters (those that steer a terminal among them), halves of surrogate pairs, which UTF-8 cannot
    hold, what reverses the direction of writing, and code points that mean nothing. White space becomes single spaces.
    """
    shown = (c if c.isprintable() or c in JOINERS else " " if c.isspace() else STRANGE for c in text)
    return " ".join("".join(shown).split())


def name_of(text: str) -> str:
    """Return text as a name: printable, not empty, and at most 80 characters."""
    name = printable(text)
    return "unnamed" if not name else name if len(name) <= LONGEST else name[: LONGEST - 1] + "…"
