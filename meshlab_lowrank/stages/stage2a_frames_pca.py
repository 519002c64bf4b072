"""Stage 2, frames: principal axes of the vertices of each patch (section 3.3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.mesh.rings import collect_rings, offsets_in_frames, walk_rings
from meshlab_lowrank.mesh.topology import vertex_adjacency
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2a_frames import tangent_frames

_EQUAL = 1e-6  # relative gap below which two eigenvalues count as equal
_UPRIGHT = 0.5  # cosine: e3 may lean 60 degrees from the mean normal of the patch


@dataclass(frozen=True)
class PrincipalFrames(Stage):
    """Principal axes of the sp vertices around each centre, of the surface with its detail."""

    def __call__(self, hole: Hole, centres: IntArray, size: int) -> FloatArray:
        """Build the frames; see `Frames`."""
        return principal_frames(hole.positions, hole.faces, centres, size)


def principal_frames(
    vertices: FloatArray, faces: IntArray, centres: IntArray, sp: int
) -> FloatArray:
    """Frames R_i of the paper's patches, (w, 3, 3); see `pca_frames`.

    The vertices of a patch are collected ring by ring, counter-clockwise as seen from outside,
    each ring from its vertex nearest to v_i, until there are sp (section 3.3.1).

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    centres : (w,) int64
    sp : int
        Vertices per patch.
    """
    if len(centres) == 0:
        return np.zeros((0, 3, 3))
    normals = vertex_normals(vertices, faces)
    found = collect_rings(vertex_adjacency(faces, len(vertices)), centres, sp)
    offsets = vertices[found.vertex] - vertices[centres[found.patch]]
    local = offsets_in_frames(tangent_frames(normals[centres]), found, offsets)
    order = walk_rings(found, local, np.linalg.norm(offsets, axis=1), sp)
    patch, vertex = found.patch[order], found.vertex[order]
    return pca_frames(patch, offsets[order], normals[vertex], len(centres))


def pca_frames(patch: IntArray, offsets: FloatArray, normals: FloatArray, w: int) -> FloatArray:
    """Frames R_i from the eigenvectors of V(v_i), in falling order of their eigenvalues.

    ``V(v_i) = 1/sp sum_j (v_j - v_i)(v_j - v_i)^T``. The paper leaves open what follows; each rule
    moves with the surface when that is moved or renumbered.

    * e3 points to the side of the mean normal of the patch. Where it leans more than 60 degrees
      from that, or the two smaller eigenvalues are equal, the patch is not flat: e3 is the mean
      normal itself, e1 the principal direction of the patch seen along it.
    * e1 points to the side on which the patch reaches further: the third moment of the offsets
      along it is positive. Where that vanishes, to the side of the vertex nearest to v_i.
    * Where the two larger eigenvalues are equal, the patch is round: e1 points to the vertex
      nearest to v_i, where section 3.3.1 starts the first ring.
    * e2 = e3 x e1, so that R_i is a rotation.

    Parameters
    ----------
    patch : (s,) int64
        Patch of each vertex, from 0 to w - 1, sorted. The second vertex of a patch is the one
        nearest to the first, its centre v_i.
    offsets : (s, 3) float64
        Vertex minus centre.
    normals : (s, 3) float64
        Vertex normals of the closed mesh.
    w : int
        Number of patches.

    Returns
    -------
    (w, 3, 3) float64
        Rows e1, e2, e3.
    """
    outer = (offsets[:, :, None] * offsets[:, None, :]).reshape(-1, 9)
    covariance = _patch_sum(patch, outer, w).reshape(w, 3, 3)  # 1/sp doesn't turn eigenvectors
    mean = tangent_frames(normalized(_patch_sum(patch, normals, w)))
    e3, e1, round_ = _principal(covariance, mean)

    first = np.searchsorted(patch, np.arange(w))
    second = np.minimum(first + 1, len(patch) - 1)
    nearest = np.where((patch[second] == np.arange(w))[:, None], offsets[second], 0.0)
    tangent = normalized(nearest - (nearest * e3).sum(axis=1, keepdims=True) * e3)
    tangent = np.where(tangent.any(axis=1, keepdims=True), tangent, tangent_frames(e3)[:, 0])

    along = (e1[patch] * offsets).sum(axis=1)
    moment = _patch_sum(patch, np.stack([along**3, np.abs(along) ** 3], axis=1), w)
    lopsided = np.abs(moment[:, 0]) > _EQUAL * moment[:, 1]
    side = np.where(lopsided, moment[:, 0], (nearest * e1).sum(axis=1))
    e1 = np.where(side[:, None] < 0.0, -e1, e1)
    e1 = np.where(round_[:, None], tangent, e1)
    return np.stack([e1, np.cross(e3, e1), e3], axis=1)


def _principal(
    covariance: FloatArray, mean: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Give e3, e1 up to its sign, and where e1 has no meaning; `mean` has the mean normal last."""
    values, vectors = np.linalg.eigh(covariance)  # rising
    small, middle, large = values.T
    cosine = (vectors[:, :, 0] * mean[:, 2]).sum(axis=1)
    flat = (np.abs(cosine) >= _UPRIGHT) & (middle - small > _EQUAL * middle)
    seen, seen_vectors = np.linalg.eigh(mean[:, :2] @ covariance @ mean[:, :2].transpose(0, 2, 1))
    seen_e1 = (seen_vectors[:, None, :, 1] @ mean[:, :2])[:, 0]
    e3 = np.where(flat[:, None], np.sign(cosine)[:, None] * vectors[:, :, 0], mean[:, 2])
    e1 = np.where(flat[:, None], vectors[:, :, 2], seen_e1)
    gap = np.where(flat, large - middle, seen[:, 1] - seen[:, 0])
    return e3, e1, gap <= _EQUAL * large


def _patch_sum(patch: IntArray, values: FloatArray, w: int) -> FloatArray:
    """Sum rows (s, d) over the patches they belong to, (w, d)."""
    return np.stack([np.bincount(patch, weights=v, minlength=w) for v in values.T], axis=1)
