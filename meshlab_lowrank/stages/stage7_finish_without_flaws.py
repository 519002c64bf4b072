"""Stage 7: detail is taken back where it folds the surface or makes it cross itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.crossings import crossing_pairs
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_normals, normalized
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.stages.stage import Stage

_LEAST_COSINE = 0.1
_HALVINGS = 8
_HOPELESS = 0.5  # pairs that come to cross, for each face that moves


@dataclass(frozen=True)
class WithoutFlaws(Stage):
    """Halve the detail at faces that it folds or makes cross others; see `Finish`."""

    def __call__(self, start: Hole, positions: FloatArray, base_normals: FloatArray) -> FloatArray:
        """Take back what folds or crosses."""
        unfolded = without_folds(start.positions, positions, start.faces, base_normals)
        return without_crossings(start.positions, unfolded, start.faces, start.unknown)


def without_folds(
    start: FloatArray, moved: FloatArray, faces: IntArray, base_normals: FloatArray
) -> FloatArray:
    """Take detail back where it folds the surface.

    Parameters
    ----------
    start : (n, 3) float64
        Positions without detail.
    moved : (n, 3) float64
    faces : (m, 3) int64
    base_normals : (n, 3) float64

    Returns
    -------
    (n, 3) float64
        The moves of the corners of each face that leans more than 84 degrees from the base, and
        did not from the start, halved until none is left or eight times.
    """
    upright = normalized(base_normals[faces].sum(axis=1))
    folded_before = np.einsum("ij,ij->i", face_normals(start, faces), upright) < _LEAST_COSINE
    result = moved
    for _ in range(_HALVINGS):
        leaning = np.einsum("ij,ij->i", face_normals(result, faces), upright) < _LEAST_COSINE
        folded = np.unique(faces[leaning & ~folded_before])
        if len(folded) == 0:
            break
        result = result.copy()
        result[folded] = start[folded] + 0.5 * (result[folded] - start[folded])
    return result


def without_crossings(
    start: FloatArray, moved: FloatArray, faces: IntArray, unknown: BoolArray
) -> FloatArray:
    """Take detail back where it makes faces of the fill cross others.

    Parameters
    ----------
    start : (n, 3) float64
        Positions without detail.
    moved : (n, 3) float64
    faces : (m, 3) int64
    unknown : (n,) bool
        Vertices of the fill.

    Returns
    -------
    (n, 3) float64
        The moves of the corners of faces that cross others, and did not from the start, halved
        until none do or eight times. All moves are taken back if more than a pair for every two
        faces of the fill crosses.
    """
    filled, every = np.flatnonzero(faces_at(unknown, faces)), np.arange(len(faces))
    weight = np.array([len(faces), 1])
    before = None
    result = moved
    for _ in range(_HALVINGS):
        pairs = crossing_pairs(result, faces, filled, every)
        if len(pairs) and before is None:
            before = crossing_pairs(start, faces, filled, every) @ weight
        if before is not None:
            pairs = pairs[~np.isin(pairs @ weight, before)]
        corners = np.unique(faces[pairs])
        corners = corners[unknown[corners]]
        if len(corners) == 0:
            break
        result = result.copy()
        if len(pairs) > _HOPELESS * len(filled):
            result[unknown] = start[unknown]
            break
        result[corners] = start[corners] + 0.5 * (result[corners] - start[corners])
        moving = np.zeros(len(start), dtype=np.bool_)
        moving[corners] = True
        filled = np.flatnonzero(faces_at(moving, faces))  # no others have come to cross
    return result
