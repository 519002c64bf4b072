"""How far smooth fills may be from the true surface, told from discs of what is known nearby."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.leveling import fill_depths
from meshlab_lowrank.mesh.face_grid import FaceGrid
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.stages.stage0_region import Region, cut_region, cut_rings
from meshlab_lowrank.stages.stage1b_fair import FairRegion
from meshlab_lowrank.tuning.error_law import ErrorLaw, learned
from meshlab_lowrank.tuning.missed_discs import (
    LARGEST_SIZE,
    MissedDisc,
    Surroundings,
    missed_discs,
)

_DISCS = 8  # from which a law is learned, where there is room for so many
_FEW = 8  # holes, beyond which each has few discs of its own, and those of its neighbours
_OWN = 3
_MOST_ASKED, _ONE_IN = 24, 10  # holes of a size that have some, and of how many more one has
_LOOKED_AT = 8  # neighbours
_ALIKE = 1.5  # largest ratio of the edge lengths and of the sizes of such neighbours
_WIDTH, _BEYOND = 2.0, 5.0  # of the surroundings: sizes of the hole, and edge lengths
_RINGS = 20  # of faces, up to which surroundings are cut out in one go
_RING = 0.8  # width of one, in edge lengths
_GRID_FROM = 8
_OWN_BAND = 0.25  # exponent of what the fairing missed at the hole itself, over what the law says
_MOST_OWN = 4.0
_ALL_ALIKE, _CAUTION = 0.90, 0.35  # length of bars where discs agree, and growth where they differ
_LEAST_SIZE = 0.1  # edge lengths
_LARGEST_SIZE = 1.35  # over the largest depth
_RAGGED = 1.2  # rim of a round hole cut along edges, over that of the disc


def smooth_errors(
    fills: Sequence[FairRegion], widened: Callable[[Sequence[int], FloatArray], Sequence[Region]]
) -> list[FloatArray]:
    """Tell how far the new vertices of smooth fills are from the true surface.

    Parameters
    ----------
    fills : sequence of FairRegion
    widened : callable
        Gives the known surface around some of them, each so many mean edge lengths wide.

    Returns
    -------
    list of (v,) float64
        For each fill the distance, in the units of the mesh, that is not exceeded at its new
        vertices in 68 % of cases; twice that in 95 %. NaN where nothing tells: on flat caps, on
        fills along creases, and where the surroundings have no room for a disc.
    """
    depths = [fill_depths(fill.region) for fill in fills]
    sizes = np.array([_size(fill.region, d) for fill, d in zip(fills, depths, strict=True)])
    chosen = [
        i
        for i, fill in enumerate(fills)
        if sizes[i] > _LEAST_SIZE and fill.region.continuity != "flat" and not fill.creases
    ]
    errors = [np.full(len(depth), np.nan) for depth in depths]
    if not chosen:
        return errors
    asked = _asked(sizes[chosen])
    rows = [chosen[k] for k in asked]
    regions = widened(rows, _WIDTH * np.minimum(sizes[rows], LARGEST_SIZE) + _BEYOND)
    around = [
        Surroundings(
            region.vertices,
            region.faces[region.known_faces],
            region.loop,
            float(sizes[i]),
            fills[i].order,
        )
        for i, region in zip(rows, regions, strict=True)
    ]
    discs = missed_discs(around, _DISCS if len(chosen) <= _FEW else _OWN)
    if len(chosen) > _FEW:
        discs = _shared([fills[i].region for i in chosen], sizes[chosen], asked, discs)
    for i, own in zip(chosen, discs, strict=True):
        if own:
            law, size = learned(own), float(sizes[i])
            bars = law.at(depths[i], size) * _lengthened(law, size, fills[i].misfit)
            errors[i] = bars * fills[i].region.scale
    return errors


def with_guess(errors: FloatArray, moves: FloatArray) -> FloatArray:
    """Lengthen the bars of a smooth fill for detail of which nothing tells that it is right.

    It has nothing to do with the detail that is missing there, so their squares add.

    Parameters
    ----------
    errors : (v,) float64
        Of the smooth fill.
    moves : (v,) float64
        How far the detail moves the vertices.

    Returns
    -------
    (v,) float64
    """
    squared = float((errors**2).mean()) if len(errors) else 0.0
    if not squared > 0.0:  # NaN too
        return errors
    return np.asarray(errors * math.sqrt(1.0 + float((moves**2).mean()) / squared))


def _size(region: Region, depths: FloatArray) -> float:
    """Give the radius of a disc that is as hard to fill, in local units.

    The fill of a hole that wraps around a limb lies too flat, and so near its rim; and in a slit a
    fill is held on two sides only: it misses as much as in a disc of 1.3 times its half width.
    """
    deepest = float(depths.max(initial=0.0))
    rim = len(region.loop) / (2.0 * math.pi * _RAGGED)  # edges of the rim have length 1
    return min(max(deepest, rim), _LARGEST_SIZE * deepest)


def _asked(sizes: FloatArray) -> list[int]:
    """Choose the holes, of sizes (h,), whose surroundings are looked at: all that are few alike."""
    kind = np.floor(np.log(sizes) / math.log(_ALIKE))
    found: list[int] = []
    for each in np.unique(kind):
        alike = np.flatnonzero(kind == each)
        count = min(len(alike), _MOST_ASKED + len(alike) // _ONE_IN)
        found += alike[np.linspace(0, len(alike) - 1, count).astype(np.int64)].tolist()
    return sorted(found)


def known_surroundings(
    vertices: FloatArray,
    faces: IntArray,
    loops: Sequence[IntArray],
    rim_faces: Sequence[IntArray],
    widths: FloatArray,
) -> list[Region]:
    """Cut out what is known around holes, the narrow ones of them in one go.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    loops, rim_faces : sequence of (k,) int64
        See `cut_region`; none of which has no extent.
    widths : (h,) float64
        In mean edge lengths around each.

    Returns
    -------
    list of Region
    """
    rings = np.ceil(widths / _RING)
    narrow = np.flatnonzero(rings <= _RINGS).tolist()
    found: dict[int, Region] = {}
    if narrow:
        cut = cut_rings(
            vertices,
            faces,
            [loops[i] for i in narrow],
            [rim_faces[i] for i in narrow],
            rings=int(rings[narrow].max()),
        )
        found = {i: each for i, each in zip(narrow, cut, strict=True) if isinstance(each, Region)}
    wide = [i for i in range(len(loops)) if i not in found]
    grid = FaceGrid(vertices, faces) if len(wide) > _GRID_FROM else None
    for i in wide:
        found[i] = cut_region(
            vertices, faces, loops[i], rim_faces[i], reach=float(widths[i]), grid=grid
        )
    return [found[i] for i in range(len(loops))]


def _lengthened(law: ErrorLaw, size: float, misfit: float) -> float:
    """Factor for what the hole itself tells, and for how little discs that differ do."""
    own = misfit / law.in_band(size)
    near = float(np.clip(own, 1.0 / _MOST_OWN, _MOST_OWN)) if math.isfinite(own) else 1.0
    return float(_ALL_ALIKE * near**_OWN_BAND * math.exp(_CAUTION * law.scatter))


def _shared(
    regions: Sequence[Region],
    sizes: FloatArray,
    asked: Sequence[int],
    discs: Sequence[list[MissedDisc]],
) -> list[list[MissedDisc]]:
    """Give each of many holes the discs of those nearest to it that were asked and are alike."""
    centres = np.stack([region.centre for region in regions])
    scales = np.array([region.scale for region in regions])
    told = [k for k, own in zip(asked, discs, strict=True) if own]
    of = dict(zip(asked, discs, strict=True))
    if not told:
        return [[] for _ in regions]
    tree = cKDTree(centres[told])
    ranks = np.arange(1, min(_LOOKED_AT, len(told)) + 1)
    near = np.asarray(tree.query(centres, k=ranks)[1])
    found = []
    for i, others in enumerate(near):
        own: list[MissedDisc] = []
        for k in (told[each] for each in others.tolist()):
            ratio = scales[k] / scales[i]
            if len(own) < _DISCS and _alike(ratio) and _alike(sizes[k] / sizes[i]):
                own += [MissedDisc(ratio * disc.depth, ratio * disc.miss) for disc in of[k]]
        found.append(own)
    return found


def _alike(ratio: float) -> bool:
    return 1.0 / _ALIKE <= ratio <= _ALIKE
