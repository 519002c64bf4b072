"""The connection of the stages: each is run, on what the one before it made."""

from __future__ import annotations

import importlib
import math
import pkgutil
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from meshlab_lowrank import stages, tuning
from meshlab_lowrank.hole import Hole, depth_of, start_hole, with_missing
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.leveling import fill_depth
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.pipeline import Pipeline, recover
from meshlab_lowrank.presets import AUTO, PAPER, pipeline_of
from meshlab_lowrank.restoring import restore_detail
from meshlab_lowrank.solving import solve_hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region
from meshlab_lowrank.stages.stage1e_base_low_pass import LowPassBase
from meshlab_lowrank.stages.stage1e_base_surface_itself import SurfaceItself
from meshlab_lowrank.stages.stage2a_frames_base import BaseFrames
from meshlab_lowrank.stages.stage2a_frames_pca import PrincipalFrames
from meshlab_lowrank.stages.stage2b_patches_grid import GridPatches
from meshlab_lowrank.stages.stage2b_patches_rings import RingPatches
from meshlab_lowrank.stages.stage3_similar_masked_distance import MaskedDistance
from meshlab_lowrank.stages.stage3_similar_normal_patch_covariance import NormalPatchCovariance
from meshlab_lowrank.stages.stage4a_complete_mean import GroupMean
from meshlab_lowrank.stages.stage4a_complete_ridge import RidgeCompletion
from meshlab_lowrank.stages.stage4b_diffuse_fronts import FrontDiffusion
from meshlab_lowrank.stages.stage5_refine_nothing import NoRefinement
from meshlab_lowrank.stages.stage5_refine_truncated_gamma import TruncatedGammaNorm
from meshlab_lowrank.stages.stage6a_average_at_vertices import AverageAtVertices
from meshlab_lowrank.stages.stage6b_update_direct import DirectUpdate
from meshlab_lowrank.stages.stage6b_update_iterative import IterativeUpdate
from meshlab_lowrank.stages.stage6c_relief_copied import CopiedRelief
from meshlab_lowrank.stages.stage8_edges_along_creases import AlongCreases
from meshlab_lowrank.stages.stage8_edges_as_closed import EdgesAsClosed
from meshlab_lowrank.tuning.trust import Trust
from tests.builders import hole_of
from tests.wiring import FAST, FULL, SHORT, WAVELENGTH, Given, Lifted, Sunk, egg_box, filled


@dataclass(frozen=True)
class Recorder(Stage):
    """A base that remembers the holes it saw."""

    base: LowPassBase = field(default_factory=LowPassBase)
    seen: list[Hole] = field(default_factory=list, compare=False)

    def __call__(self, hole, *, first):
        self.seen.append(hole)
        return self.base(hole, first=first)


@pytest.fixture(scope="module")
def egg(sheet):
    return egg_box(sheet)


@pytest.fixture(scope="module")
def usual(egg):
    return {"auto": filled(egg, FAST), "paper": filled(egg, SHORT)}


