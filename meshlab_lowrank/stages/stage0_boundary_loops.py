"""Stage 0: the boundary loops of a mesh, and which of them are outer rims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from meshlab_lowrank.mesh.boundary_walk import BoundaryWalk, Loop, flat_area, loose_chains
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray, face_vectors
from meshlab_lowrank.mesh.seams import seam_pairs, welded
from meshlab_lowrank.mesh.topology import Border, border_of, faces_at, vertex_components
from meshlab_lowrank.mesh.validation import bad_edges
from meshlab_lowrank.result import HoleShape

_RIM = 0.8 * np.pi  # a hemisphere has pi, a closed box without its lid 0.4 pi
_AS_LARGE = 0.95
_LEAST_SHARE = 1e-12  # a component of less area than that has none
_FAR_POINTS = 1000
_BLOCK = 50_000
_SINGLE_FACE = "A single face has nothing to fill."
_SEAMS = (
    "{} boundary edges lie on one another: seams where vertices are doubled, not holes. Nothing is "
    "laid over them; apply meshing_remove_duplicate_vertices to close them."
)


@dataclass(frozen=True, kw_only=True)
class BoundaryLoop:
    """One closed chain of edges that have a face on one side only.

    Attributes
    ----------
    id : int
        Place in the hole table.
    vertices : (k,) int64
        Each vertex once, in the order of a face that fills the hole (such a face runs from
        vertices[i] to vertices[i + 1]); the smallest index first.
    faces : (k,) int64
        The face at the edge from vertices[i] to vertices[i + 1].
    perimeter : float
        Length, in the units of the mesh.
    diameter : float
        Largest distance between two of its vertices (within a thousandth of the perimeter for
        loops of more than 1000 edges).
    area : float
        Area of the loop seen along its mean normal: that of a flat fill.
    planarity : float
        Root mean square distance of the vertices from their best plane, over the diameter.
    turning : float
        Sum over the vertices of pi minus the angle of the smoothed surface: -2 pi for a hole in a
        plane, 0 for the end of a cylinder, 2 pi for the rim of a flat sheet. Of a chain that is
        split where that angle can't be told, the loop of the largest area has that of the whole
        chain, and the pockets that it encloses have -2 pi.
    component : int
        Number of the connected component, the components ordered by their smallest vertex; the
        largest where several meet at vertices of the loop.
    is_rim : bool
        Whether it is the outer rim of an open sheet, which is left open unless asked otherwise.
    pinched : bool
        Whether other parts of the boundary meet one of its vertices.
    shape : {"hole", "rim", "single face", "bad edges"}
        What it was recognised as: a hole, the outer rim of an open sheet, the edges of a face by
        itself, or a chain beside an edge that has more than two faces or faces oriented against
        one another: with a face that touches both. A chain, if it is no rim, has one entry of
        vertices an edge, may not close, and its turning is 0.
    reason : str
        Why it can't be filled; empty if it can.
    """

    id: int
    vertices: IntArray
    faces: IntArray
    perimeter: float
    diameter: float
    area: float
    planarity: float
    turning: float
    component: int
    is_rim: bool
    pinched: bool
    shape: HoleShape
    reason: str


@dataclass(frozen=True)
class Boundary:
    """The boundary loops of a mesh, and what of it can be worked with.

    Attributes
    ----------
    loops : tuple of BoundaryLoop
    faces : (f, 3) int64
        An oriented manifold: the faces that touch no edge with more than two faces or with faces
        oriented against one another, with one vertex where vertices are doubled along a seam.
    rows : (f,) int64 or None
        Their rows in the mesh; None: all.
    welded : bool
        Whether there are seams.
    notes : tuple of str
        What is no hole, or no surface to work with, and what repairs it.
    """

    loops: tuple[BoundaryLoop, ...]
    faces: IntArray
    rows: IntArray | None = None
    welded: bool = False
    notes: tuple[str, ...] = ()


def boundary_loops(vertices: FloatArray, faces: IntArray) -> tuple[BoundaryLoop, ...]:
    """Find every boundary loop once; see `find_boundary`."""
    return find_boundary(vertices, faces).loops


def find_boundary(vertices: FloatArray, faces: IntArray) -> Boundary:
    """Find every boundary loop once.

    Edges that lie on one another are seams, and none of a loop; vertices that are doubled along
    them count as one. Half-edges are walked along the gap: where several fans of faces lie side by
    side at a vertex, like the sectors of a disc, each of the gaps between them is one of its own;
    where they lie otherwise, the walk goes around its fan. A chain that meets a vertex twice is
    split there into loops without repetition, so two sheets that touch at a vertex keep their rims.
    Time is linear in the mesh but for one sort.

    A loop is an outer rim if (2 pi + turning) times its flat area is at least 0.8 pi times the
    area of its component. By the theorem of Gauss and Bonnet the first factor is the total
    curvature of the piece that is missing, however jagged its outline: about 0 for a hole in a
    sheet, 2 pi for the end of a cylinder and for half a sphere, 4 pi for the rim of a flat sheet.
    It is taken as at least 2 pi for the largest loop of a component, as roughness adds up along it.
    A statue's open base or the end of a tube, small beside the rest, thus counts as a hole. The
    largest loops of a component are rims too if a flat fill would be larger than all of it, like
    the two of a narrow band.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    Returns
    -------
    Boundary
        Its loops longest first (in edges); equally long ones by their smallest vertex index.
    """
    n = len(vertices)
    border = border_of(faces, n)
    pairs = seam_pairs(vertices, faces, border.half_edges)
    notes = []
    if len(pairs):
        notes.append(_SEAMS.format(2 * len(pairs)))
        faces = welded(faces, n, pairs)
        border = border_of(faces, n)
    bad = bad_edges(border)
    rows = None
    if len(border.half_edges) == 0:
        loops: tuple[BoundaryLoop, ...] = ()
    elif not bad:
        walk = BoundaryWalk(vertices, faces, border.half_edges)
        loops = _measured(vertices, faces, walk.faces, walk.pinched, walk.loops(vertices))
    else:
        rows, loops = _beside_bad_edges(vertices, faces, border, bad)
    if bad:
        count = sum(loop.shape == "bad edges" for loop in loops)
        left = f"Holes left open for that: {count}." if count else "No hole lies there."
        notes.append(f"{bad} {left}")
    clean = faces if rows is None else faces[rows]
    return Boundary(loops, clean, rows, welded=len(pairs) > 0, notes=tuple(notes))


def _beside_bad_edges(
    vertices: FloatArray, faces: IntArray, border: Border, note: str
) -> tuple[IntArray, tuple[BoundaryLoop, ...]]:
    """Find the faces that touch no bad edge, and the loops, with those that can't be walked."""
    n = len(vertices)
    bad = np.zeros(n, dtype=np.bool_)
    bad[border.bad_vertices] = True
    touched = faces_at(bad, faces)
    clean = np.flatnonzero(~touched)
    bad[faces[touched]] = True
    walk = BoundaryWalk(vertices, faces[clean], border_of(faces[clean], n).half_edges)
    loops = [
        replace(loop, faces=clean[loop.faces])
        for loop in walk.loops(vertices)
        if not bad[loop.vertices].any()
    ]
    loops += loose_chains(faces, border.half_edges, loops)
    split = faces.copy()
    split[clean] = walk.faces
    return clean, _measured(vertices, faces, split, walk.pinched, loops, note=note)


