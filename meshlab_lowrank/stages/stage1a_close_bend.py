"""Stage 1, closing: a triangulation of the rim that bends as little as it can, then refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.density import as_dense
from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    edge_lengths,
    face_normals,
    face_vectors,
)
from meshlab_lowrank.mesh.rim_triangulation import least_bent
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_batch import with_fill
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_rim import (
    coarsening,
    face_count,
    local_lengths,
    without_double_edges,
)

Density: TypeAlias = Literal["around", "rim", "none"]

_LEAST_PART = 1.0 / 30.0  # of the longest edge at the rim
_BENT = -0.5  # cosine at the rim between the triangles and the surface around
_MOST_EDGES = 300  # time grows with the third power
_RING = "A triangulation of the rim closes single loops only, not those round an island."
_LONG = "This loop of {} edges is too long for a triangulation of its rim."
_BACK = "A triangulation of this loop of {} edges would lie back on the surface around it."
_TIED = "This loop of {} edges meets itself, so that its rim can't be triangulated."


@dataclass(frozen=True)
class LeastBendClosing(Stage):
    """Triangles between the vertices of the rim, then refined; see `Close` and `close_least_bent`.

    Parameters
    ----------
    density : {"around", "rim", "none"}
        Of the new triangles: that of the faces around, that of the edges at the rim, which are
        longer where edges are uneven, or no more triangles than the rim needs.
    """

    density: Density = "around"

    def __call__(
        self, regions: Sequence[Region], *, edge_lengths: Sequence[float | None]
    ) -> list[Region | StageError]:
        """Append the fill to each region; see `Close`."""
        return [
            self._closed(region, length)
            for region, length in zip(regions, edge_lengths, strict=True)
        ]

    def _closed(self, region: Region, length: float | None) -> Region | StageError:
        try:
            return close_least_bent(region, edge_length=length, density=self.density)
        except StageError as error:
            return error


def close_least_bent(
    region: Region, *, edge_length: float | None = None, density: Density = "around"
) -> Region:
    """Fill ``region.loop`` with the triangulation of its vertices that bends least, and refine it.

    Parameters
    ----------
    region : Region
    edge_length : float, optional
        In local units. None: by the density.
    density : {"around", "rim", "none"}
        See `LeastBendClosing`.

    Returns
    -------
    Region
        Closed; the new vertices lie on the triangles between those of the rim.

    Raises
    ------
    StageError
        If there are islands, the loop has more than 300 edges or meets itself too often, or the
        triangles would lie back on the surface, as within the outer rim of a flat sheet.
    """
    loop = region.loop
    k, n = len(loop), len(region.vertices)
    if region.islands:
        raise StageError(_RING)
    if k > _MOST_EDGES:
        raise StageError(_LONG.format(k))
    same = loop[:, None] == loop
    outer = _outer_normals(region)
    triangles = least_bent(region.vertices[loop], outer, same)
    if triangles is None:
        raise StageError(_TIED.format(k))
    patch = loop[triangles]
    if np.median(_cosines_at_rim(triangles, face_normals(region.vertices, patch), outer)) < _BENT:
        raise StageError(_BACK.format(k))
    at_rim = np.zeros(n, dtype=np.bool_)
    at_rim[loop] = True
    around = region.faces[faces_at(at_rim, region.faces)]
    lengths = np.full(n, np.inf)
    if edge_length is not None:
        lengths[loop] = edge_length
    elif density != "none":
        by_rim = density == "rim"
        lengths[loop] = (
            _lengths_at(region.vertices, around, loop) if by_rim else local_lengths(region)
        )
    areas = np.linalg.norm(face_vectors(region.vertices, patch), axis=1)
    edges = np.linalg.norm(region.vertices[loop] - region.vertices[np.roll(loop, -1)], axis=1)
    ratio = float(
        coarsening(
            face_count(areas, lengths[patch].mean(axis=1)).sum(),
            (edges / lengths[loop]).sum(),
            np.array(region.most_faces),
            asked=np.array(edge_length is not None),
        )
    )
    vertices, patch = as_dense(region.vertices, around, patch, ratio * lengths)
    ends, patch = without_double_edges(len(vertices), around, patch)
    middles = vertices[ends].mean(axis=1)
    closed = with_fill(region, np.concatenate([vertices[n:], middles]), patch)
    return replace(closed, coarsening=ratio)


def _outer_normals(region: Region) -> FloatArray:
    """Give the normals (k, 3) of the measured faces at the edges of the loop."""
    n, faces = len(region.vertices), region.faces
    keys = (faces * n + np.roll(faces, -1, axis=1)).ravel()
    order = np.argsort(keys)
    wanted = np.roll(region.loop, -1) * n + region.loop
    rows = order[np.searchsorted(keys, wanted, sorter=order)] // 3
    return face_normals(region.vertices, faces[rows])


def _lengths_at(vertices: FloatArray, faces: IntArray, ids: IntArray) -> FloatArray:
    """Give the mean length (k,) of the edges at some vertices; of those inside twice."""
    lengths = edge_lengths(vertices, faces)  # of the edge that begins at each corner
    n, tails, heads = len(vertices), faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ends, both = np.concatenate([tails, heads]), np.tile(lengths.ravel(), 2)
    total, count = np.bincount(ends, both, minlength=n), np.bincount(ends, minlength=n)
    return np.asarray(np.maximum(total[ids] / count[ids], _LEAST_PART * lengths.max()))


def _cosines_at_rim(triangles: IntArray, normals: FloatArray, outer: FloatArray) -> FloatArray:
    """Give the cosines (k,) between triangles (k - 2, 3) and the faces beyond the loop."""
    k = len(outer)
    tails, rows = triangles.ravel(), np.repeat(np.arange(len(triangles)), 3)
    at_rim = np.roll(triangles, -1, axis=1).ravel() == (tails + 1) % k
    return np.asarray(np.einsum("ij,ij->i", normals[rows[at_rim]], outer[tails[at_rim]]))