@pytest.mark.parametrize(
    ("preset", "stage", "other"),
    [
        ("auto", "drape", Sunk()),
        ("auto", "base", SurfaceItself()),
        ("auto", "base", LowPassBase(order=2)),
        ("auto", "base", LowPassBase(cutoff=3.0)),
        ("auto", "patches", GridPatches(frames=PrincipalFrames())),
        ("auto", "patches", GridPatches(extent=0.5)),
        ("auto", "patches", GridPatches(spacing=2.5)),
        ("auto", "similar", MaskedDistance(k=3)),
        ("auto", "similar", MaskedDistance(angles=0)),
        ("auto", "similar", MaskedDistance(patches=100)),
        ("auto", "complete", GroupMean()),
        ("auto", "complete", RidgeCompletion(rank=2)),
        ("auto", "diffuse", FrontDiffusion(passes=3, refit_passes=1)),
        ("auto", "diffuse", FrontDiffusion(passes=1, refit_passes=3)),
        ("auto", "diffuse", FrontDiffusion(passes=1, refit_passes=1, falloff=0.2)),
        ("auto", "refine", TruncatedGammaNorm()),
        ("auto", "average", AverageAtVertices(corrections=0)),
        ("auto", "update", IterativeUpdate()),
        ("auto", "update", DirectUpdate(steps=1)),
        ("auto", "update", DirectUpdate(face_weight=0.5)),
        ("auto", "update", DirectUpdate(damping=1.0)),
        ("auto", "relief", CopiedRelief()),
        ("auto", "finish", Lifted()),
        ("auto", "rim_normals", True),
        ("auto", "passes", 1),
        ("auto", "depth", 0.0),
        ("auto", "copying", False),
        ("paper", "patches", RingPatches(sp=40, r=2)),
        ("paper", "patches", RingPatches(sp=20, r=4)),
        ("paper", "patches", RingPatches(sp=40, r=4, frames=BaseFrames())),
        ("paper", "similar", NormalPatchCovariance(k=3)),
        ("paper", "complete", GroupMean()),
        ("paper", "refine", NoRefinement()),
        ("paper", "update", IterativeUpdate(niter=5)),
        ("paper", "update", DirectUpdate()),
        ("paper", "finish", Lifted()),
        ("paper", "rim_normals", False),
        ("paper", "passes", 2),
    ],
)
def test_a_stage_that_is_changed_changes_the_fill(egg, usual, preset, stage, other):
    pipeline = {"auto": FAST, "paper": SHORT}[preset]
    assert getattr(pipeline, stage) != other
    changed = filled(egg, replace(pipeline, **{stage: other}))
    assert changed.shape == usual[preset].shape
    new = np.arange(len(changed)) >= len(egg[0])
    np.testing.assert_array_equal(changed[~new], egg[0])
    assert np.abs(changed - usual[preset])[new].max() > 1e-5


def test_edges_follow_the_detail_between_the_same_vertices(egg):
    assert AUTO.edges == AlongCreases()
    eager = replace(AUTO.edges, least_gain=1e-5)  # there are no creases here
    found, as_closed = (
        inpaint(*egg, parameters=FULL, pipeline=replace(FAST, edges=edges))
        for edges in (eager, EdgesAsClosed())
    )
    np.testing.assert_array_equal(found.vertices, as_closed.vertices)
    changed = (found.faces != as_closed.faces).any(axis=1)
    assert changed.any()
    assert not changed[: len(egg[1])].any()


def test_special_runs_get_changed_stages():
    trial, deep, copying = AUTO.for_trial(), AUTO.for_depth(), AUTO.for_copying()
    assert trial.similar.patches == 1000  # fewer would rank otherwise
    assert trial.similar.patches < AUTO.similar.patches
    assert trial.similar.angles < AUTO.similar.angles
    assert trial.patches.spacing > AUTO.patches.spacing
    assert trial.passes < AUTO.passes
    assert trial.diffuse.passes < AUTO.diffuse.passes
    assert deep.patches.extent > AUTO.patches.extent
    assert deep.passes < AUTO.passes
    assert copying.similar.k == 1
    assert copying.average.amplify > AUTO.for_last().average.amplify > AUTO.average.amplify
    assert copying.diffuse.falloff < AUTO.diffuse.falloff
    assert copying.passes == AUTO.passes
    assert not trial.copying
    assert not deep.copying
    assert PAPER.for_trial().similar == PAPER.similar


def test_tuning_is_done_with_the_cheaper_copy(egg):
    tried = []

    @dataclass(frozen=True)
    class Trying(Given):
        def __call__(self, hole, look, attempt, report):
            around = replace(hole, wavelength=WAVELENGTH)
            start = len(recorder.seen)
            attempt(replace(around, parts=np.where(depth_of(hole) > 0.0, 0, -1)), around)
            tried.append(len(recorder.seen) - start)
            return super().__call__(hole, look, attempt, report)

    recorder = Recorder()
    filled(egg, replace(FAST, tune=Trying(), base=recorder, passes=4))
    assert tried == [2 + 1]  # two passes, and a base for the library
    assert len(recorder.seen) == 3 + 4


