"""The settings of the extraction."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from ..estimation.shared import SharedConfig, of_shared
from ..geometry.quantities import Beams, Count, Number, Part, Sigmas, Turn, Weight


@dataclass(frozen=True)
class ExtractionConfig:
    """How a scan is split into line segments.

    Costs and sigmas were chosen on half of the plans, by recall, segments across two faces and NEES. The 95th
    percentile of a segment's NEES is four times what it should be with 3 beams, 1.4 times with 4. The last beam at an
    end may be of another surface: off by five to seven standard deviations, it is not noticed among three or four.
    """

    shared: SharedConfig = of_shared()
    gap_beams: Number = 3
    """Largest gap within a segment, in steps between beams without a return."""
    grazing_rad: Turn = float(np.deg2rad(6.0))
    """Smallest angle of incidence that is assumed of a wall: a range jump that would need a smaller one splits the
    scan."""
    scales: Annotated[tuple[Count, ...], Meta(min_length=1)] = (3, 8, 20)
    """Numbers of beams on either side of a possible breakpoint over which two lines are compared with one."""
    candidate_gain: Weight = 7.0
    """Decrease of chi-square by two lines that makes a candidate breakpoint; a low value only costs computing time."""
    sure_gain: Weight = 30.0
    """Decrease of chi-square from which the neighbours of a candidate are candidates too."""
    segment_cost: Weight = 20.0
    """Decrease of chi-square that one more segment must bring; with a lower value noise splits straight walls."""
    least_beams: Beams = 3
    """Smallest number of beams of a segment."""
    sure_beams: Beams = 5
    """A segment of fewer beams is tentative."""
    doubt_sigmas: Sigmas = 2.5
    """The last beam before a breakpoint is left out if the other line predicts it within this many standard
    deviations."""
    end_share: Part = 0.1
    """Weight of the last beam at an end that is no corner, if too few beams would remain without it."""
