"""Holes in bodies of few flat faces: these go on across it, with no vertex more than they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csgraph

from meshlab_lowrank.creases import creased_fill, is_plain
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import shapes_of
from meshlab_lowrank.mesh.geometry import BoolArray, IntArray, edge_lengths, face_vectors
from meshlab_lowrank.stages.stage0_coarse import are_coarse
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage0_sharp_edges import EXACT, SharpEdges, sharp_edges
from meshlab_lowrank.stages.stage1a_close_planes import close_with_planes
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_FLAT = np.radians(2.0)
_CAP = np.radians(40.0)  # at which a flat face that continues none meets its neighbours
_CAP_FACES = 3
_LEAST_SHARE = 0.4  # of its area that continues flat faces or is such a cap
_LONGEST = 2.5  # times the longest edge around
_NO_POINTS = 1e6  # edge length with which nothing is divided
_FLAT_FACES = "The flat faces around it go on across it."


def coarse_fills(regions: Sequence[Region]) -> list[FairRegion | None]:
    """Close regions in bodies of few flat faces, without vertices that are not needed.

    Parameters
    ----------
    regions : sequence of Region
        Open at their loops.

    Returns
    -------
    list of FairRegion or None
        None where the surroundings are no such body, or their flat faces don't meet across.
    """
    return [
        _coarse(region) if some and is_plain(region) else None
        for region, some in zip(regions, are_coarse(regions), strict=True)
    ]


def _coarse(region: Region) -> FairRegion | None:
    cornered = creased_fill(region, _NO_POINTS, EXACT, only_corners=True)
    if isinstance(cornered, FairRegion) and _continues(cornered.region):
        return cornered
    try:
        closed = close_with_planes(region)
    except StageError:
        return None
    edges = sharp_edges(closed.vertices, closed.faces[~closed.known_faces], EXACT)
    closed = replace(closed, creases=edges.ends[edges.sharp])
    if not _continues(closed):
        return None
    return FairRegion(closed, np.nan, _FLAT_FACES, len(closed.creases))


def _continues(region: Region) -> bool:
    """Whether a fill is made of flat faces that are there already, or of caps that end a body.

    Its edges may not be far longer than those around: a finely meshed body wants an even fill.
    """
    (shape,) = shapes_of([region])
    if shape.folded_edges + shape.flat_faces:
        return False
    new = ~region.known_faces
    lengths = edge_lengths(region.vertices, region.faces).max(axis=1)
    if lengths[new].max() > _LONGEST * lengths[~new].max():
        return False
    edges = sharp_edges(region.vertices, region.faces, EXACT)
    graph = edges.face_graph(edges.angle > _FLAT, len(region.faces))
    _, label = csgraph.connected_components(graph, directed=False)
    facet = np.asarray(label, dtype=np.int64)
    old = np.bincount(facet, region.known_faces) > 0
    caps = ~old & (np.bincount(facet, new) >= _CAP_FACES)
    if region.continuity == "flat":
        return bool(caps[facet[new]].all()) and len(np.unique(facet[new])) == 1
    if (caps & ~_sharply_met(edges, facet, len(caps))).any():
        return False
    areas = np.linalg.norm(face_vectors(region.vertices, region.faces), axis=1)
    good = new & (old | caps)[facet]
    return bool(areas[good].sum() >= _LEAST_SHARE * areas[new].sum())


def _sharply_met(edges: SharpEdges, facet: IntArray, count: int) -> BoolArray:
    """Whether each flat face meets all its neighbours at sharp edges, (count,) bool."""
    beside = facet[edges.beside]
    soft = (beside[:, 0] != beside[:, 1]) & (edges.angle < _CAP)
    met = np.ones(count, dtype=np.bool_)
    met[beside[soft]] = False
    return met
