"""From the catalogue to meshes with holes: makes, loads, punches, and keeps what is slow."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pymeshlab

from benchmarks.catalogue import Hole, Model, Shape
from meshlab_lowrank.mesh.filled_mesh import KnownSurface
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_lengths,
    face_vectors,
    normalized,
)
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, boundary_loops
from sample_meshes import bodies, details, shapes
from sample_meshes.holes import disc, remove_faces

CACHE_VARIABLE = "MESHLAB_LOWRANK_BENCHMARK_CACHE"
LARGEST_SHARE = 0.06  # of the surface that a hole may take
_TRIES = 60


@dataclass(frozen=True)
class Cell:
    """A model with one hole at one place."""

    model: Model
    hole: Hole
    seed: int


@dataclass(frozen=True)
class Problem:
    """A mesh with one hole to fill, and what was there.

    Attributes
    ----------
    cell : Cell
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loops : tuple of BoundaryLoop
        All of the mesh.
    loop : BoundaryLoop
        The one to fill.
    truth : SurfacePart
        The whole model, with what was cut out as its part.
    """

    cell: Cell
    vertices: FloatArray
    faces: IntArray
    loops: tuple[BoundaryLoop, ...]
    loop: BoundaryLoop
    truth: SurfacePart

    @property
    def selected(self) -> BoolArray:
        """The faces at the hole, (m,) bool."""
        selected = np.zeros(len(self.faces), dtype=np.bool_)
        selected[self.loop.faces] = True
        return selected

    @cached_property
    def known(self) -> KnownSurface:
        """The mesh, prepared for finding what a filler added."""
        return KnownSurface(self.vertices, self.faces, [each.vertices for each in self.loops])

    @cached_property
    def _near(self) -> IntArray:
        return self.faces[np.isin(self.faces, self.loop.vertices).any(axis=1)]

    @property
    def edge_length(self) -> float:
        """Mean edge length at the hole (h)."""
        return float(edge_lengths(self.vertices, self._near).mean())

    @property
    def centre(self) -> FloatArray:
        """Mean of the vertices of the loop, (3,)."""
        return np.asarray(self.vertices[self.loop.vertices].mean(axis=0))

    @property
    def radius(self) -> float:
        """Largest distance of the loop from its centre."""
        rim = self.vertices[self.loop.vertices]
        return float(np.linalg.norm(rim - self.centre, axis=1).max())

    @property
    def normal(self) -> FloatArray:
        """Unit normal of the surface around the hole, (3,)."""
        return normalized(face_vectors(self.vertices, self._near).sum(axis=0))


def load_model(model: Model) -> tuple[FloatArray, IntArray]:
    """Give the vertices (n, 3) and faces (m, 3) of a model."""
    if isinstance(model.source, Shape):
        return _made(model.source)
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.load_new_mesh(str(model.source))
    meshes.meshing_remove_duplicate_vertices()
    meshes.meshing_remove_unreferenced_vertices()
    mesh = meshes.current_mesh()
    vertices = np.ascontiguousarray(mesh.vertex_matrix(), dtype=np.float64)
    return vertices, np.ascontiguousarray(mesh.face_matrix(), dtype=np.int64)


def fits(cell: Cell, vertices: FloatArray) -> bool:
    """Tell whether a model is large enough for a hole."""
    return bool(np.pi * cell.hole.radius**2 < LARGEST_SHARE * bodies.HEXAGON * len(vertices))


def punched(cell: Cell, vertices: FloatArray, faces: IntArray) -> Problem | None:
    """Punch the hole of a cell; None if no place on the model takes it.

    The place depends on the seed alone, so that holes of all sizes share their centres.
    """
    for place in _places(cell.model, vertices, faces, cell.seed):
        problem = punched_at(cell, vertices, faces, int(place))
        if problem is not None:
            return problem
    return None


def punched_at(cell: Cell, vertices: FloatArray, faces: IntArray, place: int) -> Problem | None:
    """Punch the hole of a cell around a vertex; None if there is no room."""
    try:
        removed = disc(
            vertices,
            faces,
            place,
            cell.hole.radius,
            outline=cell.hole.outline,
            seed=cell.seed,
        )
    except ValueError:
        return None
    before = len(boundary_loops(vertices, faces))
    cut = remove_faces(vertices, faces, removed)
    loops = boundary_loops(cut.vertices, cut.faces)
    rim = np.intersect1d(faces[removed], cut.vertex_ids)
    own = [loop for loop in loops if np.isin(cut.vertex_ids[loop.vertices], rim).all()]
    if len(loops) != before + 1 or len(own) != 1 or own[0].reason:
        return None
    truth = SurfacePart(vertices, faces, removed)
    return Problem(cell, cut.vertices, cut.faces, loops, own[0], truth)


def _places(model: Model, vertices: FloatArray, faces: IntArray, seed: int) -> IntArray:
    """Vertices to try as centres, in order."""
    candidates = np.unique(faces)
    if isinstance(model.source, Shape) and model.source.body == "capsule":
        # The detail fades towards the caps.
        centred = vertices - vertices.mean(axis=0)
        along = centred @ np.linalg.eigh(centred.T @ centred)[1][:, -1]
        candidates = candidates[np.abs(along[candidates]) < 0.4 * np.abs(along).max()]
    rng = np.random.default_rng(seed)
    return np.asarray(rng.permutation(candidates)[:_TRIES])


def _made(source: Shape) -> tuple[FloatArray, IntArray]:
    """Make a shape, or read it from the cache if its recipe has not changed."""
    recipe = hashlib.sha256(repr(source).encode())
    for module in (bodies, details, shapes):
        recipe.update(Path(str(module.__file__)).read_bytes())
    folder = Path(os.environ.get(CACHE_VARIABLE) or Path(__file__).resolve().parent / ".cache")
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{source.name}-{recipe.hexdigest()[:12]}.npz"
    if not file.exists():
        vertices, faces = shapes.make_shape(
            source.body,
            source.detail,
            count=source.count,
            wavelength=source.wavelength,
            amplitude=source.amplitude,
            triangulation=source.triangulation,
            seed=source.seed,
        )
        scratch = file.with_suffix(f".{os.getpid()}.npz")
        np.savez_compressed(scratch, vertices=vertices, faces=faces.astype(np.int32))
        scratch.replace(file)
    with np.load(file) as stored:
        return stored["vertices"], stored["faces"].astype(np.int64)
