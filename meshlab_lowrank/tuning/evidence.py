"""A quick look at the surroundings of a hole, for detail that repeats."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray, cotangent_laplacian, normalized
from meshlab_lowrank.mesh.topology import edges_of

_ROUNDS = 40  # of averages over neighbours: what is shorter than some 20 edges is left as detail
_CENTRES = 500
_OTHERS = 3000
_FARTHEST = 12  # edge lengths: the first minimum of the longest repeat length lies nearer
_NEAREST = 3  # normals of noise alternate too, from a vertex to those two edges away
_LEAST_LENGTH = 1e-9
_FACING = 0.5  # cosine: the other side of a thin sheet doesn't count
_FEWEST = 50  # pairs at a distance that tell anything
_LEAST = 0.02  # radians: of detail 20 edges long that a smooth fill misses by 0.08 of one
_LEANING = 0.2  # of an average, over the detail, with which a place still tells
_OWN = 1.0 / 6.0  # weight of a normal in the average over its neighbours, of theirs together


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
        The lowest mean product over the mean square, with its sign changed: 0.09 to 0.4 where
        detail repeats, down to 0.03 at the ends of the lengths that are looked for; below that on
        nearly half of the scans without any. 0 where the root of the mean square is below 0.02.
    """
    smooth, detail, lean = _split(hole)
    if not hole.measured.any():
        return 0.0
    strength = np.sqrt((detail[hole.measured] ** 2).sum(axis=1).mean())
    measured = np.flatnonzero(hole.measured & (lean <= _LEANING * strength))
    if len(measured) == 0:
        return 0.0
    chance = np.random.default_rng(seed)
    centres = chance.permutation(measured)[:_CENTRES]
    others = chance.permutation(measured)[:_OTHERS]
    trees = [cKDTree(hole.positions[each]) for each in (centres, others)]
    pairs = trees[0].sparse_distance_matrix(trees[1], _FARTHEST, output_type="ndarray")
    one, other = centres[pairs["i"]], others[pairs["j"]]
    facing = np.einsum("ij,ij->i", smooth[one], smooth[other]) > _FACING
    place = np.rint(pairs["v"][facing]).astype(np.int64)
    product = np.einsum("ij,ij->i", detail[one], detail[other])[facing]
    number = np.bincount(place, minlength=_FARTHEST + 1)
    sums = np.bincount(place, product, minlength=_FARTHEST + 1)
    square = float((detail[measured] ** 2).sum(axis=1).mean())
    told = number >= _FEWEST
    told[:_NEAREST] = False
    if square < _LEAST**2 or not told.any():
        return 0.0
    return float(np.max(-sums[told] / number[told]) / square)


def _split(hole: Hole) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth normals, the part of the normals that is tangential to them, and how far they lean.

    Near a border the average lies to one side of its vertex, and on a bent surface it leans then as
    the normals do over there, (n,) in radians. The weights are the cotangents', with which it
    lies in the middle elsewhere.
    """
    laplacian = cotangent_laplacian(hole.positions, hole.faces)
    known = sparse.diags_array(hole.measured.astype(np.float64))
    near = sparse.csr_array(known @ (sparse.diags_array(laplacian.diagonal()) - laplacian) @ known)
    share = np.asarray(near.sum(axis=1)).ravel()
    own = np.where(share > 0.0, _OWN * share, 1.0)
    average = sparse.diags_array(1.0 / (share + own)) @ (near + sparse.diags_array(own))
    average = sparse.csr_array(average)
    both = np.hstack([hole.normals, hole.positions])  # (n, 6)
    for _ in range(_ROUNDS):
        both = average @ both
    smooth = normalized(both[:, :3])
    upright = np.einsum("ij,ij->i", hole.normals, smooth)[:, None] * smooth
    detail = np.where(hole.measured[:, None], hole.normals - upright, 0.0)
    shift = both[:, 3:] - hole.positions
    shift -= np.einsum("ij,ij->i", shift, smooth)[:, None] * smooth
    return smooth, detail, _bending(hole, smooth) * np.linalg.norm(shift, axis=1)


def _bending(hole: Hole, smooth: FloatArray) -> FloatArray:
    """Tell how much smooth normals turn towards measured neighbours, (n,), over the distance."""
    n = len(hole.positions)
    ends = edges_of(hole.faces).vertices
    tails, heads = ends[hole.measured[ends].all(axis=1)].T
    turns = np.linalg.norm(smooth[tails] - smooth[heads], axis=1)
    lengths = np.linalg.norm(hole.positions[tails] - hole.positions[heads], axis=1)
    turn, length = (
        np.bincount(tails, each, minlength=n) + np.bincount(heads, each, minlength=n)
        for each in (turns, lengths)
    )
    return np.asarray(turn / np.maximum(length, _LEAST_LENGTH))
