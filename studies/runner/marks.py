"""Parts of pages: numbers in words, and tables between `<!-- table: NAME -->` and `<!-- end -->`."""

import re
from collections.abc import Callable

PART = re.compile(r"(<!-- table: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(page: str, make: Callable[[str], str]) -> str:
    """Return the text of a page on which `make` has written every part anew, each by its name."""
    return PART.sub(lambda part: f"{part[1]}\n{make(part[2])}\n\n{part[3]}", page)


def short(value: float) -> str:
    """Return a number to three digits, in words."""
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{float(f'{value:.3g}'):,.0f}"
