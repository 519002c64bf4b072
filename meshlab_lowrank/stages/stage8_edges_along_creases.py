"""Stage 8: edges are flipped until they run along the creases of the detail."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.crossings import crossing_pairs
from meshlab_lowrank.mesh.edge_flips import follow_normals
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    edge_lengths,
    vertex_normals,
)
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.stages.stage import Stage


@dataclass(frozen=True)
class AlongCreases(Stage):
    """Flip edges that run across creases; see `Edges`.

    The closing knew of no detail, so its triangles cut off ridges and fill furrows. The normals at
    the vertices, each a mean over a fan, hardly depend on the edges that are chosen between them;
    they tell where the detail has its creases.

    Parameters
    ----------
    least_gain : float
        That is worth a flip, see `follow_normals`; in squared mean edge lengths of the fill.
    least_angle : float
        Degrees, see `follow_normals`.
    """

    least_gain: float = 0.003
    least_angle: float = 12.0

    def __call__(self, positions: FloatArray, faces: IntArray, new: BoolArray) -> IntArray:
        """Flip edges; none where that made the fill cross anything."""
        if not new.any():
            return faces
        filled = np.zeros(len(positions), dtype=np.bool_)
        filled[faces[new]] = True
        near = np.flatnonzero(faces_at(filled, faces))
        own = new[near]
        length = edge_lengths(positions, faces[new]).mean()
        flipped = faces.copy()
        flipped[near] = follow_normals(
            positions,
            faces[near],
            own,
            vertex_normals(positions, faces[near]),
            least_gain=self.least_gain * length**2,
            least_angle=np.radians(self.least_angle),
        )
        changed = np.flatnonzero((flipped != faces).any(axis=1))
        if len(changed) == 0:
            return faces
        after, before = (
            len(crossing_pairs(positions, each, changed, np.arange(len(faces))))
            for each in (flipped, faces)
        )
        return flipped if after <= before else faces
