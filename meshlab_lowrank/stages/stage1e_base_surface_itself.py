"""Stage 1, base: the surface as it is, detail and all."""

from __future__ import annotations

from dataclasses import dataclass, replace

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.stages.stage import Stage


@dataclass(frozen=True)
class SurfaceItself(Stage):
    """The base is M^1: the known surface and the faired fill, later what the last pass made."""

    def __call__(self, hole: Hole, *, first: bool) -> Hole:  # noqa: ARG002
        """Take the surface; see `Base`."""
        normals = vertex_normals(hole.positions, hole.faces)
        return replace(hole, base=hole.positions, base_normals=normals)
