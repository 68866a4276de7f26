"""User-provided text, drawn literally."""

NONE = "–"
"""What stands where there is no value."""


def literal(words: str) -> str:
    r"""Return text that matplotlib draws as it is: between two plain dollar signs it would typeset mathematics.

    An escaped dollar sign is drawn as one, also after a backslash in the text itself.
    """
    return words.replace("$", r"\$")
