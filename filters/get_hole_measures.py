"""The filter `get_hole_measures`."""

from __future__ import annotations

from typing import Any

import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.filters.filter_arguments import refuse_unknown
from meshlab_lowrank.filters.reading import compact_copy, current_mesh, mesh_arrays
from meshlab_lowrank.filters.script_steps import recorded
from meshlab_lowrank.hole_table import measure_holes
from meshlab_lowrank.signatures import showing_parameters

_NAME = "get_hole_measures"


@recorded
@showing_parameters(())
def get_hole_measures(ms: pymeshlab.MeshSet, **parameters: Any) -> dict[str, list[Any]]:
    """Tabulate the boundary loops of the current mesh; nothing is changed.

    Parameters
    ----------
    ms : pymeshlab.MeshSet

    Returns
    -------
    dict
        One list a column, one entry a loop: "id", "boundary_edges", "perimeter", "diameter",
        "area", "planarity", "centre", "normal", "component", "vertex", "is_rim", "is_pinched",
        "shape", "fillable", "reason"; lengths and places in the units of the mesh, its layer
        transform left out. See `measure_holes`.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If there is no mesh, it has no faces, can't be measured, or a parameter is given.

    See Also
    --------
    meshing_inpaint_lowrank : Fills them.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet()
    >>> ms.create_sphere()
    >>> ms.compute_selection_by_condition_per_face(condselect="fi == 0")
    >>> ms.meshing_remove_selected_faces()
    >>> ms.get_hole_measures()["boundary_edges"]
    [3]
    """
    refuse_unknown(_NAME, parameters, ())
    mesh = current_mesh(ms, _NAME)
    scratch = None if mesh.is_compact() else compact_copy(mesh)
    try:
        return measure_holes(*mesh_arrays(mesh if scratch is None else scratch.current_mesh()))
    except InvalidMeshError as error:
        msg = f"Filter {_NAME}: {error}"
        raise pymeshlab.PyMeshLabException(msg) from error
