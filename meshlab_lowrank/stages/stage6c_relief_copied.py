"""Stage 6, relief: copied as heights, in large pieces, and as strong as that around the hole."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage6c_relief_crispness import Crispness
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_fronts import copy_inwards
from meshlab_lowrank.stages.stage6c_relief_joining import Joiner
from meshlab_lowrank.stages.stage6c_relief_patches import PatchMaker

_SMALLER = (1.0, 0.7, 0.5)  # sizes of patches, for surroundings that are too narrow for larger
_FEWEST = 300  # turned sources that offer a choice
_GAINS = (0.5, 2.0)  # of the copies, at least and at most, so that they stay copies
_ENOUGH = 0.85  # of the detail expected, from which on a smooth fill lacks nothing
_MOSTLY = 0.25  # of its vertices may have less
_SHORTEST = 6.0  # split, in mean edge lengths
_CRISPEST = 2.0
_CRUMPLED = 1.2  # times the angles around the hole
_CALMEST = 0.5
_ROUNDS = 3
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
    spread : float
        Radii of a patch between the centres of those that are put; what is kept of each is as wide.
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
    spread: float = 0.8
    split: float = 14.0
    share: float = 1.8
    patches: int = 2000
    turns: int = 2
    shortlist: int = 20
    strength: float = 1.2
    crispness: float = 0.95
    seed: int = 0

    def __call__(self, hole: Hole) -> Hole | None:
        """Put relief on the smooth fill; see `Relief`."""
        if not hole.measured.any():
            return None
        field = HeightField.over_base(hole, self.cutoff)
        unknown = hole.unknown
        strength = field.carried_on(field.strength(field.heights))
        for size in _SMALLER:
            maker = PatchMaker.of_size(field, size * self.radius, size * self.spacing)
            sources = maker.sources(strength, self.patches, self.turns, self.seed)
            if len(sources.values) >= _FEWEST:
                break
        else:
            return None
        there = field.around(field.strength(field.heights), unknown)[unknown]
        if np.quantile(there / strength[unknown], _MOSTLY) >= _ENOUGH:
            return replace(hole, base=field.base, base_normals=field.normals)
        targets = maker.targets(self.spread * maker.radius)
        copies = copy_inwards(maker, targets, sources, strength, shortlist=self.shortlist)
        split = min(self.split, max(_SHORTEST, self.share * float(depth_of(hole).max())))
        joiner = Joiner(field, copies, split)
        heights = _of_strength(field, joiner, self.strength * strength)
        crispness = Crispness(field)
        heights = crispness.matched(heights, self.crispness, least=_CALMEST, most=_CRISPEST)
        return replace(
            hole, positions=field.raised(heights), base=field.base, base_normals=field.normals
        )

    def calmed(self, hole: Hole) -> Hole:
        """Take the shortest waves back where faces meet more sharply than around the hole."""
        field = HeightField.over_base(hole, self.cutoff)
        crispness = Crispness(field)
        if crispness.ratio(field.heights) <= _CRUMPLED:
            return hole
        heights = crispness.matched(field.heights, 1.0, least=_CALMEST)
        return replace(hole, positions=field.raised(heights))


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
