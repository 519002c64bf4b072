"""What fake holes tell of the detail that is recovered in a hole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.tuning.conflict import conflict
from meshlab_lowrank.tuning.fake_holes import FakeHoles
from meshlab_lowrank.tuning.trust import DEPTHS, Trust

_DEPTH_WIDTH = 2.0
_NOISE = 0.05  # detail that is not higher than this is not told from chance
_ENOUGH = 0.7  # a strength from which detail is put on whole
_HALF = 0.15  # conflict at which half of the detail was true, over all surfaces that were looked at
_LEAST_CONFLICT = 1e-3
_WIDTH = 0.7  # of the logarithm of a conflict, within which parts are like the hole
_UNLIKE = 0.05  # least weight of a part: a fit alone is no evidence where all others failed
_OWN_WEIGHT = 1.0  # of what the hole's own conflict tells, in parts just like it
_LEAST_TRUE = 0.1  # mean square of the true detail, over that of it and the recovered one
_LEFT = 0.5  # of what trials leave, is left in the hole itself, which has more passes
_COVERED = 20.0  # vertices at a depth from which on a part tells all that it can
_OPPOSED, _WORSE = -0.05, 2.0  # agreement, and error over that of a smooth fill
_LESS = 0.5  # of the conflict of a fake hole: what a hole with all its rim may have


class Evidence(Protocol):
    """Tells how far detail can be believed."""

    @property
    def error(self) -> float:
        """Part of the variance of the true detail that trials miss, 1 for a smooth fill."""
        ...

    @property
    def promising(self) -> bool:
        """Whether it is worth the time to recover the detail of the hole."""
        ...

    @property
    def hopeless(self) -> bool:
        """Whether other settings are not worth the time either."""
        ...

    def trust(self, conflict: float) -> Trust:
        """Judge what was recovered in the hole by its `conflict`."""
        ...


@dataclass(frozen=True)
class Belief:
    """Takes all detail as right; see `Evidence`."""

    error: float = 0.0
    promising: bool = True
    hopeless: bool = False

    def trust(self, conflict: float) -> Trust:  # noqa: ARG002
        """Trust it."""
        return Trust(np.ones(len(DEPTHS)), 1.0)


@dataclass(frozen=True)
class Part:
    """How well one part of the known surface was recovered.

    Attributes
    ----------
    conflict : float
        See `conflict`.
    agreement : float
        Correlation of the recovered with the true detail, about zero.
    product, square : (3,) float64
        Means at `DEPTHS` of recovered times true detail, and of recovered times recovered, over
        the mean square of both.
    size : (3,) float64
        Number of vertices at `DEPTHS`.
    error, variance : float
        Mean square of what is wrong, and of the true detail.
    """

    conflict: float
    agreement: float
    product: FloatArray
    square: FloatArray
    size: FloatArray
    error: float
    variance: float


@dataclass(frozen=True)
class FakeHoleEvidence:
    """How well fake holes were recovered; see `Evidence`.

    Attributes
    ----------
    parts : tuple of Part
    asking : bool
        Whether the hole's own conflict counts; otherwise all parts count alike.
    """

    parts: tuple[Part, ...]
    asking: bool = True

    @property
    def error(self) -> float:
        """Squared error over the variance of the true detail, 1 for a smooth fill.

        Parts with little conflict count more: only by their like is a hole given detail.
        """
        weight = np.array([_usual(part.conflict) for part in self.parts])
        errors, variances = (
            np.array([getattr(part, name) for part in self.parts]) for name in ("error", "variance")
        )
        return float((weight @ errors) / max(float(weight @ variances), 1e-12))

    @property
    def promising(self) -> bool:
        """Whether the hole would get detail with a conflict that it may well have."""
        return any(self.trust(_LESS * part.conflict).worthwhile for part in self.parts)

    @property
    def hopeless(self) -> bool:
        """Whether detail was recovered that is opposed to the true one, and no part promises more.

        Where detail repeats, the first wavelength tried leaves less than is missed without it.
        """
        agreement = float(np.mean([part.agreement for part in self.parts]))
        return agreement < _OPPOSED and self.error > _WORSE and not self.promising

    def trust(self, conflict: float) -> Trust:
        """Judge by the parts whose conflict is like the hole's, and by what is usual at it.

        Parameters
        ----------
        conflict : float
            Of the hole.

        Returns
        -------
        Trust
        """
        weight, own, usual = np.ones(len(self.parts)), 0.0, 0.0
        if self.asking:
            conflicts = [*(part.conflict for part in self.parts), conflict]
            at = np.log(np.maximum(conflicts, _LEAST_CONFLICT))
            weight = np.maximum(np.exp(-0.5 * ((at[:-1] - at[-1]) / _WIDTH) ** 2), _UNLIKE)
            own, usual = _OWN_WEIGHT, _usual(conflict)
        product, square = np.full(len(DEPTHS), own * usual), np.full(len(DEPTHS), own)
        count = square.copy()  # product and square are over the mean of recovered and true detail
        agreement = own * usual
        for like, part in zip(weight, self.parts, strict=True):
            told = like * np.minimum(part.size / _COVERED, 1.0)
            product += told * part.product
            square += told * part.square
            count += told
            agreement += like * part.agreement
        strength = np.clip(product / np.maximum(square, 1e-12) / _ENOUGH, 0.0, 1.0)
        agreement /= weight.sum() + own
        true = np.maximum(2.0 * count - square, _LEAST_TRUE * count)
        left, left_by_whole = (
            _LEFT * np.maximum(1.0 - (2.0 * each * product - each**2 * square) / true, 0.0)
            for each in (strength, 1.0)
        )
        return Trust(strength, max(0.0, float(agreement)) ** 2, left, left_by_whole)


def judge(fake: FakeHoles, solved: Hole, *, asking: bool = True) -> FakeHoleEvidence:
    """Compare recovered with true detail in the fake holes.

    Parameters
    ----------
    fake : FakeHoles
    solved : Hole
        What the method made of ``fake.hole``.
    asking : bool
        See `FakeHoleEvidence`.

    Returns
    -------
    FakeHoleEvidence
    """
    normals, smooth = solved.base_normals, fake.hole.positions
    true = np.einsum("ij,ij->i", fake.truth - smooth, normals)
    found = np.einsum("ij,ij->i", solved.positions - smooth, normals)
    near = np.exp(-(((depth_of(fake.hole)[:, None] - DEPTHS) / _DEPTH_WIDTH) ** 2))  # (n, 3)
    parts = []
    for number in np.unique(fake.parts[fake.parts >= 0]):
        part = fake.parts == number
        f, t, at = found[part], true[part], near[part]
        size = np.maximum(at.sum(axis=0), 1e-12)
        power, noise = (f * f).mean(), _NOISE**2
        variance, amplitude = (t * t).mean(), at.T @ (f * f + t * t) / 2.0 + size * noise
        parts.append(
            Part(
                conflict=conflict(solved, part),
                agreement=float((f * t).mean() / np.sqrt((power + noise) * (variance + noise))),
                product=at.T @ (f * t) / amplitude,
                square=at.T @ (f * f + noise) / amplitude,
                size=size,
                error=float(((t - f) ** 2).mean()),
                variance=float(variance),
            )
        )
    return FakeHoleEvidence(tuple(parts), asking)


def _usual(conflict: float) -> float:
    """Agreement that goes with a conflict."""
    return 1.0 / (1.0 + conflict / _HALF)
