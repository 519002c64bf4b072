"""The meshes that a comparison is given, in whatever form."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pymeshlab

from meshlab_lowrank.comparison.task import FUNCTION, READING, current_arrays
from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.seams import seam_pairs, welded
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.mesh.validation import check_mesh
from meshlab_lowrank.mesh_files import check_readable
from meshlab_lowrank.scratch import scratch_folder

MeshSource: TypeAlias = "str | os.PathLike[str] | pymeshlab.MeshSet | tuple[Any, Any]"


def read_mesh(source: MeshSource, pool: WorkerPool) -> tuple[FloatArray, IntArray]:
    """Give the vertices and faces of a mesh, without vertices that no face uses.

    Seams are closed: vertices that are doubled along them become one.

    Parameters
    ----------
    source : path, pymeshlab.MeshSet, or (vertices, faces)
        Files are read in a process of its own, which some of them crash.
    pool : WorkerPool

    Returns
    -------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Raises
    ------
    InvalidParameterError
        If there is no such file.
    InvalidMeshError
        If the mesh can't be read or worked on.
    """
    if isinstance(source, pymeshlab.MeshSet):
        if source.mesh_number() == 0:
            msg = "The MeshSet has no mesh; load one first."
            raise InvalidMeshError(msg)
        arrays = current_arrays(source)
    elif isinstance(source, tuple):
        arrays = source
    else:
        arrays = _read_file(Path(source), pool)
    vertices, faces = check_mesh(*arrays)
    pairs = seam_pairs(vertices, faces, border_of(faces, len(vertices)).half_edges)
    return without_unused(vertices, welded(faces, len(vertices), pairs) if len(pairs) else faces)


def mesh_name(source: MeshSource) -> str:
    """Give the file name or label of a mesh."""
    if isinstance(source, pymeshlab.MeshSet):
        return str(source.current_mesh().label()) or "mesh"
    return "mesh" if isinstance(source, tuple) else Path(source).name


def without_unused(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Drop vertices that no face uses."""
    used, local = np.unique(faces, return_inverse=True)
    return np.ascontiguousarray(vertices[used]), local.reshape(-1, 3).astype(np.int64)


def _read_file(path: Path, pool: WorkerPool) -> tuple[FloatArray, IntArray]:
    check_readable(path)
    with scratch_folder() as folder:
        target = folder / "mesh.npz"
        files = {"source": str(path.absolute()), "target": str(target)}
        with pool.borrowed() as worker:
            ending = worker.run({"function": FUNCTION, "filler": READING, **files})
        if ending.report is None:
            msg = f"{path.name} can't be read: {ending.cause}"
            raise InvalidMeshError(msg)
        if ending.report["status"] != "read":
            raise InvalidMeshError(ending.report["reason"])
        with np.load(target) as arrays:
            return arrays["vertices"], arrays["faces"]
