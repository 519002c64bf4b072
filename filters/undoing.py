"""Bring the current mesh back to what it was before a filter began to write into it.

There is no way to put a copy in its place, see `growing`. So what a filter may have changed when
something is raised is changed back: new elements are removed or merged with the old ones, and
values return by row, as `place` moves all vertices by theirs.
"""

from __future__ import annotations

import contextlib
import math
import zlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.filters.breeding import Band, tear
from meshlab_lowrank.filters.filter_script import unrecorded
from meshlab_lowrank.filters.placing import CARRIED, carry, place
from meshlab_lowrank.filters.reading import CustomAttributes, has_vertex_attribute
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh_files import INPAINT_ERROR, INPAINT_TRUST, INPAINTED

_MEASURED = {INPAINT_TRUST: "1", INPAINT_ERROR: "0"}  # what marks say where nothing is invented


class Undo:
    """What the current mesh was.

    Its normals are computed anew. What can't be taken away again are the marks of new elements,
    which then say of all that it is measured, and texture coordinates of vertices where MeshLab
    switched them on.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact.
    names : CustomAttributes or None
        Of the mesh. None: only positions and the selection of vertices are going to change.

    Attributes
    ----------
    names : CustomAttributes
        Those that it has now: a selection of some faces is kept in their mark.
    """

    def __init__(self, ms: pymeshlab.MeshSet, names: CustomAttributes | None) -> None:
        mesh = ms.current_mesh()
        self._ms, self._mesh, self._moving = ms, mesh, names is None
        self.names = names or CustomAttributes()
        self._layers, self._transform = _layers(ms), mesh.transform_matrix()
        self._n, self._m = mesh.vertex_number(), mesh.face_number()
        self._print = self._fingerprint()
        self._quality = mesh.vertex_scalar_array() if mesh.has_vertex_scalar() else None
        self._texture = mesh.vertex_tex_coord_matrix() if mesh.has_vertex_tex_coord() else None
        self._marks = {
            name: mesh.vertex_custom_scalar_attribute_array(name)
            for name in _MEASURED
            if name in self.names.vertex_scalars
        }
        self._selected_vertices = mesh.vertex_selection_array()
        self._all_faces = mesh.selected_face_number() == self._m
        self._offset = 0.0
        if 0 < mesh.selected_face_number() < self._m and not self._moving:
            self._mark_selected()
        self._ids, self._positions = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self._band: Band | None = None
        self._everywhere: FloatArray | None = None

    def remember(self, ids: IntArray, positions: FloatArray, band: Band | None) -> None:
        """Keep what is about to change: positions (k, 3) of some vertices, and faces."""
        self._ids, self._positions, self._band = ids, positions, band

    @contextlib.contextmanager
    def moving_all(self, positions: FloatArray) -> Iterator[None]:
        """Keep where all vertices are, (n + v, 3), while all are elsewhere for a while."""
        self._everywhere = positions
        yield
        self._everywhere = None

    def holds(self) -> bool:
        """Whether the vertices and faces that there were are there, the same to the last bit."""
        return self._fingerprint() == self._print

    def drop(self) -> None:
        """Take the selection out of the marks, as it is not needed any more."""
        if self._offset:
            kept = f"({INPAINTED} > {0.5 * self._offset!r} ? {INPAINTED} - {self._offset!r} : "
            self._ms.compute_new_custom_scalar_attribute_per_face(
                name=INPAINTED, expr=f"{kept}{INPAINTED})"
            )
            self._offset = 0.0

    def __call__(self) -> None:
        """Change back what was changed.

        Raises
        ------
        LowrankError
            If that fails.
        """
        ms, mesh = self._ms, self._mesh
        for added in _layers(ms) - self._layers:
            ms.set_current_mesh(added)
            ms.delete_current_mesh()
        ms.set_current_mesh(mesh.id())
        ms.set_matrix(transformmatrix=np.eye(4), freeze=False)
        mesh.compact()
        if mesh.face_number() > self._m:
            ms.compute_selection_by_condition_per_face(condselect=f"fi >= {self._m}")
            ms.meshing_remove_selected_faces()
        positions = mesh.vertex_matrix() if self._everywhere is None else self._everywhere
        positions = positions[: self._n].copy()
        positions[self._ids] = self._positions
        if mesh.vertex_number() > self._n:
            self._merge()
        self._restore_values()
        place(ms, positions)
        if not self._moving:
            self._restore_faces()
        ms.set_matrix(transformmatrix=self._transform, freeze=False)
        if not self.holds():
            msg = "What was written into the mesh could not be taken back; load the mesh again."
            raise LowrankError(msg)

    def _mark_selected(self) -> None:
        old, largest = "0", 0.0
        if INPAINTED in self.names.face_scalars:
            values = np.abs(self._mesh.face_custom_scalar_attribute_array(INPAINTED))
            old, largest = INPAINTED, float(values.max())
        self._offset = 4.0 * 2.0 ** math.ceil(math.log2(1.0 + largest))
        self._ms.compute_new_custom_scalar_attribute_per_face(
            name=INPAINTED, expr=f"{old} + (fsel ? {self._offset!r} : 0)"
        )
        faces = dict.fromkeys((*self.names.face_scalars, INPAINTED))
        self.names = replace(self.names, face_scalars=tuple(faces))

    def _merge(self) -> None:
        """Merge new vertices with the old ones whose corners they took, or with any."""
        ms, mesh, band = self._ms, self._mesh, self._band
        if band is not None:
            # one may have come to be the corner of several old faces
            ms.compute_normal_by_function_per_vertex(
                x=f"vi >= {self._n} ? sqrt(-1) : 0", y="0", z="0", onselected=False
            )
            tear(ms)
        target = np.zeros((mesh.vertex_number(), 3))
        target[: self._n, 0] = np.arange(self._n)
        if band is not None:
            corners = mesh.face_matrix()[band.rows].astype(np.int64)
            taken = corners >= self._n
            if band.wedges is not None:
                target[corners[taken], 1:] = band.wedges[taken]
                place(ms, target)
                ms.compute_texcoord_by_function_per_wedge(
                    **{f"u{i}": f"vi{i} >= {self._n} ? y{i} : wtu{i}" for i in range(3)},
                    **{f"v{i}": f"vi{i} >= {self._n} ? z{i} : wtv{i}" for i in range(3)},
                    onselected=False,
                )
                target[:, 1:] = 0.0
            target[corners[taken], 0] = band.corners[taken]
        place(ms, target)
        ms.meshing_remove_duplicate_vertices()

    def _restore_values(self) -> None:
        """Give vertices their quality, texture coordinates, marks and selection."""
        ms, mesh = self._ms, self._mesh
        if self._quality is not None and not _same(mesh.vertex_scalar_array(), self._quality):
            carry(ms, self._quality)
            ms.compute_scalar_by_function_per_vertex(
                q=CARRIED, normalize=False, map=False, onselected=False
            )
        if self._texture is not None and not _same(mesh.vertex_tex_coord_matrix(), self._texture):
            for axis, values in zip("uv", self._texture.T, strict=True):
                carry(ms, values)
                kept = {"u": "vtu", "v": "vtv"} | {axis: CARRIED}
                ms.compute_texcoord_by_function_per_vertex(**kept, onselected=False)
        for name, measured in _MEASURED.items():
            if name in self._marks:
                carry(ms, self._marks[name])
                ms.compute_new_custom_scalar_attribute_per_vertex(name=name, expr=CARRIED)
            elif has_vertex_attribute(mesh, name) and not self._moving:
                ms.compute_new_custom_scalar_attribute_per_vertex(name=name, expr=measured)
        carry(ms, self._selected_vertices.astype(np.float64))
        ms.compute_selection_by_condition_per_vertex(condselect="x > 0.5")

    def _restore_faces(self) -> None:
        """Select the faces that were selected, and give them their marks."""
        if self._offset:
            self._ms.compute_selection_by_condition_per_face(
                condselect=f"{INPAINTED} > {0.5 * self._offset!r}"
            )
            self.drop()
        elif self._all_faces:
            self._ms.set_selection_all(allfaces=True, allverts=False)
        else:
            self._ms.set_selection_none(allfaces=True, allverts=False)

    def _fingerprint(self) -> int:
        """Checksum of the vertices and faces that there were."""
        total = 1
        for matrix, count in (
            (self._mesh.vertex_matrix(), self._n),
            (self._mesh.face_matrix(), self._m),
        ):
            for column in matrix.T:
                total = zlib.adler32(np.ascontiguousarray(column[:count]).data, total)
        return total


@contextlib.contextmanager
def undone_on_error(ms: pymeshlab.MeshSet, names: CustomAttributes | None) -> Iterator[Undo]:
    """Leave the current mesh as it was if anything is raised; see `Undo`."""
    with unrecorded(ms):
        undo = Undo(ms, names)
    try:
        yield undo
        with unrecorded(ms):
            undo.drop()
    except BaseException:
        with unrecorded(ms):
            undo()
        raise


def _layers(ms: pymeshlab.MeshSet) -> set[int]:
    return {mesh.id() for mesh in ms}


def _same(one: FloatArray, other: FloatArray) -> bool:
    return one.tobytes() == other.tobytes()
