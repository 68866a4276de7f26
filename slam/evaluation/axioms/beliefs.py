"""What a belief owes: parts of one whole, stale once its back end has moved on, honest ids."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ...estimation.backend import Backend, StaleBeliefError
from ...robot import Odometry
from .broken import BrokenError, everything, expect, expect_same
from .room import P0, START, Make, Room, journey, see


def a_part_of_the_belief_is_a_slice_of_the_whole(make: Make) -> None:
    """`belief.joint(ids)` is of these lines in this order, whichever are asked for."""
    for seed in range(4):
        rng = np.random.default_rng([1, seed])
        belief = journey(make, rng).drive(8, rng).backend.belief
        whole = belief.joint(belief.ids)
        chosen = rng.permutation(belief.ids)[: rng.integers(0, len(belief.ids) + 1)]
        rows = np.searchsorted(belief.ids, chosen)
        expected, part = whole.take(rows), belief.joint(chosen)
        expect_same(part.mean, expected.mean, "means of a part and of the whole")
        expect_same(part.cov, expected.cov, "covariances of a part and of the whole")
        expect_same(part.anchors, expected.anchors, "anchors of a part and of the whole")


def verbs(backend: Backend, room: Room) -> dict[str, Callable[[], object]]:
    """Return a call of each verb that changes a back end."""
    looks, first = room.seen(backend.belief.pose_world, np.arange(2)), backend.belief.ids[:2]
    return {
        "predict": lambda: backend.predict(Odometry(np.array([0.1, 0.0, 0.0]), 1e-4 * np.eye(3))),
        "update": lambda: see(backend, first, looks),
        "grow": lambda: backend.grow(*looks),
        "merge": lambda: backend.merge(*first.tolist()),
        "remove": lambda: backend.remove(first[:1].tolist()),
    }


def a_belief_goes_stale_when_its_back_end_moves_on(make: Make) -> None:
    """Its `joint` then raises StaleBeliefError; what it said stays."""
    for verb in ("predict", "update", "grow", "merge", "remove"):
        rng = np.random.default_rng(2)
        drive = journey(make, rng).drive(10, rng)
        belief = drive.backend.belief
        said = [np.array(part) for part in (belief.pose_world, belief.pose_cov, belief.ids, belief.means)]
        belief.joint(belief.ids)
        verbs(drive.backend, drive.room)[verb]()
        _raises(StaleBeliefError, f"belief.joint after {verb}", partial(belief.joint, belief.ids[:1]))
        for now, then in zip((belief.pose_world, belief.pose_cov, belief.ids, belief.means), said, strict=True):
            expect_same(now, then, f"what a belief says before and after {verb}")
        everything(drive.backend)


def a_joint_taken_earlier_is_not_changed_by_what_follows(make: Make) -> None:
    """Arrays once handed out are the asker's."""
    rng = np.random.default_rng(3)
    drive = journey(make, rng).drive(10, rng)
    joint = everything(drive.backend)
    mean, cov = joint.mean.copy(), joint.cov.copy()
    for verb in verbs(drive.backend, drive.room).values():
        verb()
        everything(drive.backend)
    expect_same(joint.mean, mean, "means handed out before and after")
    expect_same(joint.cov, cov, "covariances handed out before and after")


def ids_are_never_used_again(make: Make) -> None:
    """Not even those of lines that were removed."""
    rng = np.random.default_rng(4)
    room, backend = Room.random(rng), make(START.copy(), P0.copy())
    used: set[int] = set()
    for _ in range(6):
        ids = backend.grow(*room.seen(START, np.arange(3), rng)).tolist()
        expect(len(set(ids)) == 3, "an id for each of three new lines", ids)
        expect(not used & set(ids), "ids that were never used before", sorted(used & set(ids)))
        used |= set(ids)
        backend.remove(backend.belief.ids.tolist())
    expect(len(backend.belief.ids) == 0, "an empty map once all is removed", backend.belief.ids.tolist())


def unknown_ids_raise_key_errors(make: Make) -> None:
    """Those of lines that were removed, or never were; nothing changes by the attempt."""
    rng = np.random.default_rng(5)
    room, backend = Room.random(rng), make(START.copy(), P0.copy())
    looks = room.seen(START, np.arange(2), rng)
    _raises(KeyError, "joint of an empty map", lambda: backend.belief.joint([0]))
    kept, gone = backend.grow(*looks).tolist()
    backend.remove([gone])
    one = looks[0][:1], looks[1][:1], looks[2][:1]
    for what, ask in {
        "joint": lambda: backend.belief.joint([kept, gone]),
        "remove": lambda: backend.remove([gone]),
        "merge, dropping": lambda: backend.merge(kept, gone),
        "merge, keeping": lambda: backend.merge(999, kept),
        "update": lambda: see(backend, [gone], one),
    }.items():
        _raises(KeyError, f"{what} of a line that is not in the map", ask)
    expect(backend.belief.ids.tolist() == [kept], f"the line {kept} left", backend.belief.ids.tolist())


def removing_lines_leaves_the_marginal_of_the_rest(make: Make) -> None:
    """So what was learnt through a line that is forgotten stays learnt, were it seen only twice."""
    rng = np.random.default_rng(6)
    drive = journey(make, rng).drive(40, rng)
    _leaves_the_rest(drive.backend, [drive.ids[0], drive.ids[3]])
    room, backend, rows = Room.random(rng), make(START.copy(), P0.copy()), np.arange(8)
    ids = backend.grow(*room.seen(START, rows, rng))
    backend.predict(Odometry(np.zeros(3), 1e-2 * np.eye(3)))
    see(backend, ids, room.seen(START, rows, rng))
    _leaves_the_rest(backend, ids[1:].tolist())


def _leaves_the_rest(backend: Backend, gone: list[int]) -> None:
    rest = np.array([i for i in backend.belief.ids.tolist() if i not in gone])
    before = backend.belief.joint(rest)
    backend.remove(gone)
    expect_same(backend.belief.ids, rest, "ids that are left, and those that were not removed")
    after = everything(backend)
    expect_same(after.mean, before.mean, "means before and after", 1e-14)
    expect_same(after.cov, before.cov, "covariances before and after", 1e-16)
    expect_same(after.anchors, before.anchors, "anchors before and after")


def _raises(kind: type[Exception], what: str, ask: Callable[[], object]) -> None:
    try:
        ask()
    except kind:
        return
    except Exception as other:
        raise BrokenError(f"expected {what} to raise {kind.__name__}, found {other!r}") from other
    raise BrokenError(f"expected {what} to raise {kind.__name__}, found no error")


BELIEFS = (
    a_part_of_the_belief_is_a_slice_of_the_whole,
    a_belief_goes_stale_when_its_back_end_moves_on,
    a_joint_taken_earlier_is_not_changed_by_what_follows,
    ids_are_never_used_again,
    unknown_ids_raise_key_errors,
    removing_lines_leaves_the_marginal_of_the_rest,
)
