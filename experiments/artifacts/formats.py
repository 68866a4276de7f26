"""The format number of every file that is read back: its keys and their order change only with its number.

A file of another number is refused with the reason, but for those of `OLDEST`; settings of older formats are read under
today's names and values.
"""

from collections.abc import Callable, Mapping
from typing import Any

from sim.logs import recorded_robot
from slam.robot import NANO, RobotError, RobotSpec

CONFIG = "config.json"
RECORD = "trials/*.npz"
FORMATS = {
    CONFIG: 16,
    "summary.json": 2,
    "log.npz": recorded_robot.FORMAT,
    "log.arrow": 2,
    "map.npz": 1,
    "map.geojson": 1,
    "visibility.json": 1,
    RECORD: 1,
    "comparison.json": 1,
    "contrast.json": 1,
}
"""By name; `config.json` is that of a run, of a campaign and of merged campaigns."""
OLDEST = {CONFIG: 1, "summary.json": 1}
"""The first format that can still be looked at and replayed, where that is not the one of now. Format 1 of
`config.json` had other names for some settings (`older.RENAMED`), and a campaign no `settings`: nothing goes on.
Format 2 had one setting more (`older.DROPPED`), format 3 no `matching.method`, format 4 no `robot.faults`. Until
format 5 the body and the step stood at several places (`MOVED`), until format 6 no robot was ever lost
(`mission.lost`, `mission.mapper.recovery`), until format 7 short faces were taken for what they seem
(`mission.mapper.walls.reliability.straightness`), until format 8 nothing was round (`mission.explorer.round_things`).
Until format 10 some settings said what another says (`DROPPED`), and `mission.mapper.vertices` was a group.
Until format 11 no scan told a drive's motion (`odometry`). Until format 12 a place in the whole map was sought by
pairs of walls (`DROPPED`), until format 13 walls and lines of few beams were believed and forgotten by rules of their
own (`DROPPED`), until format 14 no wall was followed to and fro (`mission.explorer.following.method`), until
format 15 the scale stood alone (`scale`).
Format 1 of `summary.json` had no `coverage_curve`."""


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


RENAMED: dict[str, str | None] = {
    "scale": "drawing.scale",
    "mission.mapper.walls.pieces.sure_gap_m": "mission.mapper.shared.door_m",
    "mission.mapper.walls.pieces.corner_leap_m": "mission.mapper.shared.within_m",
    "mission.max_steps": None,
    "mission.explorer.sweeping.near_m": "mission.explorer.near_m",
    "mission.explorer.following.looks": "mission.explorer.following.viewpoints",
    "mission.mapper.bends": "mission.mapper.vertices",
    "mission.mapper.bends.young_sightings": None,
    "mission.mapper.chains": None,
    "mission.mapper.duplicates": "mission.mapper.merging",
    "mission.mapper.duplicates.gate": None,
    "mission.mapper.faint": "mission.mapper.walls.existence",
    "mission.mapper.gaps": None,
    "mission.mapper.kinks": "mission.mapper.change_points",
    "mission.mapper.torn": None,
    "mission.mapper.walls.firmness": "mission.mapper.walls.reliability",
    "mission.mapper.walls.trusted_sightings": None,
    "mission.mapper.walls.established_sightings": None,
    "robot.drive.step_max_m": "robot.step_m",
    "robot.drive.turn_max_rad": "robot.turn_rad",
    "robot.drive.wheel_base_m": "robot.wheels.base_m",
    "robot.drive.wheel_slip": "robot.wheels.slip",
    "robot.drive.lateral_slip": "robot.wheels.lateral_slip",
    "robot.drive.floor": "robot.wheels.floor",
    "robot.drive.wheel_speed_m_s": "robot.wheel_speed_m_s",
}
"""Settings of a trial, or groups of them, that had other names in older formats of `config.json`; the longest name
counts. None stands where a setting said nothing of its own."""


