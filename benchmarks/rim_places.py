"""Places for holes anywhere on a mesh, at ragged borders and thin parts too."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from meshlab_lowrank.filters.reading import mesh_arrays
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, edge_lengths
from meshlab_lowrank.mesh.topology import boundary_vertices, faces_at, vertex_adjacency
from meshlab_lowrank.mesh_files import READ_SUFFIXES, load_mesh
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, find_boundary

_LEAST_FACES = 1500
_NEAR = 200  # faces around a place, of whose edges the mean is taken
_LONGEST = 700  # edges of a rim
_TRIES = 20
_RINGS = 40  # of a large mesh around a hole
_LARGE = 60_000  # faces


@dataclass(frozen=True)
class Place:
    """A mesh with a hole that was punched into it.

    Attributes
    ----------
    file : str
    number : int
    at_border : bool
        Whether the hole has run into the border of the mesh.
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loops : tuple of BoundaryLoop
        Those that came to be.
    """

    file: str
    number: int
    at_border: bool
    vertices: FloatArray
    faces: IntArray
    loops: tuple[BoundaryLoop, ...]


def mesh_files(folders: list[Path]) -> list[Path]:
    """List the meshes of some folders."""
    return sorted(
        path
        for folder in folders
        for path in folder.iterdir()
        if path.suffix.lower() in READ_SUFFIXES
    )


def places_on(path: Path, count: int, radius: float) -> Iterator[Place]:
    """Punch round holes of a radius, in mean edge lengths there, at vertices taken by chance.

    Every second one lies at the border of the mesh, if it has one.
    """
    loaded = load_mesh(path)
    loaded.meshset.current_mesh().compact()
    vertices, faces = mesh_arrays(loaded.meshset.current_mesh())
    faces = find_boundary(vertices, faces).faces
    if len(faces) < _LEAST_FACES:
        return
    border = np.flatnonzero(boundary_vertices(faces, len(vertices)))
    tree = cKDTree(vertices[faces].mean(axis=1))
    choice = np.random.default_rng([zlib.crc32(path.name.encode()), round(radius)])
    for number in range(count):
        at_border = number % 2 == 1 and len(border) > 0
        for _ in range(_TRIES):
            start = int(choice.choice(border if at_border else np.unique(faces)))
            near = tree.query(vertices[start], k=_NEAR)[1]
            reach = radius * float(edge_lengths(vertices, faces[near]).mean())
            found = _punched(vertices, faces, start, reach)
            if found is not None:
                yield Place(path.name, number, at_border, vertices, *found)
                break


def _punched(
    vertices: FloatArray, faces: IntArray, start: int, reach: float
) -> tuple[IntArray, tuple[BoundaryLoop, ...]] | None:
    inside = np.linalg.norm(vertices - vertices[start], axis=1) <= reach
    local = faces[inside[faces].all(axis=1)]
    _, label = csgraph.connected_components(vertex_adjacency(local, len(vertices)), directed=False)
    inside &= label == label[start]
    gone = faces_at(inside, faces)
    rest = faces[~gone]
    if len(rest) < _LEAST_FACES // 2 or gone.sum() < 10:
        return None
    rest = _around(rest, faces[gone], len(vertices))
    rim = np.intersect1d(faces[gone], rest)
    loops = tuple(
        loop
        for loop in find_boundary(vertices, rest).loops
        if np.isin(loop.vertices, rim).any() and not loop.reason
    )
    if not loops or sum(len(loop.vertices) for loop in loops) > _LONGEST:
        return None
    return rest, loops


def _around(faces: IntArray, gone: IntArray, n: int) -> IntArray:
    """Cut a large mesh down to what lies around a hole."""
    if len(faces) <= _LARGE:
        return faces
    inside: BoolArray = np.zeros(n, dtype=np.bool_)
    inside[gone] = True
    for _ in range(_RINGS):
        inside[faces[faces_at(inside, faces)]] = True
    return faces[faces_at(inside, faces)]
