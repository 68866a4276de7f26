"""Tables of the console: a headline, and a row for each thing that was measured."""

from collections.abc import Sequence

from rich.table import Table


def headed(title: str, head: Sequence[str], words: int = 1) -> Table:
    """Return a table without rows; its first columns hold words, at the left, the others numbers, at the right."""
    table = Table(title=title, title_justify="left")
    for number, column in enumerate(head):
        table.add_column(column, justify="left" if number < words else "right")
    return table
