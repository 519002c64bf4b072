"""Meshes, holes in them and damages of every kind, as fuzzing puts them together.

Set MESHLAB_LOWRANK_FUZZING to a number of cases to try more, each time others.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pymeshlab
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.topology import edges_of

Mesh = tuple[FloatArray, IntArray]
Generator = np.random.Generator


def grid(rows: int, columns: int, *, around: bool, along: bool) -> IntArray:
    """Triangulate a grid of vertices that may be closed in one or both directions."""
    i, j = np.meshgrid(np.arange(rows - (not around)), np.arange(columns - (not along)))
    a = (i * columns + j).ravel()
    b = ((i + 1) % rows * columns + j).ravel()
    c = ((i + 1) % rows * columns + (j + 1) % columns).ravel()
    d = (i * columns + (j + 1) % columns).ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def torus(chance: Generator) -> Mesh:
    u, v = np.meshgrid(np.arange(18) / 18, np.arange(10) / 10, indexing="ij")
    u, v = 2 * np.pi * u.ravel(), 2 * np.pi * v.ravel()
    radius = 1 + chance.uniform(0, 0.1) * np.sin(6 * u) * np.cos(3 * v)
    ring = 3 + radius * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), radius * np.sin(v)], 1)
    return points, grid(18, 10, around=True, along=True)


def sphere(_: Generator) -> Mesh:
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_sphere(subdiv=2)
    mesh = meshset.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def sheet(chance: Generator) -> Mesh:
    x, y = np.meshgrid(np.arange(12.0), np.arange(14.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), chance.uniform(-0.1, 0.1, x.size)], 1)
    return points, grid(12, 14, around=False, along=False)


def strip(chance: Generator) -> Mesh:
    """Give an open cylinder: two loops bound it; it may be one face wide."""
    columns = int(chance.integers(2, 5))
    angle, height = np.meshgrid(np.arange(16) * np.pi / 8, np.arange(columns), indexing="ij")
    points = np.stack([2 * np.cos(angle), 2 * np.sin(angle), height], -1).reshape(-1, 3)
    return points, grid(16, columns, around=True, along=False)


def two_pieces(chance: Generator) -> Mesh:
    """Give a torus and a piece that is smaller than any patch."""
    points, faces = torus(chance)
    corners = np.array([[0.0, 0, 5], [1, 0, 5], [0, 1, 5], [0, 0, 6]])
    piece = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3]]) + len(points)
    return np.concatenate([points, corners]), np.concatenate([faces, piece])


def cut_disc(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    centre = points[chance.integers(len(points))]
    size = np.nanmax(np.ptp(points, axis=0))
    distance = np.linalg.norm(points[faces].mean(axis=1) - centre, axis=1)
    return points, faces[~(distance < chance.uniform(0.05, 0.3) * size)]


def cut_band(mesh: Mesh, chance: Generator) -> Mesh:
    """Take out a slice, which may split a component in two."""
    points, faces = mesh
    if len(faces) == 0:
        return mesh
    axis = chance.standard_normal(3)
    height = points[faces].mean(axis=1) @ axis
    low = np.nanquantile(height, chance.uniform(0, 0.9)) if len(height) else 0.0
    return points, faces[~((height >= low) & (height < low + 0.1 * np.nanmax(np.abs(height))))]


def nested_loops(mesh: Mesh, chance: Generator) -> Mesh:
    """Take out a ring of faces around a piece that stays, maybe with a hole of its own."""
    points, faces = mesh
    if len(faces) == 0 or faces.max() >= len(points):
        return mesh
    centre = points[chance.integers(len(points))]
    distance = np.linalg.norm(points[faces].mean(axis=1) - centre, axis=1)
    radii = np.nanquantile(distance, np.sort(chance.uniform(0, 0.4, chance.integers(2, 5))))
    return points, faces[np.searchsorted(radii, distance) % 2 == chance.integers(2)]


def remove_faces(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points, faces[chance.random(len(faces)) > chance.uniform(0, 0.1)]


def duplicate_faces(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points, np.concatenate([faces, chance.permutation(faces)[:2]])


def flip_faces(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    share = chance.choice([0.02, 1.0])
    flipped = chance.random(len(faces)) < share
    return points, np.where(flipped[:, None], faces[:, ::-1], faces)


def collapse_faces(mesh: Mesh, chance: Generator) -> Mesh:
    """Make faces of no area by moving one corner onto another."""
    points, faces = mesh
    if len(faces) and faces.max() >= len(points):
        return mesh
    points = points.copy()
    for a, b, _ in chance.permutation(faces)[:3]:
        points[a] = points[b]
    return points, faces


def repeat_corner(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    faces = faces.copy()
    if len(faces):
        row = chance.integers(len(faces))
        faces[row, 0] = faces[row, 1]
    return points, faces


def spoil_coordinate(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    points = points.copy()
    points[chance.integers(len(points)), chance.integers(3)] = chance.choice([np.nan, np.inf])
    return points, faces


def stray_vertices(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return np.concatenate([points, chance.standard_normal((5, 3))]), faces


def join_vertices(mesh: Mesh, chance: Generator) -> Mesh:
    """Use one vertex for two, so that loops touch or edges get many faces."""
    points, faces = mesh
    a, b = chance.integers(len(points), size=2)
    return points, np.where(faces == a, b, faces)


def missing_vertex(mesh: Mesh, _: Generator) -> Mesh:
    points, faces = mesh
    return points[:-1], faces


def move_far(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points * chance.choice([1e-6, 1.0, 1e6]) + chance.choice([0.0, 1e7]), faces


def scale(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points * 10.0 ** chance.choice([-300, -150, -30, -6, 6, 30, 150, 300]), faces


def quantise(mesh: Mesh, chance: Generator) -> Mesh:
    """Round coordinates as a file with few digits does."""
    points, faces = mesh
    step = chance.choice([1e-3, 1e-2, 0.05, 0.2]) * np.nanmax(np.ptp(points, axis=0))
    if not (np.isfinite(step) and step > 0):
        return mesh
    return np.round(points / step) * step, faces


def squeeze(mesh: Mesh, chance: Generator) -> Mesh:
    """Stretch along some direction, a thousandfold at most."""
    points, faces = mesh
    axes, _ = np.linalg.qr(chance.standard_normal((3, 3)))
    factors = 10.0 ** chance.uniform(-3, 3, 3) if chance.random() < 0.5 else np.ones(3)
    factors[0] = 10.0 ** chance.uniform(-3, 3)
    return points @ (axes * factors) @ axes.T, faces


def flatten(mesh: Mesh, chance: Generator) -> Mesh:
    """Press the mesh onto a plane, a line or a point."""
    points, faces = mesh
    kept = np.array([1.0, chance.choice([1.0, 0.0], p=[0.8, 0.2]), 0.0])
    return points * (chance.permutation(kept) if chance.random() < 0.9 else 0.0), faces


def jitter(mesh: Mesh, chance: Generator) -> Mesh:
    """Move vertices so far that the surface, or just its rims, crosses itself."""
    points, faces = mesh
    edges = edges_of(faces)
    if len(faces) == 0 or faces.max() >= len(points):
        return mesh
    tails, heads = edges.vertices.T
    length = np.nanmean(np.linalg.norm(points[tails] - points[heads], axis=1))
    chosen = np.zeros(len(points), dtype=np.bool_)
    chosen[edges.vertices[edges.face_count == 1]] = True
    if chance.random() < 0.3:
        chosen[:] = True
    moves = chosen[:, None] * chance.standard_normal(points.shape)
    return points + length * chance.choice([0.1, 0.5, 2.0]) * moves, faces


def double_vertices(mesh: Mesh, chance: Generator) -> Mesh:
    """Give some corners vertices of their own at the same place, as a seam does."""
    points, faces = mesh
    if len(faces) == 0 or faces.max() >= len(points):
        return mesh
    split = chance.random(faces.shape) < chance.choice([0.01, 0.1, 1.0])
    faces = faces.copy()
    doubled = faces[split]
    faces[split] = len(points) + np.arange(len(doubled))
    return np.concatenate([points, points[doubled]]), faces


def attach_faces(mesh: Mesh, chance: Generator) -> Mesh:
    """Attach fins, with three faces at an edge, and flaps, which hang on a border."""
    points, faces = mesh
    if len(faces) == 0 or faces.max() >= len(points):
        return mesh
    edges = edges_of(faces)
    border = np.flatnonzero(edges.face_count == 1)
    pool = border if len(border) and chance.random() < 0.5 else np.arange(len(edges.vertices))
    ends = edges.vertices[chance.choice(pool, size=min(3, len(pool)), replace=False)]
    tips = points[ends].mean(axis=1) + 0.1 * chance.standard_normal((len(ends), 3))
    new = np.column_stack([ends, len(points) + np.arange(len(ends))])
    return np.concatenate([points, tips]), np.concatenate([faces, new])


BASES: tuple[Callable[[Generator], Mesh], ...] = (torus, sphere, sheet, strip, two_pieces)
HOLES = (cut_disc, cut_disc, cut_disc, cut_band, nested_loops, remove_faces)
DAMAGES = (
    duplicate_faces,
    flip_faces,
    collapse_faces,
    repeat_corner,
    spoil_coordinate,
    stray_vertices,
    join_vertices,
    missing_vertex,
    move_far,
    scale,
    quantise,
    squeeze,
    squeeze,
    flatten,
    jitter,
    double_vertices,
    attach_faces,
)

Change = Callable[[Mesh, Generator], Mesh]


def put_together(
    seed: int, base: Callable[[Generator], Mesh], holes: list[Change], damages: list[Change]
) -> Mesh:
    chance = np.random.default_rng(seed)
    mesh = base(chance)
    with np.errstate(all="ignore"):
        for change in (*holes, *damages):
            mesh = change(mesh, chance)
    return mesh


def damaged_meshes(*, holes: int) -> st.SearchStrategy[Mesh]:
    """Meshes with at least so many holes, some of them damaged."""
    return st.builds(
        put_together,
        seed=st.integers(0, 2**32 - 1),
        base=st.sampled_from(BASES),
        holes=st.lists(st.sampled_from(HOLES), min_size=holes, max_size=3),
        damages=st.lists(st.sampled_from(DAMAGES), max_size=2),
    )


CASES = settings(
    max_examples=int(os.environ.get("MESHLAB_LOWRANK_FUZZING", "100")),
    deadline=None,
    database=None,
    derandomize="MESHLAB_LOWRANK_FUZZING" not in os.environ,
    suppress_health_check=list(HealthCheck),
)
