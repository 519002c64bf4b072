"""Stage 3, masked distance: fully known patches in every turn, searched by one product."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from meshlab_lowrank.mesh.geometry import BoolArray, FloatArray, IntArray
from meshlab_lowrank.stages.stage2_patches_grid import HexagonalGrid

Float32Array: TypeAlias = NDArray[np.float32]

BATCH = 256  # targets a product; fixed, so that results don't depend on the number of threads


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


def turned_patches(values: FloatArray, grid: HexagonalGrid) -> Float32Array:
    """All six 60 degree turns of patches of local normals.

    Parameters
    ----------
    values : (w, sp, 3) float64
    grid : HexagonalGrid

    Returns
    -------
    (6 w, 3 sp) float32
    """
    turned = []
    for quarter, slots in enumerate(grid.turns):
        angle = quarter * np.pi / 3.0
        cosine, sine = np.cos(angle), np.sin(angle)
        back = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        turned.append((values[:, slots] @ back).reshape(len(values), 3 * grid.size))
    return np.concatenate(turned).astype(np.float32)


def similar_patches(
    values: FloatArray,
    weights: FloatArray,
    library: PatchLibrary,
    k: int,
    *,
    among: IntArray | None = None,
    barred: BoolArray | None = None,
) -> IntArray:
    """Find the k patches of the library nearest to each target.

    The distance is ``sum m |n_a - n_b|^2 / sum m`` over the samples of weight m that the target
    knows; since all normals are unit vectors, the nearest has the largest product.

    Parameters
    ----------
    values : (t, sp, 3) float64
        Local unit normals of the targets, zero where missing.
    weights : (t, sp) float64
        Weight m of each sample, 0 where missing.
    library : PatchLibrary
    k : int
    among : (t, c) int64, optional
        Rows of the library that each target is compared with; by default all.
    barred : (t, w) bool, optional
        Rows that a target may not take, where it is compared with all.

    Returns
    -------
    (t, min(k, c)) int64
        Rows of the library, the most similar first.
    """
    columns = (values * weights[..., None]).reshape(len(values), -1).astype(np.float32)
    if among is None:
        score = -(columns @ library.rows.T)
        if barred is not None:
            score[barred] = np.inf
        k = min(k, len(library))
        nearest = np.argpartition(score, k - 1, axis=1)[:, :k]
        score = np.take_along_axis(score, nearest, axis=1)
    else:
        score = -(library.rows[among] @ columns[..., None])[..., 0]
        nearest = among
    order = np.argsort(score, axis=1, kind="stable")[:, :k]
    return np.take_along_axis(nearest, order, axis=1)


def batches(count: int) -> list[slice]:
    """Cut a range into slices of BATCH."""
    return [slice(start, min(start + BATCH, count)) for start in range(0, count, BATCH)]


def run_batches(function: Any, count: int, executor: Executor | None) -> list[Any]:
    """Call a function with every slice of BATCH, on the executor's threads where there is one."""
    slices = batches(count)
    return list(executor.map(function, slices) if executor else map(function, slices))
