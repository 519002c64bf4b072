"""Edges along creases: ridges come back crisp, and only inner edges of the fill change."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.mesh.crossings import crossing_pairs
from meshlab_lowrank.mesh.geometry import corner_angles, face_normals
from meshlab_lowrank.mesh.topology import border_of, edges_of, half_edge_pairs
from meshlab_lowrank.stages.stage8_edges_along_creases import AlongCreases
from meshlab_lowrank.stages.stage8_edges_as_closed import EdgesAsClosed

SIDE = 14
RIDGE = 7  # row of vertices


@pytest.fixture(scope="module")
def roof(sheet):
    """A roof with a row of vertices on its ridge, its triangles as they should be."""
    points, faces = sheet(SIDE, SIDE, jitter=0.0)
    rows = np.unique(points[:, 1])
    points[:, 2] = -0.7 * np.abs(points[:, 1] - rows[RIDGE])
    return points, faces


@pytest.fixture(scope="module")
def spoilt(roof):
    """The same roof with edges that run across its ridge, and which faces may change."""
    points, faces = roof
    faces = faces.copy()
    inner = ~np.isin(faces, np.unique(faces[_outer(faces)])).any(axis=1)
    ends = np.isclose(points[:, 2], 0.0)
    spent = ~inner
    for here, there in half_edge_pairs(edges_of(faces)).T:
        (f, i), (g, j) = divmod(int(here), 3), divmod(int(there), 3)
        a, b, c, d = faces[f, i], faces[g, j], faces[f, i - 1], faces[g, j - 1]
        if not (spent[f] or spent[g]) and ends[[a, b]].all():
            faces[f], faces[g] = (d, b, c), (a, d, c)
            spent[[f, g]] = True
    return points, faces, inner


def _outer(faces):
    """Faces at the border."""
    edges = edges_of(faces)
    return (edges.face_count[edges.face_edges] == 1).any(axis=1)


def slopes(points, faces):
    """Mark the faces that lie in one side of the roof."""
    steep = np.array([0.0, 0.7, 1.0]) / np.hypot(0.7, 1.0)
    normals = face_normals(points, faces)
    return np.isclose(np.abs(normals), steep, atol=1e-9).all(axis=1)


def test_a_ridge_that_edges_ran_across_comes_back(roof, spoilt):
    points, faces, new = spoilt
    assert slopes(*roof).all()
    assert np.count_nonzero(~slopes(points, faces)) >= 4
    mended = AlongCreases()(points, faces, new)
    assert slopes(points, mended).all()
    np.testing.assert_array_equal(mended[~new], faces[~new])
    assert not slopes(points, EdgesAsClosed()(points, faces, new)).all()


def test_the_fill_stays_a_manifold_with_its_border_and_its_angles(sheet):
    points, faces = sheet(30, 30, jitter=0.25)
    wild = np.random.default_rng(3)
    points[:, 2] = 0.5 * np.abs(np.sin(1.3 * points[:, 0] + wild.uniform(0.0, 0.3, len(points))))
    new = np.hypot(*(points[faces].mean(axis=1) - points.mean(axis=0))[:, :2].T) < 9.0
    flipped = AlongCreases()(points, faces, new)
    assert (flipped != faces).any(axis=1).sum() > 20
    np.testing.assert_array_equal(flipped[~new], faces[~new])
    border = border_of(flipped, len(points))
    assert (border.non_manifold, border.inconsistent) == (0, 0)
    rims = [
        {tuple(e) for e in np.sort(x.vertices[x.face_count == 1], axis=1)}
        for x in (edges_of(faces[new]), edges_of(flipped[new]))
    ]
    assert rims[0] == rims[1]
    least = min(np.radians(12.0), corner_angles(points, faces).min())
    assert corner_angles(points, flipped).min() >= least - 1e-12
    assert (face_normals(points, flipped)[:, 2] > 0.0).all()


def test_a_surface_without_detail_keeps_its_edges(sheet):
    points, faces = sheet(20, 20)
    everywhere = np.ones(len(faces), dtype=np.bool_)
    np.testing.assert_array_equal(AlongCreases()(points, faces, everywhere), faces)


def test_no_flip_makes_the_fill_cross_anything():
    corners = [(-1.0, 0, 0), (1, 0, 0), (0, -1, 0.6), (0, 1, 0.6)]  # a ridge from 2 to 3
    around = [(-2.0, -1, -0.6), (2, -1, -0.6), (2, 1, -0.6), (-2, 1, -0.6)]
    spike = [(0.0, 0.0, 0.4), (0.1, 0.0, 0.9), (-0.1, 0.0, 0.9)]
    points = np.array(corners + around + spike)
    faces = np.array([(0, 2, 1), (0, 1, 3)])
    rest = [(4, 2, 0), (2, 5, 1), (1, 6, 3), (3, 7, 0), (4, 0, 7), (5, 6, 1)]
    clear, crossed = np.array([*faces, *rest]), np.array([*faces, *rest, (8, 9, 10)])
    new = np.arange(9) < 2
    flipped = AlongCreases()(points, clear, new[:-1])
    assert (flipped != clear).any()
    every = np.arange(9)
    assert len(crossing_pairs(points, np.vstack([flipped, crossed[-1:]]), every[:2], every)) > 0
    np.testing.assert_array_equal(AlongCreases()(points, crossed, new), crossed)
