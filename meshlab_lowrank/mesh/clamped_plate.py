"""Heights of a thin plate over a disc that is clamped along its rim."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.mesh.geometry import FloatArray

_FINER = 4  # even places around the plate for each that is given


def clamped_plate(
    angles: FloatArray, height: FloatArray, slope: FloatArray, outwards: FloatArray
) -> FloatArray:
    """Give the heights of a thin plate over the unit disc that is clamped along its rim.

    Parameters
    ----------
    angles, height, slope : (k,) float64
        Places on the rim, ascending from 0, and the heights and slopes inwards there.
    outwards : (r, k) float64
        Distances from the centre in the direction of each; beyond the rim it goes on straight.

    Returns
    -------
    (r, k) float64

    Notes
    -----
    A wave of m periods around the rim goes on inwards as (c + d rho^2) rho^m, which is what is
    bi-harmonic over a disc: the finer the waves, the sooner they end.
    """
    k = len(angles)
    even = 2.0 * np.pi * np.arange(_FINER * k) / (_FINER * k)
    a, b = (
        np.fft.rfft(np.interp(even, angles, values, period=2.0 * np.pi), norm="forward")[: k // 2]
        for values in (height, -slope)
    )
    m = np.arange(len(a))
    second = 0.5 * (b - m * a)
    turned = np.exp(1j * m * angles[:, None]) * np.where(m > 0, 2.0, 1.0)
    rows = []
    for row in outwards:
        inside = np.minimum(row, 1.0)[:, None]
        waves = (a - second + second * inside**2) * inside**m * turned
        rows.append(waves.sum(axis=1).real - slope * np.maximum(row - 1.0, 0.0))
    return np.stack(rows)
