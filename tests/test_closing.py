"""Closing a hole: what may not change, how many vertices come, how good the triangles are."""

from __future__ import annotations

import numpy as np
import pytest

import meshlab_lowrank.stages.stage1a_close_fill as closing
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import corner_angles, edge_lengths, face_normals
from meshlab_lowrank.mesh.topology import border_of, edges_of
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region
from sample_meshes.holes import punch
from sample_meshes.shapes import make_shape


def region_of(vertices, faces, loop=None):
    loop = loop or boundary_loops(vertices, faces)[0]
    return cut_region(vertices, faces, loop.vertices, loop.faces, reach=10.0)


@pytest.fixture(scope="module")
def blob():
    return make_shape("blob", "smooth", count=5000, triangulation="irregular")


@pytest.fixture(scope="module", params=[1.5, 4.0, 8.0, 12.0])
def punched(request, blob):
    """A blob less a disc, and the number of vertices that went."""
    hole = punch(*blob, np.array([0.0, 0, 100]), request.param, outline="irregular", seed=3)
    return hole.vertices, hole.faces, len(blob[0]) - len(hole.vertices)


def check_fill(region, closed):
    """The old is untouched; the new closes the loop, manifold and oriented alike."""
    n, m = len(region.vertices), len(region.faces)
    np.testing.assert_array_equal(closed.vertices[:n], region.vertices)
    np.testing.assert_array_equal(closed.faces[:m], region.faces)
    np.testing.assert_array_equal(closed.vertex_ids[:n], region.vertex_ids)
    np.testing.assert_array_equal(closed.face_ids[:m], region.face_ids)
    for known, old in ((closed.known_vertices, n), (closed.known_faces, m)):
        np.testing.assert_array_equal(known, np.arange(len(known)) < old)
    assert (closed.vertex_ids[n:] == -1).all()
    assert (closed.face_ids[m:] == -1).all()
    before, after = (border_of(r.faces, len(r.vertices)) for r in (region, closed))
    assert (after.non_manifold, after.inconsistent) == (0, 0)
    assert len(before.half_edges) - len(after.half_edges) == len(region.loop)
    fill = closed.faces[m:]
    edges = edges_of(fill)
    used = np.unique(fill)
    assert len(used) - len(edges.vertices) + len(fill) == 1  # a disc
    rim = edges.vertices[edges.face_count == 1]
    loop = np.sort(np.stack([region.loop, np.roll(region.loop, -1)], axis=1), axis=1)
    assert {tuple(e) for e in rim.tolist()} == {tuple(e) for e in loop.tolist()}
    assert set(used) == set(region.loop) | set(range(n, len(closed.vertices)))


def test_fill_of_a_disc(punched):
    vertices, faces, gone = punched
    region = region_of(vertices, faces)
    closed = close_region(region)
    check_fill(region, closed)
    new = len(closed.vertices) - len(region.vertices)
    assert abs(new - gone) <= max(0.15 * gone, 3.0)


def test_triangles_are_as_good_as_those_around(punched):
    region = region_of(*punched[:2])
    closed = close_region(region)
    old, new = (
        np.sort(corner_angles(closed.vertices, closed.faces[which]).min(axis=1))
        for which in (closed.known_faces, ~closed.known_faces)
    )
    assert new.mean() > 0.95 * old.mean()
    assert new[0] > min(np.radians(10.0), old[0])
    valence = np.bincount(closed.faces.ravel())[~closed.known_vertices]
    assert ((valence >= 4) & (valence <= 9)).all()


def test_same_input_gives_the_same_bytes(punched):
    region = region_of(*punched[:2])
    first, second = close_region(region), close_region(region)
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


def test_fill_does_not_depend_on_place_and_size(blob):
    hole = punch(*blob, np.array([0.0, 0, 100]), 5.0)
    one = close_region(region_of(hole.vertices, hole.faces))
    moved = close_region(region_of(1000.0 * hole.vertices + 1e5, hole.faces))
    np.testing.assert_array_equal(one.faces, moved.faces)
    np.testing.assert_allclose(one.vertices, moved.vertices, atol=1e-4)


