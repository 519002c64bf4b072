"""Tuning: repeat lengths of the surroundings, tried out in discs that are taken as missing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from scipy.spatial import cKDTree

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.tuning.evidence import repetition
from meshlab_lowrank.tuning.fake_holes import make_fake_holes
from meshlab_lowrank.tuning.judging import Belief, Evidence, judge
from meshlab_lowrank.tuning.repeat_length import SHORTEST, repeat_lengths
from meshlab_lowrank.tuning.tune import NO_REPEAT, Attempt, Look, Tuned

_SHORTER = 0.7  # shorter patches are tried too: they find more that is alike
_WIDE = 3.0  # depth from which a hole misses as much as its surroundings with it
_NARROWEST = 1.2  # depth of a hole whose vertices nearly all lie at the rim
_NO_DETAIL = "The surroundings have no detail, so the fill is smooth."
_NARROW = "The hole is too narrow for the detail around it to matter, so the fill is smooth."
_EDGES = 12.0  # a repeat, of a surface on which its pattern is recovered best
_SAME = 1.5  # factor between the repeat length near the hole and in all, if they are one
_ALIKE = 0.15  # relative difference of two lengths, only one of which is tried


@dataclass(frozen=True)
class FakeHoleTuning(Stage):
    """The wavelength that recovers fake holes best, and how well it did; see `Tune`.

    Parameters
    ----------
    lengths : tuple of float
        Wavelengths to try, in mean edge lengths; empty: those of `repeat_lengths`.
    shorten_from : float
        Of the best wavelength so far, from which a shorter one is tried too.
    apart : bool
        Shorten the patches alone; otherwise the wavelength, and with it the cut-off of the base.
    believing : bool
        Take all detail as right, whatever the fake holes say.
    least_miss : float
        Of a smooth fill, in mean edge lengths, from which on detail is looked for.
    least_repetition : float
        See `repetition`; from which on detail is tried out.
    near : float
        Distance from the hole, in mean edge lengths, within which a pattern is looked for: what
        lies farther off, on a real object, may be of another kind. Where it has about the same
        length, the longer of both readings counts. Longer repeats are looked for in
        all that is cut out.
    alike, rim : bool
        See `make_fake_holes`.
    asking : bool
        See `FakeHoleEvidence`.
    seed : int
        Choice of the places.
    """

    lengths: tuple[float, ...] = ()
    shorten_from: float = 10.0
    apart: bool = True
    believing: bool = False
    least_miss: float = 0.08
    least_repetition: float = 0.03
    near: float = 15.0
    alike: bool = True
    rim: bool = True
    asking: bool = True
    seed: int = 0

    def rules_out(self, misfit: float, depth: float) -> str:
        """Rule out holes whose smooth fill is nearly right; see `Tune`.

        The smooth fill misses known surface as wide as the rings around the hole by the misfit;
        of a narrower hole it misses less, of a deeper one more, about with the square of the depth.
        """
        miss = misfit * (depth / _WIDE) ** 2
        if miss < self.least_miss or depth < _NARROWEST:
            return _NO_DETAIL if misfit < self.least_miss else _NARROW
        return ""  # also where nothing tells the misfit

    def look(self, hole: Hole) -> Look:
        """Rule out surroundings whose detail does not repeat; see `Tune`."""
        near = self._near(hole)
        strength = repetition(near, self.seed)
        if strength < self.least_repetition:
            return Look(NO_REPEAT, strength)
        lengths = repeat_lengths(near, self.seed)
        if max(lengths) > self.near:  # near the hole they don't show
            strength = repetition(hole, self.seed)
            if strength < self.least_repetition:
                return Look(NO_REPEAT, strength)
        lengths = self._lengths(hole, lengths)
        return Look("", strength, lengths, tuple(length / _EDGES for length in lengths))

    def __call__(
        self, hole: Hole, look: Look, attempt: Attempt, report: Callable[[float], object]
    ) -> Tuned:
        """Try the wavelengths; see `Tune`."""
        lengths = self.lengths or look.lengths
        if not lengths:
            lengths = self._lengths(hole, repeat_lengths(self._near(hole), self.seed))
        waiting = [(length, 1.0) for length in lengths]
        fake = make_fake_holes(hole, self.seed, alike=self.alike, rim=self.rim)
        best = waiting[0]
        evidence: Evidence | None = None
        least = math.inf
        if fake is None:
            return Tuned(_with(hole, best), None)
        for trial in waiting:
            solved = attempt(_with(fake.hole, trial), _with(hole, trial))
            report(0.5)
            if solved is None:  # no room for whole patches; shorter ones may do
                if evidence is None and _patch(trial) >= 2.0 * SHORTEST:
                    waiting.append((0.5 * trial[0], trial[1]))
                continue
            found = judge(fake, solved, asking=self.asking)
            if evidence is None or found.error < least:
                best, evidence, least = trial, found, found.error
                if found.hopeless:
                    break
                shorter = self._shortened(*trial)
                if _patch(trial) >= self.shorten_from and not _has(waiting, _patch(shorter)):
                    waiting.append(shorter)
        if self.believing and evidence is not None:
            evidence = Belief()
        return Tuned(_with(hole, best), evidence)

    def _shortened(self, length: float, shortening: float) -> tuple[float, float]:
        if self.apart:
            return length, _SHORTER * shortening
        return _SHORTER * length, shortening

    def _lengths(self, hole: Hole, lengths: tuple[float, ...]) -> tuple[float, ...]:
        """Give the repeat lengths near the hole, or of all, where they don't fit in near it.

        Where both are the same, the longer one counts: what cuts windows short makes them read so.
        """
        wide = repeat_lengths(hole, self.seed)
        same = abs(math.log(wide[0] / lengths[0])) < math.log(_SAME)
        long = max(lengths) > self.near
        return wide if long or (same and wide[0] > lengths[0]) else lengths

    def _near(self, hole: Hole) -> Hole:
        """Leave of the measured surface what lies near the hole, if anything does."""
        away = cKDTree(hole.positions[hole.unknown]).query(hole.positions)[0]
        near = hole.measured & (away < self.near)
        return replace(hole, measured=near) if near.any() else hole


def _with(hole: Hole, trial: tuple[float, float]) -> Hole:
    """Give a hole a wavelength, and how far its patches are shortened."""
    return replace(hole, wavelength=trial[0], shortening=trial[1])


def _patch(trial: tuple[float, float]) -> float:
    """Wavelength that patches are made for."""
    return trial[0] * trial[1]


def _has(trials: list[tuple[float, float]], length: float) -> bool:
    return any(abs(_patch(each) / length - 1.0) < _ALIKE for each in trials)
