"""Several cut-out regions as one mesh, so that one call works on all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.stages.stage0_region import Region


@dataclass(frozen=True)
class RegionBatch:
    """Regions side by side, each in its own local units.

    Their coordinates overlap: only connectivity keeps them apart.

    Attributes
    ----------
    regions : tuple of Region
    vertices : (n, 3) float64
    faces : (m, 3) int64
    part : (n,) int64
        Number of the region of each vertex; ascending.
    loop : (k,) int64
        The loops one after the other.
    following : (k,) int64
        Place in ``loop`` of the vertex that comes next.
    loop_part : (k,) int64
    """

    regions: tuple[Region, ...]
    vertices: FloatArray
    faces: IntArray
    part: IntArray
    loop: IntArray
    following: IntArray
    loop_part: IntArray

    def __len__(self) -> int:
        """Count the regions."""
        return len(self.regions)

    def is_flat(self) -> BoolArray:
        """Mark the regions whose fill shall be flat, (p,) bool."""
        return np.array([region.continuity == "flat" for region in self.regions])

    def rim_faces(self) -> IntArray:
        """Give the faces (r, 3) at vertices of the loops."""
        marked = np.zeros(len(self.vertices), dtype=np.bool_)
        marked[self.loop] = True
        return self.faces[faces_at(marked, self.faces)]


def merged(regions: Sequence[Region]) -> RegionBatch:
    """Put regions, at least one, side by side."""
    sizes = np.array([len(region.vertices) for region in regions])
    edges = np.array([len(region.loop) for region in regions])
    first, start = np.cumsum(sizes) - sizes, np.cumsum(edges) - edges
    numbers = np.arange(len(regions))
    following = np.arange(1, edges.sum() + 1)
    some = edges > 0  # a patch that is all of a piece of surface has no rim
    following[(start + edges - 1)[some]] = start[some]
    return RegionBatch(
        regions=tuple(regions),
        vertices=np.concatenate([region.vertices for region in regions]),
        faces=np.concatenate([r.faces + n for r, n in zip(regions, first, strict=True)]),
        part=np.repeat(numbers, sizes),
        loop=np.concatenate([r.loop + n for r, n in zip(regions, first, strict=True)]),
        following=following,
        loop_part=np.repeat(numbers, edges),
    )


def with_fills(
    batch: RegionBatch, vertices: FloatArray, part: IntArray, faces: IntArray
) -> list[Region]:
    """Append fills to their regions.

    Parameters
    ----------
    batch : RegionBatch
    vertices : (v, 3) float64
        New vertices, in the local units of their regions.
    part : (v,) int64
        Number of the region of each.
    faces : (f, 3) int64
        New faces, each of one region; the new vertices are numbered on from those of the batch.

    Returns
    -------
    list of Region
    """
    parts = np.append(batch.part, part)
    number = np.empty(len(parts), dtype=np.int64)  # within the region
    order = np.argsort(parts, kind="stable")
    bounds = np.searchsorted(parts[order], np.arange(len(batch) + 1))
    number[order] = np.arange(len(parts)) - np.repeat(bounds[:-1], np.diff(bounds))
    face_part = parts[faces[:, 0]]
    face_order = np.argsort(face_part, kind="stable")
    face_bounds = np.searchsorted(face_part[face_order], np.arange(len(batch) + 1))
    new_order = np.argsort(part, kind="stable")
    new_bounds = np.searchsorted(part[new_order], np.arange(len(batch) + 1))
    filled = []
    for i, region in enumerate(batch.regions):
        rows = new_order[new_bounds[i] : new_bounds[i + 1]]
        own = faces[face_order[face_bounds[i] : face_bounds[i + 1]]]
        filled.append(with_fill(region, vertices[rows], number[own]))
    return filled


def with_fill(region: Region, vertices: FloatArray, faces: IntArray) -> Region:
    """Append new vertices (v, 3) and new faces (f, 3) to a region."""
    new, filled = len(vertices), len(faces)
    return replace(
        region,
        vertices=np.concatenate([region.vertices, vertices]),
        faces=np.concatenate([region.faces, faces]),
        known_vertices=np.append(region.known_vertices, np.zeros(new, dtype=np.bool_)),
        known_faces=np.append(region.known_faces, np.zeros(filled, dtype=np.bool_)),
        vertex_ids=np.append(region.vertex_ids, np.full(new, -1)),
        face_ids=np.append(region.face_ids, np.full(filled, -1)),
    )
