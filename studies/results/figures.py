"""What many rows come to, in the words of a table."""

from collections.abc import Mapping, Sequence

import numpy as np
import rich.table

from chainslam.slam.evaluation.consistency import noise_model

from ..runner.marks import short
from ..runner.rows import Row

Table = list[list[str]]


def of_console(table: rich.table.Table) -> Table:
    """Return the cells of a table that a study prints."""
    columns = [[str(column.header), *map(str, column.cells)] for column in table.columns]
    return [list(cells) for cells in zip(*columns, strict=True)]


def grouped(rows: Sequence[Row], name: str) -> Mapping[str, list[Row]]:
    """Return the rows by what they have under a name."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row[name], []).append(row)
    return found


def numbers(rows: Sequence[Row], name: str) -> list[float]:
    """Return the numbers that the rows have under a name."""
    return [row[name] for row in rows if row[name] is not None]


def mean_of(rows: Sequence[Row], name: str) -> float:
    """Return their mean."""
    return float(np.mean(numbers(rows, name)))


def median_of(rows: Sequence[Row], name: str, digits: int = 3) -> str:
    """Return their median to so many digits, in words."""
    return f"{np.median(numbers(rows, name)):.{digits}g}"


def typical(rows: Sequence[Row], name: str) -> str:
    """Return their mean and their median, in words."""
    return f"{short(mean_of(rows, name))}, {median_of(rows, name)}"


def pose_score(rows: Sequence[Row]) -> tuple[str, str]:
    """Return what the pose is scored by, in words, and its name: from the start, but for rows older than that score."""
    told = [row for row in rows if row.get("pose_anees") is not None]
    if told and all(row.get("pose_anees_from_start") is not None for row in told):
        return "pose ANEES from the start", "pose_anees_from_start"
    return "pose ANEES", "pose_anees"


def innovations(rows: Sequence[Row]) -> str:
    """Return the mean NIS, the share of scans in its band, and what both say of the stated noise; "-" without any."""
    told = [row for row in rows if row.get("nis") is not None]
    if not told:
        return "-"
    nis, share = mean_of(told, "nis"), mean_of(told, "nis_in_band")
    return f"{nis:.2f}, {100 * share:.0f} %: {noise_model(nis, share)}"


def total(rows: Sequence[Row], name: str) -> int:
    """Return their sum."""
    return round(sum(numbers(rows, name)))


def completed(rows: Sequence[Row]) -> str:
    """Return how many runs are complete, in words."""
    return f"{sum(row['status'] == 'complete' for row in rows)} of {len(rows)}"


def closed_contours(rows: Sequence[Row]) -> str:
    """Return how many contours are closed, in words."""
    return f"{total(rows, 'contours_closed')} of {total(rows, 'contours_reachable')}"


def false_matches(rows: Sequence[Row]) -> list[int]:
    """Return the false matches of each row that are of segments of five beams or more: older rows have no others."""
    return [row["false_matches"] - row.get("false_matches_few_beams", 0) for row in rows]
