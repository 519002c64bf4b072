"""Stage 0: whether the surroundings of a hole are a body of few flat faces, as in a drawing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshlab_lowrank.mesh.geometry import normalized
from meshlab_lowrank.mesh.topology import boundary_vertices
from meshlab_lowrank.stages.stage0_batch import merged
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage0_sharp_edges import EXACT, sharp_edges

_FLAT = np.radians(1.0)
_LEAST_FLAT = 0.12  # of the edges around the hole
_MOST_SOFT = 0.4  # of the edges, neither in a flat face nor sharp
_MOST_SPARE = 0.1  # of the vertices
_IN_PLANE = 1e-4  # diameters of the hole
_MOST_EDGES = 64  # of its loop


def are_coarse(regions: Sequence[Region]) -> list[bool]:
    """Whether many edges around each hole lie inside a flat face, and nearly no vertex does.

    Nor may vertices lie inside a straight edge: such a mesh has none that it doesn't need.

    Parameters
    ----------
    regions : sequence of Region
        Open at their loops.

    Returns
    -------
    list of bool
    """
    found = [False] * len(regions)
    small = [i for i, each in enumerate(regions) if len(each.loop) <= _MOST_EDGES]
    if not small:
        return found
    batch = merged([regions[i] for i in small])
    edges = sharp_edges(batch.vertices, batch.rim_faces(), EXACT)
    part = batch.part[edges.ends[:, 0]]
    total = np.maximum(np.bincount(part, minlength=len(small)), 1)
    flat, sharp = (
        np.bincount(part, weights=kind, minlength=len(small)) / total
        for kind in (edges.angle < _FLAT, edges.sharp)
    )
    likely = (flat >= _LEAST_FLAT) & (1.0 - flat - sharp <= _MOST_SOFT)
    for i in np.array(small)[likely].tolist():
        found[i] = _is_coarse(regions[i])
    return found


def _is_coarse(region: Region) -> bool:
    if not _shares_planes(region):
        return False
    n = len(region.vertices)
    edges = sharp_edges(region.vertices, region.faces, EXACT)
    flat = edges.angle < _FLAT
    if flat.mean() < _LEAST_FLAT or (~flat & ~edges.sharp).mean() > _MOST_SOFT:
        return False
    ends = edges.ends[~flat]
    along = normalized(region.vertices[ends[:, 1]] - region.vertices[ends[:, 0]])
    count = np.bincount(ends.ravel(), minlength=n)
    onward = np.zeros((n, 3))  # where two bent edges are one straight line, they cancel out
    np.add.at(onward, ends[:, 0], along)
    np.add.at(onward, ends[:, 1], -along)
    straight = (count == 2) & (np.linalg.norm(onward, axis=1) < _FLAT)
    inner = np.zeros(n, dtype=np.bool_)
    inner[region.faces] = True
    inner &= ~boundary_vertices(region.faces, n)
    spare = ((count == 0) | straight)[inner]
    return not inner.any() or float(spare.mean()) <= _MOST_SPARE


def _shares_planes(region: Region) -> bool:
    """Whether planes that faces at the rim lie in, or parts of the rim span, go on across it."""
    rim = region.vertices[region.loop]
    k = len(rim)
    at_rim = np.zeros(len(region.vertices), dtype=np.bool_)
    at_rim[region.loop] = True
    own = at_rim[region.faces].sum(axis=1)
    faces = region.faces[own >= 2]
    thirds = [np.arange(k)[:, None] + step * np.arange(3) for step in (k // 3, k // 3 + 1)]
    spans = np.concatenate(thirds) % k
    own = np.append(own[own >= 2], np.full(len(spans), 3))
    corners = np.concatenate([region.vertices[faces], rim[spans]])
    normals = normalized(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    off = np.abs(normals @ rim.T - np.sum(normals * corners[:, 0], axis=1)[:, None])
    limit = _IN_PLANE * float(np.linalg.norm(np.ptp(rim, axis=0)))
    more = (off <= limit).sum(axis=1) > own
    return bool(k > 3 and more[normals.any(axis=1)].any())
