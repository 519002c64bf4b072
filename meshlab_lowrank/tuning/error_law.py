"""The law by which smooth fills miss the true surface: more inwards, and in larger holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.tuning.missed_discs import MissedDisc

_SHAPES = np.arange(0.5, 2.51, 0.25)  # exponents; 2 is the bi-harmonic fill of a bent surface
_GROWTHS = np.arange(0.25, 3.01, 0.25)  # exponents; small where relief is all that is missed
_USUAL, _SPREAD = (1.25, 1.25), (0.5, 1.0)  # of both over many surfaces
_BINS = 12  # of the depth over the largest one
_LEAST = 1e-6  # edge lengths: nothing is known better
_BAND = 5.0  # edge lengths around a hole that the fairing predicts
_BAND_STEPS = 20


@dataclass(frozen=True)
class ErrorLaw:
    """Root mean square distance of smooth fills from the true surface, in mean edge lengths.

    Attributes
    ----------
    scale : float
        In the middle of a hole of that size.
    size : float
        Largest depth of a hole.
    shape : float
        Exponent of the growth from the rim to the middle.
    growth : float
        Exponent of the growth with the size of the hole.
    scatter : float
        Standard deviation of the logarithm of the error, from disc to disc.
    """

    scale: float
    size: float
    shape: float
    growth: float
    scatter: float

    def at(self, depth: FloatArray, size: float) -> FloatArray:
        """Give the error at depths (k,) of a hole with a largest depth."""
        share = np.clip(depth / size, 0.0, 1.0)
        grown = self.scale * (size / self.size) ** self.growth
        return np.asarray(grown * _inwards(share) ** self.shape)

    def in_band(self, size: float) -> float:
        """Give the error in the outer five edge lengths of a hole that is so much larger.

        The fairing predicts the band around a hole of some size, and the error of that is known.
        """
        depth = _BAND * (np.arange(_BAND_STEPS) + 0.5) / _BAND_STEPS
        weight = size + _BAND - depth
        squared = self.at(depth, size + _BAND) ** 2
        return float(np.sqrt((weight * squared).sum() / weight.sum()))


def learned(discs: Sequence[MissedDisc]) -> ErrorLaw:
    """Fit the law to discs; the likeliest, with what is usual where they tell little.

    Parameters
    ----------
    discs : sequence of MissedDisc
        At least one.

    Returns
    -------
    ErrorLaw
    """
    size = np.array([disc.size for disc in discs])
    largest = float(size.max())
    number = np.repeat(np.arange(len(discs)), [len(disc.depth) for disc in discs])
    share = np.concatenate([disc.depth for disc in discs]) / size[number]
    squared = np.concatenate([disc.miss for disc in discs]) ** 2 + _LEAST**2
    place = number * _BINS + np.minimum((share * _BINS).astype(np.int64), _BINS - 1)
    count = np.bincount(place, minlength=len(discs) * _BINS).reshape(-1, _BINS)
    total = np.bincount(place, squared, minlength=count.size).reshape(-1, _BINS)
    mean = total / np.maximum(count, 1)
    weight = count / count.sum(axis=1, keepdims=True) / len(discs)  # (d, bins)
    inwards = 2.0 * np.log(_inwards((np.arange(_BINS) + 0.5) / _BINS))  # (bins,)
    larger = 2.0 * np.log(size / largest)  # (d,)
    # logarithm of the variance that the law gives, but for its scale: (d, bins, shapes, growths)
    expected = (
        _SHAPES[:, None] * inwards[None, :, None, None]
        + _GROWTHS[None, :] * larger[:, None, None, None]
    )
    scale = np.einsum("db,dbsg->sg", weight * mean, np.exp(-expected))
    surprise = 0.5 * len(discs) * (np.log(scale) + np.einsum("db,dbsg->sg", weight, expected))
    for each, usual, spread in zip((_SHAPES[:, None], _GROWTHS), _USUAL, _SPREAD, strict=True):
        surprise = surprise + 0.5 * ((each - usual) / spread) ** 2
    best = np.unravel_index(surprise.argmin(), surprise.shape)
    law = np.exp(-expected[:, :, best[0], best[1]])
    own = np.log((count * mean * law).sum(axis=1) / count.sum(axis=1))  # (d,)
    return ErrorLaw(
        scale=float(np.sqrt(scale[best])),
        size=largest,
        shape=float(_SHAPES[best[0]]),
        growth=float(_GROWTHS[best[1]]),
        scatter=float(0.5 * own.std()),
    )


def _inwards(share: FloatArray) -> FloatArray:
    """Give the fill of a bent surface over a disc, 0 at the rim and 1 in the middle."""
    return share * (2.0 - share)
