"""How well the fill of a generated part has the creases that were cut out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.cases import Problem
from meshlab_lowrank.comparison.figures import error_figures
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs
from sample_meshes.parts import Part, distances

_ON_CREASE = 0.35  # edge lengths within which an edge counts as one of the crease
_SHARP = 0.5  # of the true angle, from which on an edge is taken for one


@dataclass(frozen=True)
class PartFigures:
    """Figures of a fill, in mean edge lengths and degrees.

    Attributes
    ----------
    rms : float
    angle : float
        Difference of the median angles between the normals along the crease, of the fill and of
        what was cut out. NaN where no edge of the fill lies along the crease.
    place : float
        Largest distance of a sharp edge of the fill from the crease; NaN without one.
    """

    rms: float
    angle: float
    place: float


def part_figures(part: Part, problem: Problem, mesh: tuple[FloatArray, IntArray]) -> PartFigures:
    """Measure a filled part."""
    filled = problem.known.locate(*mesh)
    fill = filled.surface(problem.loop.id)
    rms = error_figures(fill, problem.truth, 1.0).rms
    true_angles, _ = _angles(part.vertices, part.faces[part.removed], part)
    angles, middles = _angles(fill.vertices, fill.faces[fill.part], None)
    expected = float(np.median(true_angles))
    away = distances(part, middles) if len(middles) else np.zeros(0)
    on_crease = away < _ON_CREASE
    sharp = angles > _SHARP * expected
    along = angles[on_crease & sharp]
    return PartFigures(
        rms=rms,
        angle=abs(float(np.median(along)) - expected) if len(along) else float("nan"),
        place=float(away[sharp].max()) if sharp.any() else float("nan"),
    )


def _angles(
    vertices: FloatArray, faces: IntArray, part: Part | None
) -> tuple[FloatArray, FloatArray]:
    """Angles in degrees at inner edges, and their middles; of a part, at its creases only."""
    edges = edges_of(faces)
    pairs = half_edge_pairs(edges) // 3
    normals = face_normals(vertices, faces)
    cosine = np.einsum("ij,ij->i", normals[pairs[0]], normals[pairs[1]])
    ends = edges.vertices[edges.face_count == 2]
    angles = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if part is not None:
        n = len(vertices)
        keys = np.sort(part.creases, axis=1) @ np.array([n, 1])
        chosen = np.isin(np.sort(ends, axis=1) @ np.array([n, 1]), keys)
        ends, angles = ends[chosen], angles[chosen]
    return angles, vertices[ends].mean(axis=1)
