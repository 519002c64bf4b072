"""Stage 6, vertex update: positions that fit the recovered normals (end of section 3.4.3).

Variants: `DirectUpdate`, `IterativeUpdate`.
"""

from __future__ import annotations

from typing import Protocol

from meshlab_lowrank.hole import Hole


class Update(Protocol):
    """Moves the unknown vertices."""

    def __call__(self, hole: Hole) -> Hole:
        """Move the unknown vertices to fit ``hole.normals`` where ``hole.weights`` is not 0."""
        ...
