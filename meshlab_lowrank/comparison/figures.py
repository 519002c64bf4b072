"""Figures that tell how good a fill is, with the true surface and without it.

All functions take arrays: the whole filled mesh and a mask of the faces that fill the hole, and
the same of the true mesh. They measure surfaces, not triangles, so fills of any triangulation
can be compared.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from meshlab_lowrank.comparison.crossings import count_crossing_faces
from meshlab_lowrank.comparison.roughness import detail_energy
from meshlab_lowrank.mesh.distance import ClosestPoints, TriangleIndex
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    corner_sum,
    edge_lengths,
    face_vectors,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.mesh.surface_part import SurfacePart
from meshlab_lowrank.mesh.topology import edges_of
from meshlab_lowrank.mesh.triangle_sampling import (
    SurfaceSamples,
    interpolate_normals,
    sample_surface,
)

_SAMPLES_PER_EDGE = 4
_LEAST_SAMPLES = 4_000
_MOST_SAMPLES = 10_000
_FLAT = 1e-3  # height of a degenerate triangle over its longest edge
RIGHT_ROUGHNESS, RIGHT_DIHEDRAL = (0.7, 1.25), (0.75, 1.2)
_FLAT_ANGLE = 1e-6  # degrees
_FLAT_DETAIL = 0.03  # root mean square detail, in mean edge lengths, under which there is none


@dataclass(frozen=True, kw_only=True)
class ErrorFigures:
    """How far a fill is from the truth.

    Attributes
    ----------
    rms, maximum : float
        Two-sided distance between fill and truth, in mesh units: the root of the mean of both
        sides' mean squares, and the larger of both sides' maxima.
    normal_error : float
        Mean angle between the interpolated normals of the fill and of the closest truth, over
        both sides, in degrees.
    roughness : float
        Detail energy of the fill over that of the truth; 1 is right, smooth fills are lower.
        NaN where the
        root mean square detail of the truth is under 0.03 edge lengths.
    dihedral : float
        Mean angle between two faces of the fill that share an edge, over that of the truth: 1 is
        right, a smooth fill is lower, one that is crumpled facet by facet higher. Unlike all
        others it depends on the triangles, so it tells something only of fills whose triangles
        are about as large as the truth's. NaN where either has no such edge or the truth is flat.
    """

    rms: float
    maximum: float
    normal_error: float
    roughness: float
    dihedral: float

    @property
    def looks_right(self) -> bool | None:
        """Whether the fill is about as rough as the truth, in its detail and facet by facet.

        Roughness 0.7 to 1.25 together with a dihedral ratio of 0.75 to 1.2; None where either is
        not known. Detail as strong as the truth's that is crumpled fails by the second.
        """
        if not np.isfinite([self.roughness, self.dihedral]).all():
            return None
        low, high = RIGHT_ROUGHNESS
        least, most = RIGHT_DIHEDRAL
        return bool(low <= self.roughness <= high and least <= self.dihedral <= most)

    def as_dict(self) -> dict[str, float]:
        """Give the figures by name."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class ShapeFigures:
    """What can be said of a fill without the truth.

    Attributes
    ----------
    faces : int
    flipped : int
        Faces that look away from the mean normal of their corners.
    degenerate : int
        Faces whose height is under a thousandth of their longest edge.
    self_crossing : int
        Faces that cross others of the mesh.
    rim_angle : float
        Largest dihedral angle across the rim in degrees, 0 where both sides lie in one plane;
        NaN if the part has no rim.
    roughness : float
        Detail energy of the fill over that of its surroundings; NaN where that of
        these is under 0.03 edge lengths.
    """

    faces: int
    flipped: int
    degenerate: int
    self_crossing: int
    rim_angle: float
    roughness: float

    def as_dict(self) -> dict[str, float]:
        """Give the figures by name."""
        return asdict(self)


def error_figures(fill: SurfacePart, truth: SurfacePart, edge_length: float) -> ErrorFigures:
    """Measure a fill against the surface that was removed.

    Parameters
    ----------
    fill, truth : SurfacePart
    edge_length : float
        Mean edge length around the hole, which sets the density of the samples (four an edge
        length) and the length scale of the roughness.

    Returns
    -------
    ErrorFigures
        NaN throughout if the fill or the truth has no area.
    """
    there, back = (
        compare_samples(fill, truth, edge_length),
        compare_samples(truth, fill, edge_length),
    )
    if there is None or back is None:
        nan = float("nan")
        return ErrorFigures(rms=nan, maximum=nan, normal_error=nan, roughness=nan, dihedral=nan)
    sides = (there, back)
    mean_square = np.mean([np.mean(side.distances**2) for side in sides])
    return ErrorFigures(
        rms=float(np.sqrt(mean_square)),
        maximum=float(max(side.distances.max() for side in sides)),
        normal_error=float(np.mean([side.angles.mean() for side in sides])),
        roughness=_ratio(
            detail_energy(fill, edge_length).inside,
            detail_energy(truth, edge_length).inside,
            edge_length,
        ),
        dihedral=_dihedral_ratio(fill, truth),
    )


@dataclass(frozen=True)
class SampleErrors:
    """Errors at the samples of one side.

    Attributes
    ----------
    samples : SurfaceSamples
        Face numbers count within the part.
    distances : (p,) float64
    angles : (p,) float64
        Degrees.
    """

    samples: SurfaceSamples
    distances: FloatArray
    angles: FloatArray


