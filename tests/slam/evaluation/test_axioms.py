"""The axioms hold for every back end of the registry, and each of them finds a filter that breaks it."""

from dataclasses import replace

import jaxtyping
import numpy as np
import pytest

import chainslam
from chainslam.slam.backends import BACKENDS
from chainslam.slam.backends.blocks.block_ekf import BlockEkf
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.backends.textbook_ekf import TextbookEkf
from chainslam.slam.estimation.models import Motion
from chainslam.slam.evaluation.axioms.answers import an_observation_that_says_nothing_changes_next_to_nothing
from chainslam.slam.evaluation.axioms.broken import BrokenError
from chainslam.slam.evaluation.axioms.check import axioms_of, check_backend
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import Odometry

OWED = [
    (name, axiom, holds)
    for name, entry in BACKENDS.items()
    for axiom, holds in axioms_of(entry.covariance, entry.is_about_origin).items()
]
LONG = ("over a long drive", "stands still", "errors are", "moving the world")


@pytest.mark.parametrize(("name", "axiom", "holds"), OWED, ids=[f"{name}: {axiom}" for name, axiom, _ in OWED])
def test_every_back_end_owes_it(name, axiom, holds):
    """Shapes are checked too, where it does not take minutes."""
    jaxtyping.config.update("jaxtyping_disable", any(words in axiom for words in LONG))
    try:
        holds(BACKENDS[name].make)
    finally:
        jaxtyping.config.update("jaxtyping_disable", False)


@pytest.mark.usefixtures("_unchecked")
def test_a_back_end_that_solves_when_it_is_asked_owes_no_more_where_nobody_asks():
    """Checks of types ask for every belief on the way."""
    an_observation_that_says_nothing_changes_next_to_nothing(BACKENDS["graph"].make)


class Shown(FullEkf):
    """A full EKF whose belief is shown otherwise than it is."""

    def shown(self, joint):
        return joint

    def _new_belief(self):
        belief = super()._new_belief()
        return replace(belief, query=lambda ids: self.shown(belief.query(ids)))


class Transposed(Shown):
    """Gives lines in the order of their ids, whatever was asked for."""

    def _query(self, version, wanted):
        return super()._query(version, np.sort(wanted))


class NeverStale(FullEkf):
    def _query(self, version, wanted):
        return super()._query(self._version, wanted)


class Shared(FullEkf):
    """Hands out its own arrays."""

    def __init__(self, *args):
        super().__init__(*args)
        self._own = {}

    def _query(self, version, wanted):
        joint = super()._query(version, wanted)
        kept = self._own.setdefault(len(joint.mean), joint)
        kept.mean[:], kept.cov[:] = joint.mean, joint.cov
        return replace(kept, anchors=joint.anchors)


class Reusing(FullEkf):
    def remove(self, ids):
        super().remove(ids)
        self.map._next_id = int(self.map.ids.max(initial=-1)) + 1


class Lenient(FullEkf):
    def remove(self, ids):
        super().remove([line for line in ids if line in self.belief.ids])


class Forgetful(FullEkf):
    """Forgets with a line what it had said of the pose."""

    def remove(self, ids):
        super().remove(ids)
        self.map.move(Motion(self.map.pose_world, np.eye(3), np.eye(3)), 1e-6 * np.eye(3))


class Unsymmetric(Shown):
    def shown(self, joint):
        joint.cov[0, 1] += 1e-3 * joint.cov[0, 0]
        return joint


class Eroding(FullEkf):
    """Loses a little of the variances with every step."""

    def predict(self, odometry):
        super().predict(odometry)
        self.map._P -= 1e-3 * np.diag(np.diag(self.map._P))


class Sinking(FullEkf):
    """Takes a little too much away in every look."""

    def update(self, first, second):
        super().update(first, second)
        self.map._P -= 2e-5 * np.diag(np.diag(self.map._P))


class Certain(FullEkf):
    """Takes no observation for worse than it can imagine."""

    def update(self, first, second):
        seen = replace(second, cov=np.tile(1e-4 * np.eye(2), (len(second), 1, 1)))
        super().update(seen, seen)


class Unwrapped(FullEkf):
    """Lets the heading run on past half a turn."""

    def update(self, first, second):
        before = self.map.pose_world[2]
        super().update(first, second)
        self.map._x[2] = before + wrap(self.map.pose_world[2] - before)


