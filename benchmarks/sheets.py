"""Sheets of bumps, and sheets full of small holes, for measuring costs."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import boundary_vertices, edges_of, vertex_adjacency
from sample_meshes.bodies import HEXAGON

WAVELENGTH = 9.0


def sheet(count: int) -> tuple[FloatArray, IntArray]:
    """Make a square sheet of bumps, (n, 3) and (m, 3), slightly jittered, with edge length 1."""
    side = round(np.sqrt(count))
    x, y, faces = _rows(side)
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, (2, side, side))
    x, y = x + jitter[0], y + jitter[1]
    wave = 2.0 * np.pi / WAVELENGTH
    height = 1.1 * np.sin(wave * x) * np.sin(wave * y)
    return np.stack([x, y, height], axis=-1).reshape(-1, 3), faces


def _rows(side: int) -> tuple[FloatArray, FloatArray, IntArray]:
    """Coordinates (side, side) of rows of vertices, each second one shifted, and their faces."""
    i, j = np.mgrid[:side, :side]
    corner = (i * side + j)[:-1, :-1]
    a, b, c, d = corner, corner + 1, corner + side, corner + side + 1
    odd = (i % 2 == 1)[:-1, :-1, None]
    faces = np.where(
        odd, np.stack([a, b, d, a, d, c], axis=-1), np.stack([a, b, c, b, d, c], axis=-1)
    )
    return j + 0.5 * (i % 2), HEXAGON * i, faces.reshape(-1, 3).astype(np.int64)


def one_ring_holes(side: int, count: int) -> tuple[FloatArray, IntArray]:
    """Make a nearly flat sheet with holes of the three vertices of a triangle each."""
    x, y, faces = _rows(side)
    chance = np.random.default_rng(1)
    vertices = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    vertices += chance.normal(0.0, 0.02, vertices.shape)
    rows, columns = np.mgrid[5 : side - 5 : 6, 5 : side - 5 : 7]
    places = np.stack([rows, columns], axis=-1).reshape(-1, 2)
    places = places[chance.permutation(len(places))[:count]]
    first = places[:, 0] * side + places[:, 1]
    above = first + side + places[:, 0] % 2
    gone = np.zeros(len(vertices), dtype=np.bool_)
    gone[np.concatenate([first, first + 1, above])] = True
    return _without(vertices, faces, gone)


def scattered_holes(
    vertices: FloatArray, faces: IntArray, count: int, missing: int
) -> tuple[FloatArray, IntArray]:
    """Cut holes of some missing vertices each out of a mesh, far apart and off its rim."""
    n = len(vertices)
    adjacency = vertex_adjacency(faces, n)
    gone = np.zeros(n, dtype=np.bool_)
    taken = boundary_vertices(faces, n)
    made = 0
    for seed in np.random.default_rng(0).permutation(n):
        if made == count:
            break
        if taken[seed]:
            continue
        hood = np.array([seed])
        for _ in range(6 if missing < 50 else 24):
            hood = np.unique(adjacency[hood].indices)
        if taken[hood].any():
            continue
        taken[hood] = True
        away = np.linalg.norm(vertices[hood] - vertices[seed], axis=1)
        gone[hood[np.argsort(away)[:missing]]] = True
        made += 1
    return _without(vertices, faces, gone)


def _without(vertices: FloatArray, faces: IntArray, gone: BoolArray) -> tuple[FloatArray, IntArray]:
    kept = faces[~gone[faces].any(axis=1)]
    used, corners = np.unique(kept, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3)


def ragged_hole(
    seed: int, *, side: int = 24, jitter: float = 0.25
) -> tuple[FloatArray, IntArray, IntArray]:
    """Cut 6 to 39 faces that hang together out of a flat sheet, by chance.

    Returns
    -------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    missing : (q, 3) int64
        The faces that were cut out.
    """
    chance = np.random.default_rng(seed)
    x, y, faces = _rows(side)
    vertices = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    inner = ~boundary_vertices(faces, len(vertices))
    vertices[inner, :2] += jitter * chance.uniform(-1.0, 1.0, (int(inner.sum()), 2))
    may = inner[faces].all(axis=1)
    edges = edges_of(faces)
    near = np.linalg.norm(vertices[faces].mean(axis=1) - vertices.mean(axis=0), axis=1) < 4.0
    gone = np.zeros(len(faces), dtype=np.bool_)
    gone[chance.choice(np.flatnonzero(may & near))] = True
    for _ in range(int(chance.integers(5, 39))):
        at_hole = np.zeros(len(edges.vertices), dtype=np.bool_)
        at_hole[edges.face_edges[gone]] = True
        beside = np.flatnonzero(at_hole[edges.face_edges].any(axis=1) & may & ~gone)
        gone[chance.choice(beside)] = True
    return vertices, faces[~gone], faces[gone]