@pytest.fixture(scope="module")
def with_ear(egg):
    """A closed region with a face of the fill whose corners all lie on the rim."""
    points, faces = egg
    ragged = 4.0 + np.random.default_rng(0).uniform(-0.8, 0.8, len(faces))
    middle = points[faces].mean(axis=1)
    faces = faces[np.hypot(*middle[:, :2].T) >= ragged]
    loops = [loop for loop in boundary_loops(points, faces) if not loop.is_rim]
    region = cut_region(points, faces, loops[0].vertices, loops[0].faces, reach=30.0)
    closed = AUTO.fair(AUTO.close([region], edge_lengths=[None]))[0].region
    n = len(region.vertices)
    known = ~closed.known_faces & (closed.faces < n).all(axis=1)
    return closed, known


def test_faces_of_the_fill_between_rim_vertices_are_not_known(with_ear):
    region, ears = with_ear
    assert ears.any()
    recorder = Recorder()
    solve_hole(
        region, replace(FAST, base=recorder, passes=1), detail="full", report=lambda *_: None
    )
    hole = recorder.seen[0]
    assert not hole.known_faces[ears].any()
    np.testing.assert_array_equal(hole.known_faces, region.known_faces)
    np.testing.assert_array_equal(hole.loop, region.loop)
    assert not hole.measured[region.faces[ears]].any()


@pytest.mark.parametrize("rim_normals", [True, False])
def test_known_normals_are_those_of_known_faces(with_ear, rim_normals):
    region, ears = with_ear
    hole = start_hole(
        region.vertices,
        region.faces,
        unknown=~region.known_vertices,
        known_faces=region.known_faces,
        loop=region.loop,
        rim_normals=rim_normals,
    )
    expected = vertex_normals(region.vertices, region.faces[region.known_faces])
    np.testing.assert_array_equal(hole.normals[hole.measured], expected[hole.measured])
    assert not hole.normals[~hole.measured].any()
    assert hole.measured[region.loop].all() == rim_normals
    everywhere = vertex_normals(region.vertices, region.faces)
    assert (expected[region.loop] != everywhere[region.loop]).any()
    assert ears.any()


def test_what_is_missed_too_takes_its_faces_along(with_ear):
    region, ears = with_ear
    hole = hole_of(region.vertices, region.faces, ~region.known_vertices)
    hole = replace(hole, known_faces=region.known_faces, wavelength=WAVELENGTH)
    far = np.linalg.norm(hole.positions - [10.0, 0.0, 0.0], axis=1) < 2.0
    both = with_missing(hole, hole.positions, np.where(far, 0, -1))
    assert not both.known_faces[ears].any()
    np.testing.assert_array_equal(
        both.known_faces, region.known_faces & ~far[region.faces].any(axis=1)
    )
    np.testing.assert_array_equal(both.unknown, hole.unknown | far)
    assert both.wavelength == WAVELENGTH


@pytest.mark.parametrize("rings", [0, 4, 12])
def test_rings_are_cut_out_whole_however_long_their_edges(sheet, rings):
    points, faces = sheet(60, 40)
    points = points * [3.0, 0.3, 1.0]
    gone = np.hypot(*(points[:, :2] / [3.0, 0.3] - [20.0, 26.0]).T) < 2.0
    faces = faces[~gone[faces].any(axis=1)]
    loop = next(loop for loop in boundary_loops(points, faces) if not loop.is_rim)
    region = cut_region(points, faces, loop.vertices, loop.faces, reach=1.0, rings=rings)
    ring = np.full(len(points), -1)
    ring[loop.vertices] = 0
    for number in range(1, rings + 1):
        near = (ring[faces] >= 0).any(axis=1)
        ring[faces[near]] = np.where(ring[faces[near]] < 0, number, ring[faces[near]])
    assert np.isin(np.flatnonzero(ring >= 0), region.vertex_ids).all()


def test_the_paper_sees_all_its_rings(sheet):
    points, faces = sheet(90, 84)
    points = points - points.mean(axis=0)
    gone = np.hypot(*points[:, :2].T) < 1.5
    faces = faces[~gone[faces].any(axis=1)]
    recorder = Recorder(base=SurfaceItself())
    pipeline = replace(PAPER, patches=RingPatches(sp=7, r=36), base=recorder, passes=1)
    inpaint(points, faces, parameters=FULL, pipeline=pipeline)
    centres = pipeline.patches.centres(recorder.seen[0])
    reach = np.hypot(*recorder.seen[0].positions[centres][:, :2].T).max()
    assert reach > 33.0  # the reach of 30 would cut the rings at 31.5


