"""Stage 3: similar patches, which are packed into one matrix with each target (section 3.3.3).

Variants: `MaskedDistance`, `NormalPatchCovariance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from meshlab_lowrank.hole import Hole
from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.stages.stage2b_patches import Patches, PatchLayer

Float32Array: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True)
class PatchLibrary:
    """Fully known patches, each in several turns: the columns that groups are packed from.

    Attributes
    ----------
    rows : (w, 3 sp) float32
        Local normals, (n_1x, n_1y, n_1z, n_2x, ...) as in the paper's 3.3.3.
    places : (w, 3) float64
        Centres.
    """

    rows: Float32Array
    places: FloatArray

    def __len__(self) -> int:
        """Count the patches, turns included."""
        return len(self.rows)


@dataclass(frozen=True)
class Sources:
    """What the targets of one hole may be packed with.

    Attributes
    ----------
    library : PatchLibrary
        Empty where patches are compared among themselves.
    barred : (t, w) bool or None
        Patches of the library that a target may not take.
    """

    library: PatchLibrary
    barred: BoolArray | None = None


@dataclass(frozen=True)
class Columns:
    """The normals of all targets as they are known by now, Omega_M.

    Attributes
    ----------
    values : (t, sp, 3) float64
        In the frames of their patches, zero where missing.
    weights : (t, sp) float64
        1 where measured, 0 where missing, between where recovered.
    """

    values: FloatArray
    weights: FloatArray


@dataclass(frozen=True)
class Groups:
    """Patches similar to some targets, the most similar first: Omega_p but for its first column.

    Attributes
    ----------
    columns : (t, k, 3 sp) float64
    observed : (t, k, sp) bool or None
        Normals that are known; None where all are.
    listed : (t, l) int64
        A longer list of similar patches, for `Search` to choose from another time.
    """

    columns: FloatArray
    observed: BoolArray | None
    listed: IntArray


class Search(Protocol):
    """Looks for patches similar to targets, in the columns and sources it was made with."""

    def __call__(self, rows: IntArray, listed: IntArray | None = None) -> Groups:
        """Pack the groups of some targets.

        Parameters
        ----------
        rows : (t,) int64
            Numbers of the targets.
        listed : (t, l) int64, optional
            From an earlier search of these targets: look among these only.
        """
        ...


class Similar(Protocol):
    """Finds similar patches."""

    def library(self, hole: Hole, layer: PatchLayer, radius: float) -> PatchLibrary:
        """Pack the patches of the known surroundings that targets are compared with."""
        ...

    def sources(
        self, hole: Hole, targets: Patches, library: PatchLibrary, radius: float
    ) -> Sources | None:
        """Say which patches each target may take; None where there are too few."""
        ...

    def search(self, columns: Columns, sources: Sources) -> Search:
        """Get ready to look for patches similar to these columns."""
        ...
