"""Write the attributes of a fill into the current mesh, and leave those of old elements alone.

MeshLab takes values for single vertices only through expressions of what the mesh holds already,
so they are carried in as normals: a filter by function then copies nx, ny or nz of each vertex into
the attribute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pymeshlab

from meshlab_lowrank.attributes import harmonic_extension
from meshlab_lowrank.filters.growing import Fill, Grown
from meshlab_lowrank.filters.placing import CARRIED, CARRIED_NOT_FINITE, carry, place
from meshlab_lowrank.filters.reading import CustomAttributes, wedge_coordinates
from meshlab_lowrank.filters.texture_charts import RimTexture
from meshlab_lowrank.filters.undoing import Undo
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, corner_sum
from meshlab_lowrank.mesh.topology import faces_at
from meshlab_lowrank.mesh_files import INPAINT_ERROR, INPAINT_TRUST, INPAINTED

_NORMAL = ("nx", "ny", "nz")


@dataclass(frozen=True)
class _Channel:
    """Values, one row a vertex of the fill (the rim first), and how to write them.

    ``write`` gets the names of the variables, such as "nx", in which the columns lie.
    """

    values: FloatArray  # (k, d) with d up to 3
    write: Callable[[Sequence[str]], object]
    extend: bool = True  # rows beyond the rim are to be found
    everywhere: FloatArray | None = None  # (n + v, d): what other vertices get


def mark_as_measured(ms: pymeshlab.MeshSet, names: CustomAttributes) -> None:
    """Give the current mesh the marks that it doesn't have yet: all is measured.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    names : CustomAttributes
        Those that it has.
    """
    for name, value in ((INPAINTED, "0"), (INPAINT_TRUST, "1"), (INPAINT_ERROR, "0")):
        if name not in names.vertex_scalars:
            ms.compute_new_custom_scalar_attribute_per_vertex(name=name, expr=value)
    if INPAINTED not in names.face_scalars:
        ms.compute_new_custom_scalar_attribute_per_face(name=INPAINTED, expr="0")


class AttributeWriter:
    """Extends attributes into the fill of the current mesh.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
        Its current mesh has grown by the fill; all normals are lost.
    fill : Fill
    grown : Grown
    undo : Undo
    """

    def __init__(self, ms: pymeshlab.MeshSet, fill: Fill, grown: Grown, undo: Undo) -> None:
        self._ms, self._undo = ms, undo
        self._mesh = ms.current_mesh()
        self._fill = fill
        self._aside = grown.aside
        self._ids, local = np.unique(fill.faces, return_inverse=True)
        self._local_faces = local.reshape(-1, 3)
        self._rows = np.searchsorted(grown.aside.ids, self._ids)  # of vertices aside
        self._rim = self._ids[self._ids < fill.vertex_count]
        old = grown.positions[self._rows[: len(self._rim)]]
        self._positions = np.concatenate([old, fill.vertices])
        self._old_vertex = f"vi < {fill.vertex_count}"
        self._old_face = f"fi < {fill.face_count}"

    def write(
        self,
        names: CustomAttributes,
        texture: RimTexture | None,
        *,
        vertex_texture: FloatArray | None,
        vertex_rim: RimTexture | None,
        parted: bool,
    ) -> None:
        """Write all attributes that the mesh has, and the marks of new elements.

        Faces of the fill are selected afterwards, vertices are not.

        Parameters
        ----------
        names : CustomAttributes
            Those to extend.
        texture : RimTexture or None
            None if the mesh has no texture coordinates at its wedges.
        vertex_texture : (n, 2) float64 or None
            Texture coordinates at its vertices before it grew.
        vertex_rim : RimTexture or None
            What they say about the fill; None if there are none.
        parted : bool
            Whether they are lost since vertices were torn apart.
        """
        ms, fill = self._ms, self._fill
        ms.compute_selection_by_condition_per_vertex(condselect=f"vi >= {fill.vertex_count}")
        ms.compute_selection_by_condition_per_face(condselect=f"fi >= {fill.face_count}")
        channels = list(self._face_channels())
        if len(fill.vertices):  # else MeshLab takes those of selected faces
            channels += self._vertex_channels()
        lost = None
        if (vertex_texture is not None and vertex_rim) and (parted or len(fill.vertices)):
            rim = vertex_rim.coordinates
            channels.append(self._vertex_texture_channel(vertex_texture, rim, parted=parted))
            lost = vertex_texture if parted else None
        channels += self._custom_channels(names)
        if texture is not None:
            channels += self._wedge_channels(texture, vertex_texture is not None)
        for name, values, measured in (
            (INPAINT_TRUST, fill.trust, 1.0),
            (INPAINT_ERROR, fill.error, 0.0),
        ):
            old = name if name in names.vertex_scalars else f"{measured:g}"
            channels.append(self._mark_channel(name, values, measured, old))
        self._carry(self._extended(channels))
        if lost is not None and not np.isfinite(lost).all():
            self._write_not_finite(lost)
        self._mark(names)
        ms.set_selection_none(allfaces=False, allverts=True)

    def _vertex_channels(self) -> Iterator[_Channel]:
        ms, mesh = self._ms, self._mesh
        if mesh.has_vertex_color():
            colours = 255.0 * self._at_vertices(mesh.vertex_color_matrix())
            yield _Channel(
                colours[:, :3],
                lambda at: ms.compute_color_by_function_per_vertex(
                    **{c: f"rint({n})" for c, n in zip("xyz", at, strict=True)},
                    a="a",
                    onselected=True,
                ),
            )
            yield _Channel(
                colours[:, 3:],
                lambda at: ms.compute_color_by_function_per_vertex(
                    x="r", y="g", z="b", a=f"rint({at[0]})", onselected=True
                ),
            )
        if mesh.has_vertex_scalar():
            yield _Channel(
                self._at_vertices(mesh.vertex_scalar_array()),
                lambda at: ms.compute_scalar_by_function_per_vertex(
                    q=at[0], normalize=False, map=False, onselected=True
                ),
            )

    def _vertex_texture_channel(
        self, coordinates: FloatArray, rim: FloatArray, *, parted: bool
    ) -> _Channel:
        everywhere = np.zeros((self._mesh.vertex_number(), 2))
        everywhere[: len(coordinates)] = coordinates
        return _Channel(
            rim,
            lambda at: self._ms.compute_texcoord_by_function_per_vertex(
                u=at[0], v=at[1], onselected=not parted
            ),
            everywhere=everywhere if parted else None,
        )

    def _face_channels(self) -> Iterator[_Channel]:
        ms, mesh = self._ms, self._mesh
        if not mesh.has_face_color():
            return  # writing the quality of faces would switch their colour on
        colours = 255.0 * self._at_faces(mesh.face_color_matrix())
        yield _Channel(
            colours[:, :3],
            lambda at: ms.compute_color_by_function_per_face(
                **{c: f"rint({_mean(x)})" for c, x in zip("rgb", at, strict=True)},
                a="fa",
                onselected=True,
            ),
        )
        yield _Channel(
            colours[:, 3:],
            lambda at: ms.compute_color_by_function_per_face(
                r="fr", g="fg", b="fb", a=f"rint({_mean(at[0])})", onselected=True
            ),
        )
        if mesh.has_face_scalar():
            yield _Channel(
                self._at_faces(mesh.face_scalar_array()),
                lambda at: ms.compute_scalar_by_function_per_face(
                    q=_mean(at[0]), normalize=False, map=False, onselected=True
                ),
            )

    def _custom_channels(self, names: CustomAttributes) -> Iterator[_Channel]:
        marks = (INPAINTED, INPAINT_TRUST, INPAINT_ERROR)
        for name in (name for name in names.vertex_scalars if name not in marks):
            values = self._at_vertices(self._mesh.vertex_custom_scalar_attribute_array(name))
            yield _Channel(values, self._vertex_scalar_writer(name))
        for name in (name for name in names.face_scalars if name not in marks):
            values = self._at_faces(self._mesh.face_custom_scalar_attribute_array(name))
            yield _Channel(values, self._face_scalar_writer(name))
        for name in names.vertex_points:
            points = self._mesh.vertex_custom_point_attribute_matrix(name)
            points[self._fill.vertex_count :] = 0.0  # of new vertices they are undefined
            if np.isfinite(points).all():  # positions must be, and these are carried for all
                yield _Channel(
                    self._at_vertices(points), self._vertex_point_writer(name), everywhere=points
                )

        for name in names.face_points:
            values = self._at_faces(self._mesh.face_custom_point_attribute_matrix(name))
            yield _Channel(values, self._face_point_writer(name))

    def _vertex_scalar_writer(self, name: str) -> Callable[[Sequence[str]], object]:
        return lambda at: self._ms.compute_new_custom_scalar_attribute_per_vertex(
            name=name, expr=f"{self._old_vertex} ? {name} : {at[0]}"
        )

    def _face_scalar_writer(self, name: str) -> Callable[[Sequence[str]], object]:
        return lambda at: self._ms.compute_new_custom_scalar_attribute_per_face(
            name=name, expr=f"{self._old_face} ? {name} : {_mean(at[0])}"
        )

    def _vertex_point_writer(self, name: str) -> Callable[[Sequence[str]], object]:
        # an expression of the attribute itself would read freed memory
        return lambda at: self._ms.compute_new_custom_point_attribute_per_vertex(
            name=name, x_expr=at[0], y_expr=at[1], z_expr=at[2]
        )

    def _face_point_writer(self, name: str) -> Callable[[Sequence[str]], object]:
        # MeshLab's variables for the parts of points lie in a list whose growth moves them away
        # from where expressions look; any earlier function of faces has grown it for good
        return lambda at: self._ms.compute_new_custom_point_attribute_per_face(
            name=name,
            **{
                f"{c}_expr": f"{self._old_face} ? {name}_{c} : {_mean(n)}"
                for c, n in zip("xyz", at, strict=True)
            },
        )

    def _wedge_channels(self, texture: RimTexture, vertex_texture: bool) -> Iterator[_Channel]:
        yield _Channel(
            texture.coordinates,
            lambda at: self._ms.compute_texcoord_by_function_per_wedge(
                **{f"{c}{i}": f"{at[j]}{i}" for i in range(3) for j, c in enumerate("uv")},
                onselected=True,
            ),
        )
        wedges = wedge_coordinates(self._mesh)
        if not vertex_texture and wedges is not None:  # they are switched on now, but undefined
            everywhere = np.zeros((self._mesh.vertex_number(), 2))
            everywhere[self._mesh.face_matrix()] = wedges
            yield _Channel(
                texture.coordinates,
                lambda at: self._ms.compute_texcoord_by_function_per_vertex(
                    u=at[0], v=at[1], onselected=False
                ),
                everywhere=everywhere,
            )

    def _mark_channel(self, name: str, values: FloatArray, measured: float, old: str) -> _Channel:
        return _Channel(
            np.concatenate([np.full(len(self._rim), measured), values])[:, None],
            lambda at: self._ms.compute_new_custom_scalar_attribute_per_vertex(
                name=name, expr=f"{self._old_vertex} ? {old} : {at[0]}"
            ),
            extend=False,
        )

    def _mark(self, names: CustomAttributes) -> None:
        old = INPAINTED if INPAINTED in names.vertex_scalars else "0"
        self._ms.compute_new_custom_scalar_attribute_per_vertex(
            name=INPAINTED, expr=f"{self._old_vertex} ? {old} : 1"
        )
        old = INPAINTED if INPAINTED in names.face_scalars else "0"
        self._ms.compute_new_custom_scalar_attribute_per_face(
            name=INPAINTED, expr=f"{self._old_face} ? {old} : 1"
        )

    def _at_vertices(self, values: FloatArray) -> FloatArray:
        """Values at the rim, from those of all vertices."""
        return _finite(values[self._rim])

    def _at_faces(self, values: FloatArray) -> FloatArray:
        """Values at the rim, from those of all faces: the mean of the old faces around."""
        rows, corners = self._rim_faces
        near = np.repeat(_finite(values[rows]), 3, axis=0)
        n = self._fill.vertex_count
        count = corner_sum(corners, np.ones(corners.size), n)[self._rim]
        mean: FloatArray = corner_sum(corners, near, n)[self._rim] / count[:, None]
        return mean

    @cached_property
    def _rim_faces(self) -> tuple[IntArray, IntArray]:
        """Rows and corners of the old faces at the rim."""
        faces = self._mesh.face_matrix()[: self._fill.face_count]
        at_rim = np.zeros(self._mesh.vertex_number(), dtype=np.bool_)
        at_rim[self._rim] = True
        rows = np.flatnonzero(faces_at(at_rim, faces))
        return rows, faces[rows].astype(np.int64)

    def _extended(self, channels: Sequence[_Channel]) -> list[_Channel]:
        """Extend all channels that need it, by one harmonic solve."""
        rows, rim = len(self._ids), len(self._rim)
        columns = [channel.values for channel in channels if channel.extend]
        values = np.zeros((rows, sum(part.shape[1] for part in columns)))
        values[:rim] = np.hstack([np.zeros((rim, 0)), *columns])
        values = harmonic_extension(
            self._positions, self._local_faces, np.arange(rows) < rim, values
        )
        parts = np.split(values, np.cumsum([part.shape[1] for part in columns])[:-1], axis=1)
        found = iter(parts)
        return [replace(c, values=next(found)) if c.extend else c for c in channels]

    def _carry(self, channels: Sequence[_Channel]) -> None:
        """Hand channels over, as many at a time as fit into a normal, and write them."""
        for load in _loads(channels):
            if load[0].everywhere is not None:
                self._carry_positions(load[0], load[0].everywhere)
                continue
            values = np.zeros((len(self._aside.ids), 3))
            values[self._rows, : sum(_width(c) for c in load)] = np.hstack([c.values for c in load])
            self._aside.hand(values)
            start = 0
            for channel in load:
                channel.write(_NORMAL[start : start + _width(channel)])
                start += _width(channel)

    def _carry_positions(self, channel: _Channel, everywhere: FloatArray) -> None:
        """Hand a channel over to all vertices, as positions."""
        before = self._mesh.vertex_matrix()
        places = np.zeros_like(before)
        places[:, : _width(channel)] = _finite(everywhere)
        new = self._ids >= self._fill.vertex_count
        places[self._ids[new], : _width(channel)] = channel.values[new]
        with self._undo.moving_all(before):
            place(self._ms, places)
            channel.write("xyz"[: _width(channel)])
            place(self._ms, before)

    def _write_not_finite(self, coordinates: FloatArray) -> None:
        """Write those texture coordinates (n, 2) of vertices that positions can't be."""
        before = self._mesh.vertex_matrix()
        with self._undo.moving_all(before):
            for axis, column in zip("uv", coordinates.T, strict=True):
                values = np.zeros(len(before))
                values[: len(column)] = np.where(np.isfinite(column), 0.0, column)
                carry(self._ms, values)
                self._ms.compute_selection_by_condition_per_vertex(condselect=CARRIED_NOT_FINITE)
                expressions = {"u": "vtu", "v": "vtv"} | {axis: CARRIED}
                self._ms.compute_texcoord_by_function_per_vertex(**expressions, onselected=True)
            place(self._ms, before)


def _width(channel: _Channel) -> int:
    return int(channel.values.shape[1])


def _loads(channels: Sequence[_Channel]) -> Iterator[list[_Channel]]:
    """Split channels into runs of at most three columns; those for all vertices go alone."""
    load: list[_Channel] = []
    for channel in channels:
        alone = channel.everywhere is not None or (load and load[0].everywhere is not None)
        if load and (alone or sum(_width(other) for other in (*load, channel)) > 3):
            yield load
            load = []
        load.append(channel)
    yield load


def _mean(variable: str) -> str:
    """Expression for the mean of a variable over the corners of a face."""
    return f"(({variable}0 + {variable}1 + {variable}2) / 3)"


def _finite(values: FloatArray) -> FloatArray:
    """Give values as (k, d), with zero for those that aren't finite."""
    table = values.reshape(len(values), -1)
    return np.where(np.isfinite(table), table, 0.0)
