"""The filter `compute_selection_inpainted_lowrank`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.filters.filter_arguments import refuse_unknown
from meshlab_lowrank.filters.filter_script import unrecorded
from meshlab_lowrank.filters.interruption import uninterrupted
from meshlab_lowrank.filters.reading import current_mesh
from meshlab_lowrank.filters.script_steps import recorded
from meshlab_lowrank.filters.trust_showing import MOST_SHOWN
from meshlab_lowrank.mesh_files import INPAINTED, marks_of, put_marks, read_marks
from meshlab_lowrank.signatures import showing_parameters

_NAME = "compute_selection_inpainted_lowrank"
_BELOW = 0.5 * (1.0 + MOST_SHOWN)  # what is shown of measured vertices, and of no new one


@recorded
@showing_parameters(())
def compute_selection_inpainted_lowrank(
    ms: pymeshlab.MeshSet, *, marksfile: str = "", **parameters: Any
) -> dict[str, Any]:
    """Select the invented faces of the current mesh, also of one that was read from a file.

    Which they are is told by the marks of the mesh, its custom attributes. MeshLab's reader leaves
    these out; then by ``marksfile``, of which the mesh gets its marks back, or else by the quality
    of its vertices, where `meshing_inpaint_lowrank` showed the trust in it. The selection of
    vertices stays.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    marksfile : str
        The PLY file from which the mesh was read, if it was saved with its marks, as
        `meshlab-lowrank` does it, or the file of marks that lies beside one of another format.

    Returns
    -------
    dict
        "selected_faces": their number; "source": "marks", "marksfile" or "quality".

    Raises
    ------
    pymeshlab.PyMeshLabException
        If there is no mesh, it has no faces, nothing tells which were invented, ``marksfile``
        can't be read or belongs to another mesh, or is given for a mesh that has marks; nothing
        was changed.

    See Also
    --------
    meshing_inpaint_lowrank : Makes the marks.

    Notes
    -----
    The quality tells of vertices: a face of a fill that has measured corners only, as that of a
    hole of three edges, is not found by it.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> report = ms.meshing_inpaint_lowrank(detail="none")
    >>> ms.set_selection_none()
    >>> found = ms.compute_selection_inpainted_lowrank()
    >>> found["selected_faces"] == report["new_faces"], found["source"]
    (True, 'marks')
    """
    refuse_unknown(_NAME, parameters, ("marksfile",))
    mesh = current_mesh(ms, _NAME)
    if not isinstance(marksfile, str | Path):
        _refuse(f"Parameter marksfile is {marksfile!r}; give the path of a file.")
    mesh.compact()
    marked = marks_of(mesh) is not None
    source, condition = "marks", f"{INPAINTED} > 0.5"
    if marksfile:
        source = "marksfile"
        if marked:
            _refuse(f"Parameter marksfile is {marksfile!r}, but the mesh has marks; leave it out.")
        try:
            marks = read_marks(Path(marksfile), mesh.vertex_number(), mesh.face_number())
        except (InvalidMeshError, OSError) as error:
            _refuse(f"Parameter marksfile is {str(marksfile)!r}: {error}", error)
        put_marks(mesh, marks)
    elif not marked:
        source = "quality"
        _refuse_other_quality(mesh)
        condition = " || ".join(f"q{i} < {_BELOW!r}" for i in range(3))
    with uninterrupted(), unrecorded(ms):
        ms.compute_selection_by_condition_per_face(condselect=condition)
    return {"selected_faces": int(mesh.selected_face_number()), "source": source}


def _refuse_other_quality(mesh: pymeshlab.Mesh) -> None:
    """Refuse a mesh whose quality does not tell what was invented."""
    shown = False
    if mesh.has_vertex_scalar():
        quality = np.asarray(mesh.vertex_scalar_array())
        measured = np.abs(quality - 1.0) < 1e-6
        new = (quality >= 0.0) & (quality < MOST_SHOWN + 1e-6)
        shown = bool((measured | new).all() and measured.any() and new.any())
    if not shown:
        _refuse(
            "nothing tells which faces were invented: the mesh has no marks, and its quality shows "
            "no trust. Give the file that it was read from, or the one of marks beside it, as "
            "marksfile."
        )


def _refuse(reason: str, error: Exception | None = None) -> None:
    msg = f"Filter {_NAME}: {reason}"
    raise pymeshlab.PyMeshLabException(msg) from error
