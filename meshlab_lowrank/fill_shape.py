"""The shape of fills, as far as it can be told without the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    edge_lengths,
    face_normals,
    face_vectors,
)
from meshlab_lowrank.mesh.topology import edges_of, faces_at, half_edge_pairs
from meshlab_lowrank.stages.stage0_region import Region

_FLAT = 1e-9  # area of a face that has none, in squared mean edge lengths
_FOLDED = -0.2  # cosine between the normals of two neighbouring faces


@dataclass(frozen=True)
class FillShape:
    """What is wrong with a fill, and how it meets its surroundings; see `HoleRecord`.

    Attributes
    ----------
    folded_edges, flat_faces : int
    rim_angle : float
        NaN where no new face shares an edge with a known one.
    edge_ratio : float
        NaN likewise.
    """

    folded_edges: int
    flat_faces: int
    rim_angle: float
    edge_ratio: float


def shapes_of(regions: Sequence[Region]) -> list[FillShape]:
    """Measure the fills of regions, all in one go.

    A flat cap meets its surroundings at an edge, so that counts for no fold; neither do creases
    that were joined.

    Parameters
    ----------
    regions : sequence of Region
        Closed.

    Returns
    -------
    list of FillShape
    """
    count = len(regions)
    if count == 0:
        return []
    first = np.cumsum([0, *(len(region.vertices) for region in regions)])
    vertices = np.concatenate([region.vertices for region in regions])
    faces = np.concatenate(
        [region.faces + start for region, start in zip(regions, first, strict=False)]
    )
    new = ~np.concatenate([region.known_faces for region in regions])
    of = np.repeat(np.arange(count), [len(region.faces) for region in regions])
    near = np.zeros(len(vertices), dtype=np.bool_)
    near[faces[new]] = True
    rows = faces_at(near, faces)
    faces, new, of = faces[rows], new[rows], of[rows]

    edges = edges_of(faces)
    first_face, second_face = half_edge_pairs(edges) // 3  # (e,)
    owner = of[first_face]
    normals = face_normals(vertices, faces)
    cosine = np.einsum("ij,ij->i", normals[first_face], normals[second_face])
    both = new[first_face] & new[second_face]
    across = new[first_face] ^ new[second_face]
    capped = np.array([region.continuity == "flat" for region in regions])[owner]
    folded = (cosine < _FOLDED) & (both | (across & ~capped))
    creases = np.concatenate(
        [region.creases + start for region, start in zip(regions, first, strict=False)]
    )
    if len(creases):
        n = len(vertices)
        inner = np.sort(edges.vertices[edges.face_count == 2], axis=1) @ np.array([n, 1])
        folded &= ~np.isin(inner, np.sort(creases, axis=1) @ np.array([n, 1]))

    solid = np.asarray(normals.any(axis=1))  # a face without area has no direction
    told = across & solid[first_face] & solid[second_face]
    least = np.full(count, 1.0)
    np.minimum.at(least, owner[told], cosine[told])
    angle = np.degrees(np.arccos(least.clip(-1.0, 1.0)))

    lengths = edge_lengths(vertices, faces).mean(axis=1)
    beside = np.where(new[first_face], second_face, first_face)[
        across
    ]  # the known face at each rim edge
    around = _mean(lengths[beside], of[beside], count)
    ratio = np.divide(
        _mean(lengths[new], of[new], count), around, out=np.full(count, np.nan), where=around > 0
    )
    flat = new & (np.linalg.norm(face_vectors(vertices, faces), axis=1) < _FLAT)
    folds, flats = (np.bincount(groups, minlength=count) for groups in (owner[folded], of[flat]))
    return [
        FillShape(int(folds[i]), int(flats[i]), float(angle[i]), float(ratio[i]))
        if around[i] > 0
        else FillShape(int(folds[i]), int(flats[i]), math.nan, math.nan)
        for i in range(count)
    ]


def beyond_surroundings(region: Region) -> float:
    """Say how far a fill leaves the bounding box of the known surface around it, in local units.

    Parameters
    ----------
    region : Region
        Closed.

    Returns
    -------
    float
    """
    known, new = (region.vertices[mask] for mask in (region.known_vertices, ~region.known_vertices))
    if len(new) == 0:
        return 0.0
    above, below = new.max(axis=0) - known.max(axis=0), known.min(axis=0) - new.min(axis=0)
    return float(max(above.max(), below.max(), 0.0))


def _mean(values: FloatArray, groups: IntArray, count: int) -> FloatArray:
    """Mean of the values of each group, (count,); NaN for groups without any."""
    number = np.bincount(groups, minlength=count)
    total = np.bincount(groups, weights=values, minlength=count)
    return np.asarray(np.divide(total, number, out=np.full(count, np.nan), where=number > 0))
