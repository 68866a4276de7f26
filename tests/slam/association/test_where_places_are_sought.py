"""The rules of place search one by one, with returns and places stood in for: what is asked, and what is believed."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.slam.association.place_search import Place, Window, apart
from chainslam.slam.association.second_looks import loop_search
from chainslam.slam.association.second_looks.closures import Closure, settled
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.association.second_looks.loop_search import Candidate, LoopSearch
from chainslam.slam.association.second_looks.submaps import Returns
from chainslam.slam.geometry.poses import compose, inverse
from tests.slam.association.drives import driven, followed

pytestmark = pytest.mark.usefixtures("_unchecked")
"""Returns and places are stood in for."""
CONFIG = SecondLooksConfig()
PLACES = CONFIG.closures
AHEAD = np.array([0.5, 0.0, 0.0])
TURN = np.array([0.0, 0.0, np.pi])
THERE_AND_BACK = np.array([AHEAD] * 40 + [TURN] + [AHEAD] * 40)
"""20 m out, and back the same way: scan 81 - k was taken where scan k was."""


class StandIn:
    """Returns of which nothing is known but how many there are and which scans fit; it keeps what it was asked."""

    def __init__(self, points=0, slips=()):
        self.points, self.slips = points, slips
        self.queries, self.surfaces, self.held_against = [], [], {}

    def fit(self, scan, before, poses):
        self.held_against[scan] = before
        return 0.1 if scan in self.slips else 0.9

    def seen_from(self, scans, poses, of):
        self.queries.append(scans)
        return np.ones((self.points, 2))

    def surface(self, scans, poses):
        self.surfaces.append(scans)
        return np.ones((1, 2))


def search(motions=THERE_AND_BACK, returns=None, config=CONFIG):
    return LoopSearch(np.zeros(3), driven(motions), returns or StandIn(), config)


def put(old, new, off=(0.0, 0.0, 0.0), poses=None):
    """A closure that puts a scan where it is believed, moved by so much in the frame of the robot there."""
    poses = followed(np.zeros(3), THERE_AND_BACK) if poses is None else poses
    return Closure(old, new, compose(inverse(poses[old]), compose(poses[new], np.array(off))))


@pytest.mark.parametrize(
    ("later", "off", "agree"),
    [
        (62, (0.0, 0.0, 0.0), True),
        (62, (0.1, 0.1, 0.0), True),
        (62, (0.0, 0.2, 0.0), False),
        (62, (0.0, 0.0, 0.03), True),
        (62, (0.0, 0.0, -0.06), False),
        (61, (0.0, 0.0, 0.0), False),
        (68, (0.0, 0.0, 0.0), True),
        (69, (0.0, 0.0, 0.0), False),
    ],
)
def test_two_findings_agree_where_they_put_the_robot_at_one_place_a_metre_to_four_apart(later, off, agree):
    one, other = put(21, 60), put(81 - later, later, off)
    assert search()._agree(one, other) is agree
    assert search()._agree(other, one) is False


def test_two_findings_do_not_agree_over_a_slip():
    slipped = search(returns=StandIn(slips=[61]))
    assert slipped.drive.slipped == [61]
    assert not slipped._agree(put(21, 60), put(17, 64))
    assert slipped._agree(put(20, 61), put(17, 64))


def test_a_scan_is_held_against_scans_since_the_last_slip_and_so_is_what_it_is_laid_together_with():
    returns = StandIn(slips=[40])
    search(returns=returns)
    assert returns.held_against[39] == range(31, 39)
    assert returns.held_against[44] == range(40, 44)
    assert returns.held_against[60] == range(52, 60)
    asked = {query.stop - 1: query.start for query in returns.queries}
    assert asked[39] == 31
    assert asked[44] == 40
    assert asked[60] > 50


@pytest.mark.parametrize(("points", "is_sought"), [(99, False), (100, True)])
def test_with_few_points_no_place_is_sought(points, is_sought, monkeypatch):
    monkeypatch.setattr(loop_search, "place_on", lambda *_: None)
    returns = StandIn(points)
    search(returns=returns)
    assert bool(returns.surfaces) is is_sought


def windows(at=70, **changes):
    """The old scans beside which a scan is sought, with the windows."""
    config = replace(CONFIG, closures=replace(PLACES, **changes))
    return sought(search(config=config), at)


def sought(looked, at):
    return {each.old: each.window for each in looked._candidates(at)}


def test_a_place_is_sought_beside_the_nearest_old_scan_as_far_around_as_the_path_may_have_drifted():
    (old,), (window,) = windows().keys(), windows().values()
    assert old == 11
    way = 0.5 * 58
    assert window.half_m == pytest.approx(PLACES.radius_m + PLACES.radius_share * way)
    assert window.half_rad == pytest.approx(PLACES.turn_rad + PLACES.turn_a_metre * way)
    assert windows(turn_a_metre=1.0)[11].half_rad == PLACES.most_rad
    np.testing.assert_allclose(window.guess, search().poses[70])


def test_places_that_the_robot_left_just_now_or_a_short_way_ago_are_not_sought():
    out = np.array([AHEAD] * 5 + [TURN] + [AHEAD] * 5 + [0.1 * AHEAD] * 12)
    assert sought(search(out), 23) == {}  # 5.6 m ago
    assert sought(search(out, config=replace(CONFIG, closures=replace(PLACES, way_m=3.0))), 23).keys() == {0}
    assert windows(61) != {}
    assert windows(61, recent=62) == {}


def test_three_stretches_are_tried_and_of_each_the_scan_that_is_nearest():
    laps = np.array([[*AHEAD[:2], np.pi / 20]] * 200)  # five laps of 20 m
    found = [*sought(search(laps), 200)]
    assert found == sorted(found, key=lambda k: abs(k % 40))
    assert len(found) == 3


def test_ways_are_short_over_closures():
    looked = search()
    assert looked._shortest_ways(70)[0][11] == pytest.approx(0.5 * 58)
    looked.closures.append(put(12, 69))
    assert looked._shortest_ways(70)[0][11] == pytest.approx(0.5 + loop_search.NEAR_M + 0.5)
    assert looked._candidates(70) == []


def test_after_a_slip_any_turn_is_tried_and_as_far_around_as_it_moved_what_came_after():
    slipped = search(returns=StandIn(slips=[66]))
    (old, window), *_ = sought(slipped, 70).items()
    lever = 2.0 * float(np.hypot(*(slipped.poses[70] - slipped.poses[66])[:2]))
    assert window.half_rad == np.pi
    assert window.half_m == pytest.approx(PLACES.radius_m + PLACES.radius_share * 0.5 * (69 - old) + lever, abs=0.05)
    assert lever == pytest.approx(4.0)
    # Over a slip even what was left just now is a place to come back to.
    short = search(np.array([AHEAD] * 4), StandIn(slips=[3]))
    assert short._candidates(4) != []


def test_an_old_submap_ends_where_the_robot_slipped():
    slipped = search(returns=StandIn(slips=[8, 14]))

    def beside(old, half_m=1.0):
        return Candidate(old, Window(np.zeros(3), half_m, 0.1))

    assert search()._around(beside(11), 70) == range(1, 21)
    assert search()._around(beside(11, 5.5), 70) == range(22)
    assert slipped._around(beside(11), 70) == range(8, 14)
    assert slipped._around(beside(16), 70).start == 14
    assert slipped._around(beside(3), 70).stop == 8


def place(x, score=0.9, rival=0.0):
    return Place(np.array([x, 0.0, 0.0]), score, rival)


@pytest.mark.parametrize(
    ("told", "is_found"),
    [
        ([place(5.0), place(5.1, 0.8)], True),
        ([place(5.0), place(6.0, 0.7)], True),
        ([place(5.0), place(6.0, 0.85)], False),
        ([place(5.0, rival=0.85), place(5.1, 0.2)], False),
        ([place(5.0, 0.49), place(5.1, 0.2)], False),
        ([place(5.0, 0.51), place(5.1, 0.2)], True),
        ([None, place(5.0)], True),
        ([None, None], False),
    ],
)
def test_a_place_must_fit_and_have_no_rival_on_any_stretch(told, is_found, monkeypatch):
    laps = np.array([[*AHEAD[:2], np.pi / 20]] * 100)
    looked, left = search(laps), list(told)
    looked._returns = StandIn(200)
    assert len(looked._candidates(100)) == 2
    monkeypatch.setattr(loop_search, "place_on", lambda *_: left.pop(0))
    found = looked._place(100)
    assert (found is not None) is is_found
    if found is not None:
        closure, _ = found
        best = max((each for each in told if each is not None), key=lambda each: each.score)
        np.testing.assert_allclose(compose(looked.poses[closure.old], closure.motion), best.pose, atol=1e-9)


UNTOLD = np.array([AHEAD] * 80)
"""The same way, of which the wheels did not report the turn at scan 41."""


def test_a_closure_over_a_slip_turns_all_that_came_after_it():
    true = followed(np.zeros(3), THERE_AND_BACK)
    true = np.concatenate([true[:41], true[42:]])
    slipped = search(UNTOLD, StandIn(slips=[41]))
    assert np.hypot(*(slipped.poses - true)[70, :2]) > 10.0
    slipped.closures = [Closure(80 - new, new, TURN) for new in (68, 70)]
    slipped._settle(slipped.closures[-1])
    np.testing.assert_allclose(slipped.poses[:71, :2], true[:71, :2], atol=1e-3)


def test_a_closure_that_says_what_is_known_moves_nothing():
    looked = search()
    before = looked.poses.copy()
    for off, moves in (((0.05, 0.0, 0.0), False), ((0.0, 0.1, 0.0), True)):
        looked.closures = [put(11, 70, off)]
        looked._settle(looked.closures[0])
        assert np.any(looked.poses != before) == moves


def test_a_motion_in_which_the_robot_slipped_gives_way_to_closures():
    motions = THERE_AND_BACK.copy()
    motions[30, 2] += 0.3
    true, told = followed(np.zeros(3), THERE_AND_BACK), followed(np.zeros(3), motions)
    closures = [Closure(81 - new, new, TURN) for new in (55, 60, 65, 70, 75)]
    off = [
        np.hypot(*(settled(told, driven(motions, slips), closures, CONFIG) - true)[:, :2].T).max()
        for slips in ([31], [])
    ]
    assert off[0] < 0.1
    assert off[1] > 0.5


def test_another_place_is_one_half_a_metre_away_or_turned_by_ten_degrees():
    poses = np.array([[0.0, 0.0, 0.1], [0.4, 0.0, 0.1], [0.4, 0.4, 0.1], [0.0, 0.0, -3.1], [0.0, 0.0, 0.25]])
    np.testing.assert_array_equal(
        apart(poses, np.array([0.0, 0.0, 0.1]), PLACES.place), [False, False, True, True, False]
    )


def test_between_neighbouring_returns_of_one_surface_there_is_surface():
    corner = np.array([[1.0, 0.0], [1.0, 0.28], [1.0, 0.7]])
    (surface,) = Returns([corner], PLACES).surfaces
    y = np.sort(surface[:, 1])
    assert np.diff(y[y < 0.29]).max() <= PLACES.place.cell_m
    assert np.diff(y).max() == pytest.approx(0.42)