def test_selected_patches_go_the_same_way(egg):
    points, faces = egg
    selected = np.hypot(points[:, 0] - 8.0, points[:, 1]) < 2.5
    recorder = Recorder()
    pipeline = replace(FAST, base=recorder, passes=1)
    restore_detail(points, faces, selected, parameters=FULL, pipeline=pipeline)
    (hole,) = recorder.seen
    assert hole.unknown.sum() == selected.sum()
    np.testing.assert_array_equal(hole.known_faces, ~hole.unknown[hole.faces].any(axis=1))
    assert not hole.unknown[hole.loop].any()


def test_the_first_base_ignores_what_is_missing_and_later_ones_fit_it(egg):
    points, faces = egg
    unknown = np.hypot(points[:, 0] - 8.0, points[:, 1]) < 2.5
    hole = replace(hole_of(points, faces, unknown), wavelength=WAVELENGTH)
    lifted = points + 3.0 * np.outer(unknown, [0.0, 0.0, 1.0])
    high = replace(hole, positions=lifted)
    base = LowPassBase()
    inside = depth_of(hole) > 1.0
    first = (base(high, first=True).base - base(hole, first=True).base)[inside, 2]
    later = (base(high, first=False).base - base(hole, first=False).base)[inside, 2]
    assert np.abs(first).max() < 0.3 * np.abs(later).max()


def test_nothing_to_go_by_gives_none(egg):
    points, faces = egg
    unknown = np.hypot(points[:, 0] - 8.0, points[:, 1]) < 2.5
    hole = replace(hole_of(points, faces, unknown), wavelength=22.0)
    assert recover(hole, FAST) is None


def test_a_hole_tells_how_far_it_is(with_ear):
    told = []
    trust = Trust(np.ones(3), 0.8)
    for depth in (0.0, math.inf):
        told.clear()
        pipeline = replace(FAST, tune=Given(trust), depth=depth)
        solve_hole(with_ear[0], pipeline, detail="full", report=lambda *step: told.append(step))
        parts = [part for _, part in told]
        assert parts == sorted(parts)
        assert 0.0 < parts[0] < 0.3 < parts[-1] < 1.0
        assert ("long patches" in [stage for stage, _ in told]) == (depth == 0.0)


def test_holes_are_deep_in_lengths_of_their_patches(with_ear):
    depth = fill_depth(with_ear[0]) / (0.85 * WAVELENGTH)
    for shortening in (1.0, 0.7):
        told = []
        tune = Given(Trust(np.ones(3), 0.8), shortening)
        solve_hole(
            with_ear[0],
            replace(FAST, tune=tune, depth=depth),
            detail="full",
            report=lambda stage, _, told=told: told.append(stage),
        )
        assert ("long patches" in told) == (shortening < 1.0)


@pytest.mark.parametrize("samples", [40, 130, 300])
def test_the_patchsize_is_the_number_of_samples(egg, samples):
    patches = pipeline_of(InpaintParameters(patchsize=samples)).patches
    points, faces = egg
    hole = hole_of(points, faces, np.hypot(*points[:, :2].T) < 2.0)
    size = patches.layer(replace(hole, wavelength=60.0)).size
    assert size == pytest.approx(samples, rel=0.15)


def test_values_of_the_pipeline_cannot_be_changed():
    # A preset is shared by all runs of a process.
    classes = {Pipeline, Hole, InpaintParameters}
    for room in (stages, tuning):
        for module in pkgutil.iter_modules(room.__path__, f"{room.__name__}."):
            for name, found in vars(importlib.import_module(module.name)).items():
                is_stage = isinstance(found, type) and issubclass(found, Stage)
                if is_stage and found is not Stage and found.__module__ == module.name:
                    classes.add(found)
                    assert name == found.__name__
    assert {type(stage) for stage in vars(AUTO).values() if isinstance(stage, Stage)} <= classes
    for found in classes:
        assert found.__dataclass_params__.frozen, f"{found.__name__} is not frozen"
