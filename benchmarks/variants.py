"""Variants of preset auto: each switches one part back to the paper's, or off.

A variant is a value of `Pipeline`; to add one, enter it into `VARIANTS`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from meshlab_lowrank.pipeline import Pipeline
from meshlab_lowrank.presets import AUTO, PAPER
from meshlab_lowrank.stages.stage1c_level_mesh_itself import MeshItself
from meshlab_lowrank.stages.stage1d_drape_as_faired import AsFaired
from meshlab_lowrank.stages.stage1d_drape_foretold import ForetoldDrape
from meshlab_lowrank.stages.stage1e_base_low_pass import LowPassBase
from meshlab_lowrank.stages.stage1e_base_surface_itself import SurfaceItself
from meshlab_lowrank.stages.stage2a_frames_pca import PrincipalFrames
from meshlab_lowrank.stages.stage2b_patches_grid import GridPatches
from meshlab_lowrank.stages.stage2b_patches_rings import RingPatches
from meshlab_lowrank.stages.stage3_similar_masked_distance import MaskedDistance
from meshlab_lowrank.stages.stage3_similar_normal_patch_covariance import NormalPatchCovariance
from meshlab_lowrank.stages.stage4a_complete_mean import GroupMean
from meshlab_lowrank.stages.stage4b_diffuse_fronts import FrontDiffusion
from meshlab_lowrank.stages.stage6a_average_at_vertices import AverageAtVertices
from meshlab_lowrank.stages.stage6c_relief_copied import CopiedRelief
from meshlab_lowrank.stages.stage6c_relief_none import NoRelief
from meshlab_lowrank.stages.stage8_edges_as_closed import EdgesAsClosed
from meshlab_lowrank.tuning.tune_by_fake_holes import FakeHoleTuning

FULL = "auto"  # all parts
_ANY = 10**6  # rings, more than any hole has

VARIANTS: dict[str, tuple[str, Pipeline]] = {
    FULL: ("auto, all parts", AUTO),
    "mesh_itself": (
        "level: the mesh itself, not an even surface that follows the pattern",
        replace(AUTO, level=MeshItself()),
    ),
    "one_level": (
        "level: one, without a pass on a finer one from what it gave",
        replace(AUTO, finer=False),
    ),
    "as_faired": (
        "drape: the fill as it was faired to its rim, not where the surroundings foretell it",
        replace(AUTO, drape=AsFaired()),
    ),
    "one_spline": (
        "drape: the spline that foretells best, not a mean",
        replace(AUTO, drape=ForetoldDrape(sharpness=float("inf"))),
    ),
    "faired_base": (
        "base: the faired fill itself, frames from its own normals",
        replace(AUTO, base=SurfaceItself()),
    ),
    "biharmonic_base": (
        "base: bi-harmonic low-pass, not three-harmonic",
        replace(AUTO, base=LowPassBase(order=2)),
    ),
    "no_refits": (
        "base fitted once, not again to the completed surface",
        replace(AUTO, passes=1),
    ),
    "pca_frames": (
        "frames: principal axes of the surface (3.3.2), not of the base",
        replace(AUTO, patches=GridPatches(frames=PrincipalFrames())),
    ),
    "ring_patches": (
        "patches: rings of vertices in principal frames (3.3), no turns",
        replace(AUTO, patches=RingPatches()),
    ),
    "covariance": (
        "similar patches: normal patch covariance (Eq. 2), not masked distance",
        replace(AUTO, similar=NormalPatchCovariance()),
    ),
    "no_turns": (
        "similar patches: each in one position, not in 12 turns",
        replace(AUTO, similar=MaskedDistance(angles=0)),
    ),
    "few_patches": (
        "similar patches: among 1000 in 12 turns, not 2000 in 24",
        replace(AUTO, similar=MaskedDistance(patches=1000, angles=2)),
    ),
    "short_base": (
        "repeat length: base and drape shortened with the patches, not of the whole repeat",
        replace(AUTO, tune=FakeHoleTuning(apart=False)),
    ),
    "svt": (
        "completion: singular value thresholding (Eq. 5), not ridge",
        replace(AUTO, complete=PAPER.complete),
    ),
    "mean": (
        "completion: plain mean of the group, not ridge",
        replace(AUTO, complete=GroupMean()),
    ),
    "all_at_once": (
        "diffusion: all at once, not by fronts of two rings",
        replace(AUTO, diffuse=FrontDiffusion(rings=_ANY, share=0.0)),
    ),
    "rounds": (
        "diffusion: rounds of whole patches (3.4.2), not fronts and passes",
        replace(AUTO, diffuse=PAPER.diffuse),
    ),
    "no_agreement": (
        "no self-consistent passes",
        replace(AUTO, diffuse=FrontDiffusion(passes=0, refit_passes=0)),
    ),
    "no_deblurring": (
        "averages at the vertices as they are, not deblurred",
        replace(AUTO, average=AverageAtVertices(corrections=0, at_last=0.5)),
    ),
    "no_amplifying": (
        "averages lean from the base as little as they come",
        replace(AUTO, average=AverageAtVertices(corrections=2)),
    ),
    "rim_normals": (
        "normals at the rim count as measured",
        replace(AUTO, rim_normals=True),
    ),
    "refinement": (
        "in addition: truncated gamma norm (Eq. 6 to 16) before the averages",
        replace(AUTO, refine=PAPER.refine),
    ),
    "iterative_update": (
        "vertex update: 20 steps of the usual iteration, not direct",
        replace(AUTO, update=PAPER.update),
    ),
    "edges_as_closed": (
        "edges: as the hole was closed, not along creases",
        replace(AUTO, edges=EdgesAsClosed()),
    ),
    "fixed_length": (
        "repeat length: 10 h, not measured and chosen by fake holes",
        replace(AUTO, tune=FakeHoleTuning(lengths=(10.0,), shorten_from=float("inf"))),
    ),
    "wide_look": (
        "repeat length: looked for in all that is cut out, not near the hole",
        replace(AUTO, tune=FakeHoleTuning(near=float("inf"))),
    ),
    "no_depth": (
        "deep holes: not begun with larger patches",
        replace(AUTO, depth=float("inf")),
    ),
    "anywhere": (
        "trust: fake holes anywhere, not where the relief is like that at the hole",
        replace(AUTO, tune=FakeHoleTuning(alike=False)),
    ),
    "no_rim": (
        "trust: the rim is no fake hole",
        replace(AUTO, tune=FakeHoleTuning(rim=False)),
    ),
    "no_conflict": (
        "trust: all fake holes count alike, whatever the conflict of the fill",
        replace(AUTO, tune=FakeHoleTuning(asking=False)),
    ),
    "no_trust": (
        "detail put on whole, not scaled by what fake holes say",
        replace(AUTO, tune=FakeHoleTuning(believing=True)),
    ),
    "full": ("auto, full detail", AUTO),
    "full_no_relief": (
        "full detail: from normals where nothing repeats too, no copied heights",
        replace(AUTO, relief=NoRelief()),
    ),
    "full_best_fit": (
        "full detail: relief copied by the best fit, not by strength among the best twenty",
        replace(AUTO, relief=CopiedRelief(shortlist=1)),
    ),
    "full_small_pieces": (
        "full detail: relief copied in pieces of half the size",
        replace(AUTO, relief=CopiedRelief(spread=0.4)),
    ),
    "full_all_waves": (
        "full detail: long waves of copied relief too, not the smooth fill's",
        replace(AUTO, relief=CopiedRelief(split=100.0, share=100.0)),
    ),
    "full_soft": (
        "full detail: copied relief not sharpened",
        replace(AUTO, relief=CopiedRelief(crispness=0.0)),
    ),
}


def run_variant(ms: Any, name: str) -> None:
    """Fill the selected loops of the current mesh with a variant of preset auto."""
    detail = "full" if name.startswith("full") else "calibrated"
    ms.meshing_inpaint_lowrank(
        selected=True, closerim=True, detail=detail, pipeline=VARIANTS[name][1]
    )
