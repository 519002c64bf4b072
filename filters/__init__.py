"""Filters for `pymeshlab.MeshSet`, one module each."""

from __future__ import annotations

import pymeshlab

from meshlab_lowrank.filters.apply_coord_inpaint_lowrank import apply_coord_inpaint_lowrank
from meshlab_lowrank.filters.get_hole_measures import get_hole_measures
from meshlab_lowrank.filters.meshing_inpaint_lowrank import meshing_inpaint_lowrank

FILTERS = (get_hole_measures, meshing_inpaint_lowrank, apply_coord_inpaint_lowrank)

__all__ = [
    "FILTERS",
    "apply_coord_inpaint_lowrank",
    "get_hole_measures",
    "meshing_inpaint_lowrank",
    "register",
]


def register() -> None:
    """Bind the filters to `pymeshlab.MeshSet` as methods, as PyMeshLab binds its own.

    Importing the package does it.

    See Also
    --------
    get_hole_measures, meshing_inpaint_lowrank, apply_coord_inpaint_lowrank : The filters.

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
