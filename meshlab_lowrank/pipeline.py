"""The pipeline: one choice for each stage, and the one way in which they are run on a hole."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage1a_close import Close
from meshlab_lowrank.stages.stage1b_fair import Fair
from meshlab_lowrank.stages.stage1c_level import ChooseLevel
from meshlab_lowrank.stages.stage1d_drape import Drape
from meshlab_lowrank.stages.stage1e_base import Base
from meshlab_lowrank.stages.stage2b_patches import LayPatches, centres_at_parts
from meshlab_lowrank.stages.stage3_similar import PatchLibrary, Similar
from meshlab_lowrank.stages.stage4a_complete import Complete
from meshlab_lowrank.stages.stage4b_diffuse import Diffuse
from meshlab_lowrank.stages.stage5_refine import Refine
from meshlab_lowrank.stages.stage6a_average import Average
from meshlab_lowrank.stages.stage6b_update import Update
from meshlab_lowrank.stages.stage6c_relief import Relief
from meshlab_lowrank.stages.stage7_finish import Finish
from meshlab_lowrank.stages.stage8_edges import Edges
from meshlab_lowrank.tuning.tune import Tune

StageReport: TypeAlias = Callable[[str, float], None]

_FEW_PASSES = 2


@dataclass(frozen=True, kw_only=True)
class Pipeline:
    """What each stage does, in the order in which data passes.

    Another method is another value: ``dataclasses.replace(AUTO, complete=GroupMean())``.

    Attributes
    ----------
    close, fair : stages
        Stage 1 on the cut-out region: triangles, then their smooth shape.
    close_again : Close
        Where the first closing fails, folds or crosses something, and round islands.
    close_last : tuple of Close
        Where that does so too; one after the other, the last only if nothing else is without
        flaws.
    level : ChooseLevel
        The surface on which detail is recovered.
    tune : Tune
        Finds the wavelength of the detail, and how far what is recovered can be trusted.
    drape : Drape
        Lays the smooth fill where the surroundings foretell the base.
    base, patches, similar, complete, diffuse, refine, average, update, relief : stages
        See the Protocol of each in `meshlab_lowrank.stages`.
    finish, edges : stages
        Likewise, on the mesh.
    rim_normals : bool
        See `Hole`.
    passes : int
        Times that base to update are run, each on what the last made: the paper's S_iter.
    depth : float
        Holes deeper than this, in wavelengths, are begun with patches that see more at once, as
        short ones lose the phase there; infinite: none are.
    finer : bool
        Recover once more on a surface twice as fine, from what a coarse one gave.
    copying : bool
        Keep the amplitude rather than the mean in the last pass; see `Stage.for_copying`.
    reach : float
        Width of the surroundings that are cut out with a hole, in mean edge lengths around it.
    """

    close: Close
    close_again: Close
    close_last: tuple[Close, ...]
    fair: Fair
    level: ChooseLevel
    tune: Tune
    drape: Drape
    base: Base
    patches: LayPatches
    similar: Similar
    complete: Complete
    diffuse: Diffuse
    refine: Refine
    average: Average
    update: Update
    relief: Relief
    finish: Finish
    edges: Edges
    rim_normals: bool
    passes: int
    depth: float
    finer: bool = False
    copying: bool = False
    reach: float = 30.0

    def for_trial(self) -> Pipeline:
        """Pipeline that costs less, for trials in fake holes."""
        return replace(
            self._with_stages(lambda stage: stage.for_trial()), passes=_FEW_PASSES, copying=False
        )

    def for_depth(self) -> Pipeline:
        """Pipeline that sees more at once, for the first run in a deep hole."""
        return replace(
            self._with_stages(lambda stage: stage.for_depth()), passes=_FEW_PASSES, copying=False
        )

    def for_even(self) -> Pipeline:
        """Pipeline that works on an even surface where the mesh itself is not quite even."""
        return self._with_stages(lambda stage: stage.for_even())

    def for_finer(self) -> Pipeline:
        """Pipeline of the pass on a finer surface, from what a coarse one gave."""
        return replace(self._with_stages(lambda stage: stage.for_finer()), passes=1)

    def for_last(self) -> Pipeline:
        """Pipeline of the last pass."""
        return self._with_stages(lambda stage: stage.for_last())

    def for_copying(self) -> Pipeline:
        """Pipeline of the last pass where the amplitude is to be kept."""
        return self._with_stages(lambda stage: stage.for_copying())

    def _with_stages(self, change: Callable[[Stage], Stage]) -> Pipeline:
        changed: dict[str, Any] = {
            name: change(stage) for name, stage in vars(self).items() if isinstance(stage, Stage)
        }
        return replace(self, **changed)


def recover(
    hole: Hole,
    pipeline: Pipeline,
    *,
    library: PatchLibrary | None = None,
    report: StageReport | None = None,
    executor: Executor | None = None,
) -> Hole | None:
    """Run the stages from the base to the vertex update on one hole.

    Parameters
    ----------
    hole : Hole
        Unknown vertices on a smooth fill, or on what another run recovered.
    pipeline : Pipeline
    library : PatchLibrary, optional
        By default that of the known surface of this hole.
    report : callable, optional
        Called with the name of each stage before it begins, and the part of all that is done.
    executor : Executor, optional
        Threads for batches of linear algebra; the result doesn't depend on them.

    Returns
    -------
    Hole or None
        With new positions of the unknown vertices; None where the surroundings have too few
        patches to go by.
    """
    tell = report or (lambda _stage, _part: None)
    centres = sources = None
    for number in range(pipeline.passes):
        first = number == 0
        last = number == pipeline.passes - 1
        stages = pipeline
        if last:
            stages = pipeline.for_copying() if pipeline.copying else pipeline.for_last()
        tell("patches", number / pipeline.passes)
        hole = stages.base(hole, first=first)
        layer = stages.patches.layer(hole)
        radius = stages.patches.radius(hole)
        if centres is None:
            centres = centres_at_parts(hole, stages.patches.centres(hole), radius)
            if len(centres) == 0:
                return None
        targets = layer.at(centres)
        if sources is None:
            if library is None:
                library = stages.similar.library(hole, layer, radius)
            sources = stages.similar.sources(hole, targets, library, radius)
            if sources is None:
                return None
        tell("diffusion", (number + 0.1) / pipeline.passes)
        diffused = stages.diffuse(
            hole,
            targets,
            sources,
            layer,
            similar=stages.similar,
            complete=stages.complete,
            gather=stages.average,
            first=first,
            executor=executor,
        )
        if diffused is None:
            return None
        tell("refinement", (number + 0.9) / pipeline.passes)
        omega = stages.refine(diffused.omega)
        hole = stages.average(diffused.hole, omega)
        tell("vertex update", (number + 0.95) / pipeline.passes)
        hole = stages.update(hole)
        del layer, targets, diffused, omega  # large, and made anew in the next pass
    return hole


def library_around(hole: Hole, pipeline: Pipeline) -> PatchLibrary:
    """Pack the library of the known surface of a hole, as `recover` does."""
    hole = pipeline.base(hole, first=True)
    layer = pipeline.patches.layer(hole)
    return pipeline.similar.library(hole, layer, pipeline.patches.radius(hole))
