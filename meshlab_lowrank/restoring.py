"""The detail of what is selected of a mesh: a patch that some filler made, or a damaged area."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError, StageError
from meshlab_lowrank.fill_crossings import crossings_of_patches
from meshlab_lowrank.fill_shape import shapes_of
from meshlab_lowrank.filling import filler
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.mesh.validation import check_flags, check_mesh
from meshlab_lowrank.mesh_objects import mesh_object
from meshlab_lowrank.parameters import HOLE_PARAMETERS, InpaintParameters
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.presets import pipeline_of
from meshlab_lowrank.reporting import Reporter
from meshlab_lowrank.result import HoleRecord, HoleStatus, InpaintResult, ProgressCallback
from meshlab_lowrank.signatures import ALL_PARAMETERS, showing_parameters
from meshlab_lowrank.stages.stage0_region import Region, cut_selection


@showing_parameters([name for name in ALL_PARAMETERS if name not in HOLE_PARAMETERS])
def restore_detail(
    vertices: Any,
    faces: ArrayLike | None = None,
    selected_vertices: ArrayLike = (),
    *,
    parameters: InpaintParameters | None = None,
    progress: ProgressCallback | None = None,
    pipeline: Pipeline | None = None,
    **values: Any,
) -> InpaintResult:
    """Give selected vertices the detail of their surroundings; connectivity stays as it is.

    Parameters
    ----------
    vertices : (n, 3) array_like of float, or a mesh
    faces : (m, 3) array_like of int, optional
        As in `inpaint`.
    selected_vertices : (n,) array_like of bool
        Vertices that may move: a patch that some filler made, or a damaged area. Each connected
        patch is worked on by itself.
    parameters : InpaintParameters, optional
        ``maxholesize``, ``closerim``, ``continuity`` and ``refineedgelen`` mean nothing here.
    progress : callable, optional
    pipeline : Pipeline, optional
    **values
        As in `inpaint`.

    Returns
    -------
    InpaintResult
        ``new_vertices`` marks the vertices that were moved, ``new_faces`` the faces at them;
        ``holes`` has a record for each connected patch, which counts both.

    Raises
    ------
    InvalidMeshError
        If the mesh can't be worked on, or nothing or everything is selected.
    InvalidParameterError
        If a parameter is wrong or given twice.
    InpaintCancelledError
        If ``progress`` returned False.

    See Also
    --------
    inpaint : For holes.

    Notes
    -----
    Not for threads: MeshLab keeps the defaults of its remesher for the whole process (they are put
    back afterwards), its output is switched off by redirecting that of the process, and the
    threads of linear algebra are limited for the process. Runs at the same time belong in
    processes, as `batch` does it.

    Examples
    --------
    The cap of a sphere, flattened, becomes round again:

    >>> import numpy as np
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> vertices, faces = ms.current_mesh().vertex_matrix(), ms.current_mesh().face_matrix()
    >>> cap = vertices[:, 2] > 0.9
    >>> flat = np.where(cap[:, None], np.minimum(vertices, 0.9), vertices)
    >>> result = meshlab_lowrank.restore_detail(flat, faces, cap, detail="none")
    >>> bool(np.abs(np.linalg.norm(result.vertices, axis=1) - 1.0).max() < 0.02)
    True
    """
    for name in HOLE_PARAMETERS.intersection(values):
        msg = f"Parameter {name} is of closing holes, and none is closed here; leave it out."
        raise InvalidParameterError(msg)
    given = mesh_object(vertices) if faces is None else None
    points, triangles = check_mesh(*((given.vertices, given.faces) if given else (vertices, faces)))
    parameters = InpaintParameters.of(parameters, values)
    selected = check_flags(selected_vertices, len(points), "vertices")
    stages = pipeline or pipeline_of(parameters)

    def cut(around: FloatArray, patches: BoolArray, width: float) -> list[Region]:
        reach = width * stages.reach
        return cut_selection(around, triangles, patches, reach=reach, rings=stages.patches.rings)

    def recut(region: Region, width: float) -> Region:
        ids = region.vertex_ids[~region.known_vertices]
        wider = cut(points, np.isin(np.arange(len(points)), ids), width)[0]
        local = wider.vertices.copy()
        local[~wider.known_vertices] = region.vertices[~region.known_vertices]
        return replace(wider, vertices=local)

    regions = cut(points, selected, 1.0)
    if not regions:
        msg = "No vertex of a face is selected; select the vertices whose detail is to be restored."
        raise InvalidMeshError(msg)
    positions = points.copy()
    trust, error = np.ones(len(points)), np.zeros(len(points))
    moved = np.zeros(len(points), dtype=np.bool_)
    patch = np.full(len(triangles), -1)
    records = []
    with filler(parameters, pipeline, Reporter(progress, len(regions))) as worker:
        fills = worker.restore(regions, recut)
    for number, (region, fill) in enumerate(zip(regions, fills, strict=True)):
        if isinstance(fill, StageError):
            records.append(_selection_record(number, region, "failed", str(fill)))
            continue
        ids = region.vertex_ids[~region.known_vertices]
        positions[ids], trust[ids], moved[ids] = fill.positions, fill.trusts, True
        error[ids] = fill.errors
        patch[region.face_ids[~region.known_faces]] = number
        (shape,) = shapes_of([fill.final()])
        records.append(
            replace(
                _selection_record(number, region, "filled", fill.reason),
                new_vertices=len(ids),
                new_faces=int((~region.known_faces).sum()),
                trust=fill.trust,
                median_error=fill.median_error,
                largest_error=fill.largest_error,
                **vars(shape),
            )
        )
    crossings = crossings_of_patches(positions, triangles, patch)
    for number in np.flatnonzero(crossings).tolist():
        records[number] = replace(records[number], crossings=int(crossings[number]))
    result = InpaintResult(
        vertices=positions,
        faces=triangles,
        new_vertices=moved,
        new_faces=np.asarray(moved[triangles].any(axis=1)),
        trust=trust,
        error=error,
        holes=tuple(records),
    )
    return given.with_mesh(result) if given else result


def _selection_record(number: int, region: Region, status: HoleStatus, reason: str) -> HoleRecord:
    """Record of a selected patch; its boundary is that of its faces, without that of the mesh."""
    edges = edges_of(region.faces[~region.known_faces])
    rim = edges.vertices[edges.face_count == 1]
    ends = region.vertices[rim[region.known_vertices[rim].all(axis=1)]] * region.scale
    around = region.vertices[region.loop] * region.scale
    return HoleRecord(
        id=number,
        status=status,
        shape="patch",
        reason=reason,
        boundary_edges=len(ends),
        perimeter=float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()),
        diameter=float(np.linalg.norm(np.ptp(around, axis=0))) if len(around) else 0.0,
    )
