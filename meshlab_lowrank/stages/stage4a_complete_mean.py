"""Stage 4, completion: the plain mean of the group."""

from __future__ import annotations

from dataclasses import dataclass

from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage3_similar import Groups
from meshlab_lowrank.stages.stage4a_complete import Completed
from meshlab_lowrank.stages.stage4a_complete_ridge import ridge_completion, without_gaps


@dataclass(frozen=True)
class GroupMean(Stage):
    """Completion of rank 0; see `Complete`."""

    def __call__(self, values: FloatArray, weights: FloatArray, groups: Groups) -> Completed:
        """Average the columns of each group."""
        return ridge_completion(values, weights, without_gaps(groups), rank=0, ridge=0.0)
