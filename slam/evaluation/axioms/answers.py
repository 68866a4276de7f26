"""What an estimate owes: a sound covariance, no preferred order, no preferred frame."""

from collections.abc import Callable

import numpy as np

from ...estimation.backend import Joint, Observations
from ...geometry.poses import rotation, to_world, wrap
from ...robot import Odometry
from .broken import BrokenError, everything, expect, expect_same, expect_sound, volume
from .room import P0, START, Make, Room, driven, journey, see

NONE = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))


def covariances_stay_sound_through_any_program_of_verbs(make: Make) -> None:
    """Symmetric, positive definite, and what the belief says, after every call."""
    for seed in range(8):
        _program(make, np.random.default_rng([11, seed]))


def _program(make: Make, rng: np.random.Generator) -> None:
    room, backend = Room.random(rng), make(START.copy(), P0.copy())
    true, owner = START.copy(), dict[int, int]()
    for _ in range(40):
        verb = rng.choice(["predict", "update", "grow", "merge", "remove"], p=[0.3, 0.3, 0.2, 0.1, 0.1])
        ids = backend.belief.ids
        if verb == "predict":
            odometry, true = driven(rng, true, rng.uniform(-0.15, 0.15), rng.uniform(-0.17, 0.17))
            backend.predict(odometry)
        elif verb == "grow":
            rows = rng.choice(len(room.lines), rng.integers(1, 4), replace=False)
            owner |= zip(backend.grow(*room.seen(true, rows, rng)).tolist(), rows.tolist(), strict=True)
        elif len(ids) and verb == "update":
            chosen = rng.choice(ids, rng.integers(1, len(ids) + 1), replace=bool(rng.integers(2)))
            see(backend, chosen, room.seen(true, np.array([owner[i] for i in chosen.tolist()]), rng))
        elif verb == "merge":
            walls = [owner[i] for i in ids.tolist()]
            twins = [i for i, wall in zip(ids.tolist(), walls, strict=True) if walls.count(wall) > 1]
            if twins:
                keep = int(rng.choice(twins))
                backend.merge(keep, next(i for i in twins if i != keep and owner[i] == owner[keep]))
        elif len(ids):
            backend.remove(rng.choice(ids, rng.integers(1, len(ids) + 1), replace=False).tolist())
        expect_sound(backend)


def covariances_stay_sound_over_a_long_drive(make: Make) -> None:
    """In 400 steps rounding adds up to nothing."""
    rng = np.random.default_rng(12)
    expect_sound(journey(make, rng).drive(400, rng).backend)


def covariances_stay_sound_while_the_robot_stands_still(make: Make) -> None:
    """Nor in 400 looks at the same walls, which leave errors that are nearly one."""
    rng = np.random.default_rng(13)
    room, backend, rows = Room.random(rng), make(START.copy(), P0.copy()), np.arange(8)
    ids = backend.grow(*room.seen(START, rows, rng))
    for _ in range(400):
        see(backend, ids, room.seen(START, rows, rng))
    expect_sound(backend)


def an_observation_that_says_nothing_changes_next_to_nothing(make: Make) -> None:
    """One of a covariance a million million times as large; the first may find something waiting to be solved."""
    rng = np.random.default_rng(14)
    drive = journey(make, rng).drive(30, rng)
    rows = np.array(list(drive.ids))
    lines, cov, centres = drive.room.seen(drive.true, rows, rng)
    ids, nothing = [drive.ids[row] for row in rows.tolist()], (lines + 0.1, 1e12 * cov, centres)
    everything(drive.backend)  # Who solves when asked solves this, and nothing else, before the first.
    see(drive.backend, ids, nothing)
    before = everything(drive.backend)
    see(drive.backend, ids, nothing)
    after = everything(drive.backend)
    expect_same(after.mean, before.mean, "means before and after", 1e-9)
    expect_same(after.cov, before.cov, "covariances before and after", 1e-9 * float(np.abs(before.cov).max()))