def compare_samples(
    source: SurfacePart, target: SurfacePart, edge_length: float
) -> SampleErrors | None:
    """Measure from samples of one part to the other; None if either has no area."""
    spacing = edge_length / _SAMPLES_PER_EDGE
    bounds = {"least": _LEAST_SAMPLES, "most": _MOST_SAMPLES}
    source_faces, target_faces = source.faces[source.part], target.faces[target.part]
    samples = sample_surface(source.vertices, source_faces, spacing, **bounds)
    if len(samples.points) == 0 or not target.has_area:
        return None
    closest = TriangleIndex(target.vertices, target_faces).closest(samples.points)
    own = _normals_at(source, samples)
    other = _normals_at(target, closest)
    sine = np.linalg.norm(np.cross(own, other), axis=1)
    cosine = np.einsum("pd,pd->p", own, other)
    return SampleErrors(samples, closest.distances, np.degrees(np.arctan2(sine, cosine)))


def shape_figures(fill: SurfacePart, edge_length: float) -> ShapeFigures:
    """Measure a fill by itself and against its surroundings.

    Parameters
    ----------
    fill : SurfacePart
    edge_length : float
        Mean edge length around the hole.

    Returns
    -------
    ShapeFigures
    """
    energy = detail_energy(fill, edge_length)
    return ShapeFigures(
        faces=int(fill.part.sum()),
        flipped=int((flipped_faces(fill.vertices, fill.faces) & fill.part).sum()),
        degenerate=int((degenerate_faces(fill.vertices, fill.faces) & fill.part).sum()),
        self_crossing=count_crossing_faces(fill.vertices, fill.faces, fill.part),
        rim_angle=rim_angle(fill),
        roughness=_ratio(energy.inside, energy.around, edge_length),
    )


def flipped_faces(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Mark faces whose normal points away from the sum of their corners' normals, (m,) bool.

    Corner normals are weighted by the angles of the faces there, which keeps a folded sliver from
    hiding behind its size.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64

    References
    ----------
    Thuermer and Wuethrich, Computing vertex normals from polygonal facets, 1998.
    """
    normals = normalized(face_vectors(vertices, faces))
    corners = vertices[faces]
    ahead = normalized(np.roll(corners, -1, axis=1) - corners)
    cosine = -np.einsum("mcd,mcd->mc", ahead, np.roll(ahead, 1, axis=1))
    weighted = np.arccos(cosine.clip(-1.0, 1.0))[:, :, None] * normals[:, None]
    at_vertices = normalized(corner_sum(faces, weighted.reshape(-1, 3), len(vertices)))
    return np.asarray(np.einsum("md,md->m", normals, at_vertices[faces].sum(axis=1)) < 0.0)


def degenerate_faces(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """Mark faces whose height is under a thousandth of their longest edge, (m,) bool."""
    doubled_area = 2.0 * np.linalg.norm(face_vectors(vertices, faces), axis=1)
    longest = edge_lengths(vertices, faces).max(axis=1)
    return np.asarray(doubled_area <= _FLAT * longest**2)


def rim_angle(fill: SurfacePart) -> float:
    """Largest dihedral angle between a face of the part and one outside it, in degrees."""
    pairs = _neighbours(fill.faces)
    across = pairs[fill.part[pairs[:, 0]] != fill.part[pairs[:, 1]]]
    return float(_dihedral_angles(fill, across).max()) if len(across) else float("nan")


def mean_dihedral_angle(surface: SurfacePart) -> float:
    """Mean angle between two faces of the part that share an edge, in degrees; NaN without any."""
    pairs = _neighbours(surface.faces)
    inner = pairs[surface.part[pairs].all(axis=1)]
    return float(_dihedral_angles(surface, inner).mean()) if len(inner) else float("nan")


def _dihedral_ratio(fill: SurfacePart, truth: SurfacePart) -> float:
    wanted = mean_dihedral_angle(truth)
    return mean_dihedral_angle(fill) / wanted if wanted > _FLAT_ANGLE else float("nan")


def _neighbours(faces: IntArray) -> IntArray:
    """Give the pairs of faces (p, 2) on the two sides of an edge."""
    edges = edges_of(faces)
    order = np.argsort(edges.face_edges.ravel(), kind="stable")
    edge = edges.face_edges.ravel()[order]
    same = np.flatnonzero((edge[1:] == edge[:-1]) & (edges.face_count[edge[1:]] == 2))
    return np.column_stack([order[same] // 3, order[same + 1] // 3])


def _dihedral_angles(surface: SurfacePart, pairs: IntArray) -> FloatArray:
    """Give the angles (p,) in degrees between the normals of pairs of faces."""
    one, other = face_vectors(surface.vertices, surface.faces)[pairs].transpose(1, 0, 2)
    sine = np.linalg.norm(np.cross(one, other), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("pd,pd->p", one, other))))


def _normals_at(surface: SurfacePart, places: SurfaceSamples | ClosestPoints) -> FloatArray:
    normals = vertex_normals(surface.vertices, surface.faces)
    corners = surface.faces[surface.part][places.faces]
    return interpolate_normals(normals, corners, places.barycentric)


def _ratio(energy: float, reference: float, edge_length: float) -> float:
    if not reference > (_FLAT_DETAIL * edge_length) ** 2:
        return float("nan")
    return energy / reference
