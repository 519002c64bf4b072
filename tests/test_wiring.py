"""The connection of the stages: each is run, on what the one before it made."""

from __future__ import annotations

import importlib
import json
import math
import pkgutil
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from meshlab_lowrank import stages, tuning
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.hole import Hole, depth_of, start_hole, with_missing
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.pipeline import Pipeline, recover
from meshlab_lowrank.presets import AUTO, PAPER, pipeline_of
from meshlab_lowrank.restoring import restore_detail
from meshlab_lowrank.solving import solve_hole
from meshlab_lowrank.stages.stage import Stage
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region
from meshlab_lowrank.stages.stage1d_drape_as_faired import AsFaired
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
from meshlab_lowrank.stages.stage6c_relief_none import NoRelief
from meshlab_lowrank.stages.stage8_edges_along_creases import AlongCreases
from meshlab_lowrank.stages.stage8_edges_as_closed import EdgesAsClosed
from meshlab_lowrank.tuning.trust import Trust
from meshlab_lowrank.tuning.tune import Tuned, Unquestioning
from tests.builders import hole_of

WAVELENGTH = 7.0


@dataclass(frozen=True)
class Said:
    """Evidence for one trust, whatever the fill says of itself."""

    said: Trust
    promising: bool = True

    def trust(self, conflict):  # noqa: ARG002
        return self.said


@dataclass(frozen=True)
class Given(Unquestioning):
    """A tuning that knows its answer."""

    trust: Trust | None = None

    def __call__(self, hole, attempt, report):  # noqa: ARG002
        evidence = None if self.trust is None else Said(self.trust)
        return Tuned(replace(hole, wavelength=WAVELENGTH), evidence)


@dataclass(frozen=True)
class Recorder(Stage):
    """A base that remembers the holes it saw."""

    base: LowPassBase = field(default_factory=LowPassBase)
    seen: list[Hole] = field(default_factory=list, compare=False)

    def __call__(self, hole, *, first):
        self.seen.append(hole)
        return self.base(hole, first=first)


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


@pytest.fixture(scope="module")
def egg(sheet):
    points, faces = sheet(40, 34)
    points = points - points.mean(axis=0)
    k = 2.0 * np.pi / WAVELENGTH
    points[:, 2] = 0.4 * (np.cos(k * points[:, 0]) + np.cos(k * points[:, 1]))
    gone = np.hypot(*points[:, :2].T) < 3.5
    return points, faces[~gone[faces].any(axis=1)]


def filled(egg, pipeline):
    return inpaint(*egg, parameters=FULL, pipeline=pipeline).vertices


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
    assert trial.similar == AUTO.similar  # fewer patches would rank otherwise
    assert trial.patches.spacing > AUTO.patches.spacing
    assert trial.passes < AUTO.passes
    assert trial.diffuse.passes < AUTO.diffuse.passes
    assert deep.patches.extent > AUTO.patches.extent
    assert deep.similar.angles > AUTO.similar.angles
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
        def __call__(self, hole, attempt, report):
            around = replace(hole, wavelength=WAVELENGTH)
            start = len(recorder.seen)
            attempt(replace(around, parts=np.where(depth_of(hole) > 0.0, 0, -1)), around)
            tried.append(len(recorder.seen) - start)
            return super().__call__(hole, attempt, report)

    recorder = Recorder()
    filled(egg, replace(FAST, tune=Trying(), base=recorder, passes=4))
    assert tried == [2 + 1]  # two passes, and a base for the library
    assert len(recorder.seen) == 3 + 4


def test_trust_scales_the_detail_by_depth(egg):
    fast = replace(FAST, drape=AsFaired())
    full = inpaint(*egg, parameters=FULL, pipeline=replace(fast, copying=False))
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    new = full.new_vertices
    for strength in (1.0, 0.5):
        trust = Trust(np.full(3, strength), 0.8)
        scaled = inpaint(*egg, pipeline=replace(fast, tune=Given(trust)))
        expected = smooth.vertices + strength * (full.vertices - smooth.vertices)
        np.testing.assert_allclose(scaled.vertices[new], expected[new], atol=1e-12)
        np.testing.assert_array_equal(scaled.trust[new], 0.8)
    for doubtful in (Trust(np.ones(3), 0.1), Trust(np.array([0.0, 1.0, 1.0]), 0.8)):
        left = inpaint(*egg, pipeline=replace(FAST, tune=Given(doubtful)))
        assert left.vertices.tobytes() == smooth.vertices.tobytes()
        (record,) = (hole for hole in left.holes if hole.status == "filled")
        assert "doesn't predict itself" in record.reason


def test_detail_is_scaled_from_the_draped_fill(egg):
    slight = replace(FAST, tune=Given(Trust(np.full(3, 1e-9), 0.8)))
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    laid, left = (
        inpaint(*egg, pipeline=replace(slight, drape=drape)) for drape in (Sunk(), AsFaired())
    )
    new = smooth.new_vertices
    assert np.abs(left.vertices - smooth.vertices).max() < 1e-6
    assert np.median(np.linalg.norm((laid.vertices - smooth.vertices)[new], axis=1)) > 0.5


