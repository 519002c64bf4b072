"""Holes that are worked on together, and cutting them out of large meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.clusters import clusters
from meshlab_lowrank.mesh.face_grid import FaceGrid
from meshlab_lowrank.mesh.topology import faces_around, vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region, cut_rings
from meshlab_lowrank.stages.stage0_surroundings import faces_of_fills, with_fills_of
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region, close_regions
from meshlab_lowrank.stages.stage1b_fair_harmonic import fair_region, fair_regions
from sample_meshes.shapes import make_shape


def rim(x, y=0.0):
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    return np.stack([x + np.cos(angle), y + np.sin(angle), 0.0 * angle], axis=1)


def test_near_holes_are_one_cluster_and_far_ones_are_not():
    rims = [rim(0), rim(5), rim(30), rim(34), rim(60)]
    assert clusters(rims, [1.0] * 5, [9] * 5, 4.0) == [[0, 1], [2, 3], [4]]
    assert clusters(rims, [1.0] * 5, [9] * 5, 2.5) == [[0], [1], [2, 3], [4]]
    assert clusters([], [], [], 5.0) == []


def test_chains_of_holes_make_no_long_cluster():
    found = clusters([rim(5.0 * i) for i in range(9)], [1.0] * 9, [9] * 9, 4.0)
    assert [each[0] for each in found] == [0, 2, 4, 6, 8]
    assert sorted(hole for each in found for hole in each) == list(range(9))


def test_holes_of_other_edge_lengths_or_too_large_ones_stay_apart():
    rims = [rim(0), rim(5)]
    assert clusters(rims, [1.0, 2.0], [9, 9], 5.0) == [[0], [1]]
    assert clusters(rims, [1.0, 1.0], [3000, 3000], 5.0) == [[0], [1]]
    many = clusters([rim(0.1 * i) for i in range(40)], [1.0] * 40, [9] * 40, 5.0)
    assert max(map(len, many)) <= 12


@pytest.fixture(scope="module")
def holed():
    """A bumpy torus with twelve holes of several sizes; some lie near one another."""
    vertices, faces = make_shape("torus", "bumps", count=9000, seed=2)
    chance = np.random.default_rng(1)
    gone = np.zeros(len(vertices), dtype=bool)
    for place, radius in zip(
        chance.permutation(len(vertices))[:12], 4 * [0.7, 1.5, 3.0], strict=True
    ):
        gone |= np.linalg.norm(vertices - vertices[place], axis=1) < radius
    faces = faces[~gone[faces].any(axis=1)]
    loops = [loop for loop in boundary_loops(vertices, faces) if not loop.reason]
    assert len(loops) > 8
    return vertices, faces, loops


def cut(holed, rings=9):
    vertices, faces, loops = holed
    return cut_rings(
        vertices, faces, [each.vertices for each in loops], [e.faces for e in loops], rings=rings
    )


def test_walking_from_many_loops_is_walking_from_each(holed):
    vertices, faces, loops = holed
    adjacency = vertex_adjacency(faces, len(vertices))
    found = faces_around(faces, len(vertices), [loop.vertices for loop in loops], 4)
    for loop, rows in zip(loops, found, strict=True):
        ring = vertex_rings(adjacency, loop.vertices, 3)
        np.testing.assert_array_equal(rows, np.flatnonzero((ring[faces] >= 0).any(axis=1)))


def test_cutting_many_out_is_cutting_out_each(holed):
    vertices, faces, loops = holed
    for loop, region in zip(loops, cut(holed), strict=True):
        alone = cut_region(vertices, faces, loop.vertices, loop.faces, reach=0.0, rings=9)
        for name in ("vertices", "faces", "vertex_ids", "face_ids", "loop", "centre", "scale"):
            np.testing.assert_array_equal(getattr(region, name), getattr(alone, name))


def test_a_grid_of_faces_finds_what_looking_at_all_finds(holed):
    vertices, faces, loops = holed
    grid = FaceGrid(vertices, faces)
    for loop in loops:
        one, other = (
            cut_region(vertices, faces, loop.vertices, loop.faces, reach=12.0, grid=each)
            for each in (None, grid)
        )
        np.testing.assert_array_equal(one.face_ids, other.face_ids)
    low, high = vertices[:3].min(axis=0), vertices[:3].max(axis=0)
    inside = ((vertices >= low) & (vertices <= high)).all(axis=1)
    np.testing.assert_array_equal(grid.within(low, high), np.flatnonzero(inside[faces].all(axis=1)))
    assert len(grid.within(high + 1e6, high + 2e6)) == 0


def test_closing_and_fairing_together_is_doing_it_for_each(holed):
    regions = cut(holed)
    closed = close_regions(regions, edge_lengths=[None] * len(regions))
    faired = fair_regions(closed)
    for region, together, fair in zip(regions, closed, faired, strict=True):
        alone = close_region(region)
        # MeshLab gets its loops with a noise that differs, so triangles may.
        count = np.count_nonzero(~alone.known_vertices)
        assert abs(np.count_nonzero(~together.known_vertices) - count) <= 1 + 0.15 * count
        np.testing.assert_array_equal(together.vertices[together.known_vertices], region.vertices)
        np.testing.assert_allclose(fair_region(together).vertices, fair.region.vertices, atol=1e-8)


def test_one_bad_loop_leaves_the_others_as_they_are(holed):
    regions = cut(holed)
    lengths = [None] * len(regions)
    lengths[3] = 1e-5  # would need too many faces
    found = close_regions(regions, edge_lengths=lengths)
    assert "longer edge length" in str(found[3])
    good = [each for i, each in enumerate(found) if i != 3]
    assert all(not each.known_faces.all() for each in good)


def test_fills_move_into_wider_surroundings(holed):
    vertices, faces, loops = holed
    narrow = fair_regions(close_regions(cut(holed), edge_lengths=[None] * len(loops)))
    chosen = [1, 4]
    wide = cut_region(
        vertices,
        faces,
        np.concatenate([loops[i].vertices for i in chosen]),
        np.concatenate([loops[i].faces for i in chosen]),
        reach=60.0,
    )
    filled = with_fills_of(wide, [narrow[i].region for i in chosen])
    new = filled.to_global(filled.vertices[~filled.known_vertices])
    regions = [narrow[i].region for i in chosen]
    own = [each.to_global(each.vertices[~each.known_vertices]) for each in regions]
    np.testing.assert_allclose(new, np.concatenate(own), atol=1e-9)
    sides = [len(each.known_faces) - each.known_faces.sum() for each in regions]
    assert np.count_nonzero(~filled.known_faces) == sum(sides)
    before = len(boundary_loops(wide.vertices, wide.faces))
    assert before - len(boundary_loops(filled.vertices, filled.faces)) == 2
    for mine, each in zip(faces_of_fills(filled, regions), regions, strict=True):
        np.testing.assert_array_equal(mine, each.faces)
    turned = filled.faces.copy()
    turned[~filled.known_faces] = np.roll(turned[~filled.known_faces], 1, axis=1)
    for mine, each in zip(
        faces_of_fills(replace(filled, faces=turned), regions), regions, strict=True
    ):
        filling = ~each.known_faces
        np.testing.assert_array_equal(mine[~filling], each.faces[~filling])
        np.testing.assert_array_equal(mine[filling], np.roll(each.faces[filling], 1, axis=1))
