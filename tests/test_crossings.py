"""Which triangles cross, and which merely touch."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.mesh.crossings import crossing_pairs, faces_near
from meshlab_lowrank.stages.stage7_finish_without_flaws import without_crossings


def brute_force(a, b):
    """Whether a side of one triangle passes through the other, by signs of volumes."""

    def volume(p, q, r, s):
        return np.linalg.det(np.stack([q - p, r - p, s - p]))

    for one, other in ((a, b), (b, a)):
        for i in range(3):
            p, q = one[i], one[(i + 1) % 3]
            if volume(*other, p) * volume(*other, q) >= 0.0:
                continue
            around = [volume(p, q, other[j], other[(j + 1) % 3]) for j in range(3)]
            if min(around) > 0.0 or max(around) < 0.0:
                return True
    return False


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_triangles_in_general_position_cross_as_their_sides_tell():
    chance = np.random.default_rng(0)
    sizes = 10.0 ** chance.uniform(-1.0, 0.5, (80, 1, 1))  # so that all classes of size meet
    points = (
        chance.uniform(0.0, 2.0, (80, 1, 3)) + sizes * chance.normal(size=(80, 3, 3))
    ).reshape(-1, 3)
    faces = np.arange(240).reshape(-1, 3)
    expected = [
        [i, j]
        for i in range(40)
        for j in range(40, 80)
        if brute_force(points[faces[i]], points[faces[j]])
    ]
    assert len(expected) > 50
    found = crossing_pairs(points, faces, np.arange(40), np.arange(40, 80))
    assert found.tolist() == expected
    moved = 1e-3 * points @ rotation(1).T + 7.0
    assert crossing_pairs(moved, faces, np.arange(40), np.arange(40, 80)).tolist() == expected


@pytest.mark.parametrize("bumps", [0.0, 0.3])
def test_neighbours_touch_only(sheet, bumps):
    points, faces = sheet(12, 12)
    points[:, 2] = bumps * np.random.default_rng(0).normal(size=len(points))
    every = np.arange(len(faces))
    assert len(crossing_pairs(points, faces, every, every)) == 0


@pytest.mark.parametrize("turn", [np.eye(3), rotation(3)])
@pytest.mark.parametrize("above", [0.0, 1e-9, -1e-5])
def test_faces_that_lie_on_others_cross_them(sheet, turn, above):
    points, faces = sheet(8, 8)
    doubled = np.concatenate([points, points + np.array([0.3, 0.2, above])]) @ turn.T
    both = np.concatenate([faces, faces + len(points)])
    rows = np.arange(len(faces))
    inner = np.flatnonzero(np.abs(points[faces].mean(axis=1)[:, :2] - 3.5).max(axis=1) < 2.0)
    pairs = crossing_pairs(doubled, both, inner, rows + len(rows))
    assert np.array_equal(np.unique(pairs[:, 0]), inner)
    apart = doubled.copy()
    apart[len(points) :] += 0.1 * turn[:, 2]
    assert len(crossing_pairs(apart, both, inner, rows + len(rows))) == 0


def test_a_folded_neighbour_lies_on_the_other():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.9, 0.0]])
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    assert len(crossing_pairs(points, faces, np.array([0]), np.array([1]))) == 1


def test_faces_near_boxes_leave_none_out():
    chance = np.random.default_rng(2)
    points = chance.uniform(0.0, 10.0, (900, 3))
    points[600:] = points[:300] + 4.0 * chance.normal(size=(300, 3))
    faces = np.arange(900).reshape(3, -1).T
    low = chance.uniform(0.0, 9.0, (12, 3))
    high = low + chance.uniform(0.05, 0.5, (12, 3))
    corners = points[faces]
    reach = (corners.min(axis=1)[:, None] <= high) & (corners.max(axis=1)[:, None] >= low)
    found = faces_near(points, faces, low, high)
    assert set(np.flatnonzero(reach.all(axis=2).any(axis=1))) <= set(found.tolist())
    flat = np.array([[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]])
    box = flat[[0]] + 1e-9, flat.max(axis=0, keepdims=True) + 1e-9
    assert len(faces_near(flat, np.array([[0, 1, 2]]), *box)) == 1
    small = faces_near(points, faces, low[:1], low[:1] + 0.1)
    assert len(small) < len(faces) // 2
    assert len(faces_near(points, faces, low[:0], high[:0])) == 0


def test_detail_that_crosses_a_ceiling_is_taken_back(sheet):
    floor, faces = sheet(16, 16)
    ceiling = floor + np.array([0.0, 0.0, 1.0])
    points = np.concatenate([floor, ceiling])
    both = np.concatenate([faces, faces + len(floor)])
    middle = floor[:, :2].mean(axis=0)
    unknown = np.append(
        np.linalg.norm(floor[:, :2] - middle, axis=1) < 4.0, np.zeros(len(floor), bool)
    )
    moved = points.copy()
    distance = np.linalg.norm(points[:, :2] - middle, axis=1)
    moved[unknown, 2] += 1.5 - 0.3 * distance[unknown]
    mended = without_crossings(points, moved, both, unknown)
    rows = np.arange(len(both))
    assert len(crossing_pairs(moved, both, rows, rows)) > 0
    assert len(crossing_pairs(mended, both, rows, rows)) == 0
    assert np.array_equal(mended[~unknown], points[~unknown])
    kept = (mended == moved).all(axis=1) & unknown
    assert kept.sum() > unknown.sum() // 3


def test_detail_that_crosses_all_over_is_taken_back_as_a_whole(sheet):
    points, faces = sheet(10, 10)
    unknown = np.linalg.norm(points[:, :2] - 4.5, axis=1) < 3.0
    chance = np.random.default_rng(0).normal(0.0, 2.0, points.shape)
    moved = points + unknown[:, None] * chance
    every = np.arange(len(faces))
    assert len(crossing_pairs(moved, faces, every, every)) > unknown.sum()
    assert np.array_equal(without_crossings(points, moved, faces, unknown), points)


def test_crossings_that_were_there_before_are_no_reason_to_take_detail_back(sheet):
    floor, faces = sheet(10, 10)
    wall = np.array([[4.5, 4.5, -3.0], [5.2, 4.6, 3.0], [4.6, 5.2, 3.0]])
    points = np.concatenate([floor, wall])
    both = np.concatenate([faces, [[len(floor), len(floor) + 1, len(floor) + 2]]])
    unknown = np.append(np.linalg.norm(floor[:, :2] - 4.7, axis=1) < 3.0, np.zeros(3, bool))
    moved = points + 0.01 * unknown[:, None] * [0.0, 0.0, 1.0]
    assert np.array_equal(without_crossings(points, moved, both, unknown), moved)
