"""A pipeline that is quick, stages that can't be overlooked, and a surface, for tests of wiring."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO, PAPER
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage2b_patches_rings import RingPatches
from meshlab_lowrank.stages.stage3_similar_normal_patch_covariance import NormalPatchCovariance
from meshlab_lowrank.stages.stage4b_diffuse_fronts import FrontDiffusion
from meshlab_lowrank.stages.stage6c_relief_none import NoRelief
from meshlab_lowrank.tuning.trust import Trust
from meshlab_lowrank.tuning.tune import Tuned, Unquestioning

WAVELENGTH = 7.0


@dataclass(frozen=True)
class Said:
    """Evidence for one trust, whatever the fill says of itself."""

    said: Trust
    promising: bool = True
    hopeless: bool = False
    error: float = 0.0

    def trust(self, conflict):  # noqa: ARG002
        return self.said


@dataclass(frozen=True)
class Given(Unquestioning):
    """A tuning that knows its answer."""

    trust: Trust | None = None
    shortening: float = 1.0

    def __call__(self, hole, look, attempt, report):  # noqa: ARG002
        evidence = None if self.trust is None else Said(self.trust)
        found = replace(hole, wavelength=WAVELENGTH, shortening=self.shortening)
        return Tuned(found, evidence)


@dataclass(frozen=True)
class Lifted(Stage):
    """A finish that can't be overlooked."""

    def __call__(self, start, positions, base_normals):
        return np.where(start.unknown[:, None], positions + 5.0 * base_normals, positions)


@dataclass(frozen=True)
class Sunk(Stage):
    """A drape that can't be overlooked."""

    def __call__(self, hole):
        low = hole.positions - hole.base_normals
        return replace(hole, positions=np.where(hole.unknown[:, None], low, hole.positions))


FAST = replace(
    AUTO,
    tune=Given(),
    passes=2,
    diffuse=FrontDiffusion(passes=1, refit_passes=1),
    relief=NoRelief(),
    depth=math.inf,
)
SHORT = replace(PAPER, patches=RingPatches(sp=40, r=4), similar=NormalPatchCovariance(k=8))
FULL = InpaintParameters(detail="full")


def egg_box(sheet):
    """Give a small egg box with a hole."""
    points, faces = sheet(40, 34)
    points = points - points.mean(axis=0)
    k = 2.0 * np.pi / WAVELENGTH
    points[:, 2] = 0.4 * (np.cos(k * points[:, 0]) + np.cos(k * points[:, 1]))
    gone = np.hypot(*points[:, :2].T) < 3.5
    return points, faces[~gone[faces].any(axis=1)]


def filled(egg, pipeline):
    return inpaint(*egg, parameters=FULL, pipeline=pipeline).vertices