def a_heading_may_pass_half_a_turn(make: Make) -> None:
    """Within an update: it comes out between plus and minus pi, and so do the directions of lines."""
    for side in (1.0, -1.0):
        rng = np.random.default_rng(22)
        start, room = np.array([0.5, -0.3, side * (np.pi - 0.002)]), Room.random(rng)
        backend, rows = make(start.copy(), P0.copy()), np.arange(8)
        ids = backend.grow(*room.seen(start, rows, rng))
        backend.predict(Odometry(np.zeros(3), np.diag([0.01, 0.01, 0.02]) ** 2))
        true, before = start + np.array([0.0, 0.0, side * 0.02]), backend.belief
        see(backend, ids, room.seen(true, rows, rng))
        belief = backend.belief
        largest = float(np.abs([belief.pose_world[2], *belief.means[:, 0]]).max())
        expect(largest <= np.pi, "a heading and directions within half a turn", largest)
        off = float(wrap(belief.pose_world[2] - true[2]))
        expect(abs(off) < 0.015, "a heading within 0.015 rad of the true one", off)
        moved = belief.means - before.means
        moved[:, 0] = wrap(moved[:, 0])
        expect(np.abs(moved).max() < 0.02, "lines where they were, to 0.02 m and rad", float(np.abs(moved).max()))


def a_scan_without_matches_changes_nothing(make: Make) -> None:
    """Both sets of observations may be empty."""
    rng = np.random.default_rng(15)
    backend = journey(make, rng).drive(10, rng).backend
    before = everything(backend)
    backend.update(NONE, NONE)
    expect_same(everything(backend).mean, before.mean, "means before and after")
    expect_same(everything(backend).cov, before.cov, "covariances before and after")


def moving_the_world_moves_the_answer(make: Make) -> None:
    """In another place of the world the same observations give the same estimate, moved and turned."""
    here = _ended(make, np.zeros(3))
    for world in np.array([[100.0, -100.0, 0.0], [0.0, 0.0, 2.0], [70.0, 70.0, -1.0]]):
        there, turn = _ended(make, world), np.eye(len(here.mean))
        turn[:2, :2] = rotation(float(world[2]))
        expect_same(there.mean[:2], to_world(here.mean[None, :2], world)[0], "positions, moved back,", 1e-9)
        expect_same(there.anchors, to_world(here.anchors, world), "anchors, moved back,", 1e-9)
        off = there.mean - here.mean
        expect(abs(wrap(off[2] - world[2])) <= 1e-9, "headings, turned back, the same", wrap(off[2] - world[2]))
        expect_same(wrap(off[3::2] - world[2]), 0.0 * off[3::2], "directions, turned back,", 1e-9)
        expect_same(there.mean[4::2], here.mean[4::2], "distances of lines from their anchors", 1e-9)
        expect_same(there.cov, turn @ here.cov @ turn.T, "covariances, turned back,", 1e-9)


def _ended(make: Make, world: np.ndarray) -> Joint:
    rng = np.random.default_rng(16)
    return everything(journey(make, rng, world).drive(80, rng).backend)


def the_order_of_observations_in_a_scan_does_not_matter(make: Make) -> None:
    """Told backwards they give the same answer."""
    ends = []
    for backwards in (False, True):
        rng = np.random.default_rng(17)
        ends.append(everything(journey(make, rng).drive(60, rng, backwards).backend))
    expect_same(ends[1].mean, ends[0].mean, "means in either order", 1e-11)
    expect_same(ends[1].cov, ends[0].cov, "covariances in either order", 1e-13)


def the_order_in_which_lines_are_entered_renumbers_the_answer(make: Make) -> None:
    """And does nothing else."""
    rng, answers = np.random.default_rng(18), list[Joint]()
    room, rows = Room.random(rng), np.arange(8)
    first, again = room.seen(START, rows, rng), room.seen(START, rows, rng)
    for order in (rows, rng.permutation(rows)):
        backend, ids = make(START.copy(), P0.copy()), np.empty(8, dtype=np.int64)
        ids[order] = backend.grow(*(part[order] for part in first))
        see(backend, ids, again)
        answers.append(backend.belief.joint(ids))
    expect_same(answers[1].mean, answers[0].mean, "means in either order", 1e-12)
    expect_same(answers[1].cov, answers[0].cov, "covariances in either order", 1e-15)


