"""What a belief tells of its lines, and what a joint Gaussian tells of some of them."""

import re

import numpy as np
import pytest

from chainslam.slam.estimation.backend import Belief, Joint, Observations, columns_of

IDS = np.array([2, 3, 7, 11])
MEAN = np.arange(11.0)
COV = 100.0 * np.arange(11.0)[:, None] + np.arange(11.0)
ANCHORS = np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0], [6.0, 7.0]])


def belief(ids=IDS):
    """Return a belief that answers a query with what it was asked."""

    def query(wanted):
        assert wanted.dtype == np.int64
        return wanted

    n = len(ids)
    return Belief(np.zeros(3), np.eye(3), ids, ANCHORS[:n], MEAN[3:].reshape(4, 2)[:n], query)


@pytest.mark.usefixtures("_unchecked")
def test_some_of_the_lines_have_the_pose_before_them_in_the_order_that_was_asked_for():
    rows, columns = np.array([3, 0, 1]), [0, 1, 2, 9, 10, 3, 4, 5, 6]
    np.testing.assert_array_equal(columns_of(rows), columns)
    assert columns_of(rows).dtype == np.int64
    np.testing.assert_array_equal(columns_of(rows[:0]), [0, 1, 2])
    some = Joint(MEAN, COV, ANCHORS).take(rows)
    np.testing.assert_array_equal(some.mean, MEAN[columns])
    np.testing.assert_array_equal(some.cov, COV[np.ix_(columns, columns)])
    np.testing.assert_array_equal(some.anchors, ANCHORS[rows])


def test_rows_are_found_for_ids_in_any_order_and_an_id_that_is_not_in_the_map_is_told():
    assert belief().rows([11, 2, 7, 2]).tolist() == [3, 0, 2, 0]
    assert belief().rows(IDS).tolist() == [0, 1, 2, 3]
    for ids in ([], np.zeros(0, dtype=np.int64)):
        assert belief().rows(ids).tolist() == belief(IDS[:0]).rows(ids).tolist() == []
        assert belief().rows(ids).dtype == belief(IDS[:0]).rows(ids).dtype == np.int64
    for strange in ([5], [0], [12]):
        with pytest.raises(KeyError, match=re.escape(f"'expected ids of lines in the map, found {strange}'")):
            belief().rows([3, *strange, 11])
        told = f"'expected ids of lines in the map, found {strange} in an empty map'"
        with pytest.raises(KeyError, match=re.escape(told)):
            belief(IDS[:0]).rows(strange)


@pytest.mark.usefixtures("_unchecked")
def test_a_joint_is_asked_for_by_an_array_of_ids_whatever_they_were_given_as():
    for ids in ([7, 2], np.array([7, 2]), []):
        assert belief().joint(ids).tolist() == list(ids)


def test_observations_are_as_many_as_their_ids():
    assert len(Observations(IDS, np.zeros((4, 2)), np.zeros((4, 2, 2)))) == 4
