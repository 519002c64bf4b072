"""The two presets, values of one pipeline, and what the user's parameters change in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshlab_lowrank.parameters import Base, InpaintParameters, Preset
from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.stages.stage1a_close_bend import LeastBendClosing
from meshlab_lowrank.stages.stage1a_close_chart import ChartClosing
from meshlab_lowrank.stages.stage1a_close_meshlab import MeshLabClosing
from meshlab_lowrank.stages.stage1b_fair import Fair
from meshlab_lowrank.stages.stage1b_fair_harmonic import HarmonicFairing
from meshlab_lowrank.stages.stage1b_fair_spline import SplineFairing
from meshlab_lowrank.stages.stage1c_level_even import EvenLevel
from meshlab_lowrank.stages.stage1c_level_mesh_itself import MeshItself
from meshlab_lowrank.stages.stage1d_drape_as_faired import AsFaired
from meshlab_lowrank.stages.stage1d_drape_foretold import ForetoldDrape
from meshlab_lowrank.stages.stage1e_base_low_pass import LowPassBase
from meshlab_lowrank.stages.stage1e_base_surface_itself import SurfaceItself
from meshlab_lowrank.stages.stage2b_patches_grid import GridPatches
from meshlab_lowrank.stages.stage2b_patches_rings import RingPatches
from meshlab_lowrank.stages.stage3_similar_masked_distance import MaskedDistance
from meshlab_lowrank.stages.stage3_similar_normal_patch_covariance import NormalPatchCovariance
from meshlab_lowrank.stages.stage4a_complete_ridge import RidgeCompletion
from meshlab_lowrank.stages.stage4a_complete_svt import SingularValueThresholding
from meshlab_lowrank.stages.stage4b_diffuse_fronts import FrontDiffusion
from meshlab_lowrank.stages.stage4b_diffuse_rounds import RoundDiffusion
from meshlab_lowrank.stages.stage5_refine_nothing import NoRefinement
from meshlab_lowrank.stages.stage5_refine_truncated_gamma import TruncatedGammaNorm
from meshlab_lowrank.stages.stage6a_average_at_vertices import AverageAtVertices
from meshlab_lowrank.stages.stage6b_update_direct import DirectUpdate
from meshlab_lowrank.stages.stage6b_update_iterative import IterativeUpdate
from meshlab_lowrank.stages.stage6c_relief_copied import CopiedRelief
from meshlab_lowrank.stages.stage6c_relief_none import NoRelief
from meshlab_lowrank.stages.stage7_finish_as_it_came import AsItCame
from meshlab_lowrank.stages.stage7_finish_without_flaws import WithoutFlaws
from meshlab_lowrank.stages.stage8_edges_along_creases import AlongCreases
from meshlab_lowrank.stages.stage8_edges_as_closed import EdgesAsClosed
from meshlab_lowrank.tuning.tune_by_fake_holes import FakeHoleTuning
from meshlab_lowrank.tuning.tune_nothing import NoTuning

# parts that parameters change
_RINGS = RingPatches(sp=100, r=8)
_COVARIANCE = NormalPatchCovariance(k=10)
_GRID = GridPatches(extent=0.6, across=6.0, spacing=1.5)
_MASKED = MaskedDistance(k=8, patches=2000, angles=4)

_LEAST_BENT = tuple(LeastBendClosing(density=each) for each in ("around", "rim", "none"))

AUTO = Pipeline(
    close=MeshLabClosing(),
    close_again=ChartClosing(),
    close_last=_LEAST_BENT,
    fair=HarmonicFairing(),
    level=EvenLevel(),
    tune=FakeHoleTuning(),
    drape=ForetoldDrape(),
    base=LowPassBase(cutoff=1.8, order=3),
    patches=_GRID,
    similar=_MASKED,
    complete=RidgeCompletion(rank=6, ridge=0.01),
    diffuse=FrontDiffusion(rings=2, share=0.5, passes=3, refit_passes=2, falloff=0.5),
    refine=NoRefinement(),
    average=AverageAtVertices(corrections=2, at_last=0.5),
    update=DirectUpdate(),
    relief=CopiedRelief(),
    finish=WithoutFlaws(),
    edges=AlongCreases(),
    rim_normals=False,
    passes=4,
    depth=1.8,
    finer=True,
    copying=True,
)

_BASES: dict[Base, Fair] = {
    "meshlab": HarmonicFairing(),  # stands for the circular B-spline surface (section 3.2)
    "bspline": SplineFairing(),
}

PAPER = Pipeline(
    close=MeshLabClosing(),
    close_again=ChartClosing(),
    close_last=_LEAST_BENT,
    fair=_BASES["meshlab"],
    level=MeshItself(),
    tune=NoTuning(),
    drape=AsFaired(),
    base=SurfaceItself(),
    patches=_RINGS,
    similar=_COVARIANCE,
    complete=SingularValueThresholding(tau=0.9, delta=0.1),
    diffuse=RoundDiffusion(),
    refine=TruncatedGammaNorm(gamma=0.01, m=5),
    average=AverageAtVertices(corrections=0),
    update=IterativeUpdate(niter=20),
    relief=NoRelief(),
    finish=AsItCame(),
    edges=EdgesAsClosed(),
    rim_normals=True,
    passes=1,
    depth=np.inf,
)


def pipeline_of(parameters: InpaintParameters) -> Pipeline:
    """Give the pipeline of a preset with what the user set.

    Parameters
    ----------
    parameters : InpaintParameters

    Returns
    -------
    Pipeline
    """
    pipeline = _PRESETS[parameters.preset](parameters)
    if parameters.iterations is not None:
        pipeline = replace(pipeline, passes=parameters.iterations)
    return pipeline


def _auto(parameters: InpaintParameters) -> Pipeline:
    patches, similar = _GRID, replace(_MASKED, seed=parameters.seed)
    if parameters.patchsize is not None:  # samples of a hexagonal grid in a disc
        across = float(np.sqrt(parameters.patchsize * np.sqrt(3.0) / (2.0 * np.pi)))
        patches = replace(patches, across=across)
    if parameters.similarpatches is not None:
        similar = replace(similar, k=parameters.similarpatches)
    tune = FakeHoleTuning(seed=parameters.seed)
    relief = CopiedRelief(seed=parameters.seed)
    pipeline = replace(AUTO, tune=tune, patches=patches, similar=similar, relief=relief)
    if parameters.ringnumber is not None:
        pipeline = replace(pipeline, reach=float(parameters.ringnumber))
    return pipeline


def _paper(parameters: InpaintParameters) -> Pipeline:
    patches, similar = _RINGS, _COVARIANCE
    if parameters.patchsize is not None:
        patches = replace(patches, sp=parameters.patchsize)
    if parameters.ringnumber is not None:
        patches = replace(patches, r=parameters.ringnumber)
    if parameters.similarpatches is not None:
        similar = replace(similar, k=parameters.similarpatches)
    return replace(
        PAPER,
        fair=_BASES[parameters.base],
        patches=patches,
        similar=similar,
        complete=SingularValueThresholding(
            tau=parameters.tau,
            delta=parameters.delta,
            niter=parameters.completioniterations,
            tol=parameters.completiontolerance,
        ),
        refine=TruncatedGammaNorm(
            mu=parameters.mu,
            beta=parameters.beta,
            gamma=parameters.gamma,
            m=parameters.truncation,
            niter=parameters.refinementiterations,
            tol=parameters.refinementtolerance,
        ),
        update=IterativeUpdate(niter=parameters.updateiterations),
    )


_PRESETS: dict[Preset, Callable[[InpaintParameters], Pipeline]] = {"auto": _auto, "paper": _paper}
