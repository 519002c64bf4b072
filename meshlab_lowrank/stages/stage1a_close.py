"""Stage 1, closing: a hole gets triangles as dense as its surroundings (section 3.2).

Variants: `MeshLabClosing`, `ChartClosing`, `LeastBendClosing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from meshlab_lowrank.errors import StageError
from meshlab_lowrank.stages.stage0_region import Region


class Close(Protocol):
    """Closes the loops of regions."""

    def __call__(
        self, regions: Sequence[Region], *, edge_lengths: Sequence[float | None]
    ) -> list[Region | StageError]:
        """Append the fill to each region; nothing of what is there changes.

        Only variants that say so close loops round islands.

        Parameters
        ----------
        regions : sequence of Region
        edge_lengths : sequence of float or None
            Of the new triangles of each, in local units. None: as in the surroundings.

        Returns
        -------
        list of Region or StageError
            The error where the loop can't be closed.
        """
        ...
