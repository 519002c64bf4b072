"""What is compared: meshes with holes, and for each hole what is known about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.comparison.punching import Outline, PunchedHole, Puncher, in_rounds
from meshlab_lowrank.comparison.regions import KnownSurface
from meshlab_lowrank.comparison.roughness import REACH
from meshlab_lowrank.comparison.sources import without_unused
from meshlab_lowrank.comparison.surface import SurfacePart
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_lengths,
    face_vectors,
    normalized,
)
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, boundary_loops

ROUND = -1  # the number of a round hole that copies no real one
_AGREEMENT = 0.5  # of the faces around a loop, below which they tell no direction: ends of tubes


@dataclass(frozen=True, kw_only=True)
class Case:
    """One hole that every filler fills.

    Attributes
    ----------
    hole : int
        Number in the hole table; ROUND for a round hole that copies none.
    place : int
        0 for the real hole; 1, 2, ... for copies punched where the surface is known.
    loop : BoundaryLoop
        In the mesh of the job.
    centre : (3,) float64
        Mean of the vertices of the loop.
    radius : float
        Largest distance of these from the centre.
    normal : (3,) float64
        Unit normal of the surface around the loop, or of the loop where that has none; looks out of
        the page in pictures.
    edge_length : float
        Mean edge length of the faces at the hole.
    size : float
        Size of a copy over that of the real hole.
    truth : SurfacePart or None
        The surface that was there.
    """

    hole: int
    place: int
    loop: BoundaryLoop
    centre: FloatArray
    radius: float
    normal: FloatArray
    edge_length: float
    size: float = 1.0
    truth: SurfacePart | None = None

    @classmethod
    def of_loop(
        cls,
        vertices: FloatArray,
        faces: IntArray,
        loop: BoundaryLoop,
        *,
        hole: int,
        place: int = 0,
        size: float = 1.0,
        truth: SurfacePart | None = None,
    ) -> Case:
        """Measure a loop of a mesh, and cut the truth down to what lies around it."""
        near = faces[np.isin(faces, loop.vertices).any(axis=1)]
        points = vertices[loop.vertices]
        centre = points.mean(axis=0)
        radius = float(np.linalg.norm(points - centre, axis=1).max())
        length = float(edge_lengths(vertices, near).mean())
        if truth is not None:
            truth = truth.cut_out(centre, radius + (REACH + 1.0) * length)
        return cls(
            hole=hole,
            place=place,
            size=size,
            loop=loop,
            centre=centre,
            radius=radius,
            normal=_outward(face_vectors(vertices, near), points - centre),
            edge_length=length,
            truth=truth if truth is not None and truth.has_area else None,
        )

    def around(self, surface: SurfacePart, margin: float) -> SurfacePart:
        """Cut a surface down to a part and its surroundings, a margin in mesh units wide."""
        return surface.cut_out(self.centre, self.radius + margin)

    @property
    def name(self) -> str:
        """For tables and headings."""
        where = "round hole" if self.hole == ROUND else f"hole {self.hole}"
        return where if self.place == 0 else f"{where}, place {self.place}"


@dataclass(frozen=True)
class Job:
    """A mesh with holes that a filler gets in one run.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    selected : (m,) bool
        Faces at the holes that are to be filled.
    known : KnownSurface
    cases : tuple of Case
    """

    vertices: FloatArray
    faces: IntArray
    selected: BoolArray
    known: KnownSurface
    cases: tuple[Case, ...]


def real_job(
    vertices: FloatArray,
    faces: IntArray,
    holes: Sequence[BoundaryLoop],
    truth: tuple[FloatArray, IntArray] | None,
) -> Job:
    """Give the job of filling the real holes.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    holes : sequence of BoundaryLoop
    truth : (vertices, faces) or None
        The mesh without the holes; it may have other triangles.

    Returns
    -------
    Job
    """
    loops = boundary_loops(vertices, faces)
    known = KnownSurface(vertices, faces, [loop.vertices for loop in loops])
    whole = None if truth is None else known.locate(*truth)
    cases = []
    for hole in holes:
        part = None if whole is None else whole.surface(hole.id)
        cases.append(Case.of_loop(vertices, faces, hole, hole=hole.id, truth=part))
    return Job(vertices, faces, _selection(len(faces), holes), known, tuple(cases))


def punched_jobs(
    vertices: FloatArray,
    faces: IntArray,
    outlines: Sequence[tuple[int, Outline]],
    places: int,
    seed: int,
) -> list[Job]:
    """Give the jobs of filling copies of holes, punched where the surface is known.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    outlines : sequence of (hole, Outline)
    places : int
        Copies of each outline.
    seed : int

    Returns
    -------
    list of Job
        Copies that lie well apart share a job; none where the surface has no room.
    """
    length = float(edge_lengths(vertices, faces).mean())
    puncher = Puncher(vertices, faces, length, seed)
    punched, labels, radii = [], [], []
    for hole, outline in outlines:
        for place, piece in enumerate(puncher.punch(outline, places), 1):
            punched.append(piece)
            labels.append((hole, place))
            radii.append(outline.radius * piece.size)
    jobs = []
    for members in in_rounds(punched, radii):
        chosen = [(*labels[i], punched[i]) for i in members]
        jobs.append(_punched_job(vertices, faces, chosen))
    return jobs


def _punched_job(
    vertices: FloatArray, faces: IntArray, pieces: Sequence[tuple[int, int, PunchedHole]]
) -> Job:
    kept = np.ones(len(faces), dtype=np.bool_)
    for _, _, piece in pieces:
        kept[piece.faces] = False
    used = np.unique(faces[kept])
    rest_vertices, rest_faces = without_unused(vertices, faces[kept])
    loops = boundary_loops(rest_vertices, rest_faces)
    cases = []
    for hole, place, piece in pieces:
        removed = np.zeros(len(faces), dtype=np.bool_)
        removed[piece.faces] = True
        rim = np.intersect1d(faces[piece.faces], faces[kept])
        loop = next(loop for loop in loops if np.isin(used[loop.vertices], rim).all())
        case = Case.of_loop(
            rest_vertices,
            rest_faces,
            loop,
            hole=hole,
            place=place,
            size=piece.size,
            truth=SurfacePart(vertices, faces, removed),
        )
        cases.append(case)
    known = KnownSurface(rest_vertices, rest_faces, [loop.vertices for loop in loops])
    selected = _selection(len(rest_faces), [case.loop for case in cases])
    return Job(rest_vertices, rest_faces, selected, known, tuple(cases))


def _outward(areas: FloatArray, spokes: FloatArray) -> FloatArray:
    """Give the direction in which a hole looks, (3,).

    Parameters
    ----------
    areas : (m, 3) float64
        Area vectors of the faces around it.
    spokes : (k, 3) float64
        From its centre to the vertices of its loop, in order.
    """
    total = areas.sum(axis=0)
    if np.linalg.norm(total) < _AGREEMENT * np.linalg.norm(areas, axis=1).sum():
        total = np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
    return normalized(total) if total.any() else np.array([0.0, 0.0, 1.0])


def _selection(number: int, loops: Sequence[BoundaryLoop]) -> BoolArray:
    selected = np.zeros(number, dtype=np.bool_)
    for loop in loops:
        selected[loop.faces] = True
    return selected
