"""Which surface a hole is worked on: the one on which the pattern around it shows best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1c_level import Level
from meshlab_lowrank.tuning.tune import UNSEEN, Look

Widen: TypeAlias = Callable[[float], Region]

_STEP = 2.0
_SHALLOWEST = 2.5  # edges of a coarser level that a hole is deep; its fill can't be wrong otherwise
_LEAST_VERTICES = 1500  # of a coarser level, on which what is repeated is the body itself otherwise
_FINE = 1.2  # edges a repeat, over those wanted, above which a coarser surface may show it better
_FINEST = 0.5  # factor, as surfaces much finer than the mesh cost much and hold no more
_FINEST_AGAIN = 0.75  # edges of the mesh, likewise, where a level is refined
_OWN = 1.3  # edges of the mesh, below which its own triangles will do
_COARSE = 0.75  # edges a repeat, over those wanted, that are not worth another surface


def choose_level(region: Region, widen: Widen | None, pipeline: Pipeline) -> tuple[Level, Look]:
    """Look for the pattern around a hole, on coarser and coarser surfaces.

    Parameters
    ----------
    region : Region
        Closed and faired.
    widen : callable or None
        Gives the region with surroundings so many times as wide. None: no coarser surface.
    pipeline : Pipeline

    Returns
    -------
    level : Level
        The mesh itself, if it is even, where there is no pattern on any.
    look : Look
        At that surface, or the last one on which nothing was seen.
    """
    level = pipeline.level(region, 1.0, rim_normals=pipeline.rim_normals)
    if not (level.hole.measured.any() and level.hole.unknown.any()):
        return level, UNSEEN
    look = pipeline.tune.look(level.hole)
    own = level, look
    most = min(pipeline.level.coarsest, fill_depth(region) / _SHALLOWEST)
    factor, coarse = 1.0, _STEP
    while widen is not None and (look.reason or look.fineness[0] > _FINE) and coarse <= most:
        coarser = _made(widen(coarse), coarse, pipeline)
        if coarser is None:
            break
        seen = pipeline.tune.look(coarser.hole)
        if not look.reason and (seen.reason or seen.strength < look.strength):
            break
        if not seen.reason:
            level, look, factor = coarser, seen, coarse
        coarse *= _STEP
    if look.reason or level.is_mesh:
        return level, look
    fineness = look.fineness[0]  # a maximum nearer than twice the first minimum is chance
    if _COARSE <= fineness <= 1.0 / _COARSE:
        return level, look
    factor = min(max(factor * fineness, _FINEST), max(most, 1.0))
    if own[1].reason and factor <= 1.0:
        return own  # what is so short would have shown there
    fitting = _made(region if widen is None else widen(factor), factor, pipeline)
    if fitting is None:
        return level, look
    return fitting, pipeline.tune.look(fitting.hole)  # chance looks like a pattern on one surface


def finer_level(level: Level, widen: Widen | None, pipeline: Pipeline) -> Level | None:
    """Make the surface on which what a level gave is recovered once more.

    Parameters
    ----------
    level : Level
    widen : callable or None
        See `choose_level`.
    pipeline : Pipeline

    Returns
    -------
    Level or None
        Twice as fine, but not finer than the mesh; None where the level is as fine as that. It is a
        surface of its own even if it has the triangles of the mesh, as it is as wide as the level:
        what has to be met more exactly has to be chosen from as much.
    """
    factor = level.spacing / _STEP
    if level.is_mesh or widen is None or not pipeline.finer or factor < _FINEST_AGAIN:
        return None
    around = widen(max(level.spacing, 1.0))
    finer = _made(around, factor if factor > _OWN else 1.0, pipeline)
    return None if finer is None else replace(finer, is_mesh=False)


def _made(region: Region, factor: float, pipeline: Pipeline) -> Level | None:
    """Make a level; None where there is none that tells anything."""
    try:
        level = pipeline.level(region, factor, rim_normals=pipeline.rim_normals)
    except StageError:
        return None
    hole = level.hole
    if len(hole.positions) < _LEAST_VERTICES or not hole.measured.any():
        return None
    return level


def fill_depths(region: Region) -> FloatArray:
    """Distance of each new vertex from the known ones, (v,) in local units."""
    known = region.known_vertices
    return np.asarray(cKDTree(region.vertices[known]).query(region.vertices[~known])[0])


def fill_depth(region: Region) -> float:
    """Largest distance of a new vertex from the known ones, in local units."""
    return float(np.max(fill_depths(region), initial=0.0))
