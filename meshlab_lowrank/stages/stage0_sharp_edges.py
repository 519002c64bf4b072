"""Stage 0: edges at which the known surface turns sharply, and what counts as sharp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, half_edge_pairs
from meshlab_lowrank.stages.stage0_batch import merged
from meshlab_lowrank.stages.stage0_region import Region

_CLEAR = 2.5  # times the angle that three quarters of the edges keep below
_CLEAR_AT_RIM = 2.0  # likewise, where only the rim is looked at
_QUARTERS = 0.75
_FLAT = np.radians(1.0)
_LEAST_FLAT, _MOST_SOFT = 0.25, 0.05  # of the edges of a mesh without noise


@dataclass(frozen=True)
class Evidence:
    """From where on sharp edges are a crease.

    Attributes
    ----------
    edge_angle : float
        Of each edge, between the normals on either side, in radians.
    angle : float
        Median along the crease.
    edges : int
        Number of edges.
    joined : float
        Share of the creases at a rim that belong together; less is a pattern, not a body's edges.
    exact : bool
        Whether the mesh is free of noise, so that a crease needn't stand out against the other
        edges around.
    """

    edge_angle: float
    angle: float
    edges: int
    joined: float
    exact: bool = False


STRONG = Evidence(np.radians(22.0), np.radians(30.0), 4, 0.6)
WEAK = Evidence(np.radians(12.0), np.radians(15.0), 3, 0.0)
EXACT = Evidence(np.radians(12.0), np.radians(12.0), 1, 0.0, exact=True)


@dataclass(frozen=True)
class SharpEdges:
    """The inner edges of some faces, and which of them are sharp.

    Attributes
    ----------
    ends : (e, 2) int64
    beside : (e, 2) int64
        The faces at each.
    angle : (e,) float64
        Between their normals, in radians.
    limit : float
        From which angle on an edge stands out.
    normals : (m, 3) float64
        Of the faces.
    """

    ends: IntArray
    beside: IntArray
    angle: FloatArray
    limit: float
    normals: FloatArray

    @cached_property
    def sharp(self) -> BoolArray:
        """Mark those that stand out, (e,) bool."""
        return np.asarray(self.angle > self.limit)

    @cached_property
    def sharp_at(self) -> dict[int, list[int]]:
        """Rows of those that stand out, for each vertex that has any."""
        at: dict[int, list[int]] = {}
        for number in np.flatnonzero(self.sharp).tolist():
            for vertex in self.ends[number].tolist():
                at.setdefault(vertex, []).append(number)
        return at

    def face_graph(self, blocked: BoolArray, m: int) -> sparse.csr_array:
        """Symmetric (m, m) matrix of ones where two faces share an edge that isn't blocked."""
        here, there = self.beside[~blocked].T
        graph = sparse.coo_array((np.ones(len(here)), (here, there)), shape=(m, m)).tocsr()
        return sparse.csr_array(graph + graph.T)


def sharp_edges(vertices: FloatArray, faces: IntArray, evidence: Evidence) -> SharpEdges:
    """Measure the inner edges of faces, and tell from which angle on they stand out."""
    edges = edges_of(faces)
    beside = (half_edge_pairs(edges) // 3).T
    normals = face_normals(vertices, faces)
    cosine = np.einsum("ij,ij->i", normals[beside[:, 0]], normals[beside[:, 1]])
    solid = (normals[beside] != 0.0).any(axis=2).all(axis=1)
    angle = np.where(solid, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
    limit = evidence.edge_angle
    if len(angle) and not evidence.exact:
        limit = max(limit, _CLEAR * float(np.quantile(angle, _QUARTERS)))
    return SharpEdges(edges.vertices[edges.face_count == 2], beside, angle, limit, normals)


def may_have_creases(regions: Sequence[Region], evidence: Evidence) -> list[bool]:
    """Whether sharp edges lead from two vertices of each rim outwards; it costs little to ask."""
    if len(regions) == 0:
        return []
    batch = merged(regions)
    on_rim = np.zeros(len(batch.vertices), dtype=np.bool_)
    on_rim[batch.loop] = True
    edges = sharp_edges(batch.vertices, batch.rim_faces(), evidence)
    part = batch.part[edges.ends[:, 0]]
    if len(part) == 0:
        return [False] * len(regions)
    exact = _are_exact(edges, part, len(regions))
    order = np.lexsort((edges.angle, part))
    count = np.bincount(part, minlength=len(regions))
    quarter = np.cumsum(count) - count + (_QUARTERS * np.maximum(count - 1, 0)).astype(np.int64)
    usual = edges.angle[order][np.minimum(quarter, len(order) - 1)]
    usual[exact] = 0.0
    stands_out = edges.angle > np.maximum(evidence.edge_angle, _CLEAR_AT_RIM * usual)[part]
    ends = edges.ends[stands_out]
    ends = ends[on_rim[ends].sum(axis=1) == 1]
    starts = np.unique(ends[on_rim[ends]])
    return [number > 1 for number in np.bincount(batch.part[starts], minlength=len(regions))]


def are_exact(edges: SharpEdges) -> bool:
    """Whether nearly all edges lie in flat faces or are sharp, which leaves no room for noise."""
    return bool(_are_exact(edges, np.zeros(len(edges.angle), dtype=np.int64), 1)[0])


def _are_exact(edges: SharpEdges, part: IntArray, count: int) -> BoolArray:
    """Tell the same for the edges of each part, (count,)."""
    total = np.bincount(part, minlength=count)
    flat = np.bincount(part[edges.angle < _FLAT], minlength=count)
    sharp = np.bincount(part[edges.angle > EXACT.edge_angle], minlength=count)
    soft = total - flat - sharp
    return np.asarray((flat >= _LEAST_FLAT * total) & (soft <= _MOST_SOFT * total) & (total > 0))