def a_wall_seen_twice_in_one_scan_is_taken_in_twice(make: Make) -> None:
    """`Observations.ids` may repeat an id: one wall behind a pillar is two segments."""
    ends = []
    for times in (1, 2):
        rng = np.random.default_rng(19)
        drive = journey(make, rng).drive(30, rng)
        before = volume(everything(drive.backend).cov)
        lines, cov, centres = drive.room.seen(drive.true, np.zeros(2, dtype=np.int64), rng)
        see(drive.backend, [drive.ids[0]] * times, (lines[:times], cov[:times], centres[:times]))
        expect_sound(drive.backend)
        ends.append(everything(drive.backend))
        after = volume(ends[-1].cov)
        expect(after < before + 1e-6, "a scan to leave no larger volume", f"log volume {after - before:+.1e} larger")
    moved = float(np.abs(ends[1].mean - ends[0].mean).max())
    expect(
        moved > 1e-9,
        "another answer from two observations of one wall than from the first alone",
        f"{moved:.1e} between them",
    )


def a_line_seen_again_is_better_known(make: Make) -> None:
    """Pose and lines together: their volume shrinks."""
    rng = np.random.default_rng(20)
    room, backend, rows = Room.random(rng), make(START.copy(), P0.copy()), np.arange(4)
    ids = backend.grow(*room.seen(START, rows, rng))
    before = volume(everything(backend).cov)
    see(backend, ids, room.seen(START, rows, rng))
    after = volume(everything(backend).cov)
    expect(after < before, "a smaller volume", f"log volume {before:.2f} before, {after:.2f} after")


def merging_makes_two_lines_one(make: Make) -> None:
    """Between the two, about the anchor kept, and no less sure; a line is not its own twin."""
    rng = np.random.default_rng(21)
    room, backend, rows = Room.random(rng), make(START.copy(), P0.copy()), np.arange(2)
    keep, other = backend.grow(*room.seen(START, rows, rng)).tolist()
    drop = int(backend.grow(*room.seen(START, rows[:1], rng))[0])
    _refused(lambda: backend.merge(keep, keep))
    before = backend.belief
    alpha = before.means[before.rows([keep, drop]), 0]
    size = np.trace(before.joint([keep]).cov[3:, 3:])
    backend.merge(keep, drop)
    belief = backend.belief
    expect(belief.ids.tolist() == sorted([keep, other]), "the lines kept and the other", belief.ids.tolist())
    expect_same(belief.anchors, before.anchors[before.rows(belief.ids)], "anchors before and after")
    merged = belief.means[belief.rows([keep])[0], 0]
    expect(alpha.min() - 1e-9 <= merged <= alpha.max() + 1e-9, f"a direction between {alpha}", merged)
    after = np.trace(belief.joint([keep]).cov[3:, 3:])
    expect(after <= size * (1 + 1e-6), f"variances that add up to {size:.3e} or less", f"{after:.3e}")
    expect_sound(backend)


def _refused(ask: Callable[[], object]) -> None:
    try:
        ask()
    except ValueError:
        return
    raise BrokenError("expected a merge of a line with itself to raise ValueError, found no error")


ANSWERS = (
    covariances_stay_sound_through_any_program_of_verbs,
    covariances_stay_sound_over_a_long_drive,
    covariances_stay_sound_while_the_robot_stands_still,
    an_observation_that_says_nothing_changes_next_to_nothing,
    a_heading_may_pass_half_a_turn,
    a_scan_without_matches_changes_nothing,
    moving_the_world_moves_the_answer,
    the_order_of_observations_in_a_scan_does_not_matter,
    the_order_in_which_lines_are_entered_renumbers_the_answer,
    a_wall_seen_twice_in_one_scan_is_taken_in_twice,
    a_line_seen_again_is_better_known,
    merging_makes_two_lines_one,
)