@pytest.mark.parametrize("length", [0.5, 2.0])
def test_edge_length_can_be_given(blob, length):
    hole = punch(*blob, np.array([0.0, 0, 100]), 10.0)
    region = region_of(hole.vertices, hole.faces)
    closed = close_region(region, edge_length=length)
    check_fill(region, closed)
    inner = closed.faces[(~closed.known_vertices[closed.faces]).all(axis=1)]
    assert edge_lengths(closed.vertices, inner).mean() == pytest.approx(length, rel=0.2)


def test_edge_length_follows_the_surroundings():
    shape = make_shape("sphere", "smooth", count=4000)
    vertices, faces = shape
    vertices = vertices - vertices.mean(axis=0)
    # a conformal map of the sphere: inversion at a point outside makes one side coarser
    pole = np.array([0.0, 0.0, 2.2 * np.linalg.norm(vertices, axis=1).max()])
    away = vertices - pole
    vertices = away / np.sum(away**2, axis=1, keepdims=True)
    middle = int(np.argmin(np.abs(shape[0] - np.array([100.0, 0, 0])).sum(axis=1)))
    hole = punch(vertices, faces[:, ::-1].copy(), middle, 9.0)
    region = region_of(hole.vertices, hole.faces)
    closed = close_region(region)
    check_fill(region, closed)

    def lengths(which):
        """Mean edge length on the coarse and on the fine side, of faces near the rim."""
        some = closed.faces[which]
        centre = closed.vertices[some].mean(axis=1)
        along = centre[:, 2]
        rim = closed.vertices[closed.loop][:, 2]
        near = (
            np.min(np.linalg.norm(centre[:, None] - closed.vertices[closed.loop], axis=2), axis=1)
            < 3.0
        )
        sides = (along > np.quantile(rim, 0.75)), (along < np.quantile(rim, 0.25))
        return np.array([edge_lengths(closed.vertices, some[near & side]).mean() for side in sides])

    outside, inside = lengths(closed.known_faces), lengths(~closed.known_faces)
    assert outside.max() / outside.min() > 1.5
    np.testing.assert_allclose(inside, outside, rtol=0.2)


def test_a_missing_face_is_one_face_again(blob):
    vertices, faces = blob
    region = region_of(vertices, faces[1:])
    closed = close_region(region)
    check_fill(region, closed)
    ids = closed.vertex_ids[closed.faces[-1]]
    np.testing.assert_array_equal(
        np.roll(ids, -np.argmin(ids)), np.roll(faces[0], -np.argmin(faces[0]))
    )
    assert len(closed.faces) == len(region.faces) + 1


def test_two_missing_faces(blob):
    vertices, faces = blob
    shared = np.flatnonzero(np.isin(faces, faces[0]).sum(axis=1) == 2)[0]
    region = region_of(vertices, np.delete(faces, [0, shared], axis=0))
    assert len(region.loop) == 4
    closed = close_region(region)
    check_fill(region, closed)
    assert len(closed.vertices) == len(region.vertices)


def test_only_the_loop_is_closed(blob):
    near = punch(*blob, np.array([0.0, 0, 100]), 4.0)
    both = punch(near.vertices, near.faces, np.array([30.0, 0, 100]), 3.0)
    for loop in boundary_loops(both.vertices, both.faces):
        region = region_of(both.vertices, both.faces, loop)
        check_fill(region, close_region(region))


def battlements():
    """A tube whose upper end is notched like a castle's wall: a loop far from any plane."""
    sides, rings = 32, 4
    u, w = np.divmod(np.arange(sides * rings), rings)
    height = w * (1.0 + 0.8 * (u // 4 % 2))
    angle = 2.0 * np.pi * u / sides
    vertices = np.stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), height], axis=1)
    a = (np.arange(sides)[:, None] * rings + np.arange(rings - 1)).ravel()
    b = (a + rings) % (sides * rings)
    faces = np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], axis=1)])
    return vertices, faces


def test_a_loop_far_from_any_plane():
    vertices, faces = battlements()
    for loop in boundary_loops(vertices, faces):
        region = region_of(vertices, faces, loop)
        check_fill(region, close_region(region))


