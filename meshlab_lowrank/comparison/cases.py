"""What is compared: meshes with holes, and for each hole what is known about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.comparison.punching import Outline, PunchedHole, Puncher, in_rounds
from meshlab_lowrank.comparison.roughness import REACH
from meshlab_lowrank.comparison.sources import without_unused
from meshlab_lowrank.mesh.filled_mesh import KnownSurface
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_lengths,
)
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.report.view import View
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop, boundary_loops

ROUND = -1  # the number of a round hole that copies no real one


@dataclass(frozen=True, kw_only=True)
class Case(View):
    """One hole that every filler fills.

    Attributes
    ----------
    hole : int
        Number in the hole table; ROUND for a round hole that copies none.
    place : int
        0 for the real hole; 1, 2, ... for copies punched where the surface is known.
    loop : BoundaryLoop
        In the mesh of the job.
    size : float
        Size of a copy over that of the real hole.
    truth : SurfacePart or None
        The surface that was there.
    """

    hole: int
    place: int
    loop: BoundaryLoop
    size: float = 1.0
    truth: SurfacePart | None = None

    @classmethod
    def of_hole(
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
        view = View.of_loop(vertices, faces, loop.vertices)
        if truth is not None:
            truth = view.around(truth, (REACH + 1.0) * view.edge_length)
        return cls(
            **vars(view),
            hole=hole,
            place=place,
            size=size,
            loop=loop,
            truth=truth if truth is not None and truth.has_area else None,
        )

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
        cases.append(Case.of_hole(vertices, faces, hole, hole=hole.id, truth=part))
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
        case = Case.of_hole(
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


def _selection(number: int, loops: Sequence[BoundaryLoop]) -> BoolArray:
    selected = np.zeros(number, dtype=np.bool_)
    for loop in loops:
        selected[loop.faces] = True
    return selected
