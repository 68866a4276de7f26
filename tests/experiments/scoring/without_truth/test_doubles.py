"""Walls that stand in a map twice, told by their geometry."""

import numpy as np

from chainslam.experiments.scoring.without_truth.doubles import doubles


def turned(ends, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array(ends, dtype=float) @ np.array([[c, -s], [s, c]]).T + [3.0, -7.0]


def test_a_line_that_overlaps_an_earlier_one_of_its_side_is_one_too_many():
    wall = [[0, 0], [2, 0]]
    cases = {
        "again": ([[1, 0.05], [3, 0.05]], True),
        "a little crooked": ([[1, 0.05], [3, 0.12]], True),
        "the other face": ([[2, 0.05], [0, 0.05]], False),
        "farther along": ([[1.9, 0], [4, 0]], False),
        "a niche": ([[0.5, 0.3], [1.5, 0.3]], False),
        "across": ([[1, -1], [1, 1]], False),
    }
    for angle in (0.0, 1.0, 3.1):
        for name, (other, is_double) in cases.items():
            found = doubles(turned([wall, other], angle))
            assert found == ([(0, 1)] if is_double else []), (name, angle)


def test_each_line_counts_once():
    pile = [[[0, 0.01 * k], [1, 0.01 * k]] for k in range(4)]
    assert doubles(np.array(pile, dtype=float)) == [(0, 1), (0, 2), (0, 3)]
    assert doubles(np.zeros((0, 2, 2))) == []
