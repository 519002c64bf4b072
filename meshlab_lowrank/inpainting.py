"""The whole method on the holes of a mesh."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.fill import Fill
from meshlab_lowrank.fill_shape import FillShape, beyond_surroundings, shapes_of
from meshlab_lowrank.filling import filler
from meshlab_lowrank.gap import Gap
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.seams import on_seams
from meshlab_lowrank.mesh.validation import check_arrays, check_flags
from meshlab_lowrank.mesh_objects import mesh_object
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.picking import reasons_to_skip
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.reporting import Reporter
from meshlab_lowrank.result import HoleRecord, HoleStatus, InpaintResult, ProgressCallback
from meshlab_lowrank.signatures import showing_parameters
from meshlab_lowrank.stages.stage0_boundary_loops import Boundary, BoundaryLoop, find_boundary
from meshlab_lowrank.stages.stage0_region import Region

_LOGGER = logging.getLogger(__name__)
_BEYOND = 0.1  # diameters of the hole
_OUTSIDE = "It leaves the bounding box of its surroundings by {:.2g} of the hole's diameter."
_ISLAND = "It is the rim of a piece of surface within hole {}, which was filled around it."


@showing_parameters()
def inpaint(
    vertices: Any,
    faces: ArrayLike | None = None,
    *,
    parameters: InpaintParameters | None = None,
    progress: ProgressCallback | None = None,
    selected_faces: ArrayLike | None = None,
    holes: Sequence[int] | None = None,
    near: Sequence[float] | None = None,
    pipeline: Pipeline | None = None,
    **values: Any,
) -> InpaintResult:
    """Fill the holes of a triangle mesh and bring back the detail that was lost there.

    Parameters
    ----------
    vertices : (n, 3) array_like of float, or a mesh
        A `trimesh.Trimesh`, a `pyvista.PolyData` or a ``TriangleMesh`` of Open3D, without
        ``faces``; the result then has its mesh of the same kind.
    faces : (m, 3) array_like of int, optional
        Neighbours oriented alike. Holes at edges with more than two faces, or with faces oriented
        against one another, are skipped, and a note says what repairs them.
    parameters : InpaintParameters, optional
        All settings in one, instead of by name.
    progress : callable, optional
        Called with a `ProgressEvent` at each step; returning False stops the run.
    selected_faces : (m,) array_like of bool, optional
        Fill only loops at which at least one of these faces lies.
    holes : sequence of int, optional
        Fill only loops with these numbers of the hole table, see `measure_holes`.
    near : sequence of three floats, optional
        Fill only the hole whose rim lies nearest to this point; outer rims count with ``closerim``.
    pipeline : Pipeline, optional
        Stages to run instead of a preset's; parameters that belong to stages are then refused.
    **values
        Fields of `InpaintParameters` by name, which tells what they mean.

    Returns
    -------
    InpaintResult
        The first n vertices and the first m faces are the input, bit for bit.

    Raises
    ------
    InvalidMeshError
        If the mesh can't be worked on.
    InvalidParameterError
        If a parameter is wrong or given twice, a pipeline is given and parameters that belong to
        stages are too, ``holes`` names one that isn't there, or ``selected_faces``, ``holes`` and
        ``near`` leave nothing to fill.
    InpaintCancelledError
        If ``progress`` returned False.

    See Also
    --------
    restore_detail : For a patch that is there already.
    measure_holes : The holes, without filling them.

    Notes
    -----
    Not for threads: MeshLab keeps the defaults of its remesher for the whole process (they are put
    back afterwards), its output is switched off by redirecting that of the process, and the
    threads of linear algebra are limited for the process. Runs at the same time belong in
    processes, as `batch` does it.

    References
    ----------
    Patch-based mesh inpainting via low rank recovery, Algorithm 1.

    Examples
    --------
    A sphere without its cap:

    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> mesh = ms.current_mesh()
    >>> vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    >>> result = meshlab_lowrank.inpaint(vertices, faces, maxholesize=400, detail="none")
    >>> [(hole.boundary_edges, hole.status) for hole in result.holes]
    [(20, 'filled')]
    >>> bool((result.vertices[: len(vertices)] == vertices).all())
    True
    """
    given = mesh_object(vertices) if faces is None else None
    points, triangles = check_arrays(
        *((given.vertices, given.faces) if given else (vertices, faces))
    )
    parameters = InpaintParameters.of(parameters, values)
    marked = (
        None if selected_faces is None else check_flags(selected_faces, len(triangles), "faces")
    )
    boundary = find_boundary(points, triangles)
    loops = boundary.loops
    reasons = reasons_to_skip(points, loops, parameters, marked=marked, holes=holes, near=near)
    chosen = [loop for loop, reason in zip(loops, reasons, strict=True) if not reason]
    reporter, length = Reporter(progress, len(chosen)), parameters.edge_length_on(points)
    with filler(parameters, pipeline, reporter, edge_length=length) as worker:
        found = worker.fill(
            points,
            boundary.faces,
            _renumbered(chosen, boundary),
            loops=_renumbered([loop for loop in loops if _is_clean(loop)], boundary),
            measured=triangles,
        )
    outcome = {loop.id: fill for loop, fill in zip(chosen, found, strict=True)}
    fills = [fill for fill in found if isinstance(fill, Fill)]
    closed_with = {island: fill for fill in fills for island in fill.islands}
    fills = [fill for fill in fills if fill.hole not in closed_with]
    finals = {fill.hole: fill.final() for fill in fills}
    shapes = dict(zip(finals, shapes_of(list(finals.values())), strict=True))
    records = []
    for loop, reason in zip(loops, reasons, strict=True):
        result = outcome.get(loop.id)
        if loop.id in closed_with:
            records.append(_island_record(loop, closed_with[loop.id]))
        elif result is None:
            records.append(_record(loop, "skipped", reason))
        elif isinstance(result, StageError):
            _LOGGER.warning("Hole %d was left open: %s", loop.id, result)
            records.append(_record(loop, "failed", str(result)))
        else:
            records.append(_filled_record(loop, result, finals[loop.id], shapes[loop.id]))
    for note in boundary.notes:
        _LOGGER.warning(note)
    assembled = _assemble(points, triangles, fills, tuple(records), boundary)
    return given.with_mesh(assembled) if given else assembled


def _is_clean(loop: BoundaryLoop) -> bool:
    return loop.shape == "single face" or not loop.reason


def _renumbered(loops: list[BoundaryLoop], boundary: Boundary) -> list[BoundaryLoop]:
    """Give loops by the rows of their faces among those that can be worked with."""
    rows = boundary.rows
    if rows is None:
        return loops
    return [replace(loop, faces=np.searchsorted(rows, loop.faces)) for loop in loops]


def _record(loop: BoundaryLoop, status: HoleStatus, reason: str) -> HoleRecord:
    return HoleRecord(
        id=loop.id,
        status=status,
        shape=loop.shape,
        reason=reason,
        boundary_edges=len(loop.vertices),
        perimeter=loop.perimeter,
        diameter=loop.diameter,
    )


def _filled_record(loop: BoundaryLoop, fill: Fill, final: Region, shape: FillShape) -> HoleRecord:
    beyond = beyond_surroundings(final) * final.scale / loop.diameter if loop.diameter else 0.0
    outside = _OUTSIDE.format(beyond) if beyond > _BEYOND else ""
    return replace(
        _record(loop, "filled", " ".join(filter(None, (fill.note, outside, fill.reason)))),
        shape="ring" if fill.islands else "cut" if fill.is_cut else loop.shape,
        new_vertices=len(fill.positions),
        new_faces=int((~fill.region.known_faces).sum()),
        crossings=fill.crossings,
        creases=fill.creases,
        trust=fill.trust,
        median_error=fill.median_error,
        largest_error=fill.largest_error,
        **vars(shape),
    )


def _island_record(loop: BoundaryLoop, fill: Fill) -> HoleRecord:
    record = _record(loop, "filled", _ISLAND.format(fill.hole))
    return replace(
        record,
        shape="island",
        trust=fill.trust,
        median_error=fill.median_error,
        largest_error=fill.largest_error,
    )


def _assemble(
    vertices: FloatArray,
    faces: IntArray,
    fills: list[Fill],
    records: tuple[HoleRecord, ...],
    boundary: Boundary,
) -> InpaintResult:
    """Append all patches to the mesh."""
    all_vertices, all_faces = [vertices], [faces]
    trust, error = [np.ones(len(vertices))], [np.zeros(len(vertices))]
    count = len(vertices)
    for fill in fills:
        region = fill.region
        ids = region.vertex_ids.copy()
        new = ~region.known_vertices
        ids[new] = count + np.arange(len(fill.positions))
        count += len(fill.positions)
        all_vertices.append(fill.positions)
        filled = ids[region.faces[~region.known_faces]]
        if boundary.welded and fill.gap is not None:
            filled = on_seams(filled, *_doubled(faces, fill.gap, boundary))
        all_faces.append(filled)
        trust.append(fill.trusts)
        error.append(fill.errors)
    merged = np.concatenate(all_vertices)
    triangles = np.concatenate(all_faces)
    return InpaintResult(
        vertices=merged,
        faces=triangles,
        new_vertices=np.arange(len(merged)) >= len(vertices),
        new_faces=np.arange(len(triangles)) >= len(faces),
        trust=np.concatenate(trust),
        error=np.concatenate(error),
        holes=records,
        notes=boundary.notes,
    )


def _doubled(
    faces: IntArray, gap: Gap, boundary: Boundary
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Give the ends (k,) of the edges around a gap, and the vertices that these are in the mesh."""
    rows, heads = gap.faces, gap.following
    welded = boundary.faces[rows]
    corners = faces[rows if boundary.rows is None else boundary.rows[rows]]
    starts = corners[welded == gap.vertices[:, None]]
    ends = corners[welded == heads[:, None]]
    return gap.vertices, heads, starts, ends
