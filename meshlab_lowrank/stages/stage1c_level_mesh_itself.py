"""Stage 1, level: the mesh itself, with the user's triangles."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.hole import start_hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1c_level import Level


@dataclass(frozen=True)
class MeshItself(Stage):
    """Work on the triangles as they are; see `ChooseLevel`."""

    coarsest: float = 1.0

    def __call__(self, region: Region, factor: float, *, rim_normals: bool) -> Level:  # noqa: ARG002
        """Take the region's own surface; see `ChooseLevel`."""
        return mesh_itself(region, rim_normals=rim_normals)


def mesh_itself(region: Region, *, rim_normals: bool) -> Level:
    """Take the region's own surface as its level."""
    hole = start_hole(
        region.vertices,
        region.faces,
        unknown=~region.known_vertices,
        known_faces=region.known_faces,
        loop=region.loop,
        rim_normals=rim_normals,
    )
    return Level(hole, 1.0, is_mesh=True)
