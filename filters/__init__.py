"""Filters for `pymeshlab.MeshSet`, one module each."""

from __future__ import annotations

import pymeshlab

from meshlab_lowrank.filters import meshset_calls, script_printing
from meshlab_lowrank.filters.apply_coord_inpaint_lowrank import apply_coord_inpaint_lowrank
from meshlab_lowrank.filters.compute_selection_inpainted_lowrank import (
    compute_selection_inpainted_lowrank,
)
from meshlab_lowrank.filters.get_hole_measures import get_hole_measures
from meshlab_lowrank.filters.meshing_inpaint_lowrank import meshing_inpaint_lowrank
from meshlab_lowrank.filters.native_calls import FUNCTIONS, METHODS, ORIGINAL

FILTERS = (
    get_hole_measures,
    meshing_inpaint_lowrank,
    apply_coord_inpaint_lowrank,
    compute_selection_inpainted_lowrank,
)

__all__ = [
    "FILTERS",
    "apply_coord_inpaint_lowrank",
    "compute_selection_inpainted_lowrank",
    "get_hole_measures",
    "meshing_inpaint_lowrank",
    "register",
]


def register() -> None:
    """Bind the filters to `pymeshlab.MeshSet` as methods, as PyMeshLab binds its own.

    PyMeshLab's calls that take the name of a filter, list filters, or work on filter scripts find
    them too; for MeshLab's own filters these do what they did. Importing the package does all this.

    See Also
    --------
    get_hole_measures, meshing_inpaint_lowrank, apply_coord_inpaint_lowrank,
    compute_selection_inpainted_lowrank : The filters.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> meshlab_lowrank.register()
    >>> pymeshlab.MeshSet.get_hole_measures.__name__
    'get_hole_measures'
    """
    for function in FILTERS:
        setattr(pymeshlab.MeshSet, function.__name__, function)
    for owner, originals, calls in (
        (pymeshlab.MeshSet, METHODS, meshset_calls.CALLS),
        (pymeshlab, FUNCTIONS, script_printing.CALLS),
    ):
        for call in calls:
            original = originals[call.__name__]
            if not hasattr(call, ORIGINAL):
                call.__doc__ = f"{(original.__doc__ or '').rstrip()}\n\n{call.__doc__}\n"
            setattr(call, ORIGINAL, original)
            setattr(owner, call.__name__, call)
