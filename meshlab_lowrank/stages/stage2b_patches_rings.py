"""Stage 2, patches: sp vertices found ring by ring (sections 3.3.1 to 3.3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.rings import (
    collect_rings,
    offsets_in_frames,
    position_in_patch,
    walk_rings,
)
from meshlab_lowrank.mesh.topology import vertex_adjacency, vertex_rings
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2a_frames import Frames
from meshlab_lowrank.stages.stage2a_frames_pca import PrincipalFrames, principal_frames
from meshlab_lowrank.stages.stage2b_patches import Patches


@dataclass(frozen=True)
class RingLayer:
    """Ring patches on the surface of one pass; see `PatchLayer`.

    Parameters
    ----------
    hole : Hole
    size : int
        Vertices per patch, the paper's sp.
    frames : Frames
    """

    hole: Hole
    size: int
    frames: Frames

    @property
    def distances(self) -> FloatArray:
        """About how far out each sample lies, as if vertices filled a disc evenly."""
        return np.sqrt(np.arange(self.size) / self.size)

    @property
    def turns(self) -> IntArray:
        """One only: a turn does not map rings of vertices on themselves."""
        return np.arange(self.size)[None]

    def at(self, centres: IntArray, angle: float = 0.0) -> Patches:  # noqa: ARG002
        """Lay patches with centres (w,); each ring starts where e1 points, whatever the angle."""
        hole = self.hole
        frames = self.frames(hole, centres, self.size)
        return ring_patches(hole.positions, hole.faces, centres, self.size, frames)


@dataclass(frozen=True)
class RingPatches(Stage):
    """The paper's patches N(v_i) of the r-ring neighbourhood NB_r; see `LayPatches`.

    Parameters
    ----------
    sp : int
        Vertices per patch.
    r : int
        Rings around the hole in which patches are taken.
    frames : Frames
    """

    sp: int = 100
    r: int = 8
    frames: Frames = field(default_factory=PrincipalFrames)

    @property
    def rings(self) -> int:
        """Rings of vertices that patches in NB_r reach: a ring j of a regular mesh has 6 j."""
        return self.r + 1 + int(np.ceil(np.sqrt(self.sp / 3.0)))

    def radius(self, hole: Hole) -> float:  # noqa: ARG002
        """Radius of a disc of a regular mesh that holds sp vertices."""
        return float(np.sqrt(self.sp * np.sqrt(3.0) / (2.0 * np.pi)))

    def centres(self, hole: Hole) -> IntArray:
        """Take every vertex of NB_r, and of the hole."""
        inside = np.flatnonzero(hole.unknown)
        return ring_centres(hole.faces, len(hole.positions), hole.loop, inside, self.r)

    def layer(self, hole: Hole) -> RingLayer:
        """Lay patches on the surface itself, M^1."""
        return RingLayer(hole, self.sp, self.frames)


def ring_centres(faces: IntArray, n: int, loop: IntArray, inside: IntArray, r: int) -> IntArray:
    """Give the centres of the patches of one hole: the r-ring neighbourhood NB_r (section 3.3).

    NB_r lies on M^1, so it reaches into the filled hole as well as outwards. Where a hole is
    deeper than r rings, its other vertices are added: otherwise no patch would hold them, and
    their normals could never be recovered.

    Parameters
    ----------
    faces : (m, 3) int64
        Faces of M^1, the closed mesh.
    n : int
        Number of vertices.
    loop : (b,) int64
        Vertices of the hole boundary HB.
    inside : (u,) int64
        Vertices of the filled hole, M^1 - M^0.
    r : int
        Number of rings.

    Returns
    -------
    (w,) int64, sorted
    """
    rings = vertex_rings(vertex_adjacency(faces, n), loop, r)
    return np.union1d(np.flatnonzero(rings >= 0), inside)


def ring_patches(
    vertices: FloatArray,
    faces: IntArray,
    centres: IntArray,
    sp: int,
    frames: FloatArray | None = None,
) -> Patches:
    """Extract the patches N(v_i) of the paper.

    Section 3.3.1: the vertices around a centre are collected ring by ring, counter-clockwise as
    seen from outside, each ring from its vertex nearest to v_i, until there are sp. Their
    covariance about v_i gives the frame (section 3.3.2). The rings are then walked again, each
    from the vertex nearest to the half-line of e1 (section 3.3.3), and cut at sp: that is the
    order of the samples. Complete rings hold the same vertices in both walks.

    A ring is all vertices at one distance in edges, its order is the angle about v_i in the
    tangent plane: that is the walk along the ring where the ring is one, and stays defined where
    it is torn by a border.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    centres : (w,) int64
    sp : int
        Vertices per patch.
    frames : (w, 3, 3) float64, optional
        Frames R_i; by default `principal_frames`.

    Returns
    -------
    Patches
        One vertex per sample. Where the surface has fewer than sp vertices in reach, the last
        samples are empty rows.
    """
    if frames is None:
        frames = principal_frames(vertices, faces, centres, sp)
    found = collect_rings(vertex_adjacency(faces, len(vertices)), centres, sp)
    offsets = vertices[found.vertex] - vertices[centres[found.patch]]
    local = offsets_in_frames(frames, found, offsets)
    beside = np.where(local[:, 0] > 0, local[:, 1] ** 2, (local[:, :2] ** 2).sum(axis=1))
    order = walk_rings(found, local, beside, sp)
    rows = found.patch[order] * sp + position_in_patch(found.patch[order])
    sampler = sparse.csr_array(
        (np.ones(len(order)), (rows, found.vertex[order])),
        shape=(len(centres) * sp, len(vertices)),
    )
    return Patches(centres=centres, frames=frames, sampler=sampler, size=sp)
