"""The cut-out part of the mesh round one hole, in local units."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Region:
    """One hole with its surroundings, in units of the mean edge length around the hole.

    Attributes
    ----------
    vertices : (n, 3) float64
        Local coordinates: global = local * scale + centre.
    faces : (m, 3) int64
    known_vertices : (n,) bool
        False on the vertices that fill the hole.
    known_faces : (m,) bool
        False on the faces that fill the hole.
    vertex_ids : (n,) int64
        Index in the whole mesh, -1 for new vertices.
    face_ids : (m,) int64
        Index in the whole mesh, -1 for new faces.
    centre : (3,) float64
    scale : float
        Mean edge length around the hole, in the units of the mesh.
    loop : (k,) int64
        The boundary loop as indices into vertices, ordered as ``BoundaryLoop.vertices``: a face
        that fills the hole runs from loop[i] to loop[i + 1].
    """

    vertices: FloatArray
    faces: IntArray
    known_vertices: BoolArray
    known_faces: BoolArray
    vertex_ids: IntArray
    face_ids: IntArray
    centre: FloatArray
    scale: float
    loop: IntArray

    def to_global(self, positions: FloatArray) -> FloatArray:
        """Local coordinates (..., 3) in the units of the mesh."""
        return positions * self.scale + self.centre
