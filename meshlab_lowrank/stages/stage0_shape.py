"""Stage 0: whether a hole is a cut, which a flat cap closes better than a smooth continuation."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.boundary_walk import area_vector
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import faces_at, vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage0_region import Region

_PLANAR = 0.03  # root mean square distance of the rim from its plane, in diameters
_STEEP, _LEAST_STEEP = 0.65, 0.3  # sine of the angle to that plane: median, and of nine tenths
_STEEP_RINGS, _BEND_RINGS = 3, 9
_CLOSING = (0.5, 1.4)  # bending towards the rim, over that of a sphere, with which it closes


def is_cut(region: Region) -> bool:
    """Whether the rim is nearly planar, and the surface meets that plane steeply all round.

    A smooth surface that closes beyond the rim, like a sphere, meets it steeply too, but turns
    towards the rim's plane as it comes nearer. On a sphere the angle to the plane falls by its own
    sine over a distance of the rim's radius. Where it falls by less than half as much, as on the
    end of a tube, or by much more, as at the rounded edge of a statue's base, the hole is a cut.

    Parameters
    ----------
    region : Region
        Open at its loop, with nine rings of vertices around it where the mesh has so many.
    """
    rim = region.vertices[region.loop]
    centre = rim.mean(axis=0)
    radius = float(np.linalg.norm(rim - centre, axis=1).max())
    normal = area_vector(rim)
    length = float(np.linalg.norm(normal))
    if radius == 0.0 or length == 0.0:
        return False
    normal = normal / length
    if np.sqrt(np.mean(((rim - centre) @ normal) ** 2)) > 2.0 * radius * _PLANAR:
        return False
    at_rim = np.zeros(len(region.vertices), dtype=np.bool_)
    at_rim[region.loop] = True
    beside = np.setdiff1d(region.faces[faces_at(at_rim, region.faces)], region.loop)
    if not _steep(region, normal, beside):  # spares most holes the walk over the rings
        return False
    ring = vertex_rings(
        vertex_adjacency(region.faces, len(region.vertices)), region.loop, _BEND_RINGS
    )
    steep = _steep(region, normal, np.flatnonzero((ring > 0) & (ring <= _STEEP_RINGS)))
    low, high = _CLOSING
    bend = radius * _bending(region, normal, ring, radius)
    return steep > 0.0 and not low * steep <= bend <= high * steep


def _steep(region: Region, normal: FloatArray, near: IntArray) -> float:
    """Sine of the angle between the surface at some vertices and the rim's plane, 0 if not steep.

    Steep it is if all lie on one side of the plane, most of them well off it.
    """
    rim = region.vertices[region.loop]
    distance, nearest = (np.asarray(each) for each in cKDTree(rim).query(region.vertices[near]))
    apart = distance > 0.0
    if not apart.any():
        return 0.0
    spokes = region.vertices[near[apart]] - rim[nearest[apart]]
    sine = np.sort((spokes @ normal) / distance[apart])
    if np.median(sine) < 0.0:
        sine = -sine[::-1]
    if np.quantile(sine, 0.1) < _LEAST_STEEP or np.median(sine) < _STEEP:
        return 0.0
    return float(np.median(sine))


def _bending(region: Region, normal: FloatArray, ring: IntArray, reach: float) -> float:
    """Angle by which the surface turns towards the rim's plane, for each unit of length."""
    upright = vertex_normals(region.vertices, region.faces) @ normal
    distance = np.asarray(cKDTree(region.vertices[region.loop]).query(region.vertices)[0])
    far, angle = [], []
    for number in range(_BEND_RINGS + 1):
        at = (ring == number) & (distance <= reach)
        if at.any():
            far.append(float(distance[at].mean()))
            angle.append(float(np.arccos(np.clip(upright[at].mean(), -1.0, 1.0))))
    if len(far) < 2 or np.ptp(far) == 0.0:
        return 0.0
    return float(np.polyfit(far, angle, 1)[0])
