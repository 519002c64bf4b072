"""Triangulations of least area, of one loop and of two together, as Zou and others published."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag

from meshlab_lowrank.comparison.published import zou
from meshlab_lowrank.comparison.published.zou_ring import triangulated_ring
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from tests.published import area, circle, filled, holes_of, punched


def triangulations(first, last):
    if last - first < 2:
        yield []
        return
    for middle in range(first + 1, last):
        for left in triangulations(first, middle):
            for right in triangulations(middle, last):
                yield [*left, *right, (first, middle, last)]


def rings(p, q):
    """All triangulated rings between chains of p and q points, the other one passed backwards."""

    def on(i, j, a, b):
        if i == p and j == q:
            yield []
            return
        for g in range(1, min(p - i, p - 2) + 1):
            side = (a + i, a + i + g)
            for inner in triangulations(*side):
                for rest in on(i + g, j, a, b):
                    inside = [tuple(x % p for x in each) for each in inner]
                    yield [(side[0] % p, side[1] % p, p + (b - j) % q), *inside, *rest]
        for h in range(1, min(q - j, q - 2) + 1):
            side = (b - j - h, b - j)
            for inner in triangulations(*side):
                for rest in on(i, j + h, a, b):
                    inside = [tuple(p + x % q for x in each) for each in inner]
                    yield [(p + side[0] % q, p + side[1] % q, (a + i) % p), *inside, *rest]

    for a, b in np.ndindex(p, q):
        yield from on(0, 0, a, b)


def sides_and_points(*sizes):
    """Pairs that are a side of one of several loops, or one point."""
    blocks = [np.eye(k) + np.eye(k, k=1) + np.eye(k, k=-1) for k in sizes]
    for block in blocks:
        block[0, -1] = block[-1, 0] = 1.0
    return block_diag(*blocks) > 0.0


@pytest.mark.parametrize("k", [3, 4, 5, 7])
def test_no_triangulation_of_a_loop_has_less_area(k):
    points = np.random.default_rng(k).normal(size=(k, 3))
    found = zou.triangulated_loop(points, np.eye(k, dtype=np.bool_))
    least = min(area(points, each) for each in triangulations(0, k - 1))
    assert area(points, found) == pytest.approx(least, rel=1e-12)
    edges = edges_of(found)
    assert (edges.face_count == 1).sum() == k


@pytest.mark.parametrize(("p", "q"), [(4, 3), (4, 4)])
def test_no_ring_between_two_loops_has_less_area(p, q):
    chance = np.random.default_rng(p)
    one = circle(p) + 0.3 * chance.normal(size=(p, 3))
    other = circle(q, 0.8, 0.6)[::-1] + 0.3 * chance.normal(size=(q, 3))
    points = np.concatenate([one, other])
    found = triangulated_ring(one, other, sides_and_points(p, q))
    least = min(area(points, each) for each in rings(p, q))
    assert area(points, found) == pytest.approx(least, rel=1e-12)
    edges = edges_of(found)
    assert (edges.face_count == 1).sum() == p + q


def test_bans_are_kept():
    points = circle(6)
    banned = np.eye(6, dtype=np.bool_)
    banned[0, 2:5] = banned[2:5, 0] = True
    found = zou.triangulated_loop(points, banned)
    ends = edges_of(found).vertices
    assert not {(0, 2), (0, 3), (0, 4)} & set(map(tuple, ends.tolist()))
    banned[:] = True
    with pytest.raises(StageError, match="meets itself"):
        zou.triangulated_loop(points, banned)


def test_edges_from_loop_to_loop_can_be_banned():
    points = np.concatenate([circle(6), circle(6, 1.0, 0.5)[::-1]])
    points += 0.1 * np.random.default_rng(0).normal(size=points.shape)
    banned = sides_and_points(6, 6)
    free = triangulated_ring(points[:6], points[6:], banned)
    ends = {tuple(each) for each in edges_of(free).vertices.tolist()}
    across = next(each for each in sorted(ends) if each[0] < 6 <= each[1])
    banned[across] = banned[across[::-1]] = True
    found = triangulated_ring(points[:6], points[6:], banned)
    assert across not in {tuple(each) for each in edges_of(found).vertices.tolist()}
    assert area(points, found) >= area(points, free) - 1e-12
    banned[:6, 6:] = banned[6:, :6] = True
    assert triangulated_ring(points[:6], points[6:], banned) is None


def test_a_hole_and_its_island_are_joined(sheet):
    points, faces = sheet(22, 20, seed=3)
    vertices, known = punched(points - points.mean(axis=0), faces, radius=6.0, island=3.0)
    inner = sorted(boundary_loops(vertices, known), key=lambda loop: loop.diameter)[:2]
    found, triangles = filled("zou", vertices, known, inner)
    assert len(boundary_loops(found, triangles)) == 1  # the rim of the sheet
    assert area(found, triangles[len(known) :]) == pytest.approx(
        area(points, faces) - area(vertices, known), rel=1e-9
    )


def test_two_holes_side_by_side_are_filled_apart(sheet):
    points, faces = sheet(22, 20, seed=3)
    points = points - points.mean(axis=0)
    vertices, known = punched(points, faces, centre=(-4.0, 0.0), radius=2.5)
    vertices, known = punched(vertices, known, centre=(4.0, 0.0), radius=2.5)
    found, triangles = filled("zou", vertices, known)
    assert len(holes_of(found, triangles)) == 0
    assert area(found, triangles) == pytest.approx(area(points, faces), rel=1e-9)


def test_a_long_loop_is_refused():
    k = zou.MOST_EDGES + 1
    with pytest.raises(StageError, match=r"601 edges is too long .* up to 600"):
        zou.triangulated_loop(circle(k), np.eye(k, dtype=np.bool_))
