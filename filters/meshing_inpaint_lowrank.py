"""The filter `meshing_inpaint_lowrank`."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pymeshlab

from meshlab_lowrank.errors import InvalidMeshError, InvalidParameterError, LowrankError
from meshlab_lowrank.filters.attribute_writing import AttributeWriter, mark_as_measured
from meshlab_lowrank.filters.breeding import Growth, can_part
from meshlab_lowrank.filters.filter_arguments import METHOD_PARAMETERS, flag, inpaint_parameters
from meshlab_lowrank.filters.filter_script import unrecorded
from meshlab_lowrank.filters.growing import Fill, grow
from meshlab_lowrank.filters.interruption import uninterrupted
from meshlab_lowrank.filters.placing import untransformed
from meshlab_lowrank.filters.reading import (
    current_mesh,
    custom_attributes,
    mesh_arrays,
    texture_indices,
    wedge_coordinates,
)
from meshlab_lowrank.filters.script_steps import recorded
from meshlab_lowrank.filters.summary import summary
from meshlab_lowrank.filters.texture_charts import RimTexture, rim_texture, vertex_rim_texture
from meshlab_lowrank.filters.texture_notes import texture_notes
from meshlab_lowrank.filters.trust_showing import (
    ShowTrust,
    checked_show_trust,
    places_for_trust,
    show_trust,
)
from meshlab_lowrank.filters.undoing import Undo, undone_on_error
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import BoolArray, IntArray
from meshlab_lowrank.mesh.topology import border_of
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.result import ProgressCallback
from meshlab_lowrank.signatures import showing_parameters

_LOGGER = logging.getLogger(__name__)
_NAME = "meshing_inpaint_lowrank"


@recorded
@showing_parameters()
def meshing_inpaint_lowrank(
    ms: pymeshlab.MeshSet,
    *,
    selected: bool = False,
    holes: Sequence[int] | None = None,
    near: Sequence[float] | None = None,
    showtrust: ShowTrust | None = None,
    progress: ProgressCallback | None = None,
    pipeline: Pipeline | None = None,
    **parameters: Any,
) -> dict[str, Any]:
    """Fill the holes of the current mesh and bring back the detail that was lost there.

    The mesh keeps its id, name, visibility and transform, its vertices and faces their row,
    positions and attributes; normals are computed anew, polygons become triangles. Colours,
    qualities, texture coordinates and custom attributes run on into the fill; where the rim of a
    fill lies in several texture charts, it gets the texel of one rim vertex instead. Vertices and
    faces have the custom attribute "inpainted", 1 on new ones and 0 on measured ones, and vertices
    "inpaint_trust" and "inpaint_error", see `InpaintResult`, also where nothing was filled. Where
    vertices had no quality, it shows the trust after a fill. New faces are selected afterwards,
    nothing else.

    Parameters
    ----------
    ms : pymeshlab.MeshSet
    selected : bool
        Fill only holes with at least one selected face at their boundary. False unless asked for:
        MeshLab's own filter takes True whenever any face is selected, but each run leaves the new
        faces selected, and a second one would then pass over all other holes.
    holes : sequence of int, optional
        Fill only holes with these numbers, see `get_hole_measures`.
    near : sequence of three floats, optional
        Fill only the hole whose rim lies nearest to this point, in the coordinates of the mesh
        without its transform.
    showtrust : {"quality", "colour", "none"}, optional
        Where the trust of vertices is shown to other programs: in their quality, 1 on measured
        ones and at most 0.99 on new ones, 0 where it is not known; in their colour, grey on
        measured ones and from red to yellow on new ones; or not at all. Quality and colours that
        the mesh has stay and run on, unless they show the trust of an earlier run, or what is
        asked for is the same on all vertices, as on a mesh made from arrays. None: in the quality
        if the mesh has none.
    progress : callable, optional
        Called with a `ProgressEvent` at each step; returning False stops the run.
    pipeline : Pipeline, optional
        Stages to run instead of a preset's, see `meshlab_lowrank.inpaint`.
    preset : {"auto", "paper"}
        Which choice each stage makes; ``"paper"`` is the published algorithm, its stages 2 to 6
        as written.
    base : {"meshlab", "bspline"}
        Stage 1 of ``preset="paper"``: MeshLab's closing and our fairing, or the circular B-spline
        surface that the paper describes.
    maxholesize : int
        Longest boundary loop that is filled, in edges, inclusive; 0 is no limit.
    minholesize : int
        Shortest one, in edges, inclusive.
    maxholelength, minholelength : float
        Longest and shortest perimeter of what is filled, in the units of the mesh, inclusive; 0 is
        no limit.
    closerim : bool
        Fill the outer rims of open sheets too.
    detail : {"calibrated", "full", "none"}
        Detail scaled by how far it can be trusted, all of it, or the smooth fill. ``"full"`` by
        default with ``preset="paper"``.
    continuity : {"auto", "crease", "flat", "tangent", "smooth"}
        How fills go on from the rim.
    refineedgelen : float, str, pymeshlab.PercentageValue or pymeshlab.PureValue, optional
        Edge length of the fill: a number or a `pymeshlab.PureValue` in the units of the mesh, or
        a part of the diagonal of its bounding box, as ``"1%"`` or a `pymeshlab.PercentageValue`.
        That of the surroundings by default.
    seed : int
        Of every random choice.
    patchsize, ringnumber, similarpatches, iterations : int, optional
        Samples of a patch, rings around the hole in which patches are taken, patches of a group,
        passes over the method; the preset chooses by default.
    tau, delta, gamma, truncation, mu, beta : optional
    completioniterations, completiontolerance : optional
    refinementiterations, refinementtolerance : optional
    updateiterations : int
        Constants of the paper's equations, for ``preset="paper"`` only; see `InpaintParameters`.

    Returns
    -------
    dict
        "closed_holes", "skipped_holes", "failed_holes", "new_faces", "new_vertices",
        "untextured_faces" (new faces into which a texture could not run on): numbers;
        "texture_notes": why it could not, and what to do;
        "holes": a dictionary for each boundary loop, see `HoleRecord`.

    Raises
    ------
    pymeshlab.PyMeshLabException
        If there is no mesh, it has no faces or can't be worked on, a parameter is wrong, or
        ``selected``, ``holes`` and ``near`` leave nothing to fill; nothing was changed.
    InpaintCancelledError
        If ``progress`` returned False; nothing was changed.

    Notes
    -----
    PLY files keep the marks if asked to: ``ms.save_current_mesh("whole.ply",
    __ca_vs__inpainted=True, __ca_vs__inpaint_trust=True, __ca_vs__inpaint_error=True,
    __ca_fs__inpainted=True)``.

    A mesh with custom attributes should not be copied by `MeshSet.add_mesh`: MeshLab's filters by
    function crash on the copy.

    Where texture coordinates belong to wedges, MeshLab switches those of vertices on as well; each
    vertex then has those of one of its wedges.

    The quality of faces without colours is not extended: new faces have that of some face near.

    MeshLab crashes as it reads a CTM file with quality and no colours; show no quality in those.

    Not for threads: MeshLab keeps the defaults of its remesher for the whole process (they are put
    back afterwards), its output is switched off by redirecting that of the process, and the
    threads of linear algebra are limited for the process. Runs at the same time belong in
    processes, as `batch` does it.

    See Also
    --------
    get_hole_measures : The holes, without filling them.
    apply_coord_inpaint_lowrank : For the fill of another filter.
    compute_selection_inpainted_lowrank : Selects the fills, also after a file was read again.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> report = ms.meshing_inpaint_lowrank(maxholesize=400, detail="none")
    >>> report["closed_holes"], report["holes"][0]["boundary_edges"]
    (1, 20)
    >>> ms.current_mesh().selected_face_number() == report["new_faces"]
    True
    """
    mesh = current_mesh(ms, _NAME)
    settings = inpaint_parameters(_NAME, parameters, METHOD_PARAMETERS)
    mesh.compact()
    places = _places_for_trust(mesh, showtrust)
    marked = _selected_faces(mesh) if flag(_NAME, "selected", selected) else None
    try:
        with unrecorded(ms):
            names = custom_attributes(ms, _NAME)
        result = inpaint(
            *mesh_arrays(mesh),
            parameters=settings,
            progress=progress,
            selected_faces=marked,
            holes=holes,
            near=near,
            pipeline=pipeline,
        )
    except (InvalidMeshError, InvalidParameterError) as error:
        msg = f"Filter {_NAME}: {error}"
        raise pymeshlab.PyMeshLabException(msg) from error
    counts = {
        "new_faces": int(np.count_nonzero(result.new_faces)),
        "new_vertices": int(np.count_nonzero(result.new_vertices)),
    }
    out = summary(result, **counts)
    n, m = mesh.vertex_number(), mesh.face_number()
    fill = Fill(
        result.vertices[n:].copy(),
        result.faces[m:].copy(),
        n,
        m,
        result.trust[n:].copy(),
        result.error[n:].copy(),
    )
    bad = np.zeros(0, dtype=np.int64)
    if result.notes and len(fill.faces):
        bad = border_of(result.faces[:m], n).bad_vertices
        if len(bad) and not can_part(mesh):
            msg = (
                f"Filter {_NAME}: {result.notes[0]} Fills can't be written into a mesh with such "
                "edges without loss of its curvature directions."
            )
            raise pymeshlab.PyMeshLabException(msg)
    owner = np.repeat([h.id for h in result.holes], [h.new_faces for h in result.holes])
    del result  # writing takes much memory
    untextured: BoolArray | None = None
    if len(fill.faces) == 0:
        with uninterrupted(), unrecorded(ms):
            ms.set_selection_none(allfaces=True, allverts=True)
            mark_as_measured(ms, names)
    else:
        with (
            uninterrupted(),
            undone_on_error(ms, names) as undo,
            unrecorded(ms),
            untransformed(ms),
        ):
            untextured = _write(ms, fill, bad, undo)
            show_trust(ms, places)
    told = [] if untextured is None else _told(mesh, untextured, owner)
    return {
        **out,
        "untextured_faces": 0 if untextured is None else int(np.count_nonzero(untextured)),
        "texture_notes": told,
    }


def _places_for_trust(mesh: pymeshlab.Mesh, showtrust: object) -> frozenset[str]:
    try:
        return places_for_trust(mesh, checked_show_trust(showtrust))
    except InvalidParameterError as error:
        msg = f"Filter {_NAME}: {error}"
        raise pymeshlab.PyMeshLabException(msg) from error


def _told(mesh: pymeshlab.Mesh, untextured: BoolArray, owner: IntArray) -> list[str]:
    holes = np.unique(owner[untextured]).tolist()
    count = int(np.count_nonzero(untextured))
    notes = texture_notes(
        holes,
        count,
        of_vertices=not mesh.has_wedge_tex_coord(),
        has_image=mesh.texture_number() > 0,
    )
    for note in notes:
        _LOGGER.warning(note)
    return notes


def _selected_faces(mesh: pymeshlab.Mesh) -> BoolArray:
    if mesh.selected_face_number() == 0:
        msg = f"Filter {_NAME}: no face is selected; select faces at the holes or drop selected."
        raise pymeshlab.PyMeshLabException(msg)
    marked: BoolArray = mesh.face_selection_array().astype(np.bool_)
    return marked


def _write(
    ms: pymeshlab.MeshSet, fill: Fill, bad_vertices: IntArray, undo: Undo
) -> BoolArray | None:
    """Append the new elements to the current mesh.

    Returns
    -------
    (q,) bool or None
        New faces, in the order of the fill, into which the texture doesn't run on; None if the
        mesh has none.
    """
    mesh = ms.current_mesh()
    texture = _texture(ms, fill)
    vertex_texture = mesh.vertex_tex_coord_matrix() if mesh.has_vertex_tex_coord() else None
    vertex_rim = None
    if vertex_texture is not None:
        vertex_rim = vertex_rim_texture(mesh.vertex_matrix(), fill.faces, vertex_texture)
    grown = grow(
        ms,
        Growth(
            new_faces=fill.faces,
            new_vertex_count=len(fill.vertices),
            textures=np.zeros(0, dtype=np.int64) if texture is None else texture.textures,
            bad_vertices=bad_vertices,
        ),
        undo,
    )
    fill = replace(fill, faces=fill.faces[grown.order])
    writer = AttributeWriter(ms, fill, grown, undo)
    parted = len(bad_vertices) > 0
    writer.write(
        undo.names,
        texture,
        vertex_texture=vertex_texture,
        vertex_rim=vertex_rim,
        parted=parted,
    )
    grown.aside.move(np.concatenate([grown.positions, fill.vertices]))
    ms.meshing_poly_to_tri()  # MeshLab writes some formats with hidden edges as other faces
    ms.set_selection_none(allfaces=False, allverts=True)
    if not (
        undo.holds()
        and np.array_equal(mesh.vertex_matrix()[fill.vertex_count :], fill.vertices)
        and np.array_equal(mesh.face_matrix()[fill.face_count :], fill.faces)
    ):
        msg = f"Filter {_NAME} could not write the fill into the mesh, which is as it was."
        raise LowrankError(msg)
    shown = texture or vertex_rim
    return None if shown is None else ~shown.in_one_chart


def _texture(ms: pymeshlab.MeshSet, fill: Fill) -> RimTexture | None:
    mesh = ms.current_mesh()
    wedges = wedge_coordinates(mesh)
    if wedges is None:
        return None
    indices = texture_indices(ms)
    if indices is None:
        indices = np.zeros(len(wedges), dtype=np.int64)
    faces = mesh.face_matrix().astype(np.int64)
    return rim_texture(mesh.vertex_matrix(), faces, fill.faces, wedges, indices)
