"""What several tests build."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.folders.summary_page import RunFacts
from meshlab_lowrank.hole import Hole, start_hole

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
