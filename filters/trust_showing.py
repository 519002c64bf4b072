"""Show the trust where programs look: in the quality or the colour of the vertices.

Only where the mesh had none of its own; what was written so by an earlier run goes on. A mesh made
from arrays has quality 0 and white vertices from PyMeshLab on. That is data until somebody asks for
the trust in its place.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal, TypeAlias, get_args

import numpy as np
import pymeshlab

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.mesh_files import INPAINT_TRUST, INPAINTED, Marks, marks_of
from meshlab_lowrank.parameter_checks import check_choice

ShowTrust: TypeAlias = Literal["quality", "colour", "none"]

MOST_SHOWN = 0.99  # of new vertices, which measured ones with 1 stay apart from
_MEASURED = (200, 200, 200)
_LEAST, _MOST = (200, 30, 30), (250, 210, 60)  # colours of trust 0 and 1
_CLOSE = 1e-6  # files may hold quality in single precision
_CLOSE_COLOUR = 1.01

_NEW = f"{INPAINTED} > 0.5"
_TRUST = f"({INPAINT_TRUST} >= 0 ? min({INPAINT_TRUST}, {MOST_SHOWN}) : 0)"  # 0 if not known


def checked_show_trust(value: object) -> ShowTrust | None:
    """Give the parameter ``showtrust`` if it is None or one of its choices.

    Raises
    ------
    InvalidParameterError
    """
    if value is None:
        return None
    check_choice("showtrust", value, get_args(ShowTrust))
    return value  # type: ignore[return-value]


def places_for_trust(mesh: pymeshlab.Mesh, wanted: ShowTrust | None) -> frozenset[str]:
    """Tell where trust may be shown: where a mesh has nothing yet, or has its trust.

    Parameters
    ----------
    mesh : pymeshlab.Mesh
        Compact.
    wanted : {"quality", "colour", "none"} or None
        What was asked for may take the place of values that are the same everywhere. None: the
        quality if there is none.

    Returns
    -------
    frozenset of {"quality", "colour"}
    """
    marks = marks_of(mesh)
    found = set()
    for place, taken, read in (
        ("quality", mesh.has_vertex_scalar(), mesh.vertex_scalar_array),
        ("colour", mesh.has_vertex_color(), mesh.vertex_color_matrix),
    ):
        if not taken:
            free = (wanted or "quality") == place
        else:
            values = read().reshape(mesh.vertex_number(), -1)
            free = wanted == place and bool((values == values[0]).all())
            free = free or _shows(values, place, marks)
        if free:
            found.add(place)
    return frozenset(found)


def show_trust(ms: pymeshlab.MeshSet, places: Collection[str]) -> None:
    """Write the trust of the current mesh, which has marks, into the quality or the colour."""
    if "quality" in places:
        ms.compute_scalar_by_function_per_vertex(
            q=f"{_NEW} ? {_TRUST} : 1", normalize=False, map=False, onselected=False
        )
    if "colour" in places:
        ms.compute_color_by_function_per_vertex(
            **{
                axis: f"{_NEW} ? rint({least} + {most - least} * {_TRUST}) : {measured}"
                for axis, least, most, measured in zip("xyz", _LEAST, _MOST, _MEASURED, strict=True)
            },
            a="255",
            onselected=False,
        )


def shown_trust(marks: Marks) -> FloatArray:
    """Give what the quality of the vertices is where it shows the trust, (n,)."""
    trust = np.where(marks.trust >= 0.0, np.minimum(marks.trust, MOST_SHOWN), 0.0)
    return np.where(marks.vertices, trust, 1.0)


def _shows(values: FloatArray, place: str, marks: Marks | None) -> bool:
    """Whether quality (n, 1) or colours (n, 4) were written by `show_trust`."""
    if marks is None or not marks.vertices.any():
        return False
    shown = shown_trust(marks)
    if place == "quality":
        return bool(np.allclose(values[:, 0], shown, rtol=0.0, atol=_CLOSE))
    least, most = np.array(_LEAST), np.array(_MOST)
    colours = np.where(
        marks.vertices[:, None], np.rint(least + (most - least) * shown[:, None]), _MEASURED
    )
    return bool(np.allclose(255.0 * values[:, :3], colours, rtol=0.0, atol=_CLOSE_COLOUR))
