"""What a run gives back, and what it tells on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.plain_text import gist_line

HoleStatus: TypeAlias = Literal["filled", "skipped", "failed"]
HoleShape: TypeAlias = Literal[
    "hole", "rim", "single face", "bad edges", "cut", "ring", "island", "patch"
]
# NaN in a record, None in JSON
NOT_ALWAYS_KNOWN = ("rim_angle", "edge_ratio", "trust", "median_error", "largest_error")


@dataclass(frozen=True, kw_only=True)
class HoleRecord:
    """What became of one boundary loop.

    Attributes
    ----------
    id : int
        Number of the loop, as in the hole table.
    status : {"filled", "skipped", "failed"}
    shape : {"hole", "rim", "single face", "bad edges", "cut", "ring", "island", "patch"}
        What it was recognised as, see `BoundaryLoop`; "cut" for a hole that was capped flat since
        its rim is, and is met steeply all round; "ring" for one that was filled around pieces of
        surface inside it, and "island" for the rims of these; "patch" for selected vertices.
    reason : str
        Why it was skipped or failed, why its shape is not the usual one, what it crosses, how far
        it leaves the bounding box of its surroundings if by more than a tenth of the hole's
        diameter, why it got no detail or why its trust is not known; empty otherwise.
    boundary_edges : int
    perimeter, diameter : float
        In the units of the mesh.
    new_vertices, new_faces : int
    crossings : int
        Pairs of a new face and any other that cross or lie on one another.
    creases : int
        How many creases, sharp edges of the surroundings, were joined across it; the edges that
        meet in a corner count one by one.
    folded_edges, flat_faces : int
        Edges of the fill at which two faces lie folded onto one another (normals more than 101
        degrees apart; not those at which a flat cap meets its rim, nor joined creases), and new
        faces without area.
    rim_angle : float
        Largest angle between the normals of a new face and the known face at an edge of the rim,
        in degrees; 0 where the fill goes on in the plane of its surroundings. NaN without a fill.
    edge_ratio : float
        Mean edge length of the new faces over that of the known faces at the rim. NaN without a
        fill.
    trust : float
        How far the recovered detail can be believed: the share of the variance of the true detail
        that it is expected to explain, from 0 (a smooth fill) to 1. NaN where nothing tells: with
        ``preset="paper"``, and with ``detail="full"`` where there was no room to try it out.
    median_error, largest_error : float
        Of the error bars of its new vertices, see `InpaintResult.error`, in the units of the mesh.
        NaN where they are not known, and where there are none.

    See Also
    --------
    InpaintResult : Holds them.

    Examples
    --------
    >>> from meshlab_lowrank import HoleRecord
    >>> record = HoleRecord(
    ...     id=0, status="filled", reason="", boundary_edges=8, perimeter=8.0, diameter=2.8
    ... )
    >>> record.as_dict()["status"], record.as_dict()["trust"]
    ('filled', 0.0)
    """

    id: int
    status: HoleStatus
    shape: HoleShape = "hole"
    reason: str
    boundary_edges: int
    perimeter: float
    diameter: float
    new_vertices: int = 0
    new_faces: int = 0
    crossings: int = 0
    creases: int = 0
    folded_edges: int = 0
    flat_faces: int = 0
    rim_angle: float = math.nan
    edge_ratio: float = math.nan
    trust: float = 0.0
    median_error: float = math.nan
    largest_error: float = math.nan

    def __repr__(self) -> str:
        """Tell the gist on a line."""
        gist = f"{self.shape} of {self.boundary_edges} edges {self.status}"
        if self.status == "filled":
            gist += f" by {self.new_faces} faces, trust {self.trust:.2f}"
        return gist_line(f"HoleRecord {self.id}", gist, self.reason)

    def as_dict(self) -> dict[str, Any]:
        """Give the record as a plain dictionary, ready for JSON, with None for NaN."""
        unknown = {name: None for name in NOT_ALWAYS_KNOWN if math.isnan(getattr(self, name))}
        return {**asdict(self), **unknown}


@dataclass(frozen=True, kw_only=True)
class InpaintResult:
    """A mesh with its holes filled.

    Attributes
    ----------
    vertices : (n', 3) float64
        The first n rows are the input, bit for bit.
    faces : (m', 3) int64
        The first m rows are the input.
    new_vertices : (n',) bool
    new_faces : (m',) bool
    trust : (n',) float64
        1 on measured vertices; on new ones the share of the variance of what a smooth fill misses
        that is expected to be right there, which falls inwards. NaN where nothing tells.
    error : (n',) float64
        Error bars in the units of the mesh: the distance to the true surface that is not exceeded
        in 68 % of cases, and twice it in 95 %. 0 on measured vertices, whose own error nobody knows
        here; NaN on new ones where nothing tells: on flat caps and along joined creases, and where
        the surroundings are too small to try a fill on.
    holes : tuple of HoleRecord
        One a boundary loop, in the order of the hole table.
    notes : tuple of str
        What is wrong with the mesh as a whole.
    mesh : trimesh.Trimesh, pyvista.PolyData, open3d.geometry.TriangleMesh or None
        The whole result as a mesh of the kind that was given; None if arrays were.

    See Also
    --------
    inpaint, restore_detail : Give it.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> mesh = ms.current_mesh()
    >>> vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    >>> parameters = meshlab_lowrank.InpaintParameters(detail="none")
    >>> result = meshlab_lowrank.inpaint(vertices, faces, parameters=parameters)
    >>> len(result.faces) - len(faces) == int(result.new_faces.sum()) == result.holes[0].new_faces
    True
    """

    vertices: FloatArray
    faces: IntArray
    new_vertices: BoolArray
    new_faces: BoolArray
    trust: FloatArray
    error: FloatArray
    holes: tuple[HoleRecord, ...]
    notes: tuple[str, ...] = ()
    mesh: Any = None

    def __repr__(self) -> str:
        """Tell the gist on a line."""
        filled = sum(hole.status == "filled" for hole in self.holes)
        new = f"{self.new_vertices.sum()} new vertices, {self.new_faces.sum()} new faces"
        return f"<InpaintResult: {filled} of {len(self.holes)} holes filled, {new}>"


@dataclass(frozen=True)
class ProgressEvent:
    """One step of a run.

    Attributes
    ----------
    hole : int
        Number of holes that are done, or one less when all are: the position of the hole that is
        worked on, where it is one at a time.
    holes : int
        Number of holes that are filled.
    stage : str
        Name of the stage that begins.
    fraction : float
        Part of the whole run that is done, from 0 to 1.

    See Also
    --------
    inpaint : Tells of each step by one.

    Examples
    --------
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> mesh = ms.current_mesh()
    >>> vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    >>> parameters = meshlab_lowrank.InpaintParameters(detail="none")
    >>> result = meshlab_lowrank.inpaint(
    ...     vertices, faces, parameters=parameters, progress=lambda event: print(event.stage)
    ... )
    closing
    fairing
    done
    """

    hole: int
    holes: int
    stage: str
    fraction: float


ProgressCallback: TypeAlias = Callable[[ProgressEvent], object]
