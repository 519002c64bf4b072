"""Which boundary loops are filled: those of a size, at selected faces, by number or by place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NoReturn

import numpy as np

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages.stage0_boundary_loops import BoundaryLoop

NOT_PICKED = "It is none of the holes that were picked."


def reasons_to_skip(
    points: FloatArray,
    loops: Sequence[BoundaryLoop],
    parameters: InpaintParameters,
    *,
    marked: BoolArray | None = None,
    holes: Iterable[int] | None = None,
    near: Iterable[float] | None = None,
) -> list[str]:
    """Say of each loop why it is not to be filled; nothing if it is.

    Parameters
    ----------
    points : (n, 3) float64
    loops : sequence of BoundaryLoop
    parameters : InpaintParameters
    marked : (m,) bool or None
        Only loops at which at least one of these faces lies.
    holes : iterable of int or None
        Only loops with these numbers.
    near : iterable of three numbers or None
        Only the loop whose rim lies nearest to this point; outer rims count with ``closerim``.

    Returns
    -------
    list of str

    Raises
    ------
    InvalidParameterError
        If there is no hole of a number, or nothing is left of what was picked.
    """
    picked = {loop.id for loop in loops}
    given = ["selected is True"] if loops and marked is not None else []
    if holes is not None:
        ids = checked_ids(holes)
        given.append(f"holes is {list(ids)}")
        _refuse_unknown(ids, picked)
        picked &= set(ids)
    if near is not None:
        place = checked_point(near)
        given.append(f"near is {place}")
        picked &= _nearest(points, loops, place, rims=parameters.closerim)
    reasons = [
        _reason(loop, parameters, marked) if loop.id in picked else NOT_PICKED for loop in loops
    ]
    if given and all(reasons):
        _refuse_nothing(" and ".join(given), reasons)
    return reasons


def checked_ids(holes: object) -> tuple[int, ...]:
    """Give numbers of holes.

    Raises
    ------
    InvalidParameterError
        If they are none.
    """
    items = list(holes) if isinstance(holes, Iterable) and not isinstance(holes, str) else []
    ids = [item for item in items if isinstance(item, int | np.integer)]
    if not ids or len(ids) < len(items) or any(isinstance(item, bool) for item in items):
        msg = f"Parameter holes is {holes!r}; give numbers of the hole table, as in 3,7."
        raise InvalidParameterError(msg)
    return tuple(dict.fromkeys(map(int, ids)))


def checked_point(near: object) -> tuple[float, float, float]:
    """Give a place.

    Raises
    ------
    InvalidParameterError
        If it is none.
    """
    try:
        x, y, z = map(float, near)  # type: ignore[call-overload]
    except (TypeError, ValueError):
        x = y = z = math.nan
    if isinstance(near, str) or not all(map(math.isfinite, (x, y, z))):
        msg = f"Parameter near is {near!r}; give three numbers x,y,z in the units of the mesh."
        raise InvalidParameterError(msg)
    return x, y, z


def _reason(loop: BoundaryLoop, parameters: InpaintParameters, marked: BoolArray | None) -> str:
    if loop.is_rim and loop.shape != "single face" and not parameters.closerim:
        return "It is the outer rim of an open sheet; set closerim to fill it too."
    if loop.reason:
        return loop.reason
    if wrong := _wrong_size(loop, parameters):
        return wrong
    if marked is not None and not marked[loop.faces].any():
        return "No face at it is selected."
    return ""


def _wrong_size(loop: BoundaryLoop, parameters: InpaintParameters) -> str:
    edges, length = len(loop.vertices), loop.perimeter
    if parameters.maxholesize and edges > parameters.maxholesize:
        return f"It has {edges} edges, more than maxholesize {parameters.maxholesize}."
    if edges < parameters.minholesize:
        return f"It has {edges} edges, less than minholesize {parameters.minholesize}."
    if parameters.maxholelength and length > parameters.maxholelength:
        return f"It is {length:.4g} long, more than maxholelength {parameters.maxholelength}."
    if length < parameters.minholelength:
        return f"It is {length:.4g} long, less than minholelength {parameters.minholelength}."
    return ""


def _nearest(
    points: FloatArray, loops: Sequence[BoundaryLoop], place: Sequence[float], *, rims: bool
) -> set[int]:
    """Find the loop whose rim lies nearest, the first of several; none if there is no loop."""
    distances = {
        loop.id: _distance(points[loop.vertices], np.array(place), closed=loop.shape != "bad edges")
        for loop in loops
        if rims or not loop.is_rim
    }
    return {min(distances, key=lambda number: (distances[number], number))} if distances else set()


def _distance(rim: FloatArray, place: FloatArray, *, closed: bool) -> float:
    """Distance of a point (3,) from a polygon (k, 3), or from its corners alone."""
    steps = np.roll(rim, -1, axis=0) - rim if closed else np.zeros_like(rim)
    squares = (steps**2).sum(axis=1)
    along = ((place - rim) * steps).sum(axis=1) / np.where(squares > 0.0, squares, 1.0)
    nearest = rim + np.clip(along, 0.0, 1.0)[:, None] * steps
    return float(np.linalg.norm(place - nearest, axis=1).min())


def _refuse_unknown(ids: Iterable[int], known: set[int]) -> None:
    for number in ids:
        if number not in known:
            there = f"holes 0 to {len(known) - 1}" if known else "no hole"
            msg = f"Parameter holes is {number}, but the mesh has {there}; see the hole table."
            raise InvalidParameterError(msg)


def _refuse_nothing(given: str, reasons: Sequence[str]) -> NoReturn:
    left = ((i, reason) for i, reason in enumerate(reasons) if reason != NOT_PICKED)
    number, reason = next(left, (-1, ""))
    why = f"hole {number}: {reason[0].lower()}{reason[1:]}" if reason else "no hole is both."
    if not reason and " and " not in given:
        why = "there is no hole but outer rims; set closerim to fill these." if reasons else ""
        why = why or "there is no hole."
    msg = f"Parameter {given}, but that leaves nothing to fill: {why}"
    raise InvalidParameterError(msg)
