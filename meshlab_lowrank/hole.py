"""The state of one hole, which each stage takes and returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, vertex_normals
from meshlab_lowrank.mesh.topology import boundary_vertices


@dataclass(frozen=True)
class HoleState:
    """Geometry and normals of one hole's region while it is worked on.

    Lengths are in mean edge lengths.

    Attributes
    ----------
    positions : (n, 3) float64
    faces : (m, 3) int64
    unknown : (n,) bool
        Vertices whose positions are looked for; all others stay bit for bit.
    measured : (n,) bool
        Vertices whose normal is known: all their faces are, and they are not on a border.
    normals : (n, 3) float64
        Unit normals, zero where missing.
    weights : (n,) float64
        1 where the normal is measured, 0 where it is missing, between where it is recovered.
    base, base_normals : (n, 3) float64
        The smooth surface below the detail.
    """

    positions: FloatArray
    faces: IntArray
    unknown: BoolArray
    measured: BoolArray
    normals: FloatArray
    weights: FloatArray
    base: FloatArray
    base_normals: FloatArray


def start_state(positions: FloatArray, faces: IntArray, unknown: BoolArray) -> HoleState:
    """Begin with the normals of the known faces and the mesh itself as its base.

    Parameters
    ----------
    positions : (n, 3) float64
        Unknown vertices lie on a smooth fill.
    faces : (m, 3) int64
    unknown : (n,) bool

    Returns
    -------
    HoleState
    """
    n = len(positions)
    known_faces = ~unknown[faces].any(axis=1)
    measured = ~boundary_vertices(faces, n)
    measured[faces[~known_faces]] = False
    used = np.zeros(n, dtype=np.bool_)
    used[faces] = True
    measured &= used
    normals = np.where(measured[:, None], vertex_normals(positions, faces[known_faces]), 0.0)
    return HoleState(
        positions=positions,
        faces=faces,
        unknown=unknown,
        measured=measured,
        normals=normals,
        weights=measured.astype(np.float64),
        base=positions,
        base_normals=vertex_normals(positions, faces),
    )
