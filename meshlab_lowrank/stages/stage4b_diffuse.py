"""Stage 4, diffusion: what is recovered near the rim carries on inwards (section 3.4.2).

Variants: `FrontDiffusion`, `RoundDiffusion`.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Protocol

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage2b_patches import Patches, PatchLayer
from meshlab_lowrank.stages.stage3_similar import Similar, Sources
from meshlab_lowrank.stages.stage4a_complete import Complete


@dataclass(frozen=True)
class Omega:
    """The completed patches, Omega'_M, and how much each of their normals counts.

    Attributes
    ----------
    patches : Patches
        w patches of sp samples.
    values : (w, sp, 3) float64
        In the frames of the patches.
    votes : (w, sp) float64
        Weight of each normal where it meets others; 0: none.
    """

    patches: Patches
    values: FloatArray
    votes: FloatArray


@dataclass(frozen=True)
class Diffused:
    """What the diffusion found.

    Attributes
    ----------
    hole : Hole
        With the normals that it met on the way.
    omega : Omega
        Its last word, for the refinement.
    """

    hole: Hole
    omega: Omega


class Gather(Protocol):
    """The part of `Average` that diffusion needs."""

    def normals(self, omega: Omega) -> tuple[FloatArray, FloatArray]:
        """Average at the vertices; see `Average`."""
        ...


class Diffuse(Protocol):
    """Recovers missing normals, from the rim of the hole inwards."""

    def __call__(
        self,
        hole: Hole,
        targets: Patches,
        sources: Sources,
        layer: PatchLayer,
        *,
        similar: Similar,
        complete: Complete,
        gather: Gather,
        first: bool,
        executor: Executor | None,
    ) -> Diffused | None:
        """Recover the normals of the targets.

        Parameters
        ----------
        hole : Hole
        targets : Patches
        sources : Sources
        layer : PatchLayer
            That the targets lie on.
        similar, complete : stages
        gather : Gather
            Brings normals of overlapping patches together.
        first : bool
            Whether this is the first pass.
        executor : Executor or None
            Threads for batches; the result doesn't depend on them.

        Returns
        -------
        Diffused or None
            None if nothing could be recovered.
        """
        ...
