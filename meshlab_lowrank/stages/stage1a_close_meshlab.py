"""Stage 1, closing: MeshLab closes the loop and gives the fill the local edge length."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pymeshlab
from scipy.spatial import cKDTree

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.edge_flips import flip_edges, open_ears
from meshlab_lowrank.mesh.fairing import fair_surface
from meshlab_lowrank.mesh.fixed_values import minimise_with_fixed
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    cotangent_laplacian,
    face_vectors,
)
from meshlab_lowrank.mesh.topology import border_of, edges_of
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region

_TARGET_FACTOR = 0.98  # the remesher's target over the edge that its mean triangle area implies
_COARSE = 2.0  # edge length, in final ones, of the fill whose faired shape is remeshed
_ROUNDS = 10
_LEVEL = 1.25  # ratio of edge lengths between two steps of a graded fill
_NOISE = 1e-6
_MOST_FACES = 4_000_000
_NEAR_FACES = 40  # faces whose mean area gives the edge length at a vertex of the loop


@dataclass(frozen=True)
class _Fill:
    """Faces within a loop; the loop's k vertices come first.

    MeshLab sees them together with a strip of faces around the loop, made for the purpose, so
    that neither pinched vertices nor other holes nearby mislead it, and so that the loop's edges
    are not the border of its mesh.
    """

    vertices: FloatArray
    faces: IntArray
    strip: FloatArray  # (k, 3) outer vertices of the strip

    def mesh_set(self, marks: dict[str, FloatArray]) -> pymeshlab.MeshSet:
        """Fill and strip as a mesh with face marks; ``loop`` numbers the kept vertices from 1."""
        k, n = len(self.strip), len(self.vertices)
        tail = np.arange(k)
        head = np.roll(tail, -1)
        strip = np.concatenate(
            [np.stack([head, tail, n + tail], axis=1), np.stack([head, n + tail, n + head], axis=1)]
        )
        loop = np.zeros(n + k)
        loop[np.r_[:k, n : n + k]] = np.arange(1.0, 2 * k + 1)
        mesh_set = pymeshlab.MeshSet(verbose=False)
        positions = np.concatenate([self.vertices, self.strip])
        noise = np.random.default_rng(0).uniform(-_NOISE, _NOISE, (2 * k, 3))
        positions[loop > 0.5] += noise  # MeshLab welds vertices at the same place
        mesh_set.add_mesh(pymeshlab.Mesh(positions, np.concatenate([self.faces, strip])))
        mesh = mesh_set.current_mesh()
        mesh.add_vertex_custom_scalar_attribute(loop, "loop")
        mesh.add_face_custom_scalar_attribute(
            np.r_[np.zeros(len(self.faces)), np.ones(2 * k)], "strip"
        )
        for name, values in marks.items():
            mesh.add_face_custom_scalar_attribute(np.r_[values, np.zeros(2 * k)], name)
        return mesh_set

    def taken_from(self, mesh_set: pymeshlab.MeshSet) -> _Fill:
        """Read the fill back, the loop where it was."""
        k = len(self.strip)
        mesh = mesh_set.current_mesh()
        positions = mesh.vertex_matrix()
        loop = mesh.vertex_custom_scalar_attribute_array("loop")
        kept = np.flatnonzero(loop > 0.5)
        added = np.flatnonzero(loop < 0.5)
        number = np.empty(len(loop), dtype=np.int64)
        number[kept] = np.rint(loop[kept]) - 1
        number[added] = np.arange(2 * k, 2 * k + len(added))
        outer = np.concatenate([self.vertices[:k], self.strip])
        if len(kept) != 2 * k or not np.allclose(
            positions[kept], outer[number[kept]], rtol=0.0, atol=2 * _NOISE
        ):
            msg = f"MeshLab moved the rim of this loop of {k} edges while it closed it."
            raise StageError(msg)
        faces = mesh.face_matrix()[mesh.face_custom_scalar_attribute_array("strip") < 0.5]
        faces = number[faces.astype(np.int64)]
        faces[faces >= 2 * k] -= k
        return replace(self, vertices=np.concatenate([outer[:k], positions[added]]), faces=faces)


@dataclass(frozen=True)
class MeshLabClosing(Stage):
    """MeshLab's hole filler and remesher on the loop alone; see `Close` and `close_region`."""

    def __call__(self, region: Region, *, edge_length: float | None) -> Region:
        """Append the fill to a region; see `Close`."""
        return close_region(region, edge_length=edge_length)