DROPPED = {
    "mission.mapper.change_points.most_rad",
    "mission.mapper.ambiguity.turn_rad",
    "mission.mapper.ambiguity.across_m",
    "mission.mapper.candidates.apart_m",
    "mission.mapper.candidates.gate",
    "mission.mapper.candidates.longest_m",
    "mission.mapper.candidates.looks",
    "mission.mapper.candidates.patience_m",
    "mission.mapper.candidates.patience_steps",
    "mission.mapper.candidates.spare_beams",
    "mission.mapper.change_points.agrees_sigmas",
    "mission.mapper.change_points.ends",
    "mission.mapper.change_points.gate_sigmas",
    "mission.mapper.change_points.least_rad",
    "mission.mapper.extraction.corner_beams",
    "mission.mapper.extraction.corner_leap_m",
    "mission.mapper.extraction.loose_cost",
    "mission.mapper.extraction.noise_sigmas",
    "mission.mapper.extraction.open_gate_sigmas",
    "mission.mapper.extraction.settling_rounds",
    "mission.mapper.extraction.sure_gap_m",
    "mission.mapper.matching.apart_m",
    "mission.mapper.matching.beside_m",
    "mission.mapper.matching.clear",
    "mission.mapper.matching.doubt",
    "mission.mapper.matching.offset_m",
    "mission.mapper.matching.short_m",
    "mission.mapper.matching.whole_m",
    "mission.mapper.merging.across_m",
    "mission.mapper.merging.hidden_overlap_m",
    "mission.mapper.merging.hidden_share",
    "mission.mapper.merging.overlap_m",
    "mission.mapper.merging.turn_rad",
    "mission.mapper.merging.turn_sigma_rad",
    "mission.mapper.openings.across_m",
    "mission.mapper.openings.beams",
    "mission.mapper.openings.beyond_m",
    "mission.mapper.openings.least_m",
    "mission.mapper.openings.margin_m",
    "mission.mapper.recovery.contradicted",
    "mission.mapper.recovery.inside_m",
    "mission.mapper.recovery.noise.chance",
    "mission.mapper.recovery.place.across_m",
    "mission.mapper.recovery.place.explained",
    "mission.mapper.recovery.place.least_segments",
    "mission.mapper.recovery.place.overlap",
    "mission.mapper.recovery.place.seeds",
    "mission.mapper.recovery.place.turn_rad",
    "mission.mapper.vertices.across_m",
    "mission.mapper.vertices.beside_m",
    "mission.mapper.vertices.cut_reach_m",
    "mission.mapper.vertices.known",
    "mission.mapper.vertices.largest_rad",
    "mission.mapper.vertices.least_rad",
    "mission.mapper.vertices.past_m",
    "mission.mapper.vertices.past_shown_m",
    "mission.mapper.vertices.reach_m",
    "mission.mapper.vertices.sharpest_rad",
    "mission.mapper.vertices.shown",
    "mission.mapper.vertices.slight_rad",
    "mission.mapper.vertices.young_observations",
    "mission.mapper.walls.claims",
    "mission.mapper.walls.contradictions",
    "mission.mapper.walls.end_margin_m",
    "mission.mapper.walls.established_observations",
    "mission.mapper.walls.existence.apart_m",
    "mission.mapper.walls.existence.gate",
    "mission.mapper.walls.existence.longest_m",
    "mission.mapper.walls.existence.looks",
    "mission.mapper.walls.existence.patience_m",
    "mission.mapper.walls.existence.patience_steps",
    "mission.mapper.walls.existence.spare_beams",
    "mission.mapper.walls.least_m",
    "mission.mapper.walls.pass_margin_m",
    "mission.mapper.walls.patience_m",
    "mission.mapper.walls.patience_steps",
    "mission.mapper.walls.reliability.bend_rad",
    "mission.mapper.walls.reliability.chance",
    "mission.mapper.walls.reliability.crooked_m",
    "mission.mapper.walls.reliability.excess",
    "mission.mapper.walls.reliability.few_heading_rad",
    "mission.mapper.walls.reliability.straightness.face_m",
    "mission.mapper.walls.trusted_observations",
}
"""Settings of older formats whose rules are no more, or that said what another says: the first until format 2, the
others until format 9, 10, 11 or 13."""
VERTICES = "mission.mapper.vertices"
EXPLORER = "mission.explorer."
FOLLOWING = f"{EXPLORER}following."
RADIUS, STEP, TURN = "robot.radius_m", "robot.step_m", "robot.turn_rad"
Moved = Callable[[float, RobotSpec], float] | None


def _beyond(value: float, robot: RobotSpec) -> float:
    return round(value - robot.radius_m, NANO)


def _beside(value: float, robot: RobotSpec) -> float:
    return round(value - 2.0 * robot.radius_m, NANO)


def _within(value: float, robot: RobotSpec) -> float:
    return round(robot.radius_m - value, NANO)


def _way(steps: float, robot: RobotSpec) -> float:
    return round(steps * robot.step_m, NANO)


def _as_it_was(value: float, robot: RobotSpec) -> float:
    return value


