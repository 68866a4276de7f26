"""Words that come from outside, drawn letter by letter."""

NONE = "–"
"""What stands where there is no value."""


def literal(words: str) -> str:
    r"""Return words for matplotlib that it draws as they are: between two bare dollar signs it would set mathematics.

    An escaped dollar sign is drawn as one, also after a backslash of the words' own.
    """
    return words.replace("$", r"\$")
