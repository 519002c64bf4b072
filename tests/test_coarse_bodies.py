"""Flat faces of bodies with few triangles go on across holes, without vertices to spare."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from meshlab_lowrank import inpaint
from meshlab_lowrank.mesh.geometry import face_vectors
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_coarse import are_coarse
from meshlab_lowrank.stages.stage0_region import cut_rings
from sample_meshes.parts import edge


def volume(vertices, faces):
    return float(np.sum(face_vectors(vertices, faces) * vertices[faces[:, 0]]) / 3.0)


def prism(sides=12):
    """A closed prism, whose side faces are two triangles each."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    low, high = (np.column_stack([ring, np.full(sides, z)]) for z in (0.0, 2.5))
    a = np.arange(sides)
    b = (a + 1) % sides
    faces = [np.stack([a, b, b + sides], 1), np.stack([a, b + sides, a + sides], 1)]
    for k in range(1, sides - 1):
        faces += [np.array([[0, k + 1, k]]), np.array([[sides, sides + k, sides + k + 1]])]
    return np.concatenate([low, high]), np.concatenate(faces)


@pytest.mark.parametrize("first", [0, 3])
def test_sides_of_a_prism_go_on_as_planes(first):
    vertices, faces = prism()
    lost = np.isin(np.arange(len(faces)), first + np.array([0, 1, 13, 14]))
    assert lost.sum() == 4
    result = inpaint(vertices, faces[~lost], detail="none")
    (record,) = result.holes
    assert record.new_vertices == 0
    assert record.creases == 2
    assert volume(result.vertices, result.faces) == pytest.approx(volume(vertices, faces))


def crown(points=16):
    """Spikes on a ring, whose tips lie in a plane."""
    turn = 2.0 * np.pi * np.arange(points) / points
    half = turn + np.pi / points
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    tips = 1.1 * np.stack([np.cos(half), np.sin(half)], axis=1)
    rows = [
        np.column_stack([xy, np.full(points, z)]) for xy, z in ((ring, -1), (ring, 0), (tips, 1))
    ]
    a = np.arange(points)
    b = (a + 1) % points
    faces = [
        np.stack([a, b, b + points], 1),
        np.stack([a, b + points, a + points], 1),
        np.stack([a + points, b + points, a + 2 * points], 1),
    ]
    faces += [np.array([[0, k + 1, k]]) for k in range(1, points - 1)]
    return np.concatenate(rows).astype(float), np.concatenate(faces)


def test_a_crown_gets_a_flat_lid_between_its_tips():
    vertices, faces = crown()
    result = inpaint(vertices, faces, detail="none")
    (record,) = result.holes
    assert record.new_vertices == 0
    assert record.new_faces == 30
    lid = result.faces[result.new_faces]
    lid = lid[(lid >= 32).all(axis=1)]
    assert len(lid) == 14


def box(sides):
    """A box of 1 x 1.3 x 0.8, with so many squares along each edge."""
    places: dict[tuple[int, ...], int] = {}
    faces = []
    for axis, level in product(range(3), (0, sides)):
        for i, j in product(range(sides), repeat=2):
            corners = []
            for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                place = [level] * 3
                place[(axis + 1) % 3], place[(axis + 2) % 3] = i + di, j + dj
                corners.append(places.setdefault(tuple(place), len(places)))
            corners = corners if level else corners[::-1]
            faces += [corners[:3], [corners[0], *corners[2:]]]
    return np.array(list(places)) / sides * [1.0, 1.3, 0.8], np.array(faces)


@pytest.mark.parametrize("sides", [2, 3, 5])
def test_the_corner_of_a_box_comes_back_exactly(sides):
    vertices, faces = box(sides)
    corner = np.flatnonzero((vertices == vertices.max(axis=0)).all(axis=1))
    result = inpaint(vertices, faces[~(faces == corner).any(axis=1)], detail="none")
    (record,) = [hole for hole in result.holes if hole.status == "filled"]
    assert record.creases == 3
    assert volume(result.vertices, result.faces) == pytest.approx(volume(vertices, faces))


def test_fine_bodies_are_not_coarse():
    part = edge(5.0, 90.0)
    faces = part.faces[~part.removed]
    loops = [loop for loop in boundary_loops(part.vertices, faces) if not loop.is_rim]
    regions = cut_rings(
        part.vertices, faces, [loop.vertices for loop in loops], [loops[0].faces], rings=9
    )
    assert are_coarse(regions) == [False]


def test_an_edge_length_that_was_asked_for_is_kept():
    vertices, faces = crown()
    (record,) = inpaint(vertices, faces, detail="none", refineedgelen=0.3).holes
    assert record.new_vertices > 20
