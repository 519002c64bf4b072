"""Read the current mesh of a MeshSet, and refuse it where a filter can't work on it."""

from __future__ import annotations

import itertools
import logging
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pymeshlab

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh_files import INPAINT_ERROR, INPAINT_TRUST, INPAINTED
from meshlab_lowrank.plain_text import plain

_LOGGER = logging.getLogger(__name__)
_MOST_WORDS = 4
_VERTEX_VARIABLES = re.compile(r"n?[xyz]|[rgbaq]|vi|vt[uv]|ti|vsel")
_FACE_VARIABLES = re.compile(r"f[irgbaq]|fn[xyz]|fsel|ti|(n?[xyz]|[rgbaq]|vi|wt[uv]|vsel)[012]")


def current_mesh(ms: pymeshlab.MeshSet, filter_name: str) -> pymeshlab.Mesh:
    """Give the current mesh if it has faces.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    filter_name : str
        For the message.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If there is no mesh, or it has no faces.
    """
    if ms.mesh_number() == 0:
        msg = f"Filter {filter_name} requires at least one mesh loaded."
        raise pymeshlab.PyMeshLabException(msg)
    mesh = ms.current_mesh()
    if mesh.is_point_cloud():
        msg = f"Filter {filter_name} requires faces, but the current mesh is a point cloud."
        raise pymeshlab.PyMeshLabException(msg)
    return mesh


def mesh_arrays(mesh: pymeshlab.Mesh) -> tuple[FloatArray, IntArray]:
    """Read the vertices (n, 3) float64 and faces (m, 3) int64 of a compact mesh."""
    return (
        np.ascontiguousarray(mesh.vertex_matrix(), dtype=np.float64),
        np.ascontiguousarray(mesh.face_matrix(), dtype=np.int64),
    )


def compact_copy(mesh: pymeshlab.Mesh) -> pymeshlab.MeshSet:
    """Copy a mesh with deleted elements into a MeshSet of its own, without them."""
    scratch = pymeshlab.MeshSet()
    scratch.add_mesh(mesh)
    scratch.current_mesh().compact()
    return scratch


def texture_indices(ms: pymeshlab.MeshSet) -> IntArray | None:
    """Read the texture index of each face, by selecting them; the selection is lost.

    Parameters
    ----------
    ms : pymeshlab.MeshSet

    Returns
    -------
    (m,) int64 or None
        None where no texture or a single one serves all faces; -1 for faces without.
    """
    mesh = ms.current_mesh()
    if not mesh.has_wedge_tex_coord() or mesh.texture_number() < 2:
        return None
    indices = np.full(mesh.face_number(), -1)
    for texture in range(mesh.texture_number()):
        ms.compute_selection_by_condition_per_face(condselect=f"ti == {texture}")
        indices[mesh.face_selection_array()] = texture
    return indices


def wedge_coordinates(mesh: pymeshlab.Mesh) -> FloatArray | None:
    """Read the texture coordinates (m, 3, 2) of the face corners, None if there are none."""
    if not mesh.has_wedge_tex_coord():
        return None
    coordinates: FloatArray = mesh.wedge_tex_coord_matrix().reshape(-1, 3, 2)
    return coordinates


@dataclass(frozen=True)
class CustomAttributes:
    """Names of the custom attributes of a mesh."""

    vertex_scalars: tuple[str, ...] = ()
    vertex_points: tuple[str, ...] = ()
    face_scalars: tuple[str, ...] = ()
    face_points: tuple[str, ...] = ()


def custom_attributes(ms: pymeshlab.MeshSet, filter_name: str) -> CustomAttributes:
    """List the custom attributes of the current mesh.

    The only list that there is are the parameters of the PLY writer, which has a switch for each
    attribute, in lower case. Attributes whose true name isn't found again are left out.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact; its selection is kept.
    filter_name : str
        For the message.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If an attribute has a name that MeshLab's filters by function choke on, or that hides a
        variable of theirs, or if the mesh was made from lists of polygons.

    Notes
    -----
    MeshLab's attributes hold a reference to the list of elements that they belong to, which is
    left dangling where a mesh is copied or moved: by `MeshSet.add_mesh`, and in the making of a
    mesh from polygons. Filters by function then read freed memory, often with a crash. A mesh
    that was copied together with its attributes can't be told from others.
    """
    switches = [name for name in ms.filter_parameter_values("ply") if name.startswith("__ca_")]
    if "__ca_fs__poly_birth_faces" in switches:
        msg = (
            f"Filter {filter_name} can't work on a mesh made from lists of polygons, on which "
            "MeshLab's functions read freed memory; save it to a file and load that."
        )
        raise pymeshlab.PyMeshLabException(msg)
    if not switches:
        return CustomAttributes()
    try:
        ms.compute_selection_by_condition_per_vertex(condselect="vsel")
        ms.compute_selection_by_condition_per_face(condselect="fsel")
    except RuntimeError as error:
        msg = (
            f"Filter {filter_name} can't work on this mesh, since a custom attribute has a name "
            "that isn't made of letters, digits and _; name it otherwise."
        )
        raise pymeshlab.PyMeshLabException(msg) from error
    mesh = ms.current_mesh()
    readers = {
        "vs": mesh.vertex_custom_scalar_attribute_array,
        "vp": mesh.vertex_custom_point_attribute_matrix,
        "fs": mesh.face_custom_scalar_attribute_array,
        "fp": mesh.face_custom_point_attribute_matrix,
    }
    names: dict[str, list[str]] = {kind: [] for kind in readers}
    for switch in switches:
        kind, lower = switch[5:7], switch[9:]
        name = next((n for n in _spellings(lower) if _readable(readers[kind], n)), None)
        if name is None:
            _LOGGER.warning("Custom attribute %s is not extended into the fill.", plain(lower))
        elif _is_taken(kind, name):
            msg = (
                f"Filter {filter_name} can't work on this mesh, since its custom attribute {name} "
                "has the name of a variable or mark; name it otherwise."
            )
            raise pymeshlab.PyMeshLabException(msg)
        else:
            names[kind].append(name)
    return CustomAttributes(*map(tuple, names.values()))


def _is_taken(kind: str, name: str) -> bool:
    if kind[1] == "p" and name in (INPAINTED, INPAINT_TRUST, INPAINT_ERROR):
        return True
    variables = _VERTEX_VARIABLES if kind[0] == "v" else _FACE_VARIABLES
    return variables.fullmatch(name) is not None


def _spellings(lower: str) -> Iterator[str]:
    """Give the ways in which the words of a name may be capitalised."""
    words = lower.split("_")[:_MOST_WORDS]
    rest = lower.split("_")[_MOST_WORDS:]
    choices = [dict.fromkeys((word, word.capitalize(), word.upper())) for word in words]
    return ("_".join((*chosen, *rest)) for chosen in itertools.product(*choices))


def has_vertex_attribute(mesh: pymeshlab.Mesh, name: str) -> bool:
    """Whether a mesh has a custom scalar attribute of a name at its vertices."""
    return _readable(mesh.vertex_custom_scalar_attribute_array, name)


def _readable(reader: Callable[[str], object], name: str) -> bool:
    try:
        reader(name)
    except pymeshlab.PyMeshLabException:
        return False
    return True
