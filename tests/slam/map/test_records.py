"""One record of a wall: begun, merged and removed at random, no evidence is lost and none is left behind."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.extents import WallsConfig
from chainslam.slam.map.landmarks import Landmarks
from chainslam.slam.map.records import Records
from chainslam.slam.map.reliability import Reliability

SETTINGS = (WallsConfig(), 5)


def observed(landmarks, ids, rng):
    """Give each of these walls evidence of every kind, as observations would."""
    columns, rows = landmarks.records.columns, landmarks.records.rows(np.asarray(ids))
    columns["observations"][rows] += rng.integers(1, 5, len(rows))
    middle = rng.uniform(-2.0, 2.0, len(rows))
    columns["extents"][rows] = np.column_stack([middle - 0.5, middle + 0.5])
    for row in rows.tolist():
        landmarks.profiles._add(row, int(rng.integers(-9, 9)), rng.uniform(size=(5, int(rng.integers(1, 6)))))


def totals(landmarks):
    """What must not change when walls are merged."""
    columns = landmarks.records.columns
    profiles = [profile[1].sum(axis=1) for profile in columns["profile"] if profile is not None]
    return np.concatenate([[columns["observations"].sum()], np.sum(profiles, axis=0) if profiles else np.zeros(5)])


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    doings=st.lists(st.sampled_from(["begin", "merge", "remove", "observe"]), max_size=40),
)
def test_no_evidence_is_lost_or_left_behind(seed, doings):
    landmarks, rng = Landmarks(*SETTINGS), np.random.default_rng(seed)
    alive, newest, ended = [], 0, set()
    for doing in doings:
        before = totals(landmarks)
        if doing == "begin":
            fresh = [newest + 1, newest + 3]
            newest += 3
            observed(landmarks, fresh, rng)
            alive += fresh
        elif doing == "observe" and alive:
            observed(landmarks, rng.choice(alive, min(2, len(alive)), replace=False), rng)
        elif doing == "merge" and len(alive) > 1:
            keep, drop = map(int, rng.choice(alive, 2, replace=False))
            landmarks.records.merge(keep, drop, float(rng.uniform(-2.0, 2.0)))
            alive.remove(drop)
            ended.add(drop)
            np.testing.assert_allclose(totals(landmarks), before)
        elif doing == "remove" and alive:
            gone = int(rng.choice(alive))
            landmarks.remove(np.array([gone]))
            alive.remove(gone)
            ended.add(gone)
        assert landmarks.records.ids.tolist() == sorted(alive)
        assert all(len(column) == len(alive) for column in landmarks.records.columns.values())
    for one in ended:
        # An id is never used again, but if it were its record would be that of a new wall.
        row = landmarks.records.rows(np.array([one]))[0]
        assert landmarks.records.columns["observations"][row] == 0
        assert landmarks.records.columns["profile"][row] is None


def test_a_wall_merged_has_the_extent_of_both_along_the_kept_one():
    landmarks = Landmarks(*SETTINGS)
    landmarks.records.rows(np.array([3, 5]))
    landmarks.records.columns["extents"][:] = [[-1.0, 0.5], [-0.2, 2.0]]
    anchors, means = np.array([[1.0, 4.0], [1.0, 3.0]]), np.zeros((2, 2))
    belief = Belief(
        np.zeros(3), np.eye(3), np.array([3, 5]), anchors, means, lambda ids: Joint(np.zeros(7), np.eye(7), anchors)
    )
    landmarks.merge(belief, 3, 5)
    # The second anchor lies a metre behind the first: t = J n(0) = (0, 1).
    assert landmarks.records.columns["extents"].tolist() == [[-1.2, 1.0]]


def observations(rng, count, turn_rad=0.0):
    """Clear observations of pieces of one wall, 2 m ahead of the origin, told to a milliradian."""
    alpha, along = turn_rad + rng.normal(0.0, 1e-3, count), rng.uniform(-2.0, 2.0, count)
    foot, t = 2.0 * normals(alpha), directions(alpha)
    ends = foot[:, None] + (along[:, None] + [-0.2, 0.2])[..., None] * t[:, None]
    return Segments(
        lines=np.column_stack([alpha, np.full(count, 2.0)]),
        cov=np.tile(1e-6 * np.eye(2), (count, 1, 1)),
        ends=ends,
        beams=np.column_stack([np.arange(count), np.arange(count) + 8]),
        beam_counts=np.full(count, 9),
        at_corner=np.ones((count, 2), dtype=bool),
        chi2=rng.chisquare(7, count),
        is_tentative=np.zeros(count, dtype=bool),
    )


def test_the_reliability_of_a_merged_wall_is_that_of_one_that_made_all_observations():
    rng = np.random.default_rng(5)
    first, second = observations(rng, 12), observations(rng, 15)
    apart, together = Records(), Records()
    split, whole = Reliability(records=apart), Reliability(records=together)
    apart.rows(np.arange(2)), together.rows(np.arange(1))
    for segments, owner in ((first, 0), (second, 1)):
        for k in range(len(segments)):
            split.see(segments.take(np.array([k])), np.array([owner]))
            whole.see(segments.take(np.array([k])), np.array([0]))
    apart.merge(0, 1, 0.0)
    np.testing.assert_allclose(apart.columns["longest"], together.columns["longest"], rtol=1e-12)
