"""Named settings: the method of `--preset paper-method` and the robots of `--robot`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from chainslam.sim.logs.archive import regular
from chainslam.sim.robot import RobotConfig
from chainslam.sim.robots import ROBOTS
from chainslam.sim.worlds.drawing import WorldError
from chainslam.sim.worlds.readers.plain_yaml import FILE_MAX, plain_mapping
from chainslam.slam.robot import LidarSpec, RobotSpec

from ..usage import UsageError, did_you_mean
from .schema import UnfitError
from .settings import FOLLOWING, NAVIGATION, Record, leaves, nested, some_settings, trial_of

PresetName = Literal["paper-method"]
SWEEP = "mission.explorer.sweep"
MATCHING = "mission.mapper.matching.method"


@dataclass(frozen=True)
class MethodPreset:
    """A back end and its settings, by their dotted keys."""

    backend: str
    mapper: tuple[tuple[str, Any], ...]
    """How the robot maps its scans; a campaign treats it as one of its back ends."""
    driving: tuple[tuple[str, Any], ...]
    """Where the robot drives; it is the same for all back ends of a campaign."""

    @property
    def record(self) -> Record:
        """The whole method, as a nested record of settings."""
        return nested([("backend", self.backend), *self.mapper, *self.driving])


METHODS: dict[str, MethodPreset] = {
    "paper-method": MethodPreset(
        backend="block-ekf",
        mapper=(
            (MATCHING, "paper"),
            ("mission.mapper.merging", None),
        ),
        driving=((FOLLOWING, "paper"), (NAVIGATION, "visibility"), (SWEEP, False)),
    ),
}
"""What the paper describes and today's software does otherwise (docs/concepts/exploration.md, "The paper's method")."""


def backend_of(name: str) -> str:
    """Return the back end behind a name in a campaign: itself, or that of a method."""
    return METHODS[name].backend if name in METHODS else name


def mapping_of(name: str) -> Record:
    """Return the settings that a campaign's name adds to its back end; none for a plain back end."""
    return nested(METHODS[name].mapper) if name in METHODS else {}


def preset_of(name: str | None) -> Record:
    """Return the settings of a preset; none without a name."""
    return METHODS[name].record if name else {}


def against_methods(names: Iterable[str], settings: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Return those of the settings asked for that stand against a method among the names, also where they are defaults.

    What is asked for goes before a method's own: a default that is asked for is no default to it.
    """
    own = {key for name in names if name in METHODS for key, _ in METHODS[name].mapper}
    return [(key, value) for key, value in leaves(settings) if any(f"{key}.".startswith(f"{each}.") for each in own)]


ROBOT_KEYS = "keys of `robot` in config.json"


def robot_of(name: str | None) -> Record:
    """Return the settings of a trial behind a bundled robot's name or a robot's file; none without one.

    The file is YAML and holds keys of the group `robot`. An angle may be given in degrees (`turn_deg`), and
    `outline_m`, corners about the middle of the axle, stands in place of `radius_m`. Raises UsageError, in one line.
    """
    if name is None:
        return {}
    path = ROBOTS.get(name, Path(name))
    try:
        with regular(path).open("rb") as file:
            said = plain_mapping(file.read(FILE_MAX + 1), "a robot's YAML", f" with {ROBOT_KEYS}")
        record = some_settings({"robot": _robot_keys(said, RobotConfig())})
        trial_of(record)
    except OSError as error:
        found = f"{path.name} ({error.strerror or type(error).__name__})"
        near = did_you_mean(name, ROBOTS)
        raise UsageError(
            f"expected a robot from {', '.join(ROBOTS)} or a file, found {found}{near}: name one of these"
        ) from error
    except UnfitError as error:
        raise UsageError(f"expected a description of a robot, found {error}: correct {path.name}") from error
    except (WorldError, UsageError) as error:
        raise UsageError(f"{error} (in {path.name})") from error
    return record


def stated(robot: Record) -> Record:
    """Return those settings of a robot that describe it to the software; the rest belongs to its simulation."""
    said: Record = robot.get("robot", {})
    found = {each.name: said[each.name] for each in fields(RobotSpec) if each.name in said}
    if "lidar" in found:
        found["lidar"] = {key: value for key, value in found["lidar"].items() if key in LidarSpec.__dataclass_fields__}
    return {"robot": found}


def _robot_keys(said: Mapping[str, Any], group: Any) -> Record:
    """Return what a file says under the keys of a group of settings; angles in rad, whole numbers for counts."""
    record: Record = {}
    for key, value in said.items():
        name = f"{key.removesuffix('_deg')}_rad" if key.endswith("_deg") else key
        own = getattr(group, name, None)
        if key == "outline_m" and isinstance(group, RobotSpec):
            value = _corners(value).tolist()
        elif name != key and isinstance(value, float):
            value = float(np.deg2rad(value))
        elif isinstance(value, dict) and is_dataclass(own):
            value = _robot_keys(value, own)
        elif type(own) is int and isinstance(value, float) and value.is_integer():
            value = int(value)
        if name in record:
            raise UsageError(f"expected {name} once, found {key} beside it: leave one of them out")
        record[name] = value
    is_disc = "radius_m" in record and isinstance(group, RobotSpec)
    if is_disc and record.setdefault("outline_m", None) is not None:
        raise UsageError("expected radius_m or outline_m, found both: leave one of them out")
    return record


def _corners(value: Any) -> np.ndarray:
    try:
        corners = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        corners = np.zeros(0)
    if corners.ndim != 2 or corners.shape[1:] != (2,) or len(corners) < 3 or not np.all(np.isfinite(corners)):
        raise UsageError("expected outline_m as three corners [x, y] or more, found something else: correct it")
    return corners