def close_region(region: Region, *, edge_length: float | None = None) -> Region:
    """Fill ``region.loop`` with triangles of the local edge length.

    Existing vertices, faces and edges stay as they are; new rows are appended. The loop is
    closed, remeshed and faired, and remeshed again on the faired surface, whose area decides how
    many vertices there are. A loop of three edges becomes one face.

    Parameters
    ----------
    region : Region
    edge_length : float or None
        Edge length of the new triangles in local units. None: as dense as the surroundings, from
        one side of the hole to the other.

    Returns
    -------
    Region
        Closed at the loop, manifold, oriented like the surroundings. The fill is roughly faired.

    Raises
    ------
    StageError
        If MeshLab leaves the loop open or tears it.
    """
    k, n, m = len(region.loop), len(region.vertices), len(region.faces)
    lengths = _local_lengths(region) if edge_length is None else np.full(k, edge_length)
    fill = _closed(region, float(lengths.mean()))
    coarse = _COARSE * float(lengths.mean())
    rounds = 4 + int(np.log2(k))  # each halves the longest edges
    fill = _remeshed(fill, _everywhere(fill), coarse, rounds, project=False)
    rough = _with_fill(region, fill)
    faired = fair_surface(rough.vertices, rough.faces, ~rough.known_vertices, order=2)[n:]
    fill = replace(fill, vertices=np.concatenate([fill.vertices[:k], faired]))
    filled = _with_fill(region, _graded(fill, lengths))
    new = np.arange(len(filled.faces)) >= m
    faces = flip_edges(filled.vertices, filled.faces, new)
    faces = open_ears(filled.vertices, faces, np.arange(len(filled.vertices)) < n, new)
    middles, faces = _without_double_edges(filled.vertices, faces[:m], faces[m:])
    return _with_faces(region, np.concatenate([filled.vertices[n:], middles]), faces)


def _local_lengths(region: Region) -> FloatArray:
    """Edge length of equilateral triangles as large as those around each loop vertex, (k,)."""
    areas = _face_areas(region)
    centroids = region.vertices[region.faces].mean(axis=1)
    count = min(_NEAR_FACES, len(centroids))
    _, near = cKDTree(centroids).query(region.vertices[region.loop], k=count)
    mean_area = areas[near.reshape(len(region.loop), -1)].mean(axis=1)
    return np.asarray(np.sqrt(mean_area * 4.0 / np.sqrt(3.0)))


def _outer_corners(region: Region) -> FloatArray:
    """Opposite corners of the faces at the edges of the loop, (k, 3)."""
    n = len(region.vertices)
    tail, head = region.loop, np.roll(region.loop, -1)
    keys = (region.faces * n + np.roll(region.faces, -1, axis=1)).ravel()
    order = np.argsort(keys)
    half_edges = order[np.searchsorted(keys, head * n + tail, sorter=order)]
    return region.vertices[np.roll(region.faces, 1, axis=1).ravel()[half_edges]]


def _closed(region: Region, length: float) -> _Fill:
    """Let MeshLab close the loop, ready to be remeshed to an edge length."""
    corners = region.vertices[region.loop]
    k = len(corners)
    middle = 0.5 * (corners + np.roll(corners, -1, axis=0))
    strip = 0.5 * (middle + _outer_corners(region))
    empty = _Fill(corners, np.zeros((0, 3), dtype=np.int64), strip)
    fill = empty
    for avoid_intersections in (True, False):  # the stricter way sometimes stops half-way
        mesh_set = empty.mesh_set({})
        mesh_set.compute_selection_by_condition_per_face(condselect=f"fi < {k}")
        mesh_set.meshing_close_holes(
            maxholesize=k + 1,
            selected=True,
            newfaceselected=True,
            selfintersection=avoid_intersections,
            refinehole=False,
            refineholeedgelen=pymeshlab.PercentageValue(3),
        )
        fill = empty.taken_from(mesh_set)
        if _fits(fill):
            break
    else:
        msg = f"MeshLab did not close this loop of {k} edges."
        raise StageError(msg)
    wanted = _face_areas(fill).sum() / (np.sqrt(3.0) / 4.0 * length**2)
    if wanted > _MOST_FACES:
        msg = f"The fill would need about {wanted:.0f} faces; give a longer edge length."
        raise StageError(msg)
    return fill


def _face_areas(surface: _Fill | Region) -> FloatArray:
    return np.asarray(np.linalg.norm(face_vectors(surface.vertices, surface.faces), axis=1))


def _everywhere(fill: _Fill) -> BoolArray:
    return np.ones(len(fill.faces), dtype=np.bool_)


def _fits(fill: _Fill) -> bool:
    """Whether the fill is a manifold disc with the loop, run through backwards, as its border."""
    k, n = len(fill.strip), len(fill.vertices)
    edges = edges_of(fill.faces)
    heads = np.roll(fill.faces, -1, axis=1)
    directed = (fill.faces * n + heads).ravel()
    tail = np.arange(k)
    loop = tail * n + np.roll(tail, -1)
    border = directed[(edges.face_count == 1)[edges.face_edges].ravel()]
    disc = n - len(edges.vertices) + len(fill.faces) == 1
    alike = len(np.unique(directed)) == len(directed)
    return bool(
        disc
        and alike
        and np.array_equal(np.sort(border), np.sort(loop))
        and edges.face_count.max(initial=0) <= 2
    )


