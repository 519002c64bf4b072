"""Holes across creases: found, joined, closed along them, and faired side by side."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill_shape import shapes_of
from meshlab_lowrank.stages.stage0_crease_pairs import CORNER_REACH, Junction, junctions_of
from meshlab_lowrank.stages.stage0_crease_sides import faces_of_arcs, shape_of
from meshlab_lowrank.stages.stage0_creases import CreaseEnd, crease_ends
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage0_sharp_edges import (
    EXACT,
    Evidence,
    are_exact,
    may_have_creases,
    sharp_edges,
)
from meshlab_lowrank.stages.stage1a_close_creases import close_along_creases
from meshlab_lowrank.stages.stage1a_close_rim import local_lengths
from meshlab_lowrank.stages.stage1b_fair import FairRegion
from meshlab_lowrank.stages.stage1b_fair_creases import fair_sides

_AS_AT_RIM = np.radians(15.0)  # between the angle of a crease across the hole and at the rim
_CUT_REACH = 0.5  # of a corner from the middle of a rim that looks like a cut, in its diameters
_JOINED = ("A crease goes on across it.", "{} creases go on across it.")
_FOLDED = "The sides of its creases fold."
_TURNED = "Its creases come out with other angles than at the rim."


def creased_fills(
    regions: Sequence[Region], lengths: Sequence[float | None], evidence: Evidence
) -> list[FairRegion | StageError | None]:
    """Close and fair regions across which creases go on.

    Parameters
    ----------
    regions : sequence of Region
        Open at their loops.
    lengths : sequence of float or None
        Edge lengths of the fills, see `Close`.
    evidence : Evidence
        From where on sharp edges are a crease.

    Returns
    -------
    list of FairRegion, StageError or None
        None where no two creases at the rim belong together; the error where those that do can't
        be joined.
    """
    asked = may_have_creases(regions, evidence)
    return [
        creased_fill(region, length, evidence) if some and is_plain(region) else None
        for region, length, some in zip(regions, lengths, asked, strict=True)
    ]


def is_plain(region: Region) -> bool:
    """Whether the region has one loop, with each vertex once."""
    return not region.islands and len(np.unique(region.loop)) == len(region.loop)


def creased_fill(
    region: Region, length: float | None, evidence: Evidence, *, only_corners: bool = False
) -> FairRegion | StageError | None:
    """Close and fair one region; see `creased_fills` and `junctions_of`."""
    edges = sharp_edges(region.vertices, region.faces, evidence)
    if are_exact(edges):
        evidence = EXACT
        edges = sharp_edges(region.vertices, region.faces, evidence)
    ends = crease_ends(region, edges, evidence)
    if len(ends) < 2:
        return None
    rim = region.vertices[region.loop]
    reach = _CUT_REACH if region.continuity == "flat" else CORNER_REACH
    join = partial(junctions_of, ends, rim, reach=reach, only_corners=only_corners)
    if not join([None] * len(ends)):
        return None
    try:
        arcs = faces_of_arcs(region, edges, ends)
        none = np.zeros((0, 3))
        planes = [shape_of(region, faces, none).plane() for faces in arcs]
        junctions = join(planes)
        if not junctions or _joined(junctions) < evidence.joined * len(ends):
            return None
        length = float(local_lengths(region).mean()) if length is None else length
        closed = close_along_creases(region, ends, junctions, arcs, length)
        return _checked(fair_sides(closed), ends, junctions)
    except StageError as error:
        return None if evidence.exact else error


def _joined(junctions: Sequence[Junction]) -> int:
    """Count the creases at the rim that are joined."""
    return sum(len(each.ends) for each in junctions)


def _checked(
    region: Region, ends: Sequence[CreaseEnd], junctions: Sequence[Junction]
) -> FairRegion:
    """Refuse a fill whose creases don't look like those at the rim, or that is flawed."""
    (shape,) = shapes_of([region])
    if shape.folded_edges + shape.flat_faces or not np.isfinite(region.vertices).all():
        raise StageError(_FOLDED)
    expected = [abs(ends[end].angle) for each in junctions for end in each.ends]
    if abs(_median_angle(region) - np.median(expected)) > _AS_AT_RIM:
        raise StageError(_TURNED)
    count = sum(len(each.curves) for each in junctions)
    note = _JOINED[count > 1].format(count)
    return FairRegion(region, np.nan, note, count)


def _median_angle(region: Region) -> float:
    """Median of the angles between the normals at the edges along joined creases."""
    n = len(region.vertices)
    keys = np.sort(region.creases, axis=1) @ np.array([n, 1])
    near = region.faces[np.isin(region.faces, region.creases).any(axis=1)]
    edges = sharp_edges(region.vertices, near, EXACT)
    return float(
        np.median(edges.angle[np.isin(np.sort(edges.ends, axis=1) @ np.array([n, 1]), keys)])
    )
