"""Fills that stay flawed are tried otherwise: coarser too, within bounds, and without bulges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pymeshlab
import pytest

from benchmarks.sheets import ragged_hole
from meshlab_lowrank import closing, closing_ways
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.result import InpaintResult
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import Region, cut_rings
from meshlab_lowrank.stages.stage1b_fair import FairRegion

NONE = InpaintParameters(detail="none")
Result = FairRegion | StageError


def crumpled(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Give a rolled-up sheet with a ragged hole and noise."""
    vertices, faces, _ = ragged_hole(seed)
    angle = (vertices[:, 0] - vertices[:, 0].mean()) / 1.6
    faces = faces[(np.abs(angle) < 2.9)[faces].all(axis=1)]
    away = 1.6 * (1.0 + 0.02 * angle)
    rolled = np.stack([away * np.sin(angle), vertices[:, 1], away * np.cos(angle)], axis=1)
    return rolled + np.random.default_rng(seed).normal(0.0, 0.2, rolled.shape), faces


def flaws_of(result: InpaintResult) -> int:
    return sum(hole.folded_edges + hole.flat_faces + hole.crossings for hole in result.holes)


def test_longer_edges_mend_what_others_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = crumpled(33)
    mended = inpaint(*mesh, parameters=NONE)
    assert any("times as long as those of its rim" in hole.reason for hole in mended.holes)
    monkeypatch.setattr(closing_ways, "_COARSE_EDGES", ())
    assert flaws_of(mended) < flaws_of(inpaint(*mesh, parameters=NONE))


def test_an_edge_length_that_is_asked_for_is_kept_to() -> None:
    asked = InpaintParameters(detail="none", refineedgelen=1.0)
    result = inpaint(*crumpled(33), parameters=asked)
    assert not any("times as long as those of its rim" in hole.reason for hole in result.holes)


def cap(top: float, subdivisions: int = 4) -> Region:
    """Give a sphere without what lies above a height."""
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_sphere(subdiv=subdivisions)
    points = ms.current_mesh().vertex_matrix()
    faces = ms.current_mesh().face_matrix().astype(np.int64)
    faces = faces[points[faces][:, :, 2].mean(axis=1) < top]
    (loop,) = boundary_loops(points, faces)
    (region,) = cut_rings(points, faces, [loop.vertices], [loop.faces], rings=9)
    return region


def tried_for(region: Region, flaws: float) -> tuple[Result, Result, list[Sequence[Result]]]:
    """Close a region in all ways, if each has so many flaws but the usual one has another."""
    first = closing.smooth_fills([region], [None], AUTO, lambda _: None)
    seen: list[Sequence[Result]] = []

    def count(fills: Sequence[Result]) -> list[float]:
        seen.append(fills)
        return [flaws + (fill is first[0]) for fill in fills]

    (best,) = closing.otherwise([region], [None], AUTO, first, count=count, fault="crosses")
    return first[0], best, seen[1:]


def test_of_equal_fills_that_in_its_surroundings_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    region = cap(0.3)
    first, best, seen = tried_for(region, 0.0)
    assert closing._bulge(first) > closing._FAR
    assert closing._bulge(seen[0][0]) > closing._FAR
    assert closing._bulge(best) == 0.0
    monkeypatch.setattr(closing, "_FAR", 2.0)
    assert len(tried_for(region, 0.0)[2]) == 1


def test_few_ways_are_tried_with_many_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    region = cap(0.5, subdivisions=3)
    usual = len(tried_for(region, 1.0)[2])
    monkeypatch.setattr(closing_ways, "_MOST_FACES", 10)
    assert 3 <= len(tried_for(region, 1.0)[2]) < usual