def _measured(
    vertices: FloatArray,
    faces: IntArray,
    split: IntArray,
    pinched: BoolArray,
    loops: Sequence[Loop],
    *,
    note: str = "",
) -> tuple[BoundaryLoop, ...]:
    """Measure loops, and chains at bad edges; split faces have a vertex of its own for each fan."""
    loops = sorted(loops, key=Loop.order)
    flat_areas = np.array([flat_area(vertices[loop.vertices]) for loop in loops])
    labels = _face_components(split)
    areas = _component_areas(vertices, faces, labels)
    touched = [np.unique(labels[loop.faces]) for loop in loops]  # several at pinched vertices
    component = np.array([each[np.argmax(areas[each])] for each in touched], dtype=np.int64)
    is_rim = _rims(flat_areas, np.array([loop.turning for loop in loops]), component, areas)
    found = []
    for i, loop in enumerate(loops):
        points = vertices[loop.vertices]
        diameter = _diameter(points)
        shape, reason = _shape(loop, is_rim=bool(is_rim[i]), note=note)
        found.append(
            BoundaryLoop(
                id=i,
                vertices=loop.vertices,
                faces=loop.faces,
                perimeter=float(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).sum()),
                diameter=diameter,
                area=float(flat_areas[i]),
                planarity=_planarity(points, diameter),
                turning=loop.turning,
                component=int(component[i]),
                is_rim=bool(is_rim[i]),
                pinched=bool(pinched[loop.vertices].any()),
                shape=shape,
                reason=reason,
            )
        )
    return tuple(found)


