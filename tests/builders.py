"""What several tests build."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.folders.summary_page import RunFacts
from meshlab_lowrank.hole import Hole, start_hole
from meshlab_lowrank.stages.stage0_region import Region

RUN_FACTS = RunFacts(
    source="/scans",
    target="/filled",
    finished="2024-05-06 07:08 UTC",
    seconds=1.0,
    version="0.0",
    parameters={},
    command="meshlab-lowrank batch /scans /filled",
    worked_on=1,
)


def hole_of(
    points: np.ndarray, faces: np.ndarray, unknown: np.ndarray, *, rim_normals: bool = False
) -> Hole:
    """Give the hole whose fill is the faces at the unknown vertices."""
    known_faces = ~unknown[faces].any(axis=1)
    rim = np.setdiff1d(faces[~known_faces], np.flatnonzero(unknown))
    return start_hole(
        points,
        faces,
        unknown=unknown,
        known_faces=known_faces,
        loop=rim,
        rim_normals=rim_normals,
    )


def region_of(points: np.ndarray, faces: np.ndarray, unknown: np.ndarray) -> Region:
    """Give a whole mesh as the region whose fill is the faces at the unknown vertices."""
    gone = unknown[faces].any(axis=1)
    return Region(
        vertices=points,
        faces=faces,
        known_vertices=~unknown,
        known_faces=~gone,
        vertex_ids=np.arange(len(points)),
        face_ids=np.arange(len(faces)),
        centre=np.zeros(3),
        scale=1.0,
        loop=np.setdiff1d(faces[gone], np.flatnonzero(unknown)),
    )