def _remeshed(
    fill: _Fill, chosen: BoolArray, length: float, rounds: int, *, project: bool
) -> _Fill:
    """Let MeshLab give some faces of the fill triangles of one edge length."""
    mesh_set = fill.mesh_set({"chosen": chosen.astype(np.float64)})
    mesh_set.compute_selection_by_condition_per_face(condselect="chosen > 0.5")
    with _remesher_defaults():
        mesh_set.meshing_isotropic_explicit_remeshing(
            iterations=rounds,
            adaptive=False,
            selectedonly=True,
            targetlen=pymeshlab.PureValue(length * _TARGET_FACTOR),
            featuredeg=180.0,
            checksurfdist=False,
            maxsurfdist=pymeshlab.PercentageValue(1),
            splitflag=True,
            collapseflag=True,
            swapflag=True,
            smoothflag=True,
            reprojectflag=project,
        )
    result = fill.taken_from(mesh_set)
    if not _fits(result):
        msg = f"MeshLab tore the fill of this loop of {len(fill.strip)} edges."
        raise StageError(msg)
    return result


@contextmanager
def _remesher_defaults() -> Iterator[None]:
    """Keep the defaults of MeshLab's remesher, which are the values of its last call anywhere."""
    scratch = pymeshlab.MeshSet(verbose=False)
    scratch.add_mesh(pymeshlab.Mesh(np.eye(3), np.array([[0, 1, 2]])))
    defaults = scratch.filter_parameter_values("meshing_isotropic_explicit_remeshing")
    whole = pymeshlab.PercentageValue(100)  # lengths are not remembered
    try:
        yield
    finally:
        scratch.meshing_isotropic_explicit_remeshing(
            **{**defaults, "targetlen": whole, "maxsurfdist": whole}
        )


def _graded(fill: _Fill, lengths: FloatArray) -> _Fill:
    """Remesh the fill to an edge length that varies between those along the loop.

    From the longest to the shortest, ever smaller parts of the fill are remeshed.
    """
    longest = lengths.max()
    levels = int(np.rint(np.log(longest / lengths.min()) / np.log(_LEVEL)))
    if levels <= 1:
        return _remeshed(fill, _everywhere(fill), float(lengths.mean()), _ROUNDS, project=True)
    fill = _remeshed(fill, _everywhere(fill), longest, _ROUNDS, project=True)
    for level in range(1, levels + 1):
        length = longest * _LEVEL**-level
        wanted = _extended(fill, np.log(lengths))[fill.faces].mean(axis=1)
        chosen = wanted < np.log(length * np.sqrt(_LEVEL))
        if chosen.any():
            fill = _remeshed(fill, chosen, length, _ROUNDS, project=True)
    return fill


def _extended(fill: _Fill, values: FloatArray) -> FloatArray:
    """Harmonic function on the fill with given values on the loop."""
    k = len(values)
    if len(fill.vertices) == k:
        return values
    laplacian = cotangent_laplacian(fill.vertices, fill.faces)
    n = len(fill.vertices)
    return minimise_with_fixed(laplacian, np.arange(n) < k, np.append(values, np.zeros(n - k)))


def _without_double_edges(
    vertices: FloatArray, known: IntArray, filled: IntArray
) -> tuple[FloatArray, IntArray]:
    """Split edges of the fill that the mesh has, or may get from another fill, already.

    Gives the new vertices in the middle of the edges, and the faces of the fill.
    """
    n = len(vertices)
    edges, present = edges_of(filled), edges_of(known)
    old = np.zeros(n, dtype=np.bool_)
    old[known] = True
    inner = edges.vertices[(edges.face_count == 2) & old[edges.vertices].all(axis=1)]
    double = np.isin(inner @ np.array([n, 1]), present.vertices @ np.array([n, 1]))
    tails = known.ravel()[border_of(known, n).half_edges]
    pinched = np.bincount(tails, minlength=n) > 1
    double |= pinched[inner].all(axis=1)
    middles: list[FloatArray] = []
    faces = filled.tolist()
    for a, b in inner[double].tolist():
        middle = n + len(middles)
        middles.append(0.5 * (vertices[a] + vertices[b]))
        for face in [face for face in faces if a in face and b in face]:
            faces.remove(face)
            faces += [[middle if corner == end else corner for corner in face] for end in (a, b)]
    return np.array(middles).reshape(-1, 3), np.array(faces, dtype=np.int64)


def _with_fill(region: Region, fill: _Fill) -> Region:
    """Append the fill's vertices and faces to the region."""
    k, n = len(region.loop), len(region.vertices)
    ids = np.concatenate([region.loop, np.arange(n, n + len(fill.vertices) - k)])
    return _with_faces(region, fill.vertices[k:], ids[fill.faces])


def _with_faces(region: Region, vertices: FloatArray, faces: IntArray) -> Region:
    """Append new vertices (v, 3) and new faces (f, 3) to the region."""
    new, filled = len(vertices), len(faces)
    return replace(
        region,
        vertices=np.concatenate([region.vertices, vertices]),
        faces=np.concatenate([region.faces, faces]),
        known_vertices=np.append(region.known_vertices, np.zeros(new, dtype=np.bool_)),
        known_faces=np.append(region.known_faces, np.zeros(filled, dtype=np.bool_)),
        vertex_ids=np.append(region.vertex_ids, np.full(new, -1)),
        face_ids=np.append(region.face_ids, np.full(filled, -1)),
    )
