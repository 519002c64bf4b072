"""Stage 6, relief: copied as heights, in large pieces, and as strong as that around the hole."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.hole import Hole, depth_of
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage6c_relief_crispness import Crispness
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_fronts import copy_inwards
from meshlab_lowrank.stages.stage6c_relief_joining import Joiner
from meshlab_lowrank.stages.stage6c_relief_matching import matched
from meshlab_lowrank.stages.stage6c_relief_patches import PatchMaker

_SMALLER = (1.0, 0.7, 0.5)  # sizes of patches, for surroundings that are too narrow for larger
_FEWEST = 300  # turned sources that offer a choice
_ENOUGH = 0.85  # of the detail expected, from which on a smooth fill lacks nothing
_MOSTLY = 0.25  # of its vertices may have less
_SHORTEST = 6.0  # split, in mean edge lengths
_CRUMPLED = 1.2  # times the angles around the hole
_CALMEST = 0.5


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
        The same in a hole of depth one; it grows by the root of the depth. What a smooth fill
        misses grows with the depth too, and waves that it has right a guess makes wrong.
    patches : int
        Most centres of sources.
    turns : int
        Of each source, in a sixth of a full turn.
    shortlist : int
        Best fitting sources of which the one of the right strength is taken.
    strength : float
        Of the detail, in that around the hole.
    crispness : float
        Mean angle between faces, in that of the known faces near the hole.
    seed : int
        Choice of the sources.
    """

    cutoff: float = 18.0
    radius: float = 9.0
    spacing: float = 1.5
    spread: float = 0.8
    split: float = 14.0
    share: float = 3.3
    patches: int = 2000
    turns: int = 2
    shortlist: int = 20
    strength: float = 1.07
    crispness: float = 0.88
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
        split = self.share * math.sqrt(float(depth_of(hole).max()))
        joiner = Joiner(field, copies, min(self.split, max(_SHORTEST, split)))
        by_vertex = field.areas.mean() / field.areas  # most edges are where they are short
        crispness = Crispness(field, by_vertex)
        heights = matched(
            field,
            joiner,
            crispness,
            strength=self.strength * strength,
            angles=self.crispness * crispness.wanted,
        )
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
