"""Stage 6, relief: copied as heights, in large pieces, and as strong as that around the hole."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, face_normals
from meshlab_lowrank.mesh.topology import edges_of, vertex_adjacency
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_fronts import copy_inwards
from meshlab_lowrank.stages.stage6c_relief_joining import Joiner
from meshlab_lowrank.stages.stage6c_relief_patches import PatchMaker

_SMALLER = (1.0, 0.7, 0.5)  # sizes of patches, for surroundings that are too narrow for larger
_FEWEST = 300  # turned sources that offer a choice
_SPREAD = 0.5  # patch radii between the centres of targets
_GAINS = (0.5, 2.0)  # of the copies, at least and at most, so that they stay copies
_ENOUGH = 0.85  # of the detail expected, from which on a smooth fill lacks nothing
_MOSTLY = 0.25  # of its vertices may have less
_SHORTEST = 6.0  # split, in mean edge lengths
_CRISPEST = 2.0
_ROUNDS = 2
_TINY = 1e-12


@dataclass(frozen=True)
class CopiedRelief(Stage):
    """Patches of heights copied from the rim inwards and joined; see `Relief`.

    Single heights are always a surface, as normals are not, and whole patches look like what they
    were taken from. Copies that were chosen to fit are weaker than their surroundings, and reading
    them between vertices softens them: both is made up for.

    Parameters
    ----------
    cutoff : float
        Wavelength of the base, in mean edge lengths.
    radius : float
        Of a patch.
    spacing : float
        Of its samples.
    split : float
        Wavelength from which on the smooth fill is kept, at most.
    share : float
        The same in a shallow hole, in its depths: a smooth fill is right about what is longer.
    patches : int
        Most centres of sources.
    turns : int
        Of each source, in a sixth of a full turn.
    shortlist : int
        Best fitting sources of which the one of the right strength is taken.
    strength : float
        Of the detail, in that around the hole.
    crispness : float
        Mean angle between faces that is made up for, in that of the known faces near the hole.
    seed : int
        Choice of the sources.
    """

    cutoff: float = 18.0
    radius: float = 9.0
    spacing: float = 1.5
    split: float = 14.0
    share: float = 1.25
    patches: int = 2000
    turns: int = 2
    shortlist: int = 20
    strength: float = 1.0
    crispness: float = 0.95
    seed: int = 0

    def __call__(self, hole: Hole) -> Hole | None:
        """Put relief on the smooth fill; see `Relief`."""
        if not hole.measured.any():
            return None
        field = HeightField.over_base(hole, self.cutoff)
        unknown = hole.unknown
        strength = field.carried_on(field.strength(field.heights))
        there = field.around(field.strength(field.heights), unknown)[unknown]
        if np.quantile(there / strength[unknown], _MOSTLY) >= _ENOUGH:
            return replace(hole, base=field.base, base_normals=field.normals)
        for size in _SMALLER:
            maker = PatchMaker.of_size(field, size * self.radius, size * self.spacing)
            sources = maker.sources(strength, self.patches, self.turns, self.seed)
            if len(sources.values) >= _FEWEST:
                break
        else:
            return None
        targets = maker.targets(_SPREAD * maker.radius)
        copies = copy_inwards(maker, targets, sources, strength, shortlist=self.shortlist)
        split = min(self.split, max(_SHORTEST, self.share * float(depth_of(hole).max())))
        joiner = Joiner(field, copies, split)
        heights = _of_strength(field, joiner, self.strength * strength)
        heights = _crisp(field, heights, self.crispness)
        return replace(
            hole, positions=field.raised(heights), base=field.base, base_normals=field.normals
        )


def _of_strength(field: HeightField, joiner: Joiner, wanted: FloatArray) -> FloatArray:
    """Scale copies from place to place until their detail has about the size wanted, (n,)."""
    unknown = field.hole.unknown
    gain = np.ones(len(wanted))
    heights = joiner.heights(gain)
    for _ in range(_ROUNDS):
        there = field.around(field.strength(heights), unknown)
        gain = np.clip(gain * wanted / np.maximum(there, _TINY), *_GAINS)
        heights = joiner.heights(gain)
    return heights


def _crisp(field: HeightField, heights: FloatArray, share: float) -> FloatArray:
    """Sharpen the shortest waves until faces meet at angles like those around the hole."""
    hole = field.hole
    pairs = _face_pairs(hole.faces)
    outside = pairs[hole.known_faces[pairs].all(axis=1)]
    inside = pairs[~hole.known_faces[pairs].any(axis=1)]
    wanted = share * field.carried_on(_angles(hole.positions, hole.faces, outside))
    around = vertex_adjacency(hole.faces, len(heights)).astype(np.float64)
    degree = np.maximum(np.asarray(around.sum(axis=1)).ravel(), 1.0)
    average = sparse.csr_array(sparse.diags_array(1.0 / degree) @ around)
    for _ in range(_ROUNDS + 1):
        angles = _angles(field.raised(heights), hole.faces, inside)
        there = field.around(angles, hole.unknown)
        gain = np.clip(wanted / np.maximum(there, _TINY), 1.0, _CRISPEST)
        sharper = heights + (gain - 1.0) * (heights - average @ heights)
        heights = np.where(hole.unknown, sharper, heights)
    return heights


def _face_pairs(faces: IntArray) -> IntArray:
    """Give the pairs of faces (p, 2) that share an edge."""
    edges = edges_of(faces)
    order = np.argsort(edges.face_edges.ravel(), kind="stable")
    edge = edges.face_edges.ravel()[order]
    same = np.flatnonzero((edge[1:] == edge[:-1]) & (edges.face_count[edge[1:]] == 2))
    return np.column_stack([order[same] // 3, order[same + 1] // 3])


def _angles(positions: FloatArray, faces: IntArray, pairs: IntArray) -> FloatArray:
    """Mean angle at each vertex (n,) between the faces of pairs, those of all that touch it."""
    one, other = face_normals(positions, faces)[pairs].transpose(1, 0, 2)
    angles = np.arccos(np.clip(np.einsum("ij,ij->i", one, other), -1.0, 1.0))
    corners = faces[pairs].reshape(-1)
    sums = np.bincount(corners, weights=np.repeat(angles, 6), minlength=len(positions))
    return sums / np.maximum(np.bincount(corners, minlength=len(positions)), 1)
