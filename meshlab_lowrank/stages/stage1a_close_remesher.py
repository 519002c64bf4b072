"""MeshLab's isotropic remesher, called so that nothing stays behind of a call."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray

_ONE_AT_A_TIME = Lock()


def remesh(mesh_set: pymeshlab.MeshSet, length: float, rounds: int, **flags: bool) -> None:
    """Give the current mesh triangles of about one edge length; creases count for nothing.

    Parameters
    ----------
    mesh_set : MeshSet
    length : float
        MeshLab's target, in the units of the mesh.
    rounds : int
    **flags : bool
        ``selectedonly`` and ``reprojectflag``.
    """
    with _remesher_defaults():
        mesh_set.meshing_isotropic_explicit_remeshing(
            iterations=rounds,
            adaptive=False,
            targetlen=pymeshlab.PureValue(length),
            featuredeg=180.0,
            checksurfdist=False,
            maxsurfdist=pymeshlab.PercentageValue(1),
            splitflag=True,
            collapseflag=True,
            swapflag=True,
            smoothflag=True,
            **flags,
        )


def remeshed_surface(
    vertices: FloatArray, faces: IntArray, length: float, rounds: int
) -> tuple[FloatArray, IntArray]:
    """Give a whole surface triangles of about one edge length; see `remesh`.

    Raises
    ------
    StageError
        If MeshLab refuses.
    """
    mesh_set = pymeshlab.MeshSet(verbose=False)
    mesh_set.add_mesh(pymeshlab.Mesh(vertices, faces))
    try:
        remesh(mesh_set, length, rounds, selectedonly=False, reprojectflag=True)
    except pymeshlab.PyMeshLabException as error:
        msg = "MeshLab can't mesh the surroundings of this hole evenly."
        raise StageError(msg) from error
    mesh = mesh_set.current_mesh()
    mesh.compact()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


@contextmanager
def _remesher_defaults() -> Iterator[None]:
    """Keep the defaults of MeshLab's remesher, which are the values of its last call anywhere."""
    with _ONE_AT_A_TIME:
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
