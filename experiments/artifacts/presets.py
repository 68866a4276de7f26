"""Methods by name: the settings behind `--preset paper-method`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from .settings import NAVIGATION, Record, leaves, nested

PresetName = Literal["paper-method"]
SWEEP = "mission.explorer.sweep"
MATCHING = "mission.mapper.matching.method"


@dataclass(frozen=True)
class MethodPreset:
    """A back end and the settings that go with it, by their dotted keys."""

    backend: str
    mapper: tuple[tuple[str, Any], ...]
    """What the robot makes of its scans: a campaign has it as one of its back ends."""
    driving: tuple[tuple[str, Any], ...]
    """Where the robot goes: a campaign has it for all of its back ends, or for none."""

    @property
    def record(self) -> Record:
        """All of it, as a nested record of a trial's settings."""
        return nested([("backend", self.backend), *self.mapper, *self.driving])


METHODS: dict[str, MethodPreset] = {
    "paper-method": MethodPreset(
        backend="block-ekf",
        mapper=(
            (MATCHING, "paper"),
            ("mission.mapper.merging", None),
            ("mission.mapper.vertices", None),
            ("mission.mapper.change_points", None),
        ),
        driving=((NAVIGATION, "visibility"), (SWEEP, False)),
    ),
}
"""What the paper describes and today's software does otherwise (docs/exploration.md, "The paper's method")."""


def backend_of(name: str) -> str:
    """Return the back end that a campaign's name stands for: its own, or that of a method."""
    return METHODS[name].backend if name in METHODS else name


def mapping_of(name: str) -> Record:
    """Return the settings that a campaign's name stands for beside its back end; none for a back end itself."""
    return nested(METHODS[name].mapper) if name in METHODS else {}


def preset_of(name: str | None) -> Record:
    """Return the settings of a trial behind a preset's name; none without one."""
    return METHODS[name].record if name else {}


def against_methods(names: Iterable[str], settings: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Return those of the settings asked for that stand against a method among the names, also where they are defaults.

    What is asked for goes before a method's own: a default that is asked for is no default to it.
    """
    own = {key for name in names if name in METHODS for key, _ in METHODS[name].mapper}
    return [(key, value) for key, value in leaves(settings) if any(f"{key}.".startswith(f"{each}.") for each in own)]