MOVED: dict[str, tuple[str, Moved]] = {
    f"{FOLLOWING}paths.radius_m": (RADIUS, None),
    f"{FOLLOWING}paths.squeeze_m": (f"{FOLLOWING}paths.squeeze_beyond_m", _beyond),
    f"{FOLLOWING}paths.tight_m": (f"{FOLLOWING}paths.tight_beyond_m", _beyond),
    f"{FOLLOWING}paths.standoff_m": (f"{FOLLOWING}paths.standoff_beyond_m", _beyond),
    f"{FOLLOWING}paths.escape_m": (f"{FOLLOWING}paths.escape_beyond_m", _beyond),
    f"{FOLLOWING}driving.radius_m": (RADIUS, None),
    f"{FOLLOWING}driving.step_m": (STEP, None),
    f"{FOLLOWING}driving.turn_rad": (TURN, None),
    f"{FOLLOWING}driving.narrow_m": (f"{FOLLOWING}driving.narrow_beyond_m", _beside),
    f"{FOLLOWING}driving.fits_m": (f"{FOLLOWING}driving.fits_beyond_m", _beside),
    f"{FOLLOWING}driving.obstructed_m": (f"{FOLLOWING}driving.obstructed_within_m", _within),
    f"{FOLLOWING}viewpoints.standoff_m": (f"{FOLLOWING}viewpoints.standoff_beyond_m", _beyond),
    f"{FOLLOWING}viewpoints.close_m": (f"{FOLLOWING}viewpoints.close_beyond_m", _beyond),
    f"{FOLLOWING}stall_steps": (f"{FOLLOWING}stall_m", _way),
    f"{EXPLORER}near_m": (f"{EXPLORER}near_beyond_m", _beyond),
    f"{EXPLORER}patience_steps": (f"{EXPLORER}patience_m", _way),
    "mission.free_space.body_m": (RADIUS, None),
    "mission.free_space.clearance_limit_m": ("mission.free_space.clearance_beyond_m", _beyond),
    "mission.floor_memory.last_scans": ("mission.floor_memory.last_m", _way),
    "mission.floor_memory.touched_m": (RADIUS, None),
    "mission.floor_memory.step_m": (STEP, None),
    "mission.homing.home_m": (RADIUS, None),
    "mission.homing.aim_m": (RADIUS, None),
    "mission.retreat.touched_back_m": (RADIUS, None),
    "mission.mapper.candidates.slack_m": ("mission.mapper.walls.existence.slack_m", _as_it_was),
}
"""Settings until format 5 that stood for the robot's body or step, and until format 13 one of another group: today's
key, and its value by the old one. None stands where what the robot states takes their place."""


def told_of(key: str) -> str:
    """Return today's key of a setting that older versions had; empty for any other."""
    if key in MOVED:
        return MOVED[key][0]
    now = renamed(key)
    return now if now is not None and now != key else ""


def is_past(key: str) -> bool:
    """Return whether older versions had this setting, and nothing stands for it now."""
    return key not in MOVED and renamed(key) is None


def today(key: str, value: Any, robot: RobotSpec) -> tuple[str, Any] | None:
    """Return the key and the value now of a setting of an older format; None where nothing stands for it.

    `robot` is what the robot of that time stated.
    """
    now = renamed(key)
    if now == VERTICES and value is None:
        return now, False
    if now is None or now not in MOVED:
        return None if now is None else (now, value)
    name, move = MOVED[now]
    return None if move is None or type(value) not in (int, float) else (name, move(float(value), robot))


def stated_then(said: Mapping[str, Any]) -> RobotSpec:
    """Return the body and the step that the settings of an older format name."""
    found: list[float] = []
    for group, name, default in (("robot", "radius_m", RobotSpec.radius_m), ("drive", "step_max_m", RobotSpec.step_m)):
        within = said.get("robot", {})
        within = within.get("drive", {}) if group == "drive" and isinstance(within, Mapping) else within
        value = within.get(name, default) if isinstance(within, Mapping) else default
        found.append(float(value) if type(value) in (int, float) else default)
    try:
        return RobotSpec(radius_m=found[0], step_m=found[1])
    except RobotError:
        return RobotSpec()


def renamed(key: str) -> str | None:
    """Return today's key of a setting of an older format; None where there is none."""
    parts = key.split(".")
    for count in range(len(parts), 0, -1):
        group = ".".join(parts[:count])
        if group in RENAMED:
            now = RENAMED[group]
            return None if now is None or now + key[len(group) :] in DROPPED else now + key[len(group) :]
    return None if key in DROPPED else key
