"""An axiom has several parts: each has a filter that breaks it alone, and says by its own words what was found."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.evaluation.axioms.broken import BrokenError
from chainslam.slam.evaluation.axioms.check import axioms_of

pytestmark = pytest.mark.usefixtures("_unchecked")
SOUND = "covariances stay sound through any program of verbs"
SLICE = "a part of the belief is a slice of the whole"
WORLD = "moving the world moves the answer"


def showing(change):
    """A full EKF whose joint Gaussians are changed before they are shown."""

    class Showing(FullEkf):
        def _query(self, version, wanted):
            joint = super()._query(version, wanted)
            joint = replace(joint, anchors=joint.anchors.copy())
            change(self, joint)
            return joint

    return Showing


def after(verb, change):
    """A full EKF that does something more after a verb, told by whose arguments."""

    def more(self, *args):
        said = getattr(FullEkf, verb)(self, *args)
        change(self, *args)
        return said

    return type("After", (FullEkf,), {verb: more})


def instead(verb, does):
    """A full EKF that does something else: `does` may call what it would have done."""
    return type("Instead", (FullEkf,), {verb: lambda self, *args: does(self, getattr(FullEkf, verb), *args)})


def add(part, index, value):
    """Change one number of a joint Gaussian, where it has it."""

    def change(_, joint):
        array = getattr(joint, part)
        if all(i < n for i, n in zip(index, array.shape, strict=True)):
            array[index] += value(array) if callable(value) else value

    return showing(change)


def in_parts(part):
    """A full EKF of which only parts are told otherwise, not the whole."""

    def change(self, joint):
        if len(joint.anchors) < len(self.map.ids):
            getattr(joint, part)[...] += 1e-9

    return showing(change)


def with_the_place(part, index):
    """A full EKF that tells something else the farther from the world's origin it is."""

    def change(_, joint):
        getattr(joint, part)[index] += 1e-8 * abs(joint.mean[0])

    return showing(change)


def with_the_order(part):
    """A full EKF of which something hangs on which line was seen first in the last scan."""

    class Ordered(FullEkf):
        first = 0

        def update(self, first, second):
            super().update(first, second)
            self.first = int(second.ids[0])

        def _query(self, version, wanted):
            joint = super()._query(version, wanted)
            getattr(joint, part)[...] *= 1.0 + 1e-4 * self.first
            return joint

    return Ordered


def with_the_number(part):
    """A full EKF of which something hangs on the numbers of the lines that are asked for."""

    def change(self, joint):
        getattr(joint, part)[...] *= 1.0 + 1e-4 * self.map.anchors[0, 0]

    return showing(change)


def handing_out(part):
    """A full EKF that hands out its own array of one kind."""

    class Own(FullEkf):
        own = None

        def _query(self, version, wanted):
            joint = super()._query(version, wanted)
            array = getattr(joint, part)
            self.own = array if self.own is None or self.own.shape != array.shape else self.own
            self.own[:] = array
            return replace(joint, **{part: self.own})

    return Own


class Descending(FullEkf):
    def _new_belief(self):
        belief = super()._new_belief()
        return replace(belief, ids=belief.ids[::-1].copy())


class Living(FullEkf):
    """Its belief's pose moves on with it."""

    def _new_belief(self):
        return replace(super()._new_belief(), pose_world=self.map._x[:3])


class Guessing(FullEkf):
    """Tells something of lines that it does not know: nothing of an empty map, or the lines that it has."""

    empty = False

    def _new_belief(self):
        belief = super()._new_belief()
        lenient = len(belief.ids) > 0 or self.empty
        known = lambda ids: belief.query(np.asarray(ids)[np.isin(ids, belief.ids)])  # noqa: E731
        return replace(belief, query=known) if lenient else belief


class Shifting(FullEkf):
    """Moves the anchors that it shows once a line was removed."""

    by = 0.0

    def remove(self, ids):
        super().remove(ids)
        self.by = 1e-9

    def _query(self, version, wanted):
        joint = super()._query(version, wanted)
        return replace(joint, anchors=joint.anchors + self.by)


def zero_variance(_, joint):
    joint.cov[3:4], joint.cov[:, 3:4] = 0.0, 0.0


def beyond_one(_, joint):
    if len(joint.cov) > 4:
        joint.cov[3, 4] = joint.cov[4, 3] = 2.0 * np.sqrt(joint.cov[3, 3] * joint.cov[4, 4])


def known(self, ids):
    return [line for line in ids if line in self.map.ids]


def forget_all_then_refuse(self, remove, ids):
    if known(self, ids) != list(ids):
        remove(self, self.map.ids.tolist())
    remove(self, ids)


def skip_unknown(self, update, first, second):
    if known(self, second.ids.tolist()):
        update(self, first, second)


def merge_if(test):
    return instead("merge", lambda self, merge, keep, drop: merge(self, keep, drop) if test(self, keep, drop) else None)


def wrap_from_above(self, update, first, second):
    """The heading comes back from beyond half a turn, but not from below minus half a turn."""
    before = self.map.pose_world[2]
    update(self, first, second)
    if self.map.pose_world[2] - before > np.pi:
        self.map._x[2] -= 2.0 * np.pi


def scale(by):
    return lambda self, *_: self.map._P.__imul__(by)


