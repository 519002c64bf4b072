"""Creases of the surroundings go on across holes, and nothing else is taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank import inpaint
from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import face_normals
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs
from meshlab_lowrank.stages import stage1a_close_creases
from sample_meshes.holes import remove_faces
from sample_meshes.parts import PARTS, Part, distances, edge

NOISE = 0.02
JOINED = {"box corner": 3, "blunt corner": 3, "stairs": 4, "groove": 4, "chamfer": 2}


def filled(part, vertices=None, **values):
    """Fill the hole at the origin; give the result and the record of that hole."""
    cut = remove_faces(part.vertices if vertices is None else vertices, part.faces, part.removed)
    result = inpaint(cut.vertices, cut.faces, near=(0.0, 0.0, 0.0), detail="none", **values)
    (record,) = [hole for hole in result.holes if hole.status == "filled"]
    assert np.array_equal(result.vertices[: len(cut.vertices)], cut.vertices)
    assert np.array_equal(result.faces[: len(cut.faces)], cut.faces)
    return result, record


def error(part, result):
    """Root mean square distance of new vertices and middles of faces from the part, and back."""
    new = result.faces[result.new_faces]
    middles = result.vertices[new].mean(axis=1)
    to_truth = TriangleIndex(part.vertices, part.faces).closest(middles).distances
    lost = part.vertices[part.faces[part.removed]].mean(axis=1)
    back = TriangleIndex(result.vertices, new).closest(lost).distances
    return float(np.sqrt(0.5 * (np.mean(to_truth**2) + np.mean(back**2))))


def sharp(result, least):
    """Angles in degrees, and middles, of edges between new faces that turn by more than so much."""
    faces = result.faces[result.new_faces]
    edges = edges_of(faces)
    pairs = half_edge_pairs(edges) // 3
    normals = face_normals(result.vertices, faces)
    cosine = np.sum(normals[pairs[0]] * normals[pairs[1]], axis=1)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    ends = edges.vertices[edges.face_count == 2]
    return angle[angle > least], result.vertices[ends[angle > least]].mean(axis=1)


@pytest.mark.parametrize("name", PARTS)
def test_creases_of_parts_go_on(name):
    part = PARTS[name](5.0)
    result, record = filled(part, part.noisy(NOISE))
    assert record.creases == JOINED.get(name, 1)
    assert (record.folded_edges, record.flat_faces, record.crossings) == (0, 0, 0)
    assert error(part, result) < 2.0 * NOISE
    angles, places = sharp(result, 25.0)
    assert len(angles) >= 4
    assert distances(part, places).max() < 0.15
    expected = {"blunt corner": None, "chamfer": 45.0, "groove": 60.0, "stairs": 90.0}
    told = [int(word) for word in name.replace(",", "").split() if word.isdigit()]
    true = told[0] if told else expected.get(name, 90.0)
    assert true is None or abs(np.median(angles) - true) < 5.0


@pytest.mark.parametrize("name", ["edge, 90 degrees", "box corner", "groove"])
def test_joined_creases_beat_the_smooth_fill(name):
    part = PARTS[name](5.0)
    sharp_error = error(part, filled(part)[0])
    assert sharp_error < 0.1 * error(part, filled(part, continuity="smooth")[0])
    assert sharp_error < 1e-3


def test_fill_is_the_same_again_and_turns_with_the_mesh():
    part = PARTS["chamfer"](5.0)
    first, _ = filled(part, part.noisy(NOISE))
    again, _ = filled(part, part.noisy(NOISE))
    assert np.array_equal(first.vertices, again.vertices)
    assert np.array_equal(first.faces, again.faces)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    turned, _ = filled(part, 7.0 * part.noisy(NOISE) @ turn.T)
    back = turned.vertices @ turn / 7.0
    gap = TriangleIndex(first.vertices, first.faces).closest(back[turned.new_vertices]).distances
    assert gap.max() < 0.02


@pytest.mark.parametrize("noise", [0.0, NOISE, 0.15])
def test_surfaces_without_creases_are_filled_as_ever(noise):
    part = edge(5.0, 0.0)
    x, y, _ = part.vertices.T
    wavy = part.vertices + np.stack([0 * x, 0 * x, 1.5 * np.sin(x / 4.0) * np.cos(y / 5.0)], axis=1)
    bent = Part("wavy", wavy, part.faces, part.removed, part.creases)
    auto, record = filled(bent, bent.noisy(noise))
    smooth, _ = filled(bent, bent.noisy(noise), continuity="smooth")
    assert record.creases == 0
    assert np.array_equal(auto.vertices, smooth.vertices)
    assert np.array_equal(auto.faces, smooth.faces)


def one_sided(turn_beyond):
    """An edge whose angle is another one, of a sign, beyond the hole."""
    part = edge(6.0, 0.0)
    x, y, _ = part.vertices.T
    slope = np.interp(y, [-5.0, 5.0], [np.tan(np.radians(35.0)), np.tan(np.radians(turn_beyond))])
    return Part("", np.stack([x, y, -slope * np.abs(x)], axis=1), part.faces, part.removed, [])


@pytest.mark.parametrize("turn_beyond", [0.0, -35.0, 8.0])
def test_a_crease_without_a_partner_is_rounded_as_ever(turn_beyond):
    part = one_sided(turn_beyond)
    auto, record = filled(part)
    smooth, _ = filled(part, continuity="smooth")
    assert record.creases == 0
    assert np.array_equal(auto.vertices, smooth.vertices)


def test_sides_go_on_from_their_own_waves():
    part = edge(6.0, 70.0)
    normals = np.where(part.vertices[:, :1] < 0.0, [-0.57, 0.0, 0.82], [0.57, 0.0, 0.82])
    across, along = np.abs(part.vertices[:, 0]), part.vertices[:, 1]
    height = 0.5 * np.sin(across / 1.7) * np.sin(along / 2.0)  # none on the crease
    result, record = filled(part, part.vertices + height[:, None] * normals)
    assert record.creases == 1
    assert record.rim_angle < 22.0
    assert distances(part, sharp(result, 40.0)[1]).max() < 0.1


def test_blunt_creases_are_joined_when_asked_for():
    part = edge(5.0, 24.0)
    assert filled(part, part.noisy(0.01))[1].creases == 0
    result, record = filled(part, part.noisy(0.01), continuity="crease")
    assert record.creases == 1
    assert error(part, result) < 0.02


@pytest.mark.parametrize("continuity", ["flat", "tangent", "smooth"])
def test_other_continuities_look_for_no_creases(continuity):
    assert filled(edge(4.0, 90.0), continuity=continuity)[1].creases == 0


def test_what_can_not_be_joined_stays_smooth_and_says_so(monkeypatch):
    part = edge(4.0, 90.0)
    smooth, _ = filled(part, continuity="smooth")
    monkeypatch.setattr(stage1a_close_creases, "triangulated", lambda *_: None)
    curved = PARTS["curved edge, 70 degrees"](4.0)
    _, record = filled(curved)
    assert record.creases == 0
    assert "Creases at its rim were not joined." in record.reason
    assert np.array_equal(filled(part)[0].vertices, smooth.vertices)


def test_a_joined_crease_that_would_cross_something_is_rounded():
    part = edge(6.0, 90.0)
    cut = remove_faces(part.vertices, part.faces, part.removed)
    block = np.array([[0.1, 0, 0.2], [-0.1, 0.3, 0.2], [-0.1, -0.3, 0.2], [0, 0, -0.15]])
    sides = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]) + len(cut.vertices)
    vertices = np.concatenate([cut.vertices, block])
    faces = np.concatenate([cut.faces, sides])
    result = inpaint(vertices, faces, near=(0.0, 0.0, 0.0), detail="none")
    (record,) = [hole for hole in result.holes if hole.status == "filled"]
    smooth = inpaint(vertices, faces, near=(0.0, 0.0, 0.0), detail="none", continuity="smooth")
    assert record.crossings == 0
    assert record.creases == 0
    assert np.array_equal(result.vertices, smooth.vertices)


def test_detail_is_not_brought_across_creases():
    part = edge(4.0, 90.0)
    cut = remove_faces(part.vertices, part.faces, part.removed)
    result = inpaint(cut.vertices, cut.faces, near=(0.0, 0.0, 0.0), detail="full")
    (record,) = [hole for hole in result.holes if hole.status == "filled"]
    assert record.creases == 1
    assert record.trust == 0.0
    assert "Detail is not brought across creases." in record.reason


def cut_pyramid(height):
    """A four-sided pyramid that is cut off flat, as a mesh of 24 vertices around and 21 rows."""
    level, around = (each.ravel() for each in np.mgrid[:21, :24])
    side, part = np.divmod(around, 6)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=float)
    ring = corners[side] + (corners[(side + 1) % 4] - corners[side]) * part[:, None] / 6.0
    shrink = 1.0 - level / 40.0
    vertices = np.column_stack([ring * shrink[:, None], height * (1.0 - shrink)])
    a = np.flatnonzero(level < 20)
    b = np.where(around[a] == 23, a - 23, a + 1)
    faces = np.concatenate([np.stack([a, b, b + 24], 1), np.stack([a, b + 24, a + 24], 1)])
    return vertices, faces


@pytest.mark.parametrize(("height", "creases"), [(1.0, 4), (3.0, 0)])
def test_steep_sides_that_are_cut_off_are_capped(height, creases):
    vertices, faces = cut_pyramid(height)
    result = inpaint(vertices, faces, near=(0.0, 0.0, height / 2.0), detail="none")
    (record,) = [hole for hole in result.holes if hole.status == "filled"]
    assert record.creases == creases
    top = result.vertices[:, 2].max()
    assert top == pytest.approx(height if creases else height / 2.0)
