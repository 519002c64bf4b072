"""The fills of loops while MeshLab works on them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import edges_of, vertex_components
from meshlab_lowrank.stages.stage1a_close_remesher import remesh

_TARGET_FACTOR = 0.98  # the remesher's target over the edge that its mean triangle area implies
_NOISE = 1e-6
_APART = 4.0  # extents of the largest rim from one fill to the next


@dataclass(frozen=True)
class Fills:
    """Faces within some loops; the k vertices of the loops come first.

    MeshLab sees them together with a strip of faces around each loop, made for the purpose, so
    that neither pinched vertices nor other holes nearby mislead it, and so that the edges of the
    loops are not the border of its mesh. Each fill has a unit of length of its own and a place far
    from the others, as MeshLab projects to what is nearest.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    part : (n,) int64
        Number of the fill of each vertex.
    strip : (k, 3) float64
        Outer vertices of the strips.
    following : (k,) int64
        The vertex that comes next on the loop.
    places : (p, 3) float64
    units : (p,) float64
        Lengths of the mesh: its coordinates are ``(vertices - places) * units``.
    """

    vertices: FloatArray
    faces: IntArray
    part: IntArray
    strip: FloatArray
    following: IntArray
    places: FloatArray
    units: FloatArray

    def local(self) -> FloatArray:
        """Give the vertices (n, 3) in the units of the regions."""
        return (self.vertices - self.places[self.part]) * self.units[self.part, None]

    def with_local(self, vertices: FloatArray, start: int) -> Fills:
        """Move the vertices from one on to coordinates in the units of the regions."""
        part = self.part[start:]
        moved = vertices / self.units[part, None] + self.places[part]
        return replace(self, vertices=np.concatenate([self.vertices[:start], moved]))

    def in_units(self, units: FloatArray) -> Fills:
        """Scale each fill, so that a length of (p,) becomes 1."""
        ratio = self.units / units
        grown = []
        for points, part in (
            (self.vertices, self.part),
            (self.strip, self.part[: len(self.strip)]),
        ):
            places = self.places[part]
            grown.append((points - places) * ratio[part, None] + places)
        return replace(self, vertices=grown[0], strip=grown[1], units=units)

    def mesh_set(self, marks: dict[str, FloatArray]) -> pymeshlab.MeshSet:
        """Give MeshLab fills and strips with face marks; ``loop`` numbers kept vertices from 1."""
        k, n = len(self.strip), len(self.vertices)
        tail, head = np.arange(k), self.following
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

    def taken_from(self, mesh_set: pymeshlab.MeshSet) -> Fills:
        """Read the fills back, the loops where they were."""
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
        label = vertex_components(faces, k + len(added))
        part_of = np.full(len(label), -1)
        part_of[label[:k]] = self.part[:k]
        return replace(
            self,
            vertices=np.concatenate([outer[:k], positions[added]]),
            faces=faces,
            part=part_of[label],
        )

    def fit(self) -> BoolArray:
        """Whether each is a manifold disc with its loop, run through backwards, as its border.

        Returns
        -------
        (p,) bool
        """
        k, n, count = len(self.strip), len(self.vertices), len(self.places)
        if self.part.min() < 0:
            return np.zeros(count, dtype=np.bool_)
        edges = edges_of(self.faces)
        heads = np.roll(self.faces, -1, axis=1)
        directed = (self.faces * n + heads).ravel()
        loop = np.arange(k) * n + self.following
        border = directed[(edges.face_count == 1)[edges.face_edges].ravel()]
        wrong = np.concatenate([np.setxor1d(border, loop), repeated(directed)]) // n
        edge_part = self.part[edges.vertices[:, 0]]
        euler = np.bincount(self.part, minlength=count)
        euler = euler - np.bincount(edge_part, minlength=count)
        euler = euler + np.bincount(self.part[self.faces[:, 0]], minlength=count)
        fit = np.asarray(euler == 1)
        fit[self.part[wrong]] = False
        fit[edge_part[edges.face_count > 2]] = False
        return fit


def repeated(values: IntArray) -> IntArray:
    """Values (n,) that come more than once."""
    ordered = np.sort(values)
    return np.asarray(ordered[1:][ordered[1:] == ordered[:-1]])


def empty_fills(
    corners: FloatArray, strip: FloatArray, part: IntArray, following: IntArray, units: FloatArray
) -> Fills:
    """Begin with loops without faces.

    Parameters
    ----------
    corners, strip : (k, 3) float64
        Vertices of the loops and outer vertices of the strips, in the units of the regions.
    part, following : (k,) int64
        See `Fills`.
    units : (p,) float64
    """
    count = len(units)
    both = np.concatenate([corners, strip]) / np.tile(units[part], 2)[:, None]
    extent = float(np.abs(both).max())
    side = int(np.ceil(np.cbrt(count)))
    cells = np.stack(np.unravel_index(np.arange(count), (side, side, side)), axis=1)
    places = np.asarray(2.0 * _APART * extent * cells, dtype=np.float64)
    both += places[np.tile(part, 2)]
    k = len(corners)
    faces = np.zeros((0, 3), dtype=np.int64)
    return Fills(both[:k], faces, part, both[k:], following, places, units)


def closed(fills: Fills, *, avoid_crossings: bool) -> Fills:
    """Let MeshLab close the loops of fills without faces."""
    k = len(fills.strip)
    mesh_set = fills.mesh_set({})
    mesh_set.compute_selection_by_condition_per_face(condselect=f"fi < {k}")
    mesh_set.meshing_close_holes(
        maxholesize=k + 1,
        selected=True,
        newfaceselected=True,
        selfintersection=avoid_crossings,
        refinehole=False,
        refineholeedgelen=pymeshlab.PercentageValue(3),
    )
    return fills.taken_from(mesh_set)


def remeshed(
    fills: Fills, chosen: BoolArray, length: float, rounds: int, *, project: bool
) -> Fills:
    """Let MeshLab give some faces (m,) triangles of one edge length.

    Raises
    ------
    StageError
        If it tears a fill.
    """
    mesh_set = fills.mesh_set({"chosen": chosen.astype(np.float64)})
    mesh_set.compute_selection_by_condition_per_face(condselect="chosen > 0.5")
    remesh(mesh_set, length * _TARGET_FACTOR, rounds, selectedonly=True, reprojectflag=project)
    result = fills.taken_from(mesh_set)
    if not result.fit().all():
        msg = f"MeshLab tore the fill of this loop of {len(fills.strip)} edges."
        raise StageError(msg)
    return result
