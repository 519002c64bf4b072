"""Meshes of other libraries: read as arrays, and built again, of the same kind, from a result.

None of these libraries is imported unless a mesh of it is given.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from meshlab_lowrank.attributes import harmonic_extension
from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.result import InpaintResult

_Array = NDArray[Any]


@dataclass(frozen=True)
class MeshObject:
    """A mesh of another library.

    Attributes
    ----------
    vertices : (n, 3) array
    faces : (m, 3) array
    build : callable
        Makes the mesh of a result, with what the given one holds at its vertices and faces.
    notes : tuple of str
        What of the given mesh is not in it.
    """

    vertices: _Array
    faces: _Array
    build: Callable[[InpaintResult], Any]
    notes: tuple[str, ...] = ()

    def with_mesh(self, result: InpaintResult) -> InpaintResult:
        """Give a result with its mesh of the same kind."""
        notes = (*result.notes, *self.notes)
        return replace(result, mesh=self.build(result), notes=notes)


def mesh_object(mesh: Any) -> MeshObject:
    """Read a `trimesh.Trimesh`, a `pyvista.PolyData` or an Open3D ``TriangleMesh``.

    Raises
    ------
    InvalidMeshError
        If it is something else, or holds what is no triangle.
    """
    for kind in type(mesh).__mro__:
        name = f"{kind.__module__.partition('.')[0]}.{kind.__name__}"
        if name in _READERS:
            return _READERS[name](mesh)
    msg = (
        f"A {type(mesh).__name__} alone is no mesh; give vertices and faces, a trimesh.Trimesh, a "
        "pyvista.PolyData or a TriangleMesh of Open3D."
    )
    raise InvalidMeshError(msg)


def _from_trimesh(mesh: Any) -> MeshObject:
    trimesh = importlib.import_module("trimesh")

    def build(result: InpaintResult) -> Any:
        built = trimesh.Trimesh(
            result.vertices,
            result.faces,
            process=False,
            metadata=dict(mesh.metadata),
            vertex_attributes={
                **{n: _at_vertices(v, result) for n, v in mesh.vertex_attributes.items()},
                **_vertex_marks(result),
            },
            face_attributes={
                **{n: _at_faces(v, result) for n, v in mesh.face_attributes.items()},
                **_face_marks(result),
            },
        )
        if mesh.visual.kind == "vertex":
            built.visual.vertex_colors = _at_vertices(mesh.visual.vertex_colors, result)
        elif mesh.visual.kind == "face":
            built.visual.face_colors = _at_faces(mesh.visual.face_colors, result)
        elif mesh.visual.kind == "texture" and mesh.visual.uv is not None:
            built.visual = trimesh.visual.TextureVisuals(
                uv=_at_vertices(mesh.visual.uv, result), material=mesh.visual.material
            )
        return built

    return MeshObject(np.array(mesh.vertices), np.array(mesh.faces), build)


def _from_pyvista(mesh: Any) -> MeshObject:
    pyvista = importlib.import_module("pyvista")
    if mesh.n_verts or mesh.n_lines or mesh.n_strips:
        msg = "The PolyData holds points, lines or strips as cells; give faces only."
        raise InvalidMeshError(msg)
    if not mesh.is_all_triangles:
        mesh = mesh.triangulate()

    def build(result: InpaintResult) -> Any:
        built = pyvista.PolyData.from_regular_faces(result.vertices, result.faces)
        for own, new, extended, marks in (
            (mesh.point_data, built.point_data, _at_vertices, _vertex_marks),
            (mesh.cell_data, built.cell_data, _at_faces, _face_marks),
        ):
            for name, values in own.items():
                if name != own.active_normals_name:
                    new[name] = extended(np.asarray(values), result)
            new.update(marks(result))
        for name, values in mesh.field_data.items():
            built.field_data[name] = values
        return built

    faces = np.array(mesh.regular_faces)
    notes = ("Its normals were left out; compute them anew.",)
    normals = (mesh.point_data.active_normals_name, mesh.cell_data.active_normals_name)
    return MeshObject(np.array(mesh.points), faces, build, notes if any(normals) else ())


def _from_open3d(mesh: Any) -> MeshObject:
    open3d = importlib.import_module("open3d")
    if hasattr(mesh, "to_legacy"):
        inner = _from_open3d(mesh.to_legacy())
        tensor = open3d.t.geometry.TriangleMesh
        return replace(inner, build=lambda result: tensor.from_legacy(inner.build(result)))

    def build(result: InpaintResult) -> Any:
        vectors = open3d.utility
        built = open3d.geometry.TriangleMesh(
            vectors.Vector3dVector(result.vertices),
            vectors.Vector3iVector(result.faces.astype(np.int32)),
        )
        if mesh.has_vertex_colors():
            colours = _at_vertices(np.asarray(mesh.vertex_colors), result)
            built.vertex_colors = vectors.Vector3dVector(colours)
        if mesh.has_vertex_normals():
            built.compute_vertex_normals()
        elif mesh.has_triangle_normals():
            built.compute_triangle_normals()
        return built

    notes: tuple[str, ...] = ()
    if mesh.has_triangle_uvs():
        notes = ("Its texture coordinates were left out; fill its file in a MeshSet to keep them.",)
    return MeshObject(np.asarray(mesh.vertices), np.asarray(mesh.triangles), build, notes)


_READERS: dict[str, Callable[[Any], MeshObject]] = {
    "trimesh.Trimesh": _from_trimesh,
    "pyvista.PolyData": _from_pyvista,
    "open3d.TriangleMesh": _from_open3d,
}


def _vertex_marks(result: InpaintResult) -> dict[str, _Array]:
    return {
        "inpainted": result.new_vertices.astype(np.uint8),
        "inpaint_trust": result.trust,
        "inpaint_error": result.error,
    }


def _face_marks(result: InpaintResult) -> dict[str, _Array]:
    return {"inpainted": result.new_faces.astype(np.uint8)}


def _at_vertices(values: _Array, result: InpaintResult) -> _Array:
    """Extend values (n, ...) of the given vertices to those of the fill."""
    values = np.asarray(values)
    count, n = len(result.vertices), len(values)
    if count == n:
        return values.copy()
    fill = result.faces[(result.faces >= n).any(axis=1)]
    ids, local = np.unique(fill, return_inverse=True)
    known = ids < n
    table = np.zeros((len(ids), int(np.prod(values.shape[1:]))))
    colours = values.dtype == np.uint8
    if not colours and not np.issubdtype(values.dtype, np.floating):
        nearest = cKDTree(result.vertices[ids[known]]).query(result.vertices[n:])[1]
        return np.concatenate([values, values[ids[known]][nearest]])
    table[known] = values[ids[known]].reshape(known.sum(), -1)
    table = harmonic_extension(result.vertices[ids], local.reshape(-1, 3), known, table)
    new = (np.rint(table[~known]) if colours else table[~known]).astype(values.dtype)
    return np.concatenate([values, new.reshape(-1, *values.shape[1:])])


def _at_faces(values: _Array, result: InpaintResult) -> _Array:
    """Give each face of the fill the values (m, ...) of the given face that is nearest."""
    values = np.asarray(values)
    middles = result.vertices[result.faces].mean(axis=1)
    nearest = cKDTree(middles[: len(values)]).query(middles[len(values) :])[1]
    return np.concatenate([values, values[nearest]])
