"""Triangulations of a rim bend little, and mend fills of twisted rims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.sheets import ragged_hole
from meshlab_lowrank import closing
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.density import as_dense
from meshlab_lowrank.mesh.geometry import edge_lengths, face_normals, face_vectors
from meshlab_lowrank.mesh.rim_triangulation import least_bent
from meshlab_lowrank.mesh.topology import border_of, edges_of, half_edge_pairs
from meshlab_lowrank.mesh.unfolding import unfolded
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_rings
from meshlab_lowrank.stages.stage1a_close_bend import LeastBendClosing, close_least_bent

UP = np.array([0.0, 0.0, 1.0])


def free(n):
    return np.zeros((n, n), dtype=bool)


def star(seed, corners=40):
    """Give a simple polygon with deep notches, in the plane."""
    chance = np.random.default_rng(seed)
    angle = np.sort(chance.uniform(0.0, 2.0 * np.pi, corners))
    radius = chance.uniform(2.0, 9.0, corners)
    points = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.column_stack([points, np.zeros(corners)])


def every_triangulation(first, last):
    if last - first < 2:
        yield []
        return
    for middle in range(first + 1, last):
        for one in every_triangulation(first, middle):
            for other in every_triangulation(middle, last):
                yield [*one, *other, (first, middle, last)]


def largest_bend(points, outer, triangles):
    """Compare each triangle with what lies beyond each of its sides."""
    normals = face_normals(points, triangles)
    first, second = half_edge_pairs(edges_of(triangles)) // 3
    inner = 1.0 - np.einsum("ij,ij->i", normals[first], normals[second])
    at = triangles.ravel()
    rows = np.repeat(np.arange(len(triangles)), 3)
    rim = np.roll(triangles, -1, axis=1).ravel() == (at + 1) % len(points)
    beyond = 1.0 - np.einsum("ij,ij->i", normals[rows[rim]], outer[at[rim]])
    return max(inner.max(initial=0.0), beyond.max())


@pytest.mark.parametrize("seed", range(8))
def test_a_polygon_in_a_plane_is_covered_once(seed):
    points = star(seed)
    triangles = least_bent(points, np.tile(UP, (len(points), 1)), free(len(points)))
    areas = face_vectors(points, triangles)[:, 2]
    x, y, _ = points.T
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    border = border_of(triangles, len(points)).half_edges
    assert sorted(triangles.ravel()[border]) == list(range(len(points)))


@pytest.mark.parametrize("seed", range(6))
def test_few_other_triangulations_bend_less(seed):
    chance = np.random.default_rng(seed)
    angle = 2.0 * np.pi * np.arange(8) / 8
    points = np.column_stack([np.cos(angle), np.sin(angle), chance.normal(size=8)])
    outer = chance.normal(size=(8, 3))
    outer /= np.linalg.norm(outer, axis=1, keepdims=True)
    found = largest_bend(points, outer, least_bent(points, outer, free(8)))
    others = [largest_bend(points, outer, np.array(t)) for t in every_triangulation(0, 7)]
    assert len(others) == 132
    assert found <= np.quantile(others, 0.1) + 1e-3


def test_banned_edges_are_left_out():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    outer, banned = np.tile(UP, (4, 1)), free(4)
    banned[0, 2] = True
    assert {1, 3} <= set(least_bent(square, outer, banned)[0].tolist())
    banned[1, 3] = True
    assert least_bent(square, outer, banned) is None


def test_a_patch_gets_the_density_that_is_wanted():
    angle = 2.0 * np.pi * np.arange(40) / 40
    points = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    triangles = least_bent(points, np.tile(UP, (40, 1)), free(40))
    wanted = np.full(40, 2.0 * np.pi / 40)
    vertices, patch = as_dense(points, np.zeros((0, 3), dtype=np.int64), triangles, wanted)
    assert np.array_equal(vertices[:40], points)
    areas = face_vectors(vertices, patch)[:, 2]
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(face_vectors(points, triangles)[:, 2].sum())
    assert edge_lengths(vertices, patch).mean() == pytest.approx(wanted[0], rel=0.3)
    assert len(as_dense(points, patch[:0], triangles, np.full(40, np.inf))[0]) == 40


def region_of(seed):
    vertices, faces, _ = ragged_hole(seed)
    loop = next(loop for loop in boundary_loops(vertices, faces) if not loop.is_rim)
    (region,) = cut_rings(vertices, faces, [loop.vertices], [loop.faces], rings=9)
    return region


def rolled(vertices, radius):
    """Roll a sheet up, so that a hole in it is seen from no side as a whole."""
    angle = (vertices[:, 0] - vertices[:, 0].mean()) / radius
    away = radius * (1.0 + 0.02 * angle)
    return np.column_stack([away * np.sin(angle), vertices[:, 1], away * np.cos(angle)])


@pytest.mark.parametrize("density", ["around", "rim", "none"])
def test_a_ragged_hole_in_a_flat_sheet_is_closed_without_folds(density):
    for seed in (8, 18, 30):
        region = region_of(seed)
        closed = close_least_bent(region, density=density)
        new = ~closed.known_faces
        assert face_vectors(closed.vertices, closed.faces[new])[:, 2].min() > 0.0
        if density == "none":
            assert len(closed.vertices) == len(region.vertices)
        assert np.array_equal(closed.faces[~new], region.faces)
        assert np.array_equal(closed.vertices[: len(region.vertices)], region.vertices)
        border = border_of(closed.faces, len(closed.vertices))
        assert (border.non_manifold, border.inconsistent) == (0, 0)


def test_what_lies_back_or_is_a_ring_is_refused():
    region = region_of(8)
    (error,) = LeastBendClosing()([replace(region, islands=(3,))], edge_lengths=[None])
    assert isinstance(error, StageError)
    vertices, faces, _ = ragged_hole(8)
    rim = next(loop for loop in boundary_loops(vertices, faces) if loop.is_rim)
    (outer,) = cut_rings(vertices, faces, [rim.vertices], [rim.faces], rings=9)
    with pytest.raises(StageError, match="lie back on the surface"):
        close_least_bent(outer)


def test_it_mends_what_nothing_else_does():
    vertices, faces, _ = ragged_hole(9)
    kept = np.abs(vertices[:, 0] - vertices[:, 0].mean()) < 2.9 * 1.6
    vertices, faces = rolled(vertices, 1.6), faces[kept[faces].all(axis=1)]
    without = replace(AUTO, close_last=())
    flaws, reasons = [], []
    for pipeline in (without, AUTO):
        result = inpaint(
            vertices, faces, parameters=InpaintParameters(detail="none"), pipeline=pipeline
        )
        holes = [hole for hole in result.holes if hole.status == "filled"]
        flaws.append(sum(hole.folded_edges + hole.crossings for hole in holes))
        reasons.append(" ".join(hole.reason for hole in holes))
    assert flaws[0] > 0
    assert flaws[1] == 0
    assert "bent as little as can be" in reasons[1]


def test_what_a_move_folds_is_taken_back_and_nothing_else():
    vertices, faces, _ = ragged_hole(3)
    moved = vertices + np.array([0.0, 0.0, 0.1])
    far = np.argmax(vertices[:, 0] + vertices[:, 1])
    tip = np.argmin(np.linalg.norm(vertices - vertices.mean(axis=0) - [6.0, 0.0, 0.0], axis=1))
    moved[tip] += [2.5, 0.0, 0.0]  # over its neighbours
    every = np.ones(len(faces), dtype=bool)
    result = unfolded(vertices, moved, faces, every)
    first, second = half_edge_pairs(edges_of(faces)) // 3
    normals = face_normals(vertices, faces), face_normals(moved, faces), face_normals(result, faces)
    least = [np.einsum("ij,ij->i", n[first], n[second]).min() for n in normals]
    assert least[1] < -0.2 <= least[2]
    assert np.array_equal(result[far], moved[far])
    assert 0.0 < np.linalg.norm(result[tip] - vertices[tip]) < 2.5
    assert np.array_equal(unfolded(vertices, moved, faces, ~every), moved)


def test_fairing_that_folds_a_fill_is_taken_back(monkeypatch):
    vertices, faces, _ = ragged_hole(20)
    kept = np.abs(vertices[:, 0] - vertices[:, 0].mean()) < 2.9 * 1.6
    vertices, faces = rolled(vertices, 1.6), faces[kept[faces].all(axis=1)]
    vertices = vertices + np.random.default_rng(20).normal(0.0, 0.12, vertices.shape)
    flaws = []
    for _ in range(2):
        holes = inpaint(vertices, faces, parameters=InpaintParameters(detail="none")).holes
        flaws.append(sum(hole.folded_edges + hole.crossings for hole in holes))
        monkeypatch.setattr(closing, "_unfolded", lambda _, faired: faired)
    assert flaws[0] == 0 < flaws[1]
