"""Stage 1, closing: a triangulation in the plane of the rim, which turns no triangle over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.boundary_walk import area_vector
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import FloatArray, cotangent_laplacian
from meshlab_lowrank.mesh.polygons import enclosed_area, perimeter, triangulated
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


@dataclass(frozen=True)
class ChartClosing(Stage):
    """Delaunay triangles in the plane of the rim; see `Close` and `close_in_chart`."""

    def __call__(
        self, regions: Sequence[Region], *, edge_lengths: Sequence[float | None]
    ) -> list[Region | StageError]:
        """Append the fill to each region; see `Close`."""
        return [_closed(*pair) for pair in zip(regions, edge_lengths, strict=True)]


def _closed(region: Region, length: float | None) -> Region | StageError:
    try:
        return close_in_chart(region, edge_length=length)
    except StageError as error:
        return error


def close_in_chart(region: Region, *, edge_length: float | None = None) -> Region:
    """Fill ``region.loop`` with triangles that are laid out in the plane of the rim.

    The loop is seen along its mean normal, triangulated with points of a hexagonal grid inside,
    and the heights of these are those of the harmonic function that the loop has. What lies within
    the rim of an island stays free.

    Parameters
    ----------
    region : Region
    edge_length : float, optional
        In local units. None: the mean of those along the loop.

    Returns
    -------
    Region
        Closed; no face of the fill is turned over, seen along that normal.

    Raises
    ------
    StageError
        If the loop, seen so, is no simple polygon.
    """
    outer, *_ = region.loops()
    ids, first, place = np.unique(region.loop, return_index=True, return_inverse=True)
    order = np.argsort(first)  # as on the loop, each vertex once
    ids, place = ids[order], np.argsort(order)[place.ravel()]
    rim = region.vertices[ids]
    centre = rim.mean(axis=0)
    frame = _frame(area_vector(region.vertices[outer]))
    flat = (rim - centre) @ frame.T  # (k, 3): two coordinates in the plane, and the height
    outlines = np.split(place, region.islands)
    area = np.array(enclosed_area(flat[:, :2], outlines))
    length = float(local_lengths(region).mean()) if edge_length is None else edge_length
    ratio = float(
        coarsening(
            face_count(area, length),
            np.array(perimeter(flat[:, :2], outlines) / length),
            np.array(region.most_faces),
            asked=np.array(edge_length is not None),
        )
    )
    found = triangulated(flat[:, :2], outlines, length * ratio)
    if found is None:
        msg = f"Seen along its normal, this loop of {len(outer)} edges is no simple polygon."
        raise StageError(msg)
    points, faces = found
    k = len(rim)
    plane = np.column_stack([points, np.zeros(len(points))])
    plane[:k, 2] = flat[:, 2]
    if len(points) > k:
        laplacian = cotangent_laplacian(np.column_stack([points, np.zeros(len(points))]), faces)
        plane[:, 2] = minimise_with_fixed(laplacian, np.arange(len(points)) < k, plane[:, 2])
    n = len(region.vertices)
    numbers = np.concatenate([ids, n + np.arange(len(points) - k)])
    vertices = np.concatenate([region.vertices, plane[k:] @ frame + centre])
    at_rim = np.zeros(n, dtype=np.bool_)
    at_rim[region.loop] = True
    beside = region.faces[faces_at(at_rim, region.faces)]
    ends, filled = without_double_edges(len(vertices), beside, numbers[faces])
    middles = vertices[ends].mean(axis=1)
    closed = with_fill(region, np.concatenate([vertices[n:], middles]), filled)
    return replace(closed, coarsening=ratio)


def _frame(normal: FloatArray) -> FloatArray:
    """Two unit vectors in a plane and its unit normal, right-handed, as rows (3, 3)."""
    length = np.linalg.norm(normal)
    if length == 0.0:
        msg = "This loop encloses no area."
        raise StageError(msg)
    upright = normal / length
    first = np.cross(upright, np.eye(3)[np.argmin(np.abs(upright))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(upright, first), upright])
