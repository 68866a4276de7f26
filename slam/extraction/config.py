"""The settings of the extraction."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from ..estimation.shared import SharedConfig, of_shared
from ..geometry.quantities import Beams, Count, Number, Part, Sigmas, Turn, Weight


@dataclass(frozen=True)
class ExtractionConfig:
    """How a scan becomes segments, and how far their ends are believed.

    A beam off a line by more than an outlier is better left loose (`shared`); so is the last one where no lines cross:
    another surface begins there.

    Costs, gains and sigmas were chosen on half of the plans, by recall, mixed lines and NEES
    (docs/results.md, "Extraction"); "beams" are steps of the scan, one per 2 degrees.
    """

    shared: SharedConfig = of_shared()
    gap_beams: Number = 3
    """A wall does not go on across more beam steps than this without a return: at 4 m they are 0.4 m, a narrow door."""
    grazing_rad: Turn = float(np.deg2rad(6.0))
    """A range jump that a wall at this incidence could not make breaks the scan: at a lower one neighbouring beams meet
    a wall a third farther off each."""
    scales: Annotated[tuple[Count, ...], Meta(min_length=1)] = (3, 8, 20)
    """Beams on either side of a candidate cut over which two lines are compared with one: from the least that make
    a line to those of a long wall."""
    candidate_gain: Weight = 7.0
    """Chi-square that two lines must save to make a candidate: low, since a candidate costs time alone."""
    sure_gain: Weight = 30.0
    """Saving from which the neighbours of a candidate are candidates too: a beam there may belong to neither line."""
    segment_cost: Weight = 20.0
    """Chi-square that one more segment must save: with less, noise cuts straight walls."""
    least_beams: Beams = 3
    """Fewer beams make no segment: any two lie on a line. An end loses its last beam only where so many remain."""
    sure_beams: Beams = 5
    """A segment of fewer beams is tentative: the 95th percentile of NEES is four times what it should be with 3 beams,
    1.4 times with 4."""
    doubt_sigmas: Sigmas = 2.5
    """The last beam before a joint is left out where the other line predicts it within this: it may be either's."""
    end_share: Part = 0.1
    """What the last beam counts at an end that is no corner, where too few remain to leave it out. It may be of another
    surface: off by five to seven sigmas, it hides among three or four beams."""
