"""The filter `apply_coord_inpaint_lowrank`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError
from meshlab_lowrank.filters.filter_arguments import METHOD_PARAMETERS, inpaint_parameters
from meshlab_lowrank.filters.filter_script import unrecorded
from meshlab_lowrank.filters.interruption import uninterrupted
from meshlab_lowrank.filters.placing import Aside, select_at, untransformed
from meshlab_lowrank.filters.reading import current_mesh, mesh_arrays
from meshlab_lowrank.filters.script_steps import recorded
from meshlab_lowrank.filters.summary import summary
from meshlab_lowrank.filters.undoing import Undo, undone_on_error
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.parameters import HOLE_PARAMETERS
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.restoring import restore_detail
from meshlab_lowrank.result import InpaintResult, ProgressCallback
from meshlab_lowrank.signatures import showing_parameters

_NAME = "apply_coord_inpaint_lowrank"
_KNOWN = METHOD_PARAMETERS - HOLE_PARAMETERS


@recorded
@showing_parameters(_KNOWN)
def apply_coord_inpaint_lowrank(
    ms: pymeshlab.MeshSet,
    *,
    progress: ProgressCallback | None = None,
    pipeline: Pipeline | None = None,
    **parameters: Any,
) -> dict[str, Any]:
    """Bring detail back to the selected part of the current mesh by moving its vertices.

    The selection is a patch that another filter filled in, or a damaged area. If vertices are
    selected, those are moved; otherwise those vertices all of whose faces are selected, so that
    the rim of a selected patch stays. Connectivity, selection and attributes stay as they are;
    normals are computed anew.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    progress : callable, optional
        Called with a `ProgressEvent` at each step; returning False stops the run.
    pipeline : Pipeline, optional
        Stages to run instead of a preset's, see `meshlab_lowrank.inpaint`.
    preset : {"auto", "paper"}
    detail : {"calibrated", "full", "none"}
    seed, patchsize, ringnumber, similarpatches, iterations : int, optional
    tau, delta, gamma, truncation, mu, beta : optional
    completioniterations, completiontolerance : optional
    refinementiterations, refinementtolerance : optional
    updateiterations : int
        As for `meshing_inpaint_lowrank`.

    Returns
    -------
    dict
        As `meshing_inpaint_lowrank`, with an entry in "holes" for each connected patch,
        "closed_holes" the number of those that were worked on, no new faces or vertices, and
        "moved_vertices", of all and in each entry.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If there is no mesh, no faces, no selection, or a parameter is wrong.
    InpaintCancelledError
        If ``progress`` returned False; nothing was changed.

    See Also
    --------
    meshing_inpaint_lowrank : Closes holes too.

    Notes
    -----
    Not for threads: MeshLab keeps the defaults of its remesher for the whole process (they are put
    back afterwards), its output is switched off by redirecting that of the process, and the
    threads of linear algebra are limited for the process. Runs at the same time belong in
    processes, as `batch` does it.

    Examples
    --------
    Another filter closes the hole, and leaves its new faces selected:

    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> closed = ms.meshing_close_holes(
    ...     maxholesize=100, refinehole=True, refineholeedgelen=pymeshlab.PureValue(0.2)
    ... )
    >>> report = ms.apply_coord_inpaint_lowrank(detail="none")
    >>> report["closed_holes"], len(report["holes"]), report["new_faces"]
    (1, 1, 0)
    >>> report["moved_vertices"] == report["holes"][0]["moved_vertices"] > 0
    True
    """
    mesh = current_mesh(ms, _NAME)
    settings = inpaint_parameters(_NAME, parameters, _KNOWN)
    mesh.compact()
    vertices, faces = mesh_arrays(mesh)
    try:
        result = restore_detail(
            vertices,
            faces,
            _selected(mesh, faces),
            parameters=settings,
            progress=progress,
            pipeline=pipeline,
        )
    except (InvalidMeshError, InvalidParameterError) as error:
        msg = f"Filter {_NAME}: {error}"
        raise pymeshlab.PyMeshLabException(msg) from error
    moved = int(np.count_nonzero(result.new_vertices))
    if moved:
        with (
            uninterrupted(),
            undone_on_error(ms, None) as undo,
            unrecorded(ms),
            untransformed(ms),
        ):
            _move(ms, vertices, result, undo)
    report = {**summary(result, new_faces=0, new_vertices=0), "moved_vertices": moved}
    report["holes"] = [
        {**patch, "new_faces": 0, "new_vertices": 0, "moved_vertices": patch["new_vertices"]}
        for patch in report["holes"]
    ]
    return report


def _move(ms: pymeshlab.MeshSet, vertices: FloatArray, result: InpaintResult, undo: Undo) -> None:
    chosen = ms.current_mesh().selected_vertex_number() > 0
    if not chosen:
        select_at(ms, vertices[result.new_vertices])
    ids = np.flatnonzero(ms.current_mesh().vertex_selection_array())
    undo.remember(ids, vertices[ids], None)
    aside = Aside(ms)
    aside.move(result.vertices[aside.ids])
    if not chosen:
        ms.set_selection_none(allfaces=False, allverts=True)


def _selected(mesh: pymeshlab.Mesh, faces: IntArray) -> BoolArray:
    vertices: BoolArray = mesh.vertex_selection_array().astype(np.bool_)
    if vertices.any() or mesh.selected_face_number() == 0:
        return vertices
    inside = np.zeros(len(vertices), dtype=np.bool_)
    chosen = mesh.face_selection_array().astype(np.bool_)
    inside[faces[chosen]] = True
    inside[faces[~chosen]] = False
    return inside
