"""Stage 1, closing: MeshLab closes the loops and gives the fills the local edge length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.edge_flips import ears_of, flip_edges, open_ears
from meshlab_lowrank.mesh.fairing import fair_surface, membrane
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    FloatArray,
    IntArray,
    cotangent_laplacian,
    face_vectors,
)
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_batch import RegionBatch, merged, with_fills
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_fill import Fills, closed, empty_fills, remeshed
from meshlab_lowrank.stages.stage1a_close_rim import (
    coarsening,
    face_count,
    local_lengths,
    without_double_edges,
)

_COARSE = 2.0  # edge length, in final ones, of the fill whose faired shape is remeshed
_ROUNDS = 10
_LEVEL = 1.25  # ratio of edge lengths between two steps of a graded fill
_TOGETHER = 1000  # edges of loops that are closed in one go
_RING = "MeshLab's hole filler closes single loops only, not those round an island."


@dataclass(frozen=True)
class MeshLabClosing(Stage):
    """MeshLab's hole filler and remesher on the loops alone; see `Close` and `close_regions`."""

    def __call__(
        self, regions: Sequence[Region], *, edge_lengths: Sequence[float | None]
    ) -> list[Region | StageError]:
        """Append the fill to each region; see `Close`."""
        return close_regions(regions, edge_lengths=edge_lengths)


def close_region(region: Region, *, edge_length: float | None = None) -> Region:
    """Fill ``region.loop`` with triangles of the local edge length.

    See `close_regions`, of which this is the case of one region.

    Raises
    ------
    StageError
        If MeshLab leaves the loop open or tears it.
    """
    (result,) = close_regions([region], edge_lengths=[edge_length])
    if isinstance(result, StageError):
        raise result
    return result


