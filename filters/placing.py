"""Set vertex positions of the current mesh, in place and to the last bit."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator

import numpy as np
import pymeshlab

from meshlab_lowrank.mesh.geometry import FloatArray

_COINCIDENT = 1e-30
CARRIED = "(y > 2.5 ? -1 / 0 : (y > 1.5 ? 1 / 0 : (y > 0.5 ? 0 / 0 : x)))"  # see carry
CARRIED_NOT_FINITE = "y > 0.5"
_LEAST_EXTENT = 1e-9  # of a box, in its distance from the origin
_BESIDE = 0.25  # vertices set aside are 1 apart


class Aside:
    """The selected vertices of the current mesh, set aside: each lies at (x, its index, 0).

    No filter takes values for single vertices, but one hands on the normals of another layer to
    the vertices that lie nearest, so these must lie apart. Functions can read normals, and filters
    leave them alone until positions change. What is done costs little for all other vertices.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact, has selected vertices, and its layer has no transform.

    Attributes
    ----------
    ids : (k,) int64
        Indices of the vertices, ascending.
    start : float
        Their x, beyond all other vertices.
    """

    def __init__(self, ms: pymeshlab.MeshSet) -> None:
        vertices = ms.current_mesh().vertex_matrix()
        largest = max(float(vertices.max()), -float(vertices.min()))
        self._ms = ms
        # all others lie at less than half of it, so not beside any of these
        self.start = max(math.ldexp(1.0, math.frexp(largest)[1] + 1), 8.0 * _BESIDE)
        self._number()

    def gather(self) -> None:
        """Take in the vertices that were made from vertices aside, and number all anew."""
        self.select()
        self._number()

    def select(self) -> None:
        """Select the vertices aside."""
        self._ms.compute_selection_by_condition_per_vertex(condselect=f"x >= {self.start!r}")

    def hand(self, values: FloatArray) -> None:
        """Give values (k, 3) to the vertices as normals."""
        places = np.zeros((len(self.ids), 3))
        places[:, 0] = self.start
        places[:, 1] = self.ids
        _transfer(self._ms, places, values, _BESIDE, normaltransfer=True)

    def move(self, values: FloatArray) -> None:
        """Move the vertices to positions (k, 3), to the last bit."""
        self.hand(values)
        self.select()
        self._ms.compute_coord_by_function(x="nx", y="ny", z="nz", onselected=True)

    def _number(self) -> None:
        self.ids = np.flatnonzero(self._ms.current_mesh().vertex_selection_array())
        self._ms.compute_coord_by_function(x=repr(self.start), y="vi", z="0", onselected=True)


def select_at(ms: pymeshlab.MeshSet, positions: FloatArray) -> None:
    """Select all vertices of the current mesh that lie at positions (k, 3), and no others."""
    ms.set_selection_none(allfaces=False, allverts=True)
    _transfer(ms, positions, np.zeros_like(positions), _COINCIDENT, selectiontransfer=True)


@contextlib.contextmanager
def untransformed(ms: pymeshlab.MeshSet) -> Iterator[None]:
    """Take the transform off the current layer for a while."""
    transform = ms.current_mesh().transform_matrix()
    ms.set_matrix(transformmatrix=np.eye(4), freeze=False)
    try:
        yield
    finally:
        ms.set_matrix(transformmatrix=transform, freeze=False)


def place(ms: pymeshlab.MeshSet, positions: FloatArray) -> None:
    """Move all vertices of the current mesh.

    MeshLab's linear morphing is the one filter that takes positions from another layer by index.
    It computes p + (t - p), which gives t itself only from p = 0, where a function brings all
    vertices, even from what is no number; it never gives -0, so those are set afterwards.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh is compact.
    positions : (n, 3) float64
        Finite, one row a vertex.
    """
    negative_zero = (positions == 0.0) & np.signbit(positions)
    limit = 1.0 + float(np.abs(positions).max())
    ms.compute_coord_by_function(x="0", y="0", z="0", onselected=False)
    target = pymeshlab.Mesh(vertex_matrix=np.where(negative_zero, 2.0 * limit, positions))
    with _layer(ms, target) as number:
        ms.compute_coord_linear_morphing(targetmesh=number, percentmorph=100.0)
    if negative_zero.any():
        ms.compute_coord_by_function(
            **{axis: f"{axis} > {limit!r} ? -0.0 : {axis}" for axis in "xyz"}, onselected=False
        )


def carry(ms: pymeshlab.MeshSet, values: FloatArray) -> None:
    """Let functions of the vertices of the current mesh read values (n,), as `CARRIED`.

    The positions are lost.
    """
    kind = np.select([np.isnan(values), values == np.inf, values == -np.inf], [1.0, 2.0, 3.0])
    finite = np.where(kind == 0.0, values, 0.0)
    place(ms, np.column_stack([finite, kind, np.zeros(len(values))]))


def _transfer(
    ms: pymeshlab.MeshSet,
    places: FloatArray,
    normals: FloatArray,
    reach: float,
    **attributes: bool,
) -> None:
    """Hand attributes of vertices to those of the current mesh that lie nearest to them.

    Sources whose box is a point, or rounds to one, would hang or mislead MeshLab, so there is one
    more then, far from all others. MeshLab sorts them into the cells of a grid on their box: with
    one far off, all others fall into a few cells, and the time grows with the square of their
    number.
    """
    names = ("geom", "normal", "color", "quality", "selection")
    switches = {f"{name}transfer": False for name in names} | attributes
    if np.ptp(places, axis=0).max() <= _LEAST_EXTENT * np.abs(places).max():
        bounds = ms.current_mesh().bounding_box()
        far = 4.0 * max(1.0, float(np.abs([bounds.min(), bounds.max()]).max()))
        places = np.concatenate([places, np.full((1, 3), far)])
        normals = np.concatenate([normals, np.zeros((1, 3))])
    source = pymeshlab.Mesh(vertex_matrix=places, v_normals_matrix=normals)
    with _layer(ms, source) as number:
        ms.transfer_attributes_per_vertex(
            sourcemesh=number,
            targetmesh=ms.current_mesh_id(),
            **switches,
            qualitydistance=False,
            onselected=False,
            upperbound=pymeshlab.PureValue(reach),
        )


@contextlib.contextmanager
def _layer(ms: pymeshlab.MeshSet, mesh: pymeshlab.Mesh) -> Iterator[int]:
    """Add a layer of vertices, all of them selected, for a while; give its id."""
    current = ms.current_mesh_id()
    ms.add_mesh(mesh, "positions", set_as_current=True)
    number = ms.current_mesh_id()
    try:
        ms.set_selection_all(allfaces=False, allverts=True)
        ms.set_current_mesh(current)
        yield number
    finally:
        ms.set_current_mesh(number)
        ms.delete_current_mesh()
        ms.set_current_mesh(current)
