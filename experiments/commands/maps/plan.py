"""`chainslam plan`: a dimensioned plan of a map, drawn to scale."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ...artifacts.files import json_bytes, replacing, write_anywhere
from ...artifacts.saved import cut_short
from ...terminal.answers import found
from ...terminal.console import say
from ...usage import UsageError
from ...views.plans.layout import sheet_of
from ...views.plans.records import plan_geojson, structure_record
from ...views.plans.structure import needs_structure, structured_at
from ...views.plans.survey import Survey, survey_at

Layer = Literal["furniture", "clutter", "open-ends"]
WORDS = "lengths in m, areas in m², with 95 % intervals from the map's joint covariance"


@dataclass(frozen=True)
class Plan:
    """Draw a dimensioned plan of a run's or a log's map: SVG, PDF, PNG, DXF or GeoJSON, by the file's ending."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of `explore` or `replay`."""
    out: Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")] = ()
    """A file to write, may be repeated; `plan.svg` in the folder if none is named."""
    show: tuple[Layer, ...] = ()
    """Layers to draw that are off otherwise: furniture, clutter (short chains that stand alone), open-ends."""
    structure: bool = False
    """Make walls square, parallel, collinear and equally thick where the map shows with 99 % that they are."""
    tolerance_deg: Annotated[float | None, tyro.conf.arg(metavar="DEGREES")] = None
    """Standard deviation of such walls from square; by default it is estimated from the map."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for no map, or another ending."""
        files = self.out or (self.folder / "plan.svg",)
        for file in files:
            if file.suffix.lower() not in WRITERS:
                raise UsageError(
                    f"expected a file ending in {', '.join(WRITERS)}, found {file.name}: choose one of these"
                )
        needs_structure(self.structure, self.tolerance_deg)
        title = self.folder.resolve().name
        if self.structure:
            structure, measured = structured_at(self.folder, self.tolerance_deg)
            title += ", with structure"
            found(structure=structure_record(structure))
            say(structure.words)
        else:
            measured = survey_at(self.folder)
        end = cut_short(self.folder)
        notes = (WORDS, *([f"the run ended early: {end}"] if end else []))
        for file in files:
            replaced = replacing(file)
            write_anywhere(file, WRITERS[file.suffix.lower()](measured, title, notes, self.show))
            say(f"plan in {file}{replaced}")
        counts = {
            "rooms": len(measured.rooms),
            "openings": len(measured.openings),
            "dimensions": len(measured.dimensions),
        }
        found(files=[str(file) for file in files], **counts)
        say(
            ", ".join(f"{value} {name.removesuffix('s') if value == 1 else name}" for name, value in counts.items())
            + f"; chainslam measure {self.folder}{' --structure' if self.structure else ''} lists them"
        )
        return 0


def _sheet(kind: Literal["svg", "pdf", "png"]) -> Callable[[Survey, str, tuple[str, ...], tuple[Layer, ...]], bytes]:
    def made(measured: Survey, title: str, notes: tuple[str, ...], show: tuple[Layer, ...]) -> bytes:
        from chainslam.viz.figures.plan_sheet import sheet_file

        return sheet_file(sheet_of(measured, title, notes), kind, show)

    return made


def _dxf(measured: Survey, title: str, notes: tuple[str, ...], show: tuple[Layer, ...]) -> bytes:
    from ...views.plans.cad import sheet_dxf

    return sheet_dxf(sheet_of(measured, title, notes), show)


def _geojson(measured: Survey, title: str, notes: tuple[str, ...], show: tuple[Layer, ...]) -> bytes:
    return json_bytes(plan_geojson(measured, title))


WRITERS: dict[str, Callable[[Survey, str, tuple[str, ...], tuple[Layer, ...]], bytes]] = {
    ".svg": _sheet("svg"),
    ".pdf": _sheet("pdf"),
    ".png": _sheet("png"),
    ".dxf": _dxf,
    ".geojson": _geojson,
}
