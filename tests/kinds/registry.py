"""The kinds of inputs that others complained of, each with a generator: what is new is one line here."""

from . import bags, logs, references
from .case import Kind

KINDS: dict[str, Kind] = {
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