def test_holes_that_touch_at_a_vertex(blob):
    vertices, faces = blob
    first = np.unique(faces[(faces == faces[0, 0]).any(axis=1)])
    one_ring = (faces == faces[0, 0]).any(axis=1)
    shared = first[first != faces[0, 0]][0]
    beyond = np.setdiff1d(faces[(faces == shared).any(axis=1)], first)
    opposite = beyond[np.argmax(np.linalg.norm(vertices[beyond] - vertices[faces[0, 0]], axis=1))]
    gone = one_ring | (
        (faces == opposite).any(axis=1) & ~np.isin(faces, first[first != shared]).any(axis=1)
    )
    opened = faces[~gone]
    loops = boundary_loops(vertices, opened)
    filled = [opened]
    n = len(vertices)
    for loop in loops:
        region = region_of(vertices, opened, loop)
        closed = close_region(region)
        check_fill(region, closed)
        ids = closed.vertex_ids.copy()
        new = np.flatnonzero(~closed.known_vertices)
        ids[new] = n + np.arange(len(new))
        n += len(new)
        filled.append(ids[closed.faces[~closed.known_faces]])
    border = border_of(np.concatenate(filled), n)
    assert (len(border.half_edges), border.non_manifold, border.inconsistent) == (0, 0, 0)


def test_loop_that_touches_itself_in_space(blob):
    """Vertices at the same place, as along an unwelded seam, stay apart."""
    hole = punch(*blob, np.array([0.0, 0, 100]), 4.0)
    loop = boundary_loops(hole.vertices, hole.faces)[0].vertices
    vertices = hole.vertices.copy()
    vertices[loop[len(loop) // 2]] = vertices[loop[0]]
    region = region_of(vertices, hole.faces)
    check_fill(region, close_region(region))


def test_fill_of_a_flat_hole_is_flat():
    side = 21
    row, column = np.divmod(np.arange(side * side), side)
    vertices = np.stack([column + 0.5 * row, np.sqrt(0.75) * row, 0.0 * row], axis=1)
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate(
        [np.stack([a, a + 1, a + side], axis=1), np.stack([a + 1, a + side + 1, a + side], axis=1)]
    )
    centre = vertices[side * side // 2]
    gone = np.linalg.norm(vertices - centre, axis=1) < 5.0
    opened = faces[~gone[faces].any(axis=1)]
    region = region_of(vertices, opened, boundary_loops(vertices, opened)[1])
    closed = close_region(region)
    check_fill(region, closed)
    assert abs(closed.vertices[:, 2]).max() < 1e-4
    normals = face_normals(closed.vertices, closed.faces)
    np.testing.assert_allclose(normals[:, 2], 1.0, atol=1e-6)
    assert len(closed.vertices) - len(region.vertices) == pytest.approx(gone.sum(), rel=0.15)


def test_too_fine_an_edge_length_is_refused(blob):
    hole = punch(*blob, np.array([0.0, 0, 100]), 4.0)
    with pytest.raises(StageError, match="longer edge length"):
        close_region(region_of(hole.vertices, hole.faces), edge_length=1e-4)


@pytest.mark.parametrize("damage", ["open", "torn", "moved"])
def test_what_meshlab_does_wrong_is_said(blob, monkeypatch, damage):
    hole = punch(*blob, np.array([0.0, 0, 100]), 4.0)
    region = region_of(hole.vertices, hole.faces)
    real = closing.Fills.taken_from

    def wrong(self, mesh_set):
        fill = real(self, mesh_set)
        if damage == "open" or (damage == "torn" and len(fill.vertices) > len(fill.strip)):
            return closing.replace(fill, faces=fill.faces[1:])
        return fill

    if damage == "moved":
        monkeypatch.setattr(closing, "_NOISE", 0.0)
        mesh = closing.pymeshlab.Mesh

        def shifted(vertices, faces):
            return mesh(vertices + 1.0, faces)

        monkeypatch.setattr(closing.pymeshlab, "Mesh", shifted)
    monkeypatch.setattr(closing.Fills, "taken_from", wrong)
    with pytest.raises(StageError, match=rf"MeshLab .* {len(region.loop)} edges.*\.$"):
        close_region(region)
