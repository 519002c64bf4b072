"""Error bars of a fill that carries them, beside the errors that came."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.filled_mesh import FilledMesh
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.mesh.surface_part import SurfacePart


@dataclass(frozen=True)
class ErrorBars:
    """The error bars of one fill.

    Attributes
    ----------
    median, largest : float
        In mesh units.
    within : float
        Part of the new vertices whose distance to the truth is not more than their bar; 0.68 is
        right. NaN without truth.
    """

    median: float
    largest: float
    within: float = math.nan


def error_bars(
    filled: FilledMesh, loop: int, bars: FloatArray, truth: SurfacePart | None
) -> ErrorBars | None:
    """Compare the bars of a fill with the truth.

    Parameters
    ----------
    filled : FilledMesh
    loop : int
        Number of the boundary loop.
    bars : (n,) float64
        Of all its vertices: 0 on measured ones.
    truth : SurfacePart or None

    Returns
    -------
    ErrorBars or None
        None where the fill has no new vertices, or their bars are not known.
    """
    corners = np.unique(filled.faces[filled.loop == loop])
    new = corners[bars[corners] != 0.0]
    if len(new) == 0 or not np.isfinite(bars[new]).all():
        return None
    median, largest = float(np.median(bars[new])), float(bars[new].max())
    if truth is None:
        return ErrorBars(median, largest)
    index = TriangleIndex(truth.vertices, truth.faces)
    within = index.closest(filled.vertices[new]).distances <= bars[new]
    return ErrorBars(median, largest, float(within.mean()))
