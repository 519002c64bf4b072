"""From which sides a mesh is drawn so that every hole is seen."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, normalized

_MOST = 6
_ENOUGH = 0.7  # of the best sight of a hole
_FROM_BEHIND = 0.3  # what that is worth
_STEEP = 0.9
_AXES = "xyz"


@dataclass(frozen=True)
class Side:
    """A parallel projection.

    Attributes
    ----------
    name : str
        As in ``+x -y``.
    towards, up, right : (3,) float64
        Unit vectors: towards the eye, and the axes of the picture.
    """

    name: str
    towards: FloatArray
    up: FloatArray
    right: FloatArray

    def across(self, points: FloatArray) -> FloatArray:
        """Give the places (k, 2) of points (k, 3) in the picture, in units of the mesh."""
        return np.column_stack([points @ self.right, points @ self.up])


def sides_of(extent: FloatArray) -> list[Side]:
    """List the sides along axes and diagonals.

    Parameters
    ----------
    extent : (3,) float64
        Size of the mesh along the axes; the longest stands upright where it can.

    Returns
    -------
    list of Side
    """
    upright = sorted((1, 2, 0), key=lambda axis: -round(float(extent[axis]), 6))
    steps = sorted(
        (s for s in itertools.product((1, 0, -1), repeat=3) if any(s)),
        key=lambda s: sum(map(abs, s)),
    )
    found = []
    for step in steps:
        towards = normalized(np.array(step, dtype=np.float64))
        axis = next(a for a in upright if abs(towards[a]) < _STEEP)
        right = normalized(np.cross(np.eye(3)[axis], towards))
        signs = (f"{'+-'[s < 0]}{name}" for s, name in zip(step, _AXES, strict=True) if s)
        found.append(Side(" ".join(signs), towards, np.cross(towards, right), right))
    return found


def worth(normals: FloatArray, outer: BoolArray, seen: FloatArray, side: Side) -> FloatArray:
    """Rate how well holes are seen from a side.

    Parameters
    ----------
    normals : (h, 3) float64
        Directions in which the holes look.
    outer : (h,) bool
        Whether they are outer rims, which are seen as well from behind.
    seen : (h,) float64
        Parts of their rims that nothing hides.
    side : Side

    Returns
    -------
    (h,) float64
        From 0 to 1.
    """
    facing = normals @ side.towards
    behind = np.where(outer, 1.0, _FROM_BEHIND)
    return np.asarray(seen * np.where(facing > 0.0, facing, -behind * facing))


def choose(values: FloatArray) -> list[int]:
    """Choose few sides from which all holes are seen well.

    Parameters
    ----------
    values : (sides, h) float64
        What `worth` gives.

    Returns
    -------
    list of int
        At least one, at most six.
    """
    chosen: list[int] = []
    best = np.zeros(values.shape[1])
    wanted = _ENOUGH * values.max(axis=0, initial=0.0)
    while len(chosen) < _MOST and (not chosen or (best < wanted).any()):
        gains = np.minimum(values, wanted).sum(axis=1) * 1e-3
        gains += np.maximum(values - best, 0.0)[:, best < wanted].sum(axis=1)
        chosen.append(int(gains.argmax()))
        best = np.maximum(best, values[chosen[-1]])
    return chosen
