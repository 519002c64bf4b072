"""A quick look at the surroundings of a hole, for detail that repeats."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial.distance import cdist

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, normalized
from meshlab_lowrank.mesh.topology import vertex_adjacency

_ROUNDS = 40  # of averages over neighbours: what is shorter than some 20 edges is left as detail
_CENTRES = 200
_OTHERS = 2500
_FARTHEST = 12  # edge lengths: the first minimum of the longest repeat length lies nearer
_NEAREST = 3  # normals of noise alternate too, from a vertex to those two edges away
_FACING = 0.5  # cosine: the other side of a thin sheet doesn't count
_FEWEST = 50  # pairs at a distance that tell anything


def repetition(hole: Hole, seed: int) -> float:
    """Tell how strongly the detail of the surroundings alternates.

    Detail is what an average over neighbours takes from the normals. Where it repeats, the mean
    product of the detail at two places falls below zero at half the repeat length; where it is
    noise, or soft shapes beside one another, it goes to zero and stays there. A single sharp step
    alternates too.

    Parameters
    ----------
    hole : Hole
    seed : int
        Choice of the places.

    Returns
    -------
    float
        The lowest mean product over the mean square, with its sign changed: 0.1 to 0.4 where
        detail repeats, below 0.06 on most other surfaces. Nothing with detail that repeats is to
        lie lower, not the other way round.
    """
    measured = np.flatnonzero(hole.measured)
    smooth, detail = _split(hole)
    chance = np.random.default_rng(seed)
    centres = chance.permutation(measured)[:_CENTRES]
    others = chance.permutation(measured)[:_OTHERS]
    distance = cdist(hole.positions[centres], hole.positions[others])  # (c, o)
    counts = (distance < _FARTHEST) & (smooth[centres] @ smooth[others].T > _FACING)
    place = np.rint(distance[counts]).astype(np.int64)
    product = (detail[centres] @ detail[others].T)[counts]
    number = np.bincount(place, minlength=_FARTHEST + 1)
    sums = np.bincount(place, product, minlength=_FARTHEST + 1)
    square = float((detail[measured] ** 2).sum(axis=1).mean())
    told = number >= _FEWEST
    told[:_NEAREST] = False
    if square == 0.0 or not told.any():
        return 0.0
    return float(np.max(-sums[told] / number[told]) / square)


def _split(hole: Hole) -> tuple[FloatArray, FloatArray]:
    """Smooth normals, and the part of the normals that is tangential to them, (n, 3) each."""
    n = len(hole.positions)
    known = sparse.diags_array(hole.measured.astype(np.float64))
    near = known @ (vertex_adjacency(hole.faces, n) + sparse.eye_array(n)) @ known
    share = np.asarray(near.sum(axis=1)).ravel()
    average = sparse.csr_array(sparse.diags_array(1.0 / np.maximum(share, 1.0)) @ near)
    smooth = hole.normals
    for _ in range(_ROUNDS):
        smooth = average @ smooth
    smooth = normalized(smooth)
    upright = np.einsum("ij,ij->i", hole.normals, smooth)[:, None] * smooth
    return smooth, np.where(hole.measured[:, None], hole.normals - upright, 0.0)
