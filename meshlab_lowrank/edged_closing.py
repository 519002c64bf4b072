"""Fills along the sharp edges of their surroundings where these tell of some, smooth elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from meshlab_lowrank.closing import smooth_fills
from meshlab_lowrank.coarse import coarse_fills
from meshlab_lowrank.creases import creased_fills
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.parameters import Continuity
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage0_region import Region
from meshlab_lowrank.stages.stage0_sharp_edges import STRONG, WEAK, Evidence
from meshlab_lowrank.stages.stage1b_fair import FairRegion

_NOT_JOINED = "Creases at its rim were not joined. {}"
_EVIDENCE: dict[Continuity, Evidence] = {"auto": STRONG, "crease": WEAK}


def edged_fills(
    regions: Sequence[Region],
    lengths: Sequence[float | None],
    pipeline: Pipeline,
    report: Callable[[str], object],
    *,
    continuity: Continuity,
) -> list[FairRegion | StageError]:
    """Close and fair regions: along creases, with the flat faces of a coarse body, or smoothly.

    Parameters
    ----------
    regions : sequence of Region
        Open at their loops.
    lengths : sequence of float or None
        Edge lengths of the fills, see `Close`. Where one is asked for, coarse bodies get it too.
    pipeline : Pipeline
        Of the smooth ones.
    report : callable
        Called with the name of each stage that begins.
    continuity : {"auto", "crease", "flat", "tangent", "smooth"}
        Only the first two look for creases.

    Returns
    -------
    list of FairRegion or StageError
        The error where no way closes it.
    """
    if continuity not in _EVIDENCE:
        return smooth_fills(regions, lengths, pipeline, report)
    edged = creased_fills(regions, lengths, _EVIDENCE[continuity])
    free = [region for region, length in zip(regions, lengths, strict=True) if length is None]
    coarse = iter(coarse_fills(free))
    for i, length in enumerate(lengths):
        if length is None:
            edged[i] = next(coarse) or edged[i]
    left = [i for i, fill in enumerate(edged) if not isinstance(fill, FairRegion)]
    smooth = smooth_fills([regions[i] for i in left], [lengths[i] for i in left], pipeline, report)
    found = dict(zip(left, smooth, strict=True))
    return [
        fill if isinstance(fill, FairRegion) else _with_note(found[i], fill)
        for i, fill in enumerate(edged)
    ]


def _with_note(fill: FairRegion | StageError, error: StageError | None) -> FairRegion | StageError:
    """Say of a smooth fill why creases were not joined."""
    if error is None or isinstance(fill, StageError):
        return fill
    return replace(fill, note=" ".join([*fill.note.split(), *_NOT_JOINED.format(error).split()]))
