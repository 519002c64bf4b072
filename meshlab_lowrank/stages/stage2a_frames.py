"""Stage 2, frames: the local coordinate systems R_i in which patches are compared (3.3.2).

Variants: `BaseFrames`, `PrincipalFrames`.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, normalized


class Frames(Protocol):
    """Gives each patch its frame."""

    def __call__(self, hole: Hole, centres: IntArray, size: int) -> FloatArray:
        """Build the frames of patches.

        Parameters
        ----------
        hole : Hole
        centres : (w,) int64
        size : int
            Samples per patch, the paper's sp.

        Returns
        -------
        (w, 3, 3) float64
            Rotations with rows e1, e2, e3: ``local = frames @ global``.
        """
        ...


def tangent_frames(normals: FloatArray, angle: float = 0.0) -> FloatArray:
    """Build frames with rows e1, e2, e3 whose third axis is the given normal.

    Parameters
    ----------
    normals : (w, 3) float64
    angle : float
        Turns the tangents, which are arbitrary otherwise, about the normal; in radians.

    Returns
    -------
    (w, 3, 3) float64
    """
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = normalized(np.cross(helper, normals))
    return turned(np.stack([first, np.cross(normals, first), normals], axis=1), angle)


def turned(frames: FloatArray, angle: float) -> FloatArray:
    """Turn frames (w, 3, 3) about their third axes by an angle in radians."""
    first, second, third = frames.transpose(1, 0, 2)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine * first + sine * second, cosine * second - sine * first, third], axis=1)
