"""The settings of the factor graph, apart from it: to read them one needs no gtsam."""

from dataclasses import dataclass

from ...geometry.quantities import Angle, Count, Distance, Factor, Number, Probability, Sigmas, Weight


@dataclass(frozen=True)
class GraphConfig:
    """How closely iSAM2 follows the least-squares solution, and when its own is not believed."""

    relinearise_angle_rad: Angle = 0.005
    """A pose or a line is linearised anew when it has turned by more than this: 50 m away it bends by 0.6 mm."""
    relinearise_place_m: Distance = 0.2
    """And when it has moved by more than this."""
    closure: Factor = 4.0
    """Lines that have moved by more are linearised anew with the next step, by so many times more at once."""
    passes: Number = 5
    """At most so many rounds of linearising anew at once."""
    wildfire: Weight = 1e-4
    """Changes smaller than this, m and rad, are not passed on from one part of the map to the next."""
    near: Number = 60
    """Lines that one question for a joint covariance may have, to be prepared for in the next steps."""
    careful: bool = False
    """Eliminate by QR in place of Cholesky: it also solves what is known along some directions 10,000 times better than
    along others, as after a long way without walls, and takes a fifth longer."""
    loose: Sigmas = 0.1
    """An observation is linearised anew when its line has turned so far that the distance is wrong by this many
    sigma."""
    loose_sigmas: Sigmas = 3.0
    """A line turns by no more than so many sigma of its direction: where that is too little, nobody looks after it."""
    most_turn_rad: Angle = 1.2
    """Observations are linearised no farther than this from the prediction, and no line turns further at once: beyond
    pi/2 a line is seen from behind."""
    diverged_chance: Probability = 1e-9
    """Chance of a pose farther from its prediction than is believed: such a solution is sought anew by damped steps."""
    rounds: Count = 10
    """The optimum of everything is linearised anew at most so often; after the second time it hardly moves."""
