"""All that can be read of a MeshSet, to compare it before and after."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.filters.native_calls import METHODS
from meshlab_lowrank.filters.reading import INPAINT_ERROR, INPAINT_TRUST, INPAINTED

MARKS = (INPAINTED, INPAINT_TRUST, INPAINT_ERROR)
NAMES = ("Depth", "layer_2", "direction", *MARKS)

Snapshot = dict[str, Any]


def snapshot(ms: pymeshlab.MeshSet, *, script: Path) -> Snapshot:
    """Give all that can be read of a MeshSet."""
    METHODS["save_filter_script"](ms, str(script))
    found: Snapshot = {
        "current": ms.current_mesh_id(),
        "script": script.read_text(encoding="utf-8"),
    }
    for number in (i for i in range(ms.mesh_number() + 5) if ms.mesh_id_exists(i)):
        mesh = ms.mesh(number)
        mesh.compact()
        found[f"{number} layer"] = (mesh.label(), mesh.is_visible())
        found[f"{number} transform"] = mesh.transform_matrix()
        for name, read in readers(mesh).items():
            found[f"{number} {name}"] = read()
    return found


def readers(mesh: pymeshlab.Mesh) -> dict[str, Callable[[], Any]]:
    found: dict[str, Callable[[], Any]] = {
        "vertices": mesh.vertex_matrix,
        "faces": mesh.face_matrix,
        "selected vertices": mesh.vertex_selection_array,
        "selected faces": mesh.face_selection_array,
        "vertex normals": mesh.vertex_normal_matrix,
    }
    if mesh.has_vertex_color():
        found["vertex colours"] = mesh.vertex_color_matrix
    if mesh.has_face_color():
        found["face colours"] = mesh.face_color_matrix
    if mesh.has_vertex_scalar():
        found["vertex quality"] = mesh.vertex_scalar_array
    if mesh.has_face_scalar():
        found["face quality"] = mesh.face_scalar_array
    if mesh.has_vertex_tex_coord():
        found["vertex texture"] = mesh.vertex_tex_coord_matrix
    if mesh.has_wedge_tex_coord():
        found["wedge texture"] = mesh.wedge_tex_coord_matrix
    for name in NAMES:
        for kind, read in (
            ("vertex", mesh.vertex_custom_scalar_attribute_array),
            ("vertex", mesh.vertex_custom_point_attribute_matrix),
            ("face", mesh.face_custom_scalar_attribute_array),
        ):
            try:
                read(name)
            except pymeshlab.PyMeshLabException:
                continue
            found[f"{kind} {name}"] = lambda read=read, name=name: read(name)
    return found


def differing(before: Snapshot, after: Snapshot, *, exempt: Callable[[str], bool]) -> list[str]:
    """Give the names of what is not the same, or not in both."""
    names = sorted(name for name in {*before, *after} if not exempt(name))
    return [
        name
        for name in names
        if name not in before or name not in after or not same(before[name], after[name])
    ]


def same(one: Any, other: Any) -> bool:
    if not isinstance(one, np.ndarray):
        return bool(one == other)
    return one.shape == other.shape and one.tobytes() == other.tobytes()
