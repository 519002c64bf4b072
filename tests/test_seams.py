"""Boundary edges that lie on one another are seams, and what lies across one is one hole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from meshlab_lowrank.cli import main
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.seams import on_seams, seam_pairs, welded
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops, find_boundary

NONE = InpaintParameters(detail="none")


def soup(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give each face vertices of its own."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


def parted(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Double the vertices at which faces with a positive and with a negative y meet."""
    right = vertices[faces].mean(axis=1)[:, 1] > 0.0
    at_left, at_right = np.zeros((2, len(vertices)), dtype=bool)
    at_left[faces[~right]] = True
    at_right[faces[right]] = True
    both = np.flatnonzero(at_left & at_right)
    number = np.arange(len(vertices))
    number[both] = len(vertices) + np.arange(len(both))
    return (
        np.concatenate([vertices, vertices[both]]),
        np.where(right[:, None], number[faces], faces),
    )


def open_edges(faces: np.ndarray) -> int:
    return len(border_of(faces, int(faces.max()) + 1).half_edges)


def test_a_soup_of_triangles_has_the_holes_of_the_mesh(holed_sphere):
    whole = inpaint(*holed_sphere, parameters=NONE)
    vertices, faces = soup(*holed_sphere)
    result = inpaint(vertices, faces, parameters=NONE)
    sizes = [hole.boundary_edges for hole in whole.holes]
    assert [hole.boundary_edges for hole in result.holes] == sizes
    assert [hole.status for hole in result.holes] == ["filled", "filled"]
    (note,) = result.notes
    assert note.startswith(
        f"{3 * len(faces) - sum(sizes)} boundary edges lie on one another: seams"
    )
    assert np.array_equal(result.vertices[: len(vertices)], vertices)
    assert np.array_equal(result.faces[: len(faces)], faces)
    # the order of vertices differs, so sums are rounded otherwise
    new, expected = result.vertices[len(vertices) :], whole.vertices[whole.new_vertices]
    assert len(new) == len(expected)
    np.testing.assert_allclose(np.sort(new, axis=0), np.sort(expected, axis=0), atol=1e-6)


def test_a_hole_across_a_seam_is_one_hole(holed_sphere):
    vertices, faces = parted(*holed_sphere)
    before, rims = open_edges(faces), open_edges(holed_sphere[1])
    assert before > rims
    result = inpaint(vertices, faces, parameters=NONE)
    assert sum(hole.boundary_edges for hole in result.holes) == rims
    assert [(hole.shape, hole.status) for hole in result.holes] == [("hole", "filled")] * 2
    assert np.array_equal(result.faces[: len(faces)], faces)
    # each rim edge has its face, and the seam runs on for an edge at both ends of both holes
    assert open_edges(result.faces) == before - rims + 2 * 4
    border = border_of(result.faces, len(result.vertices))
    assert (border.non_manifold, border.inconsistent) == (0, 0)
    assert boundary_loops(result.vertices, result.faces) == ()


def test_a_slit_is_a_seam(sheet):
    points, faces = sheet(12, 12)
    middle = points[faces].mean(axis=1)
    inner = np.abs(middle[:, 0] - 6.0) < 4.0
    above = inner & (middle[:, 1] > np.median(middle[:, 1]))
    below = inner & ~above
    ends = np.intersect1d(faces[above], faces[below])
    ends = np.setdiff1d(ends, faces[~inner])
    number = np.arange(len(points))
    number[ends] = len(points) + np.arange(len(ends))
    points = np.concatenate([points, points[ends]])
    slit = np.where(above[:, None], number[faces], faces)
    assert len(ends) > 2
    assert open_edges(slit) == open_edges(faces) + 2 * (len(ends) + 1)
    result = inpaint(points, slit, parameters=NONE)
    assert len(result.faces) == len(faces)
    assert [hole.shape for hole in result.holes] == ["rim"]
    assert result.notes[0].startswith(f"{2 * (len(ends) + 1)} boundary edges")


def test_three_sheets_at_one_edge_are_no_seam():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    vertices, faces = soup(corners, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    border = border_of(faces, len(vertices))
    assert len(seam_pairs(vertices, faces, border.half_edges)) == 0


def test_a_face_with_doubled_corners_does_not_collapse():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]])
    faces = np.array([[0, 1, 2], [4, 3, 5]])
    border = border_of(faces, len(vertices))
    assert len(seam_pairs(vertices, faces, border.half_edges)) == 0
    one = welded(faces, len(vertices), np.array([[0, 3], [5, 4]]))  # 5 would become 3 and 4
    assert np.array_equal(one, faces)
    assert len(inpaint(vertices, faces, parameters=NONE).faces) == 2


def test_corners_of_a_fill_go_to_the_face_beside_them():
    tails, heads = np.array([0, 1, 2, 3]), np.array([1, 2, 3, 0])
    fill = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    starts, ends = np.array([0, 11, 2, 3]), np.array([1, 2, 3, 0])
    expected = [[0, 1, 4], [11, 2, 4], [2, 3, 4], [3, 0, 4]]
    assert on_seams(fill, tails, heads, starts, ends).tolist() == expected
    ear = np.array([[0, 1, 2], [0, 2, 3]])  # both edges at 1 in one face: one of them stays open
    assert on_seams(ear, tails, heads, starts, ends).tolist() == [[0, 11, 2], [0, 2, 3]]


def test_seams_don_t_depend_on_the_numbering(holed_sphere):
    vertices, faces = parted(*holed_sphere)
    order = np.random.default_rng(0).permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[order] = vertices
    for before, after in zip(
        boundary_loops(vertices, faces), boundary_loops(moved, order[faces]), strict=True
    ):
        assert len(before.vertices) == len(after.vertices)
        assert before.area == pytest.approx(after.area)
    assert find_boundary(moved, order[faces]).welded


def test_the_filter_fills_in_place(holed_sphere):
    vertices, faces = parted(*holed_sphere)
    expected = inpaint(vertices, faces, parameters=NONE)
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    out = ms.meshing_inpaint_lowrank(detail="none")
    assert out["closed_holes"] == 2
    assert ms.current_mesh().vertex_matrix().tobytes("C") == expected.vertices.tobytes()
    assert np.array_equal(ms.current_mesh().face_matrix(), expected.faces)


def test_seams_are_said_once(tmp_path: Path, holed_sphere, capsys):
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*soup(*holed_sphere)))
    source = tmp_path / "soup.ply"
    ms.save_current_mesh(str(source))
    assert main(["holes", str(source)]) == 0
    output = capsys.readouterr()
    assert "2 boundary loops" in output.out
    assert output.err.count("meshing_remove_duplicate_vertices") == 1
