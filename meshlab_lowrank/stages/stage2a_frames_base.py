"""Stage 2, frames: the normal of the base, with any tangents."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2a_frames import tangent_frames


@dataclass(frozen=True)
class BaseFrames(Stage):
    """e3 along the base normal; e1 and e2 are arbitrary, as patches are compared in all turns."""

    def __call__(self, hole: Hole, centres: IntArray, size: int) -> FloatArray:  # noqa: ARG002
        """Build the frames; see `Frames`."""
        return tangent_frames(hole.base_normals[centres])
