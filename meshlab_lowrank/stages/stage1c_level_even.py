"""Stage 1, level: an even surface, whatever the triangles of the mesh are."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.hole import start_hole
from meshlab_lowrank.mesh.distance import TriangleIndex
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, edge_lengths, face_vectors
from meshlab_lowrank.mesh.topology import edges_of, faces_at
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage1a_close_remesher import remeshed_surface
from meshlab_lowrank.stages.stage1c_level import Level
from meshlab_lowrank.stages.stage1c_level_mesh_itself import mesh_itself

_FINER = 4.0  # faces for each of an even surface that it is made from, at most twice as many
_TARGET_FACTOR = 1.015  # the remesher's target over the edge length that comes of it
_ROUNDS = 6
_AGGRESSIVENESS = 5.0


@dataclass(frozen=True)
class EvenLevel(Stage):
    """A surface with triangles of one size; see `ChooseLevel`.

    The mesh itself where it is even and no other spacing is asked for.

    Parameters
    ----------
    uneven : float
        Coefficient of variation of the edge lengths from which on the mesh itself won't do.
    doubtful : float
        The same where trials on the mesh itself gained nothing.
    coarsest : float
    """

    uneven: float = 0.42
    doubtful: float = 0.22
    coarsest: float = 16.0

    def __call__(self, region: Region, factor: float, *, rim_normals: bool) -> Level:
        """Make the surface; see `ChooseLevel`."""
        lengths = edge_lengths(region.vertices, region.faces)
        if factor != 1.0:
            return _even(region, factor, rim_normals)
        if lengths.std() > self.uneven * lengths.mean():
            with suppress(StageError):
                return _even(region, factor, rim_normals)
        return mesh_itself(region, rim_normals=rim_normals)

    def for_even(self) -> EvenLevel:
        """Less patience with the mesh itself."""
        return replace(self, uneven=min(self.uneven, self.doubtful))


def _even(region: Region, factor: float, rim_normals: bool) -> Level:
    """Mesh a region evenly, so many times coarser than as many triangles would be."""
    areas = np.linalg.norm(face_vectors(region.vertices, region.faces), axis=1)
    spacing = factor * float(np.sqrt(areas.mean() * 4.0 / np.sqrt(3.0)))
    vertices, faces = even_surface(region.vertices / spacing, region.faces)
    below = TriangleIndex(region.vertices / spacing, region.faces).closest(vertices)
    unknown = ~region.known_faces[below.faces]
    if unknown.all() or not unknown.any():
        msg = "The hole is too small for such triangles."
        raise StageError(msg)
    known_faces = ~faces_at(unknown, faces)
    hole = start_hole(
        vertices,
        faces,
        unknown=unknown,
        known_faces=known_faces,
        loop=np.setdiff1d(faces[~known_faces], np.flatnonzero(unknown)),
        rim_normals=rim_normals,
    )
    return Level(hole, spacing, is_mesh=False)


def even_surface(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Give a surface triangles with edges of length 1, about.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
        No edge has more than two.

    Returns
    -------
    vertices : (p, 3) float64
    faces : (q, 3) int64

    Raises
    ------
    StageError
        If the surface is too small for such triangles, or MeshLab tears it.
    """
    areas = np.linalg.norm(face_vectors(vertices, faces), axis=1)
    wanted = areas.sum() / (0.25 * np.sqrt(3.0))
    if len(faces) > 2.0 * _FINER * wanted:
        import fast_simplification  # noqa: PLC0415  importing is light

        fewer, triangles = fast_simplification.simplify(
            vertices.astype(np.float32),
            faces.astype(np.int32),
            target_count=max(int(_FINER * wanted), 4),
            agg=_AGGRESSIVENESS,
        )
        vertices, faces = fewer.astype(np.float64), triangles.astype(np.int64)
    points, even = remeshed_surface(vertices, faces, _TARGET_FACTOR, _ROUNDS)
    if len(even) == 0 or edges_of(even).face_count.max() > 2:
        msg = "The surroundings of this hole are too small or too torn to be meshed evenly."
        raise StageError(msg)
    return points, even
