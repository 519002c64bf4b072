"""Stage 6, relief: patches of heights, those to take from and those to put."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.mesh.sampling import spread_points
from meshlab_lowrank.stages.stage2a_frames import tangent_frames, turned
from meshlab_lowrank.stages.stage2b_patches_grid import (
    HexagonalGrid,
    SurfaceLocator,
    hexagonal_grid,
)
from meshlab_lowrank.stages.stage3_similar import Float32Array
from meshlab_lowrank.stages.stage6c_relief_field import HeightField

_CLEAR = 0.95  # patch radii from the centre of a source to the nearest missing height
_WHOLE = 0.99  # share of a sample's weight that has to be measured
_OVERHANG = 0.3  # patch radii from the hole to the centres of targets
_FACING = 0.3  # cosine: the other side of a thin sheet is in no patch
_SIXTH = np.pi / 3.0


@dataclass(frozen=True)
class SourcePatches:
    """Fully measured patches, in several turns.

    Attributes
    ----------
    values : (w, s) float32
        Heights at the samples.
    centres : (w,) int64
    frames : (w, 3, 3) float64
        Rows e1, e2, e3, turned.
    strength : (w,) float64
        Mean size of the detail around each.
    """

    values: Float32Array
    centres: IntArray
    frames: FloatArray
    strength: FloatArray


@dataclass(frozen=True)
class TargetPatches:
    """Patches that cover what is missing.

    Attributes
    ----------
    centres : (t,) int64
    frames : (t, 3, 3) float64
    sampler : (t * s, n) csr_array of float64
        Interpolates heights at the samples.
    vertices : list of (v,) int64
        Vertices that lie in each patch.
    """

    centres: IntArray
    frames: FloatArray
    sampler: sparse.csr_array
    vertices: list[IntArray]

    def __len__(self) -> int:
        """Give their number."""
        return len(self.centres)


@dataclass(frozen=True)
class PatchMaker:
    """Lays patches of one size on a field.

    Attributes
    ----------
    field : HeightField
    radius : float
        In mean edge lengths.
    grid : HexagonalGrid
    locator : SurfaceLocator
        Of the base.
    """

    field: HeightField
    radius: float
    grid: HexagonalGrid
    locator: SurfaceLocator

    @classmethod
    def of_size(cls, field: HeightField, radius: float, spacing: float) -> PatchMaker:
        """Lay patches of a radius, their samples so far apart, both in mean edge lengths."""
        locator = SurfaceLocator(field.base, field.hole.faces)
        return cls(field, radius, hexagonal_grid(radius, spacing), locator)

    def sources(self, strength: FloatArray, most: int, turns: int, seed: int) -> SourcePatches:
        """Take patches that are measured throughout.

        Parameters
        ----------
        strength : (n,) float64
            Mean size of the detail around each vertex.
        most : int
            Centres, chosen at random where there are more.
        turns : int
            Turns of each, in sixths.
        seed : int
        """
        field = self.field
        centres = np.flatnonzero(field.source)
        away = cKDTree(field.base[~field.source]).query(field.base[centres])[0]
        centres = centres[away > _CLEAR * self.radius]
        if len(centres) > most:
            centres = np.sort(np.random.default_rng(seed).permutation(centres)[:most])
        upright = tangent_frames(field.normals[centres])
        measured = field.source.astype(np.float64)
        whole = np.ones(len(centres), dtype=np.bool_)
        sampled = []
        for part in range(turns):
            frames = turned(upright, part * _SIXTH / turns)
            sampler = self._sampler(centres, frames)
            share = (sampler @ measured).reshape(len(centres), self.grid.size)
            whole &= share.min(axis=1) > _WHOLE
            sampled.append((sampler @ field.heights).reshape(share.shape))
        values = [each[whole][:, slots] for each in sampled for slots in self.grid.turns]
        angles = [(part / turns + q) * _SIXTH for part in range(turns) for q in range(6)]
        chosen = np.tile(centres[whole], len(angles))
        return SourcePatches(
            values=np.concatenate(values).astype(np.float32),
            centres=chosen,
            frames=np.concatenate([turned(upright[whole], angle) for angle in angles]),
            strength=strength[chosen],
        )

    def targets(self, distance: float) -> TargetPatches:
        """Cover the hole with patches, their centres no nearer to one another than a distance."""
        field = self.field
        away = cKDTree(field.base[field.hole.unknown]).query(field.base)[0]
        near = np.flatnonzero(away < _OVERHANG * self.radius)
        centres = near[spread_points(field.base[near], distance)]
        frames = tangent_frames(field.normals[centres])
        found = cKDTree(field.base).query_ball_point(field.base[centres], self.radius)
        vertices = []
        for centre, close in zip(centres, found, strict=True):
            inside = np.sort(np.asarray(close, dtype=np.int64))
            facing = field.normals[inside] @ field.normals[centre] > _FACING
            vertices.append(inside[facing])
        return TargetPatches(centres, frames, self._sampler(centres, frames), vertices)

    def copied(
        self, targets: TargetPatches, target: int, sources: SourcePatches, source: int
    ) -> tuple[IntArray, FloatArray]:
        """Read the heights of a source patch at the places of a target's vertices.

        Returns
        -------
        vertices : (v,) int64
            Those of the target whose place in the source was measured.
        heights : (v,) float64
        """
        field, centre = self.field, targets.centres[target]
        vertices = targets.vertices[target]
        plane = (field.base[vertices] - field.base[centre]) @ targets.frames[target, :2].T
        places = field.base[sources.centres[source]] + plane @ sources.frames[source, :2]
        weights = self.locator.weights(places)
        good = weights @ field.source.astype(np.float64) > _WHOLE
        return vertices[good], np.asarray(weights @ field.heights)[good]

    def _sampler(self, centres: IntArray, frames: FloatArray) -> sparse.csr_array:
        points = self.field.base[centres][:, None] + self.grid.offsets @ frames[:, :2]
        return self.locator.weights(points.reshape(-1, 3))