def test_bars_are_those_of_the_smooth_fill_less_what_trials_explain(egg):
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    new = smooth.new_vertices
    trust = Trust(np.ones(3), 0.8, np.array([0.04, 0.25, 0.64]), np.array([0.09, 0.36, 1.44]))
    for parameters, left in ((None, trust.left), (FULL, trust.left_by_whole)):
        pipeline = replace(FAST, copying=False, tune=Given(trust))
        result = inpaint(*egg, parameters=parameters, pipeline=pipeline)
        shares = result.error[new] / smooth.error[new]
        assert 0.9 * np.sqrt(left[0]) < shares.min() < shares.max() < 1.1 * np.sqrt(left[-1])
        np.testing.assert_allclose(result.trust[new], np.maximum(1.0 - shares**2, 0.0), atol=1e-9)
        deepest = smooth.error[new].argmax()
        assert result.trust[new][deepest] == result.trust[new].min() < result.trust[new].max()
        (record,) = (hole for hole in result.holes if hole.status == "filled")
        assert record.largest_error == result.error[new].max()


def test_full_detail_is_copied_as_relief_where_it_does_not_predict_itself(egg):
    right, wrong = Trust(np.ones(3), 0.8), Trust(np.zeros(3), 0.0)
    for trust, copied in ((right, False), (wrong, True), (None, True)):
        tune = Given(trust)
        recovered = filled(egg, replace(FAST, tune=tune))
        usual = filled(egg, replace(FAST, tune=tune, relief=CopiedRelief()))
        assert (recovered.tobytes() != usual.tobytes()) == copied
    calibrated = replace(FAST, tune=Given(wrong), relief=CopiedRelief())
    left = inpaint(*egg, pipeline=calibrated)
    (record,) = (hole for hole in left.holes if hole.status == "filled")
    assert "doesn't predict itself" in record.reason
    assert pipeline_of(InpaintParameters(seed=3)).relief.seed == 3


def test_trust_that_nothing_tells_is_not_a_number(egg):
    for pipeline, parameters in ((None, InpaintParameters.paper(patchsize=40)), (FAST, FULL)):
        result = inpaint(*egg, parameters=parameters, pipeline=pipeline)
        (record,) = (hole for hole in result.holes if hole.status == "filled")
        assert math.isnan(record.trust)
        assert "not known" in record.reason
        assert np.isnan(result.trust[result.new_vertices]).all()
        assert not np.isnan(result.trust[~result.new_vertices]).any()
        assert json.loads(json.dumps(record.as_dict(), allow_nan=False))["trust"] is None


def test_the_filter_hands_on_that_trust_is_not_known(holed_set):
    ms = holed_set()
    report = ms.meshing_inpaint_lowrank(preset="paper", patchsize=20, ringnumber=3)
    assert [hole["trust"] for hole in report["holes"]] == [None, None]
    trust = ms.current_mesh().vertex_custom_scalar_attribute_array("inpaint_trust")
    new = ms.current_mesh().vertex_custom_scalar_attribute_array("inpainted") > 0.5
    np.testing.assert_array_equal(np.isnan(trust), new)


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
    hole = replace(hole_of(points, faces, unknown), wavelength=60.0)
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


@pytest.mark.parametrize("samples", [40, 130, 300])
def test_the_patchsize_is_the_number_of_samples(egg, samples):
    patches = pipeline_of(InpaintParameters(patchsize=samples)).patches
    points, faces = egg
    hole = hole_of(points, faces, np.hypot(*points[:, :2].T) < 2.0)
    size = patches.layer(replace(hole, wavelength=60.0)).size
    assert size == pytest.approx(samples, rel=0.15)


def test_a_fill_that_stays_smooth_is_not_trusted(egg):
    result = inpaint(*egg, pipeline=replace(FAST, tune=Given(Trust(np.ones(3), 0.1))))
    assert (result.trust[result.new_vertices] == 0.0).all()
    (record,) = (hole for hole in result.holes if hole.status == "filled")
    assert record.trust == 0.0


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


@dataclass(frozen=True)
class Failing(Stage):
    """A base that fails."""

    def __call__(self, hole, *, first):  # noqa: ARG002
        msg = "It is not to be."
        raise StageError(msg)


@dataclass(frozen=True)
class Spoiling(Stage):
    """A finish after which nothing is a number."""

    def __call__(self, hole, positions, base_normals):  # noqa: ARG002
        return np.full_like(positions, np.nan)


@pytest.mark.parametrize(
    ("broken", "words"),
    [({"base": Failing()}, "It is not to be."), ({"finish": Spoiling()}, "not finite")],
)
def test_a_hole_whose_detail_fails_keeps_its_smooth_fill(egg, broken, words):
    smooth = inpaint(*egg, parameters=InpaintParameters(detail="none"))
    trust = Trust(np.ones(3), 0.8)
    result = inpaint(*egg, pipeline=replace(FAST, tune=Given(trust), **broken))
    assert result.vertices.tobytes() == smooth.vertices.tobytes()
    (record,) = (hole for hole in result.holes if hole.status == "filled")
    assert words in record.reason
    assert record.trust == 0.0