def close_regions(
    regions: Sequence[Region], *, edge_lengths: Sequence[float | None]
) -> list[Region | StageError]:
    """Fill the loops of many regions with triangles of the local edge length.

    Existing vertices, faces and edges stay as they are; new rows are appended. The loop is
    closed, remeshed and faired, and remeshed again on the faired surface, whose area decides how
    many vertices there are. A loop of three edges becomes one face.

    Parameters
    ----------
    regions : sequence of Region
    edge_lengths : sequence of float or None
        Edge length of the new triangles of each, in local units. None: as dense as the
        surroundings, from one side of the hole to the other.

    Returns
    -------
    list of Region or StageError
        Closed at the loop, manifold, oriented like the surroundings; the fill is roughly faired.
        An error where MeshLab leaves the loop open or tears it, and where there are islands.
    """
    results: list[Region | StageError] = [StageError(_RING)] * len(regions)
    rounds = [0 if region.islands else _rounds(len(region.loop)) for region in regions]
    for number in sorted(set(rounds) - {0}):
        alike = [i for i, each in enumerate(rounds) if each == number]
        edges = np.cumsum([len(regions[i].loop) for i in alike])
        for chunk in range(int(edges[-1]) // _TOGETHER + 1):
            chosen = [i for i, end in zip(alike, edges, strict=True) if end // _TOGETHER == chunk]
            found = _together(
                [regions[i] for i in chosen], [edge_lengths[i] for i in chosen], number
            )
            for i, result in zip(chosen, found, strict=True):
                results[i] = result
    return results


def _rounds(k: int) -> int:
    """Count the rounds that give a loop of k edges an even fill: each halves the longest edges."""
    return 4 + int(np.log2(k))


def _together(
    regions: Sequence[Region], edge_lengths: Sequence[float | None], rounds: int
) -> list[Region | StageError]:
    """Close regions in one go, those apart for which that fails."""
    if len(regions) == 0:
        return []
    try:
        return list(_closed_together(regions, edge_lengths, rounds))
    except StageError as error:
        if len(regions) == 1:
            return [error]
    half = len(regions) // 2
    parts = (slice(half), slice(half, None))
    return [each for i in parts for each in _together(regions[i], edge_lengths[i], rounds)]


def _closed_together(
    regions: Sequence[Region], edge_lengths: Sequence[float | None], rounds: int
) -> list[Region]:
    batch = merged(regions)
    lengths = np.concatenate(
        [
            local_lengths(region) if length is None else np.full(len(region.loop), length)
            for region, length in zip(regions, edge_lengths, strict=True)
        ]
    )
    part = batch.loop_part
    mean = np.bincount(part, lengths) / np.bincount(part)
    fills = _first_fills(batch, mean)
    asked = np.array([length is not None for length in edge_lengths])
    most = np.array([region.most_faces for region in regions])
    ratio = coarsening(*_face_counts(fills, lengths), most, asked=asked)
    mean *= ratio
    held = np.maximum(_inner_lengths(fills) / (_COARSE * mean * most), 1.0)
    coarse = _COARSE * mean * held
    fills = fills.in_units(coarse / coarse[0])
    everywhere = np.ones(len(fills.faces), dtype=np.bool_)
    fills = remeshed(fills, everywhere, coarse[0], rounds, project=False)
    had = np.bincount(fills.part[fills.faces[:, 0]], minlength=len(most))
    inner = np.maximum(had - 2 * np.bincount(part), 0)  # those at the rim don't become more
    fills = _roughly_faired(batch, fills)
    lengths *= ratio[part]
    count, _ = _face_counts(fills, lengths)  # a dome is larger
    more = coarsening(count, _COARSE**2 * held * inner, most, asked=asked)
    fills = _graded(fills, lengths * more[part])
    batch = replace(batch, regions=tuple(map(_coarsened, regions, (ratio * more).tolist())))
    n, k = len(batch.vertices), len(batch.loop)
    vertices = np.concatenate([batch.vertices, fills.local()[k:]])
    part = np.concatenate([batch.part, fills.part[k:]])
    rim = batch.rim_faces()
    m = len(rim)
    faces = np.concatenate([rim, _numbered(batch, fills)])
    faces = flip_edges(vertices, faces, np.arange(len(faces)) >= m)
    faces = _with_ears_open(vertices, faces, n, m, part)
    ends, filled = without_double_edges(len(vertices), faces[:m], faces[m:])
    middles = vertices[ends].mean(axis=1)
    return with_fills(
        batch,
        np.concatenate([vertices[n:], middles]),
        np.concatenate([part[n:], part[ends[:, 0]]]),
        filled,
    )


def _coarsened(region: Region, ratio: float) -> Region:
    return replace(region, coarsening=ratio)


def _face_counts(fills: Fills, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Faces that each fill needs, and edges that its rim is long, (p,), for lengths (k,) there."""
    positions, k, p = fills.local(), len(lengths), len(fills.places)
    areas = np.linalg.norm(face_vectors(positions, fills.faces), axis=1)
    edges = np.linalg.norm(positions[fills.following] - positions[:k], axis=1)
    rim = np.bincount(fills.part[:k], edges / lengths, minlength=p).astype(np.float64)
    wanted = np.exp(_extended(fills, np.log(lengths))[fills.faces].mean(axis=1))
    part = fills.part[fills.faces[:, 0]]
    return np.bincount(part, face_count(areas, wanted), minlength=p).astype(np.float64), rim


def _inner_lengths(fills: Fills) -> FloatArray:
    """Sum the lengths of the edges inside each fill, (p,): remeshing begins by splitting them."""
    edges = edges_of(fills.faces)
    ends = edges.vertices[edges.face_count == 2]
    positions = fills.local()
    lengths = np.linalg.norm(positions[ends[:, 0]] - positions[ends[:, 1]], axis=1)
    part = fills.part[ends[:, 0]]
    return np.bincount(part, lengths, minlength=len(fills.places)).astype(np.float64)


def _numbered(batch: RegionBatch, fills: Fills) -> IntArray:
    """Faces of the fills, their new vertices numbered on from those of the batch."""
    n, k = len(batch.vertices), len(batch.loop)
    ids = np.concatenate([batch.loop, np.arange(n, n + len(fills.vertices) - k)])
    return np.asarray(ids[fills.faces])


def _outer_corners(batch: RegionBatch) -> FloatArray:
    """Opposite corners of the faces at the edges of the loops, (k, 3)."""
    n, rim = len(batch.vertices), batch.rim_faces()
    tail, head = batch.loop, batch.loop[batch.following]
    keys = (rim * n + np.roll(rim, -1, axis=1)).ravel()
    order = np.argsort(keys)
    half_edges = order[np.searchsorted(keys, head * n + tail, sorter=order)]
    return batch.vertices[np.roll(rim, 1, axis=1).ravel()[half_edges]]


def _first_fills(batch: RegionBatch, lengths: FloatArray) -> Fills:
    """Let MeshLab close the loops; all fills are to have the edge length (p,) of the first then."""
    corners = batch.vertices[batch.loop]
    middle = 0.5 * (corners + corners[batch.following])
    strip = 0.5 * (middle + _outer_corners(batch))
    empty = empty_fills(corners, strip, batch.loop_part, batch.following, lengths / lengths[0])
    fills = closed(empty, avoid_crossings=True)
    fit = fills.fit()
    if not fit.all():  # the stricter way sometimes stops half-way
        other = closed(empty, avoid_crossings=False)
        faces = [fills.faces[fit[fills.part[fills.faces[:, 0]]]]]
        faces += [other.faces[~fit[other.part[other.faces[:, 0]]]]]
        fills = replace(empty, faces=np.concatenate(faces))
    if not fills.fit().all():
        msg = f"MeshLab did not close this loop of {len(corners)} edges."
        raise StageError(msg)
    return fills


def _roughly_faired(batch: RegionBatch, fills: Fills) -> Fills:
    """Move the new vertices onto bi-harmonic surfaces, or where wanted flat ones."""
    n, k = len(batch.vertices), len(batch.loop)
    vertices = np.concatenate([batch.vertices, fills.local()[k:]])
    faces = np.concatenate([batch.faces, _numbered(batch, fills)])
    new = np.arange(len(vertices)) >= n
    flat = batch.is_flat()[np.concatenate([batch.part, fills.part[k:]])]
    faired = fair_surface(vertices, faces, new & ~flat, order=2)
    return fills.with_local(membrane(faired, faces, new & flat)[n:], k)


def _graded(fills: Fills, lengths: FloatArray) -> Fills:
    """Remesh each fill to an edge length that varies between those along its loop, (k,).

    From the longest to the shortest, ever smaller parts of the fill are remeshed.
    """
    k, count = len(lengths), len(fills.places)
    of = fills.part[:k]
    longest, shortest = np.zeros(count), np.full(count, np.inf)
    np.maximum.at(longest, of, lengths)
    np.minimum.at(shortest, of, lengths)
    levels = np.rint(np.log(longest / shortest) / np.log(_LEVEL)).astype(np.int64)
    graded = levels > 1
    mean = np.bincount(of, lengths) / np.bincount(of)
    first = np.where(graded, longest, mean)
    fills = fills.in_units(first / first[0])
    everywhere = np.ones(len(fills.faces), dtype=np.bool_)
    fills = remeshed(fills, everywhere, first[0], _ROUNDS, project=True)
    for level in range(1, int(levels[graded].max(initial=0)) + 1):
        length = first[0] * _LEVEL**-level
        wanted = _extended(fills, np.log(lengths * (first[0] / first[of])))[fills.faces].mean(
            axis=1
        )
        here = (graded & (levels >= level))[fills.part[fills.faces[:, 0]]]
        chosen = here & (wanted < np.log(length * np.sqrt(_LEVEL)))
        if chosen.any():
            fills = remeshed(fills, chosen, length, _ROUNDS, project=True)
    return fills


def _extended(fills: Fills, values: FloatArray) -> FloatArray:
    """Harmonic function on the fills with given values on the loops."""
    k, n = len(values), len(fills.vertices)
    if n == k:
        return values
    laplacian = cotangent_laplacian(fills.vertices, fills.faces)
    return minimise_with_fixed(laplacian, np.arange(n) < k, np.append(values, np.zeros(n - k)))


def _with_ears_open(
    vertices: FloatArray, faces: IntArray, n: int, m: int, part: IntArray
) -> IntArray:
    """Open the folded ears of each fill; the first n vertices and m faces are known."""
    held = np.arange(len(vertices)) < n
    new = np.arange(len(faces)) >= m
    of = part[faces[:, 0]]
    opened = faces
    for number in np.unique(of[ears_of(vertices, faces, held, new)]):
        rows = np.flatnonzero(of == number)
        opened = opened.copy()
        opened[rows] = open_ears(vertices, faces[rows], held, new[rows])
    return opened
