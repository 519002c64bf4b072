"""The fillers that are compared: MeshLab's, ours, published ones, and those of other packages.

The function of a filler finds the mesh with holes as current mesh, the faces at the boundary loops
that are to be filled selected, and leaves the filled mesh as current mesh. To add one, decorate
its function with `filler`.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.comparison.published import awang, brunton, pernot, zou
from meshlab_lowrank.comparison.published.holes import fill_each
from meshlab_lowrank.comparison.registry import FILLERS, Filler, filler, usual_fillers
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths

__all__ = ["FILLERS", "Filler", "filler", "rim_edge_length", "usual_fillers"]

_EVERY_SIZE = 10**9  # meshing_close_holes has no value for "all"


def rim_edge_length(ms: Any) -> float:
    """Mean edge length of the selected faces of the current mesh (of all if none is selected).

    Parameters
    ----------
    ms : pymeshlab.MeshSet

    Returns
    -------
    float
        In the units of the mesh.
    """
    mesh = ms.current_mesh()
    selected = np.asarray(mesh.face_selection_array(), dtype=np.bool_)
    faces = np.asarray(mesh.face_matrix(), dtype=np.int64)
    chosen = faces[selected] if selected.any() else faces
    return float(edge_lengths(mesh.vertex_matrix(), chosen).mean())


def _close(ms: Any, **refinement: Any) -> None:
    ms.meshing_close_holes(
        maxholesize=_EVERY_SIZE,
        selected=True,
        newfaceselected=True,
        selfintersection=True,
        **refinement,
    )


@filler("close", "MeshLab: close holes")
def _meshlab_close(ms: Any) -> None:
    _close(ms)


@filler("close-refine", "MeshLab: close holes with refinement to the edge length at the rim")
def _meshlab_refine(ms: Any) -> None:
    length = pymeshlab.PureValue(rim_edge_length(ms))
    _close(ms, refinehole=True, refineholeedgelen=length)


@filler("close-remesh-smooth", "MeshLab: close holes, remesh the fill, 10 Laplacian smoothings")
def _meshlab_remesh(ms: Any) -> None:
    length = pymeshlab.PureValue(rim_edge_length(ms))
    _close(ms)
    ms.meshing_isotropic_explicit_remeshing(
        iterations=10, selectedonly=True, targetlen=length, checksurfdist=False
    )
    ms.compute_selection_transfer_face_to_vertex(inclusive=True)
    ms.apply_coord_laplacian_smoothing(
        stepsmoothnum=10, boundary=False, cotangentweight=False, selected=True
    )


@filler("poisson", "MeshLab: screened Poisson reconstruction, cells of about the edge length")
def _meshlab_poisson(ms: Any) -> None:
    box = ms.current_mesh().bounding_box()
    cells = 1.1 * max(box.dim_x(), box.dim_y(), box.dim_z()) / rim_edge_length(ms)
    depth = int(np.clip(round(np.log2(cells)), 5, 10))
    ms.generate_surface_reconstruction_screened_poisson(depth=depth, preclean=True)


def _inpaint(ms: Any, **parameters: Any) -> None:
    importlib.import_module("meshlab_lowrank")  # binds the filter
    ms.meshing_inpaint_lowrank(selected=True, closerim=True, **parameters)


@filler("lowrank", "ours: preset auto, detail calibrated by fake holes")
def _lowrank(ms: Any) -> None:
    _inpaint(ms, preset="auto", detail="calibrated")


@filler("lowrank-full", "ours: preset auto, detail at full strength")
def _lowrank_full(ms: Any) -> None:
    _inpaint(ms, preset="auto", detail="full")


@filler("lowrank-none", "ours: preset auto without detail")
def _lowrank_none(ms: Any) -> None:
    _inpaint(ms, preset="auto", detail="none")


@filler("paper", "ours: preset paper, stages 2 to 6 as published")
def _paper(ms: Any) -> None:
    _inpaint(ms, preset="paper")


@filler("base", "ours: the faired base of preset paper, no detail")
def _base(ms: Any) -> None:
    _inpaint(ms, preset="paper", detail="none")


@filler(
    "paper-bspline", "ours: preset paper on the B-spline surface of its stage 1", named_only=True
)
def _paper_bspline(ms: Any) -> None:
    _inpaint(ms, preset="paper", base="bspline")


@filler(
    "bspline",
    "circular B-spline surface along the tangents at the rim, written from the paper's section 3.2",
    named_only=True,
)
def _bspline(ms: Any) -> None:
    _inpaint(ms, preset="paper", base="bspline", detail="none", continuity="smooth")


@filler(
    "zou",
    "Zou and others 2013, written from the published idea: triangulation of least area, two loops "
    "together",
    named_only=True,
)
def _zou(ms: Any) -> None:
    zou.fill(ms)


@filler(
    "awang",
    "Awang and others 2018, written from the published idea: advancing front",
    named_only=True,
)
def _awang(ms: Any) -> None:
    fill_each(ms, awang.fill)


@filler(
    "brunton",
    "Brunton and others 2009, written from the published idea: unfolded rim, least bending",
    named_only=True,
)
def _brunton(ms: Any) -> None:
    fill_each(ms, brunton.fill)


@filler(
    "pernot",
    "Pernot and others 2006, written from the published idea: least variation of curvature",
    named_only=True,
)
def _pernot(ms: Any) -> None:
    fill_each(ms, pernot.fill)


def _arrays(ms: Any) -> tuple[FloatArray, IntArray]:
    mesh = ms.current_mesh()
    return mesh.vertex_matrix(), np.asarray(mesh.face_matrix(), dtype=np.int64)


def _add(ms: Any, vertices: Any, faces: Any) -> None:
    ms.add_mesh(pymeshlab.Mesh(np.asarray(vertices, dtype=float), np.asarray(faces)))


@filler("meshfix", "MeshFix (pymeshfix): fill small boundaries with refinement", "pymeshfix")
def _meshfix(ms: Any) -> None:
    vertices, faces = _arrays(ms)
    fixer = importlib.import_module("pymeshfix").PyTMesh()
    fixer.set_quiet(True)
    fixer.load_array(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int32))
    fixer.fill_small_boundaries(0, True)
    _add(ms, *fixer.return_arrays())


@filler("cgal", "CGAL: triangulate, refine and fair", "CGAL")
def _cgal(ms: Any) -> None:
    kernel = importlib.import_module("CGAL.CGAL_Kernel")
    polyhedra = importlib.import_module("CGAL.CGAL_Polyhedron_3")
    processing = importlib.import_module("CGAL.CGAL_Polygon_mesh_processing")
    vertices, faces = _arrays(ms)
    wanted = np.asarray(ms.current_mesh().face_selection_array(), dtype=np.bool_)
    builder = polyhedra.Polyhedron_modifier()
    builder.begin_surface(len(vertices), len(faces))
    for point in vertices.tolist():
        builder.add_vertex(kernel.Point_3(*point))
    for face in faces.tolist():
        builder.begin_facet()
        for corner in face:
            builder.add_vertex_to_facet(corner)
        builder.end_facet()
    builder.end_surface()
    surface = polyhedra.Polyhedron_3()
    surface.delegate(builder)
    for items in (surface.vertices(), surface.facets()):
        for number, item in enumerate(items):
            item.set_id(number)

    new_points: list[list[float]] = []
    new_faces: list[list[int]] = []
    for halfedge in [edge for edge in surface.halfedges() if edge.is_border()]:
        if not halfedge.is_border() or not wanted[halfedge.opposite().facet().id()]:
            continue
        added_facets: list[Any] = []
        added_vertices: list[Any] = []
        processing.triangulate_refine_and_fair_hole(surface, halfedge, added_facets, added_vertices)
        for vertex in added_vertices:
            vertex.set_id(len(vertices) + len(new_points))
            point = vertex.point()
            new_points.append([point.x(), point.y(), point.z()])
        for facet in added_facets:
            first = facet.halfedge()
            corners = (first, first.next(), first.next().next())
            new_faces.append([corner.vertex().id() for corner in corners])
    _add(
        ms,
        np.concatenate([vertices, np.reshape(new_points, (-1, 3))]),
        np.concatenate([faces, np.reshape(new_faces, (-1, 3)).astype(np.int64)]),
    )


@filler("vtk", "VTK (PyVista): fill holes, loops triangulated by ear cutting", "pyvista")
def _vtk(ms: Any) -> None:
    surface = importlib.import_module("pyvista").PolyData.from_regular_faces(*_arrays(ms))
    filled = surface.fill_holes(surface.length)
    _add(ms, filled.points, filled.regular_faces)


@filler("open3d", "Open3D: fill holes of a tensor mesh", "open3d")
def _open3d(ms: Any) -> None:
    open3d = importlib.import_module("open3d")
    vertices, faces = (open3d.core.Tensor(np.ascontiguousarray(a)) for a in _arrays(ms))
    surface = open3d.t.geometry.TriangleMesh(vertices, faces)
    diagonal = ms.current_mesh().bounding_box().diagonal()
    filled = surface.fill_holes(hole_size=diagonal)
    _add(ms, filled.vertex.positions.numpy(), filled.triangle.indices.numpy())


@filler("trimesh", "trimesh: fill holes with fans", "trimesh", "networkx")
def _trimesh(ms: Any) -> None:
    trimesh = importlib.import_module("trimesh")
    surface = trimesh.Trimesh(*_arrays(ms), process=False)
    trimesh.repair.fill_holes(surface, use_fan=True)
    _add(ms, surface.vertices, surface.faces)
