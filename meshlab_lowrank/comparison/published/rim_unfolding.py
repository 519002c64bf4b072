"""A closed curve in space laid out in the plane."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, normalized
from meshlab_lowrank.mesh.polygons import is_simple, sides_of

_OPENINGS = np.linspace(0.0, 1.0, 6)
_MOST_STEPS = 100
_CLOSED = 1e-9  # gap, over the length of the curve


def unfolded(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Lay a closed curve out in the plane: lengths kept, turns at its vertices as near as can be.

    Where the curve would cross itself, its turns are drawn towards those of a convex one, by as
    many fifths as it takes.

    Parameters
    ----------
    points : (k, 3) float64
    normals : (k, 3) float64
        Of the surface at the points; a turn to the left, seen along them from above, is positive.

    Returns
    -------
    (k, 2) float64
        Counter-clockwise; no two sides cross.

    Raises
    ------
    StageError
        If the curve has no such place in the plane.
    """
    sides = np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(sides, axis=1)
    if not (lengths > 0.0).all():
        msg = f"This loop of {len(points)} edges has one without length; merge its vertices first."
        raise StageError(msg)
    turns = _turns(normalized(sides), normals)
    round_ones = (lengths + np.roll(lengths, 1)) * np.pi / lengths.sum()
    ring = sides_of([np.arange(len(points))])
    for opening in _OPENINGS:
        flat = _laid_out(lengths, (1.0 - opening) * turns + opening * round_ones)
        if flat is not None and is_simple(flat, ring):
            return flat
    msg = f"This loop of {len(points)} edges can't be unfolded into a plane."
    raise StageError(msg)


def _turns(directions: FloatArray, normals: FloatArray) -> FloatArray:
    """Angles (k,) from each side to the next, at the vertex between them."""
    before = np.roll(directions, 1, axis=0)
    across = np.cross(before, directions)
    angle = np.arctan2(np.linalg.norm(across, axis=1), np.einsum("ij,ij->i", before, directions))
    sign = np.where(np.einsum("ij,ij->i", across, normals) < 0.0, -1.0, 1.0)
    return np.asarray(sign * angle)


def _laid_out(lengths: FloatArray, turns: FloatArray) -> FloatArray | None:
    """Close a chain of sides in the plane with the least change of its turns; None if it can't be.

    Gauss-Newton steps on the directions of the sides; that the chain closes is their constraint.
    """
    k = len(lengths)
    goal = turns + (2.0 * np.pi - turns.sum()) / k
    angles = np.cumsum(goal) - goal[0]  # of the first side: 0
    steps = np.eye(k) - np.eye(k, k=-1)
    steps[0, -1] = -1.0  # a whole turn apart
    target = goal.copy()
    target[0] -= 2.0 * np.pi
    total = lengths.sum()
    system = np.zeros((k + 3, k + 3))
    system[:k, :k] = steps.T @ steps
    system[k, 0] = system[0, k] = 1.0  # the first side stays where it is
    for _ in range(_MOST_STEPS):
        x, y = np.cos(angles), np.sin(angles)
        gap = np.array([lengths @ x, lengths @ y]) / total
        rows = np.stack([-lengths * y, lengths * x]) / total
        system[k + 1 :, :k], system[:k, k + 1 :] = rows, rows.T
        right = np.concatenate([steps.T @ (target - steps @ angles), [0.0], -gap])
        try:
            change = np.linalg.solve(system, right)[:k]
        except np.linalg.LinAlgError:
            return None
        change *= min(1.0, 0.5 / max(float(np.abs(change).max()), 1e-300))
        angles = angles + change
        if np.abs(change).max() < _CLOSED:
            break
    x, y = np.cos(angles), np.sin(angles)
    if np.hypot(lengths @ x, lengths @ y) > _CLOSED * total:
        return None
    corners = np.stack([lengths * x, lengths * y], axis=1)
    return np.asarray(np.cumsum(corners, axis=0) - corners)