def move(row, by):
    return lambda self, *_: self.map._x.__setitem__(row, self.map._x[row] + by)


def on_repeats(self, _, second):
    if len(set(second.ids.tolist())) < len(second.ids):
        self.map._P *= 2.0


PARTS = [
    (SOUND, add("cov", (3, 4), lambda cov: 1e-3 * cov[3, 3]), "the joint covariance and its transpose"),
    (SOUND, showing(beyond_one), "a positive definite joint covariance"),
    (SOUND, Descending, "ids in ascending order"),
    (SOUND, showing(zero_variance), "variances above zero"),
    (SOUND, add("mean", (0,), 1e-9), "the belief's pose and that"),
    (SOUND, add("mean", (3,), 1e-9), "the belief's lines and those"),
    (SOUND, add("cov", (0, 0), 1e-9), "the belief's pose covariance"),
    (SOUND, add("anchors", (0, 0), 1e-9), "the belief's anchors"),
    (SLICE, in_parts("mean"), "means of a part"),
    (SLICE, in_parts("cov"), "covariances of a part"),
    (SLICE, in_parts("anchors"), "anchors of a part"),
    ("a belief goes stale when its back end moves on", Living, "what a belief says before and after predict"),
    ("a joint taken earlier is not changed by what follows", handing_out("mean"), "means handed out"),
    ("a joint taken earlier is not changed by what follows", handing_out("cov"), "covariances handed out"),
    ("ids are never used again", instead("grow", lambda s, grow, *a: grow(s, *a)[[0, 0, 0]]), "an id for each of"),
    ("ids are never used again", instead("remove", lambda s, remove, ids: remove(s, ids[1:])), "an empty map once"),
    ("unknown ids raise key errors", type("G", (Guessing,), {"empty": True}), "joint of an empty map"),
    ("unknown ids raise key errors", Guessing, "expected joint of a line"),
    ("unknown ids raise key errors", merge_if(lambda s, _, drop: known(s, [drop])), "merge, dropping of a line"),
    ("unknown ids raise key errors", merge_if(lambda s, keep, _: known(s, [keep])), "merge, keeping of a line"),
    ("unknown ids raise key errors", instead("update", skip_unknown), "update of a line"),
    ("unknown ids raise key errors", instead("remove", forget_all_then_refuse), "the line 0 left"),
    ("removing lines leaves the marginal of the rest",
     instead("remove", lambda s, remove, ids: remove(s, ids[1:])), "ids that are left"),
    ("removing lines leaves the marginal of the rest", after("remove", move(0, 1e-9)), "means before and after"),
    ("removing lines leaves the marginal of the rest",
     Shifting, "anchors before and after"),
    ("a heading may pass half a turn", after("update", move(2, 0.05)), "a heading within 0.015 rad"),
    ("a heading may pass half a turn", after("update", move(4, 0.05)), "lines where they were"),
    ("a heading may pass half a turn",
     instead("update", wrap_from_above), "a heading and directions within half a turn"),
    ("an observation that says nothing changes next to nothing", after("update", move(0, 1e-6)), "means before"),
    ("an observation that says nothing changes next to nothing", after("update", scale(1.01)), "covariances before"),
    ("a scan without matches changes nothing", after("update", move(0, 1e-9)), "means before and after"),
    (WORLD, with_the_place("mean", 0), "positions, moved back"),
    (WORLD, with_the_place("anchors", 0), "anchors, moved back"),
    (WORLD, with_the_place("mean", 2), "headings, turned back"),
    (WORLD, with_the_place("mean", 3), "directions, turned back"),
    (WORLD, with_the_place("mean", 4), "distances of lines"),
    (WORLD, with_the_place("cov", (0, 0)), "covariances, turned back"),
    ("the order of observations in a scan does not matter", with_the_order("mean"), "means in either order"),
    ("the order of observations in a scan does not matter", with_the_order("cov"), "covariances in either order"),
    ("the order in which lines are entered renumbers the answer", with_the_number("mean"), "means in either order"),
    ("the order in which lines are entered renumbers the answer", with_the_number("cov"), "covariances in either"),
    ("a wall seen twice in one scan is taken in twice", after("update", on_repeats), "no larger volume"),
    ("merging makes two lines one", merge_if(lambda s, keep, drop: keep != drop), "of a line with itself"),
    ("merging makes two lines one",
     after("merge", lambda s, *_: s.map.anchors.__iadd__(1e-9)), "anchors before and after"),
    ("merging makes two lines one", after("merge", move(3, 0.5)), "a direction between"),
    ("merging makes two lines one", after("merge", scale(9.0)), "variances that add up to"),
    ("errors are as large as the covariance says",
     showing(lambda _, joint: joint.cov.__imul__(9.0)), "a mean NEES of the pose within"),
    ("errors are no larger than the bound says",
     showing(lambda _, joint: joint.cov.__imul__(0.25)), "a mean NEES of the pose below"),
]  # fmt: skip


@pytest.mark.parametrize(("axiom", "kind", "words"), PARTS, ids=[f"{axiom}: {words}" for axiom, _, words in PARTS])
def test_a_filter_that_breaks_one_part_is_found_by_it(axiom, kind, words):
    with pytest.raises(BrokenError, match=words):
        axioms_of("bound" if "bound" in axiom else "exact")[axiom](kind)