def _shape(loop: Loop, *, is_rim: bool, note: str) -> tuple[HoleShape, str]:
    """Say what a loop is, and why it can't be filled."""
    if loop.loose:
        shape: HoleShape = "rim" if is_rim else "bad edges"
        return shape, f"Bad edges lie at its rim: {note[0].lower()}{note[1:]}"
    if np.all(loop.faces == loop.faces[0]):
        return "single face", _SINGLE_FACE
    return "rim" if is_rim else "hole", ""


def _face_components(faces: IntArray) -> IntArray:
    """Give the number of each face's component, (m,), ordered by their smallest vertices."""
    labels = vertex_components(faces, int(faces.max()) + 1)[faces[:, 0]]
    number = np.cumsum(np.bincount(labels) > 0) - 1  # vertices without faces don't count
    return np.asarray(number[labels])


def _component_areas(vertices: FloatArray, faces: IntArray, labels: IntArray) -> FloatArray:
    """Sum the areas of faces (m, 3) with each label, a block at a time to save memory."""
    count = int(labels.max()) + 1
    areas = np.zeros(count)
    for start in range(0, len(faces), _BLOCK):
        block = slice(start, start + _BLOCK)
        sizes = np.linalg.norm(face_vectors(vertices, faces[block]), axis=1)
        areas += np.bincount(labels[block], sizes, minlength=count)
    return areas


def _rims(
    flat_areas: FloatArray, turnings: FloatArray, component: IntArray, component_areas: FloatArray
) -> BoolArray:
    """Mark the loops that are outer rims of open sheets, (loops,)."""
    least = np.maximum(component_areas[component], _LEAST_SHARE * flat_areas)
    share = np.divide(flat_areas, least, out=np.zeros_like(least), where=least > 0.0)
    largest = np.zeros(len(component_areas))
    np.maximum.at(largest, component, share)
    band = (share > 1.0) & (share >= _AS_LARGE * largest[component])
    # The roughness of a long rim adds up in its turning, but nothing lies around the largest loop.
    turnings = np.where(share == largest[component], np.maximum(turnings, 0.0), turnings)
    return np.asarray(((2.0 * np.pi + turnings) * share >= _RIM) | band)


def _diameter(points: FloatArray) -> float:
    """Largest distance between two points (k, 3), one of them among at most 1000."""
    return float(cdist(points[:: 1 + (len(points) - 1) // _FAR_POINTS], points).max())


def _planarity(points: FloatArray, diameter: float) -> float:
    """Root mean square distance of points (k, 3) from their best plane, over their diameter."""
    spokes = (points - points.mean(axis=0)) / (diameter or 1.0)
    least = np.linalg.eigvalsh(spokes.T @ spokes)[0]
    return float(np.sqrt(max(least, 0.0) / len(points)))
