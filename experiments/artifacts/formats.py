"""The format number of every file that is read back: its keys and their order change only with its number.

A file of another number is refused with the reason, but for those of `OLDEST`.
"""

from typing import Any

from sim.logs import recorded_robot

CONFIG = "config.json"
RECORD = "trials/*.npz"
FORMATS = {
    CONFIG: 7,
    "summary.json": 2,
    "log.npz": recorded_robot.FORMAT,
    "log.arrow": 2,
    "map.npz": 1,
    "map.geojson": 1,
    RECORD: 1,
    "comparison.json": 1,
    "contrast.json": 1,
}
"""By name; `config.json` is that of a run, of a campaign and of merged campaigns."""
OLDEST = {CONFIG: 1, "summary.json": 1}
"""The first format that can still be looked at and replayed, where that is not the one of now. Format 1 of
`config.json` had other names for some settings (`older.RENAMED`), and a campaign no `settings`: nothing goes on.
Format 2 had one setting more (`older.DROPPED`), format 3 no `matching.method`, format 4 no `robot.faults`. Until
format 5 the body and the step stood at several places (`older.MOVED`), until format 6 no robot was ever lost
(`mission.lost`, `mission.mapper.recovery`). Format 1 of `summary.json` had no `coverage_curve`."""


def stamp(name: str) -> dict[str, int]:
    """Return what every file of this name holds: the number of its format."""
    return {"format": FORMATS[name]}


def fault(said: Any, name: str, older: bool = True) -> str:
    """Return in words what is wrong with the format number in a file; empty where it can be read.

    `older` says whether the formats since `OLDEST` will do.
    """
    least = OLDEST.get(name, FORMATS[name]) if older else FORMATS[name]
    if type(said) is int and least <= said <= FORMATS[name]:
        return ""
    shown = said if isinstance(said, int | float) else type(said).__name__
    return f"format {str(shown)[:20]}, where this version reads {FORMATS[name]}"
