"""Check that arrays are a mesh that can be worked on."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.mesh.topology import Border, border_of

_LEAST_EXTENT, _MOST_EXTENT = 1e-70, 1e70
_Number = TypeVar("_Number", np.float64, np.int64)


def check_mesh(vertices: ArrayLike, faces: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Convert a mesh to the types used throughout, and refuse what can't be worked on.

    Parameters
    ----------
    vertices : (n, 3) array of numbers
    faces : (m, 3) array of whole numbers
        Indices into the vertices, counter-clockwise seen from outside.

    Returns
    -------
    vertices : (n, 3) float64, C-contiguous
    faces : (m, 3) int64, C-contiguous
        The input itself where it has these types already.

    Raises
    ------
    InvalidMeshError
        If a shape or type is wrong, there are no faces, a coordinate is not finite, an index is
        out of range, the mesh is of the order of more than 1e70 or less than 1e-70 across, a face
        uses a vertex twice (it has no area and no orientation), an edge has more than two faces,
        or two neighbouring faces are oriented against one another. Vertices without faces,
        pinched vertices and several components are all right.
    """
    points, triangles = check_arrays(vertices, faces)
    check_manifold(border_of(triangles, len(points)))
    return points, triangles


def check_arrays(vertices: ArrayLike, faces: ArrayLike) -> tuple[FloatArray, IntArray]:
    """As `check_mesh`, but leave to the caller what faces share edges."""
    points = _checked_vertices(vertices)
    triangles = _checked_faces(faces, len(points))
    _check_extent(points, triangles)
    return points, triangles


def check_flags(values: ArrayLike, count: int, name: str) -> BoolArray:
    """Give flags (count,) of a selection; refuse another shape. The name says of what they are."""
    flags = np.asarray(values, dtype=np.bool_)
    if flags.shape != (count,):
        msg = (
            f"The selection has shape {flags.shape}; give one flag for each of the {count} {name}."
        )
        raise InvalidMeshError(msg)
    return flags


def check_manifold(border: Border) -> None:
    """Refuse edges with more than two faces and neighbours oriented against one another.

    Parameters
    ----------
    border : Border

    Raises
    ------
    InvalidMeshError
        Naming how many edges, and the MeshLab filter that repairs them.
    """
    sentence = bad_edges(border)
    if sentence:
        raise InvalidMeshError(sentence)


def bad_edges(border: Border) -> str:
    """Say what `check_manifold` refuses: a sentence, empty if there is nothing."""
    if border.non_manifold:
        return (
            f"{_counted(border.non_manifold, 'edge has', 'edges have')} more than two faces; "
            "apply meshing_repair_non_manifold_edges first."
        )
    if border.inconsistent:
        return (
            f"At {_counted(border.inconsistent, 'edge', 'edges')} two neighbouring faces are "
            "oriented against one another; apply meshing_re_orient_faces_coherently first."
        )
    return ""


def _checked_vertices(vertices: ArrayLike) -> FloatArray:
    points = _converted("vertices", vertices, np.float64, "fiu")
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        msg = (
            f"{_counted(len(bad), 'vertex has', 'vertices have')} NaN or infinite coordinates, "
            f"the first is vertex {bad[0]}; remove or correct them first."
        )
        raise InvalidMeshError(msg)
    return points


def _check_extent(points: FloatArray, triangles: IntArray) -> None:
    """Refuse sizes whose fourth powers, squared areas, can't be computed with."""
    used = np.zeros(len(points), dtype=np.bool_)
    used[triangles] = True
    halves = [0.5 * column[used].max() - 0.5 * column[used].min() for column in points.T]
    extent = float(max(halves))
    if 0.0 < extent < _LEAST_EXTENT or extent > _MOST_EXTENT:
        msg = (
            f"The mesh is about {extent:.0e} across, too {'large' if extent > 1.0 else 'small'} to "
            "compute with; apply compute_matrix_from_scaling_or_normalization first."
        )
        raise InvalidMeshError(msg)


def _checked_faces(faces: ArrayLike, n: int) -> IntArray:
    triangles = _converted("faces", faces, np.int64, "iu")
    if len(triangles) == 0:
        msg = "The mesh has no faces; give a triangle mesh, not a point cloud."
        raise InvalidMeshError(msg)
    if triangles.min() < 0 or triangles.max() >= n:
        outside = np.flatnonzero(((triangles < 0) | (triangles >= n)).any(axis=1))
        msg = (
            f"{_counted(len(outside), 'face has', 'faces have')} vertex indices outside 0 to "
            f"{n - 1}, the first is face {outside[0]} with {triangles[outside[0]].tolist()}."
        )
        raise InvalidMeshError(msg)
    a, b, c = triangles.T
    twice = np.flatnonzero((a == b) | (b == c) | (c == a))
    if len(twice):
        msg = (
            f"{_counted(len(twice), 'face uses', 'faces use')} a vertex twice, the first is face "
            f"{twice[0]}; apply meshing_remove_null_faces first."
        )
        raise InvalidMeshError(msg)
    return triangles


def _converted(name: str, values: ArrayLike, dtype: type[_Number], kinds: str) -> NDArray[_Number]:
    try:
        array = np.asarray(values)
    except ValueError as error:  # rows of different lengths
        msg = f"The {name} must be an array of shape (n, 3), not rows of different lengths."
        raise InvalidMeshError(msg) from error
    if array.size == 0:
        array = np.zeros((0, 3), dtype=dtype)
    if array.ndim != 2 or array.shape[1] != 3:
        msg = f"The {name} must be an array of shape (n, 3), not {array.shape}."
        raise InvalidMeshError(msg)
    if array.dtype.kind not in kinds:
        msg = f"The {name} must be numbers that fit {dtype.__name__}, not {array.dtype}."
        raise InvalidMeshError(msg)
    return np.ascontiguousarray(array, dtype=dtype)


def _counted(number: int, singular: str, plural: str) -> str:
    return f"{number} {singular if number == 1 else plural}"
