"""What tells whether a fill looks like what was cut out, at the rim and inside."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.cases import Problem
from meshlab_lowrank.comparison.crossings import count_crossing_faces
from meshlab_lowrank.comparison.figures import (
    RIGHT_DIHEDRAL,
    RIGHT_ROUGHNESS,
    error_figures,
    flipped_faces,
    mean_dihedral_angle,
)
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_lengths,
    face_normals,
    vertex_normals,
)
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs, vertex_adjacency

_MARGIN = 30.0  # edge lengths of surroundings that are measured with the fill
_AT_RIM = 3.0  # edge lengths from the rim
_FOLDED = -0.2  # cosine
_SPIKE = 1.5  # times the sharpest vertex of what was cut out and of its surroundings


@dataclass(frozen=True)
class Looks:
    """Figures of a fill, those with a ratio over what was cut out.

    Attributes
    ----------
    rms : float
        In mean edge lengths at the hole.
    roughness, dihedral : float
        See `ErrorFigures`.
    dihedral_at_rim, dihedral_inside : float
        Of the faces within 3 edge lengths of the rim, and of the others.
    folds, crossings, spikes : int
        Folded edges, and faces that are turned or cross others, beyond those of what was cut out;
        vertices that stand out of their neighbours more than 1.5 times as far as any of what was
        cut out and lies around it.
    """

    rms: float
    roughness: float
    dihedral: float
    dihedral_at_rim: float
    dihedral_inside: float
    folds: int
    crossings: int
    spikes: int

    @property
    def right(self) -> bool:
        """Whether it looks right everywhere."""
        low, high = RIGHT_DIHEDRAL
        angles = (self.dihedral, self.dihedral_at_rim, self.dihedral_inside)
        return (
            RIGHT_ROUGHNESS[0] <= self.roughness <= RIGHT_ROUGHNESS[1]
            and all(low <= angle <= high for angle in angles if np.isfinite(angle))
            and self.flaws == 0
        )

    @property
    def flaws(self) -> int:
        """Folds, crossings and spikes together."""
        return self.folds + self.crossings + self.spikes


def surfaces(
    problem: Problem, mesh: tuple[FloatArray, IntArray]
) -> tuple[SurfacePart, SurfacePart]:
    """Give the fill of a problem, and what was cut out, with their surroundings."""
    filled = problem.known.locate(*mesh).surface(problem.loop.id)
    reach = problem.radius + _MARGIN * problem.edge_length
    return filled.cut_out(problem.centre, reach), problem.truth.cut_out(problem.centre, reach)


def looks(problem: Problem, fill: SurfacePart, truth: SurfacePart) -> Looks:
    """Measure a fill, both as of `surfaces`."""
    length = problem.edge_length
    error = error_figures(fill, truth, length)
    rim = cKDTree(problem.vertices[problem.loop.vertices])

    def angles(*, near: bool) -> float:
        fills, truths = (
            mean_dihedral_angle(replace(each, part=each.part & (_near(rim, each, length) == near)))
            for each in (fill, truth)
        )
        return fills / truths if truths > 0.0 else float("nan")

    limit = _SPIKE * float(_standing_out(truth).max())
    return Looks(
        rms=error.rms / length,
        roughness=error.roughness,
        dihedral=error.dihedral,
        dihedral_at_rim=angles(near=True),
        dihedral_inside=angles(near=False),
        folds=max(0, _folds(fill) - _folds(truth)),
        crossings=max(0, _crossings(fill) - _crossings(truth)),
        spikes=int((_standing_out(fill)[np.unique(fill.faces[fill.part])] > limit).sum()),
    )


def _near(rim: cKDTree, surface: SurfacePart, length: float) -> BoolArray:
    middles = surface.vertices[surface.faces].mean(axis=1)
    return np.asarray(rim.query(middles)[0] < _AT_RIM * length)


def _folds(surface: SurfacePart) -> int:
    one, other = half_edge_pairs(edges_of(surface.faces)) // 3
    normals = face_normals(surface.vertices, surface.faces)
    cosine = np.einsum("ij,ij->i", normals[one], normals[other])
    folded = int(((cosine < _FOLDED) & (surface.part[one] | surface.part[other])).sum())
    return folded + int((flipped_faces(surface.vertices, surface.faces) & surface.part).sum())


def _crossings(surface: SurfacePart) -> int:
    return count_crossing_faces(surface.vertices, surface.faces, surface.part)


def _standing_out(surface: SurfacePart) -> FloatArray:
    """Height (n,) of each vertex over the mean of its neighbours, in mean edges of the ring."""
    around = vertex_adjacency(surface.faces, len(surface.vertices)).astype(np.float64)
    degree = np.maximum(np.asarray(around.sum(axis=1)).ravel(), 1.0)
    apart = surface.vertices - (around @ surface.vertices) / degree[:, None]
    lengths = edge_lengths(surface.vertices, surface.faces).mean(axis=1)
    corners = surface.faces.ravel()
    sums = np.bincount(corners, np.repeat(lengths, 3), minlength=len(degree))
    counts = np.maximum(np.bincount(corners, minlength=len(degree)), 1)
    heights = np.einsum("ij,ij->i", apart, vertex_normals(surface.vertices, surface.faces))
    result = np.abs(heights) / np.maximum(sums / counts, 1e-300)
    edges = edges_of(surface.faces)
    result[edges.vertices[edges.face_count == 1]] = 0.0  # where the surroundings end
    return np.asarray(result)
