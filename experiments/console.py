"""Where tables and progress go: a console that prints what it is given."""

from rich.console import Console


def plain_console(*, stderr: bool = False, width: int | None = None) -> Console:
    """Return a console without markup and emoji: names are the user's, and `random:1234:` is an emoji."""
    return Console(stderr=stderr, width=width, markup=False, emoji=False)
