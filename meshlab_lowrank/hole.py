"""One hole with its surroundings while it is worked on: what each stage takes and returns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices, faces_at

RECOVERED_WEIGHT = 0.3  # of a recovered normal against a measured one
_WAVELENGTH = 10.0  # until the surroundings tell


@dataclass(frozen=True, kw_only=True)
class Hole:
    """Geometry and normals of one hole's region.

    Lengths are in mean edge lengths.

    Attributes
    ----------
    positions : (n, 3) float64
    faces : (m, 3) int64
    unknown : (n,) bool
        Vertices whose positions are looked for; all others stay bit for bit.
    known_faces : (m,) bool
        Faces that were measured. A face of the fill is not known even if its corners all are.
    loop : (k,) int64
        Vertices of the boundary loop (the paper's HB), or those around a selected patch.
    rim_normals : bool
        Whether the rim's normals, of its known faces alone, count as measured.
    measured : (n,) bool
        Vertices whose normal is known.
    normals : (n, 3) float64
        Unit normals, zero where missing.
    weights : (n,) float64
        1 where the normal is measured, 0 where it is missing, between where it is recovered.
    base, base_normals : (n, 3) float64
        The smooth surface below the detail.
    wavelength : float
        Length after which the detail of the surroundings repeats.
    shortening : float
        How long patches are, over those that suit the wavelength: short ones find more that is
        alike.
    parts : (n,) int64 or None
        Number of the part of the missing surface that each vertex belongs to, -1 elsewhere: only
        these parts are recovered, and each without the patches that touch it. None: all is
        recovered.
    draped : bool
        Whether the unknown vertices lie where the base is to go, so that it is fitted to them too.
    """

    positions: FloatArray
    faces: IntArray
    unknown: BoolArray
    known_faces: BoolArray
    loop: IntArray
    rim_normals: bool
    measured: BoolArray
    normals: FloatArray
    weights: FloatArray
    base: FloatArray
    base_normals: FloatArray
    wavelength: float = _WAVELENGTH
    shortening: float = 1.0
    parts: IntArray | None = None
    draped: bool = False

    @property
    def patch_wavelength(self) -> float:
        """Wavelength that patches are made for."""
        return self.wavelength * self.shortening


def start_hole(
    positions: FloatArray,
    faces: IntArray,
    *,
    unknown: BoolArray,
    known_faces: BoolArray,
    loop: IntArray,
    rim_normals: bool = False,
) -> Hole:
    """Begin with the normals of the known faces and the mesh itself as its base.

    Parameters
    ----------
    positions : (n, 3) float64
        Unknown vertices lie on a smooth fill.
    faces : (m, 3) int64
    unknown : (n,) bool
    known_faces : (m,) bool
    loop : (k,) int64
    rim_normals : bool
        Count normals as measured at all known vertices. Otherwise only where all faces around a
        vertex are known and it is not on a border: the normal of half a fan leans.

    Returns
    -------
    Hole
    """
    n = len(positions)
    if rim_normals:
        measured = ~unknown
    else:
        measured = np.zeros(n, dtype=np.bool_)
        measured[faces] = True
        measured &= ~boundary_vertices(faces, n)
        measured[faces[~known_faces]] = False
    normals = np.where(measured[:, None], vertex_normals(positions, faces[known_faces]), 0.0)
    return Hole(
        positions=positions,
        faces=faces,
        unknown=unknown,
        known_faces=known_faces,
        loop=loop,
        rim_normals=rim_normals,
        measured=measured,
        normals=normals,
        weights=measured.astype(np.float64),
        base=positions,
        base_normals=vertex_normals(positions, faces),
    )


def with_missing(hole: Hole, positions: FloatArray, parts: IntArray) -> Hole:
    """Take parts of the known surface as missing too.

    Parameters
    ----------
    hole : Hole
    positions : (n, 3) float64
        What is missing lies on a smooth fill.
    parts : (n,) int64
        Number of the part of each vertex that is missed, -1 elsewhere.

    Returns
    -------
    Hole
    """
    missed = parts >= 0
    filled = faces_at(missed, hole.faces)
    rim = np.setdiff1d(hole.faces[filled], np.flatnonzero(missed))
    fresh = start_hole(
        positions,
        hole.faces,
        unknown=hole.unknown | missed,
        known_faces=hole.known_faces & ~filled,
        loop=np.union1d(hole.loop, rim),
        rim_normals=hole.rim_normals,
    )
    return replace(fresh, wavelength=hole.wavelength, shortening=hole.shortening, parts=parts)


def forgotten(hole: Hole) -> Hole:
    """Take the recovered normals as missing again; what was recovered stays in the positions."""
    normals = np.where(hole.measured[:, None], hole.normals, 0.0)
    return replace(hole, normals=normals, weights=hole.measured.astype(np.float64))


def with_recovered(hole: Hole, normals: FloatArray, accepted: BoolArray) -> Hole:
    """Take recovered normals (n, 3) at the accepted vertices (n,)."""
    return replace(
        hole,
        normals=np.where(accepted[:, None], normals, hole.normals),
        weights=np.where(accepted, RECOVERED_WEIGHT, hole.weights),
    )


def depth_of(hole: Hole) -> FloatArray:
    """Distance of each vertex from the nearest known one, (n,) float64 in mean edge lengths."""
    known = hole.positions[~hole.unknown]
    return np.asarray(cKDTree(known).query(hole.positions)[0], dtype=np.float64)