class Restless(FullEkf):
    def update(self, first, second):
        if len(second.ids):
            super().update(first, second)
        else:
            self.predict(Odometry(np.zeros(3), 1e-6 * np.eye(3)))


class OneByOne(FullEkf):
    """Takes the observations of a scan in one after another, each linearised where the last has led."""

    def update(self, first, second):
        for k in range(len(second.ids)):
            one = replace(second, ids=second.ids[k : k + 1], lines=second.lines[k : k + 1], cov=second.cov[k : k + 1])
            super().update(one, one)


class Ranked(FullEkf):
    """Trusts the line entered first more than the others."""

    def grow(self, lines, cov, centres):
        return super().grow(lines, cov * np.linspace(1.0, 2.0, len(cov))[:, None, None], centres)


class Deduplicated(FullEkf):
    """Takes in the first look at each wall."""

    def update(self, first, second):
        rows = np.unique(second.ids, return_index=True)[1]
        seen = replace(second, ids=second.ids[rows], lines=second.lines[rows], cov=second.cov[rows])
        super().update(seen, seen)


class Blind(FullEkf):
    def update(self, first, second):
        self._move_on()


class Renaming(FullEkf):
    """Keeps the line that it was told to drop."""

    def merge(self, keep, drop):
        super().merge(drop, keep)


class Overconfident(FullEkf):
    """Told half of the noise of what is seen."""

    def update(self, first, second):
        seen = replace(second, cov=0.5 * second.cov)
        super().update(seen, seen)

    def grow(self, lines, cov, centres):
        return super().grow(lines, 0.5 * cov, centres)


BREAKING = {
    "a part of the belief is a slice of the whole": Transposed,
    "a belief goes stale when its back end moves on": NeverStale,
    "a joint taken earlier is not changed by what follows": Shared,
    "ids are never used again": Reusing,
    "unknown ids raise key errors": Lenient,
    "removing lines leaves the marginal of the rest": Forgetful,
    "covariances stay sound through any program of verbs": Unsymmetric,
    "covariances stay sound over a long drive": Eroding,
    "covariances stay sound while the robot stands still": Sinking,
    "an observation that says nothing changes next to nothing": Certain,
    "a heading may pass half a turn": Unwrapped,
    "a scan without matches changes nothing": Restless,
    "moving the world moves the answer": TextbookEkf,
    "the order of observations in a scan does not matter": OneByOne,
    "the order in which lines are entered renumbers the answer": Ranked,
    "a wall seen twice in one scan is taken in twice": Deduplicated,
    "a line seen again is better known": Blind,
    "merging makes two lines one": Renaming,
    "errors are as large as the covariance says": Overconfident,
    "errors are no larger than the bound says": BlockEkf,
}


@pytest.mark.usefixtures("_unchecked")
def test_there_is_a_filter_that_breaks_each_axiom():
    assert BREAKING.keys() == (axioms_of() | axioms_of("bound")).keys()
    for axiom, kind in BREAKING.items():
        holds = axioms_of("bound" if "bound" in axiom else "exact")[axiom]
        with pytest.raises((BrokenError, np.linalg.LinAlgError), match="expected ") as broken:
            holds(kind)
        print(axiom, broken.value)


@pytest.mark.usefixtures("_unchecked")
def test_what_is_found_names_the_axiom_and_says_what_was_expected():
    assert chainslam.check_backend(FullEkf) == ()
    found = {failure.axiom: failure.found for failure in chainslam.check_backend(Blind)}
    assert "expected a smaller volume, found log volume" in found["a line seen again is better known"]


@pytest.mark.usefixtures("_unchecked")
def test_a_filter_that_drops_correlations_has_no_exact_covariance():
    with pytest.raises(BrokenError, match="expected a mean NEES of the pose within"):
        axioms_of()["errors are as large as the covariance says"](BlockEkf)


@pytest.mark.usefixtures("_unchecked")
def test_a_class_that_raises_fails_by_what_it_raised():
    def broken(pose, cov):
        raise TypeError("no such filter")

    failures = check_backend(broken)
    assert {failure.axiom for failure in failures} == axioms_of().keys()
    assert all(failure.found == "raised TypeError('no such filter')" for failure in failures)
