"""Stage 6, relief: copies made as strong, and as crisp, as what lies around the hole."""

from __future__ import annotations

import numpy as np

from meshlab_lowrank.hole import depth_of
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.stages.stage6c_relief_crispness import Crispness
from meshlab_lowrank.stages.stage6c_relief_field import HeightField
from meshlab_lowrank.stages.stage6c_relief_joining import Joiner

_ROUNDS = 7
_GAINS = (0.5, 2.5)  # of the copies, at least and at most, so that they stay copies
_SHARPENING = (0.3, 1.8)  # of their shortest waves
_GAIN_STEP, _SHARPENING_STEP = 0.5, 0.35  # of what is lacking: both change strength and angles
_WITHIN = 2.5  # edge lengths from the rim; nearer to it the detail is mostly the known surface's
_TINY = 1e-12


def matched(
    field: HeightField,
    joiner: Joiner,
    crispness: Crispness,
    *,
    strength: FloatArray,
    angles: FloatArray,
) -> FloatArray:
    """Scale copies, and their shortest waves, until strength and angles are those wanted.

    Sharpening adds strength and scaling adds angle, so both are sought together: one after the
    other the second spoils what the first has reached. Each follows what is lacking from place to
    place and in the mean by equal parts: averages around a vertex alone leave the sum wrong.

    Parameters
    ----------
    field : HeightField
    joiner : Joiner
    crispness : Crispness
    strength : (n,) float64
        Mean size of the detail wanted around each vertex; see `HeightField.strength`.
    angles : (n,) float64
        Mean angle between faces wanted there, in radians.

    Returns
    -------
    (n,) float64
        Heights; known ones as they were.
    """
    unknown = field.hole.unknown
    inside = unknown & (depth_of(field.hole) > _WITHIN)
    counted = field.areas * (inside if inside.any() else unknown)
    gain, sharpening = np.ones(len(strength)), np.ones(len(strength))
    for _ in range(_ROUNDS):
        heights = crispness.scaled(joiner.heights(gain), sharpening)
        found = field.strength(heights)
        near = np.maximum(field.around(found, unknown), _TINY)
        overall = float(counted @ strength) / max(float(counted @ found), _TINY)
        lack = np.sqrt(strength / near * overall)
        gain = np.where(unknown, np.clip(gain * lack**_GAIN_STEP, *_GAINS), 1.0)
        lack = crispness.lack(heights, angles)
        sharpening = np.clip(sharpening * lack**_SHARPENING_STEP, *_SHARPENING)
    return crispness.scaled(joiner.heights(gain), sharpening)
