"""Stage 1, closing: a hole gets triangles as dense as its surroundings (section 3.2).

Variant: `MeshLabClosing`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.stages.stage0_region import Region


class Close(Protocol):
    """Closes the loop of a region."""

    def __call__(self, region: Region, *, edge_length: float | None) -> Region:
        """Append the fill to a region; nothing of what is there changes.

        Parameters
        ----------
        region : Region
        edge_length : float or None
            Of the new triangles, in local units. None: as in the surroundings.

        Raises
        ------
        StageError
            If the loop can't be closed.
        """
        ...
