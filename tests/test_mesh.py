"""The mesh helpers: identities of the operators, and known combinatorics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.edge_flips import flip_edges, open_ears
from meshlab_lowrank.mesh.geometry import (
    corner_angles,
    corner_sum,
    cotangent_laplacian,
    edge_lengths,
    face_normals,
    face_vectors,
    normalized,
    vertex_areas,
    vertex_normals,
)
from meshlab_lowrank.mesh.linear_solver import factorized
from meshlab_lowrank.mesh.topology import (
    border_of,
    boundary_vertices,
    edges_of,
    vertex_adjacency,
    vertex_components,
    vertex_rings,
)
from sample_meshes.shapes import make_shape

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.fixture(scope="module")
def torus():
    return make_shape("torus", "bumps", count=1500, seed=2)


def flat_mesh(side, seed=0, jitter=0.1):
    """A triangulated lozenge, nearly regular, with its faces seen from above."""
    rows, columns = np.divmod(np.arange(side * side), side)
    points = np.column_stack([columns + 0.5 * rows, np.sqrt(0.75) * rows]).astype(np.float64)
    points += np.random.default_rng(seed).uniform(-jitter, jitter, points.shape)
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate(
        [np.stack([a, a + 1, a + side], axis=1), np.stack([a + 1, a + side + 1, a + side], axis=1)]
    )
    return np.column_stack([points, np.zeros(len(points))]), faces


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_closed_surface_has_no_vector_area(torus):
    vertices, faces = torus
    total = face_vectors(vertices, faces).sum(axis=0)
    np.testing.assert_allclose(total, 0.0, atol=1e-10 * vertex_areas(vertices, faces).sum())


def test_vertex_areas_share_out_the_surface(torus):
    vertices, faces = torus
    surface = np.linalg.norm(face_vectors(vertices, faces), axis=1).sum()
    assert vertex_areas(vertices, faces).sum() == pytest.approx(surface)


def test_angle_defects_sum_to_the_euler_characteristic(torus):
    vertices, faces = torus
    defect = 2.0 * np.pi - corner_sum(faces, corner_angles(vertices, faces).ravel(), len(vertices))
    assert defect.sum() == pytest.approx(0.0, abs=1e-8)
    corners = np.random.default_rng(0).normal(size=(4, 3))
    angles = corner_sum(TETRAHEDRON, corner_angles(corners, TETRAHEDRON).ravel(), 4)
    assert (2.0 * np.pi - angles).sum() == pytest.approx(4.0 * np.pi)


def test_angles_of_a_right_triangle():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, np.sqrt(3.0), 0]])
    angles = np.degrees(corner_angles(vertices, np.array([[0, 1, 2]])))
    np.testing.assert_allclose(angles, [[90.0, 60.0, 30.0]])


def test_normals_turn_with_the_mesh(torus):
    vertices, faces = torus
    turn = rotation(3)
    for normals in (face_normals, vertex_normals):
        expected = normals(vertices, faces) @ turn.T
        np.testing.assert_allclose(normals(vertices @ turn.T, faces), expected, atol=1e-12)


def test_normalized_keeps_zero_vectors():
    np.testing.assert_array_equal(
        normalized(np.array([[0.0, 0, 0], [0, 3, 4]])), [[0, 0, 0], [0, 0.6, 0.8]]
    )


def test_laplacian_annihilates_linear_functions_inside_a_plane():
    vertices, faces = flat_mesh(12)
    laplacian = cotangent_laplacian(vertices, faces)
    inside = ~boundary_vertices(faces, len(vertices))
    assert inside.sum() == 100
    linear = vertices @ np.array([2.0, -1.0, 0.0]) + 5.0
    np.testing.assert_allclose((laplacian @ linear)[inside], 0.0, atol=1e-12)
    assert (abs(laplacian @ linear)[~inside] > 1e-3).any()
    np.testing.assert_allclose(np.asarray(laplacian.sum(axis=1)).ravel(), 0.0, atol=1e-12)


def test_laplacian_is_symmetric_and_positive(torus):
    vertices, faces = torus
    laplacian = cotangent_laplacian(vertices, faces)
    assert abs(laplacian - laplacian.T).max() == 0.0
    values = np.random.default_rng(0).normal(size=(len(vertices), 5))
    assert (np.sum(values * (laplacian @ values), axis=0) > 0.0).all()


def test_edges_of_a_tetrahedron():
    edges = edges_of(TETRAHEDRON)
    np.testing.assert_array_equal(edges.vertices, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
    assert (edges.face_count == 2).all()
    for face, numbers in zip(TETRAHEDRON, edges.face_edges, strict=True):
        for i in range(3):
            assert set(edges.vertices[numbers[i]]) == {face[i], face[(i + 1) % 3]}


def test_euler_characteristic(torus):
    vertices, faces = torus
    assert len(vertices) - len(edges_of(faces).vertices) + len(faces) == 0


def test_border_of_a_square_of_two_faces():
    border = border_of(np.array([[0, 1, 2], [2, 1, 3]]), 4)
    np.testing.assert_array_equal(border.half_edges, [0, 2, 4, 5])
    assert (border.non_manifold, border.inconsistent) == (0, 0)


def test_border_counts_bad_edges():
    fan = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]])
    assert border_of(fan, 6).non_manifold == 1
    assert border_of(np.array([[0, 1, 2], [0, 1, 3]]), 4).inconsistent == 1
    closed = border_of(TETRAHEDRON, 4)
    assert (len(closed.half_edges), closed.non_manifold, closed.inconsistent) == (0, 0, 0)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_border_agrees_with_counting_by_hand(m, seed):
    chance = np.random.default_rng(seed)
    faces = np.array([chance.choice(12, 3, replace=False) for _ in range(m)])
    uses: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for face in faces.tolist():
        for i in range(3):
            pair = (face[i], face[(i + 1) % 3])
            uses.setdefault((min(pair), max(pair)), []).append(pair)
    border = border_of(faces, 12)
    found = {(faces.ravel()[h], np.roll(faces, -1, axis=1).ravel()[h]) for h in border.half_edges}
    assert found == {pairs[0] for pairs in uses.values() if len(pairs) == 1}
    assert border.non_manifold == sum(len(pairs) > 2 for pairs in uses.values())
    assert border.inconsistent == sum(
        len(pairs) == 2 and pairs[0] == pairs[1] for pairs in uses.values()
    )


def test_rings_around_a_vertex_of_a_strip():
    strip = np.array([[i, i + 1, i + 2] for i in range(8)])
    rings = vertex_rings(vertex_adjacency(strip, 10), np.array([0]), 3)
    np.testing.assert_array_equal(rings, [0, 1, 1, 2, 2, 3, 3, -1, -1, -1])


def test_components_count_vertices_without_faces_apart():
    labels = vertex_components(np.array([[0, 1, 2], [4, 5, 6], [6, 5, 7]]), 8)
    assert len(np.unique(labels)) == 3
    assert len(np.unique(labels[4:])) == len(np.unique(labels[:3])) == 1


def test_edge_lengths_stand_at_their_first_corner():
    vertices = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])
    np.testing.assert_allclose(edge_lengths(vertices, np.array([[0, 1, 2]])), [[3.0, 4.0, 5.0]])


def test_factorized_solves_and_refuses_singular_matrices(torus):
    vertices, faces = torus
    matrix = cotangent_laplacian(vertices, faces) + sparse.eye_array(len(vertices))
    expected = np.random.default_rng(0).normal(size=(len(vertices), 2))
    np.testing.assert_allclose(factorized(matrix)(matrix @ expected), expected, atol=1e-9)
    with pytest.raises(StageError, match="determine"):
        factorized(sparse.csr_array((3, 3)))


def test_flips_reach_the_delaunay_triangulation():
    vertices, faces = flat_mesh(10)
    everywhere = np.ones(len(faces), dtype=np.bool_)
    worse = faces.copy()
    chance = np.random.default_rng(1)
    for _ in range(300):  # flip edges at random, where the quadrilateral is convex
        f, i = chance.integers(len(worse)), chance.integers(3)
        a, b, c = (worse[f, (i + j) % 3] for j in range(3))
        for g in np.flatnonzero((worse == a).any(axis=1) & (worse == b).any(axis=1)):
            d = next(v for v in worse[g] if v not in (a, b))
            flipped = np.array([[d, b, c], [a, d, c]])
            if g != f and (face_vectors(vertices, flipped)[:, 2] > 1e-4).all():
                worse[f], worse[g] = flipped
    assert corner_angles(vertices, worse).min() < np.radians(10.0)
    mended = flip_edges(vertices, worse, everywhere)
    unordered = [np.sort(np.sort(x, axis=1).view("i8,i8,i8").ravel()) for x in (mended, faces)]
    np.testing.assert_array_equal(*unordered)


def test_an_ear_on_a_tooth_of_the_rim_is_opened():
    # Vertices 0 to 3 are a tooth with its tip at 2; 4 lies beside the tip, where flips stop.
    flat = [(0, 0), (1.06, 0), (0.68, -0.68), (0.5, 0.8), (0.78, -0.64)]
    flat += [(-0.09, -1.65), (1.72, -0.25), (1.22, -1.28)]
    vertices = np.column_stack([np.array(flat), np.zeros(8)])
    known = [(3, 0, 2), (1, 3, 2)]
    fill = [(0, 1, 2), (0, 5, 4), (0, 4, 1), (1, 4, 6), (4, 7, 6), (4, 5, 7)]
    faces, new = np.array(known + fill), np.arange(8) >= 2
    held = np.isin(np.arange(8), [0, 1, 2, 3])
    assert (face_vectors(vertices, flip_edges(vertices, faces, new))[2:, 2] < 0).any()
    opened = open_ears(vertices, faces, held, new)
    np.testing.assert_array_equal(opened[:2], faces[:2])
    assert (face_vectors(vertices, opened)[:, 2] > 0).all()
    np.testing.assert_array_equal(open_ears(vertices, opened, held, new), opened)


def test_flips_keep_faces_that_are_not_flippable():
    vertices, faces = flat_mesh(10, jitter=0.45)
    some = np.random.default_rng(0).uniform(size=len(faces)) < 0.8
    flipped = flip_edges(vertices, faces, some)
    np.testing.assert_array_equal(flipped[~some], faces[~some])
    assert (flipped[some] != faces[some]).any()
    border = border_of(flipped, len(vertices))
    assert (border.non_manifold, border.inconsistent) == (0, 0)
    np.testing.assert_array_equal(
        boundary_vertices(flipped, len(vertices)), boundary_vertices(faces, len(vertices))
    )


def test_flips_undo_a_fold():
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [1, 0.3, 0], [1, 1.5, 0]])
    folded = np.array([[0, 1, 3], [1, 0, 2]])  # vertex 2 lies inside the first face
    normals = face_normals(vertices, flip_edges(vertices, folded, np.ones(2, dtype=np.bool_)))
    assert face_normals(vertices, folded)[:, 2].prod() < 0.0
    assert normals[:, 2].prod() > 0.0
