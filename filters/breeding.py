"""Breed new faces from old ones, each with three vertices of its own.

Two ways lead there. Faster and smaller in memory is to tear the mesh open at some vertices, to let
MeshLab close the holes, and to tear all new faces off; MeshLab tears at vertices whose normal is no
number, as no corner of a face then equals another. It forgets some attributes over that. The other
way is to split faces at the middle of their edges, again and again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pymeshlab

from meshlab_lowrank.filters.filter_script import quiet
from meshlab_lowrank.filters.placing import Aside
from meshlab_lowrank.filters.reading import texture_indices
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import edges_of, faces_at

_SPLITS = 3  # fewer leave no spare vertex inside a face
_FACES_PER_SPLIT_FACE = 4  # picked at three splits; 64 new faces, of which 1 in 6 at the very best
_TORN_FACES_PER_FACE = 3  # of which about 1.8 faces come, and 1.5 are needed


@dataclass(frozen=True)
class Growth:
    """What to append to a mesh of n vertices.

    Attributes
    ----------
    new_faces : (q, 3) int64
        Indices from n on are new vertices; each new vertex is used.
    new_vertex_count : int
    textures : (q,) int64
        Texture index that each new face shall have; only read on meshes with several textures.
    bad_vertices : (b,) int64
        At edges with more than two faces, or with faces oriented against one another.
    """

    new_faces: IntArray
    new_vertex_count: int
    textures: IntArray
    bad_vertices: IntArray

    def band_size(self, *, tearing: bool) -> int:
        """Give the number of old faces to breed from."""
        count = len(self.new_faces)
        return 1 + (_TORN_FACES_PER_FACE * count if tearing else count // _FACES_PER_SPLIT_FACE)


@dataclass(frozen=True)
class Band:
    """Faces to breed from: those at the vertices that are set aside.

    Attributes
    ----------
    rows : (b,) int64
    corners : (b, 3) int64
    wedges : (b, 3, 2) float64 or None
        Their texture coordinates, if they have any.
    vertex_count, face_count : int
        Of the mesh as it was.
    """

    rows: IntArray
    corners: IntArray
    wedges: FloatArray | None
    vertex_count: int
    face_count: int


@dataclass(frozen=True)
class Brood:
    """Bred faces.

    Attributes
    ----------
    kept : (b, 3) int64
        Corners that the faces of the band have now: old ones, or new vertices of their own.
    spare : (v,) int64
        The first new vertices that are no such corners.
    picked : (q, 3) int64
        Corners of appended faces: other new vertices, none of them in two faces.
    order : (q,) int64
        Which of the wanted faces each of these becomes.
    others : (f, 3) int64
        Corners of the other faces that were appended.
    """

    kept: IntArray
    spare: IntArray
    picked: IntArray
    order: IntArray
    others: IntArray


def can_tear(mesh: pymeshlab.Mesh) -> bool:
    """Whether a mesh has none of the attributes that would be lost by tearing, or by closing holes.

    See `can_part`.
    """
    return can_part(mesh) and not (
        mesh.has_wedge_tex_coord() or mesh.has_vertex_tex_coord() or mesh.has_face_scalar()
    )


def can_part(mesh: pymeshlab.Mesh) -> bool:
    """Whether a mesh has none of the attributes that are lost where vertices are torn apart.

    Texture coordinates and quality of vertices are lost too, but can be written again.
    """
    return not _has(mesh.vertex_curvature_principal_dir1_matrix)


def breed(
    ms: pymeshlab.MeshSet, growth: Growth, band: Band, aside: Aside, *, tearing: bool
) -> Brood:
    """Append faces to the current mesh until enough can be picked.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    growth : Growth
    band : Band
        All faces at the vertices ``aside``.
    aside : Aside
    tearing : bool
        Try it first; only if `can_tear`.

    Returns
    -------
    Brood
        The quality of vertices is lost if there was tearing, or a bad vertex.
    """
    first = band.vertex_count
    condition = " && ".join(f"x{i} >= {aside.start!r}" for i in range(3))
    splits, bred = _SPLITS, "1"
    bad = np.isin(aside.ids, growth.bad_vertices)
    if bad.any():  # MeshLab closes and splits manifolds only
        _tear_at(ms, aside, bad)
    if tearing:
        _tear_and_close(ms, band, aside)
    while True:
        corners = ms.current_mesh().face_matrix()
        kept, new = corners[band.rows].astype(np.int64), corners[band.face_count :].astype(np.int64)
        del corners
        if len(new) and _separable(kept, band):
            textures = texture_indices(ms)
            brood = _pick(kept, new, growth, first, textures)
            if len(brood.picked) == len(growth.new_faces):
                return brood
            if textures is not None:  # of one texture there may be plenty by now
                missing = np.delete(growth.textures, brood.order)
                bred = "(" + " || ".join(f"ti == {ti}" for ti in np.unique(missing)) + ")"
        ms.compute_selection_by_condition_per_face(condselect=condition)
        ms.meshing_surface_subdivision_midpoint(
            iterations=splits, threshold=pymeshlab.PureValue(0), selected=True
        )
        condition, splits = f"(vi0 >= {first} || vi1 >= {first} || vi2 >= {first}) && {bred}", 1


def _tear_and_close(ms: pymeshlab.MeshSet, band: Band, aside: Aside) -> None:
    mesh = ms.current_mesh()
    first = mesh.vertex_number()
    torn = _scattered(mesh.face_matrix()[band.rows], aside)
    _hand_gaps(aside, torn)
    if np.isnan(mesh.vertex_normal_matrix()).any(axis=1).sum() != torn.sum():
        return  # it would tear elsewhere too
    tear(ms)
    ms.compute_selection_by_condition_per_face(
        condselect=f"vi0 >= {first} || vi1 >= {first} || vi2 >= {first}"
    )
    ms.meshing_close_holes(maxholesize=mesh.vertex_number(), selected=True, newfaceselected=False)
    _tear_at(ms, aside, np.ones(len(aside.ids), dtype=np.bool_))


def _tear_at(ms: pymeshlab.MeshSet, aside: Aside, torn: BoolArray) -> None:
    """Give each corner at some vertices aside (k,) a vertex of its own."""
    _hand_gaps(aside, torn)
    tear(ms)


def _hand_gaps(aside: Aside, torn: BoolArray) -> None:
    """Give some vertices aside (k,) a normal that is no number."""
    aside.hand(np.where(torn[:, None], np.nan, np.zeros((1, 3))))


def tear(ms: pymeshlab.MeshSet) -> None:
    """Give each corner a vertex of its own where the normal is no number."""
    colour = "Vertex" if ms.current_mesh().has_vertex_color() else "None"
    ms.meshing_vertex_attribute_seam(normalmode="Vertex", colormode=colour, texcoordmode="None")


def _scattered(faces: IntArray, aside: Aside) -> BoolArray:
    """Mark vertices aside by lot: none on a border, none beside another or one not aside."""
    ids, corners = np.unique(faces, return_inverse=True)
    edges = edges_of(corners.reshape(-1, 3))
    lot = np.random.default_rng(0).permutation(len(ids))
    lot[~np.isin(ids, aside.ids)] = -1
    least = np.full(len(ids), len(ids))
    tails, heads = edges.vertices.T
    np.minimum.at(least, tails, lot[heads])
    np.minimum.at(least, heads, lot[tails])
    least[edges.vertices[edges.face_count == 1]] = -1
    return np.asarray(np.isin(aside.ids, ids[lot < least]))


def _has(reader: Callable[..., object], *arguments: str) -> bool:
    try:
        with quiet(1):
            reader(*arguments)
    except (pymeshlab.MissingComponentException, pymeshlab.PyMeshLabException):
        return False
    return True


def _separable(kept: IntArray, band: Band) -> bool:
    """Whether the faces of the band can be given their old corners back, each on its own."""
    new = kept >= band.vertex_count
    own = kept[new]
    return len(np.unique(own)) == len(own) and bool((new | (kept == band.corners)).all())


def _pick(
    kept: IntArray, new: IntArray, growth: Growth, first: int, textures: IntArray | None
) -> Brood:
    """Pick as many of the new faces as are wanted, if there are so many.

    Spare vertices come before those of picked faces: a merged vertex has the row of its first one.
    """
    count = len(growth.new_faces)
    free = np.zeros(1 + int(new.max()), dtype=np.bool_)
    free[first:] = True
    free[kept[kept < len(free)]] = False
    candidates = _disjoint(new, np.flatnonzero(~faces_at(~free, new)), first)
    if textures is None and len(candidates) >= count + growth.new_vertex_count:
        donors, rows = np.split(candidates[: growth.new_vertex_count + count], [-count])
        spare = np.sort(new[donors, 0])  # the rest of their faces collapses
        if spare.max(initial=0) < new[rows].min():
            return Brood(kept, spare, new[rows], np.arange(count), np.delete(new, rows, axis=0))
    spare = np.flatnonzero(free)[: growth.new_vertex_count]
    free[spare] = False
    candidates = _disjoint(new, np.flatnonzero(~faces_at(~free, new)), first)
    if textures is None:
        rows = candidates[:count]
        order = np.arange(len(rows))
    else:
        available = textures[len(textures) - len(new) :][candidates]
        picked, wanted = [], []
        for texture in np.unique(growth.textures):
            alike = np.flatnonzero(growth.textures == texture)
            picked.append(candidates[available == texture][: len(alike)])
            wanted.append(alike[: len(picked[-1])])
        rows, order = np.concatenate(picked), np.concatenate(wanted)
        order, rows = order[np.argsort(rows)], np.sort(rows)
    return Brood(kept, spare, new[rows], order, np.delete(new, rows, axis=0))


def _disjoint(corners: IntArray, candidates: IntArray, first_vertex: int) -> IntArray:
    """Choose many faces without shared vertices: those that win at all three corners, by lot."""
    total = len(candidates)
    lot = np.random.default_rng(0).permutation(total)
    chosen = []
    while len(candidates):
        mine = corners[candidates] - first_vertex
        best = np.full(int(mine.max()) + 1, total)
        np.minimum.at(best, mine.ravel(), np.repeat(lot, 3))
        winner = (best[mine] == lot[:, None]).all(axis=1)
        chosen.append(candidates[winner])
        used = np.zeros(len(best), dtype=np.bool_)
        used[mine[winner]] = True
        left = ~used[mine].any(axis=1)
        candidates, lot = candidates[left], lot[left]
    return np.sort(np.concatenate(chosen)) if chosen else candidates
