"""The kinds of inputs that others complained of, each with a generator: what is new is one line here."""

from . import bags, drawings, logs, maps, references
from .case import Kind

KINDS: dict[str, Kind] = {
    "SVG: what no viewer shows": drawings.hidden,
    "SVG: paints that no parser knows": drawings.paints,
    "SVG: doors painted white": drawings.white_doors,
    "SVG: layers left out by name": drawings.chosen,
    "DXF: units and versions": drawings.dxf,
    "GeoJSON: reference systems": drawings.reference_systems,
    "GeoJSON: doors and storeys": drawings.doors_and_storeys,
    "formats that are not read": drawings.foreign,
    "ROS map: values as yaml-cpp reads them": maps.yaml_scalars,
    "ROS map: transparent pixels": maps.transparent,
    "picture: turned, negative, with a YAML beside": maps.pictures,
    "log: times that go back": logs.times_back,
    "log: times that are equal": logs.times_equal,
    "log: where the clock begins": logs.times_begin,
    "log: clocks in ms, µs, ns": logs.clock_units,
    "log: ranges, odometry, headings in other units": logs.lengths,
    "log: numbers of beams": logs.beams,
    "log: RLASER, other and several scanners": logs.scanners,
    "log: BreezySLAM's .dat": logs.breezyslam,
    "log: lines that hold no scan": logs.broken_lines,
    "log: packed files": logs.packed,
    "bag: clocks": bags.clocks,
    "reference, relations: clocks and units": references.reference,
}
