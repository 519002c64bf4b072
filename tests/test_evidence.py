"""What is found out before detail is tried: does any repeat, does it matter in this hole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.stages.stage3_similar_masked_distance import MaskedDistance
from meshlab_lowrank.tuning.evidence import repetition
from sample_meshes.shapes import make_shape
from tests.builders import hole_of

WAVES = 2.0 * np.pi / 9.0


def height_of(kind, x, y):
    chance = np.random.default_rng(3)
    if kind == "noise":
        return chance.normal(0.0, 0.3, len(x))
    if kind == "bulge":
        return 8.0 * np.exp(-((x - 9.0) ** 2 + y**2) / 200.0)
    if kind == "stripes":
        return 0.4 * np.cos(WAVES * x)
    return 0.4 * (np.cos(WAVES * x) + np.cos(WAVES * y))


def surface(sheet, kind, radius):
    points, faces = sheet(70, 60)
    points = points - points.mean(axis=0)
    x, y = points[:, :2].T
    points[:, 2] = height_of(kind, x, y)
    return points, faces, np.hypot(x, y) < radius


@pytest.mark.parametrize("kind", ["waves", "stripes"])
def test_what_repeats_alternates(sheet, kind):
    hole = hole_of(*surface(sheet, kind, 6.0))
    assert repetition(hole, 0) > 0.15


@pytest.mark.parametrize("kind", ["noise", "bulge"])
def test_noise_and_soft_shapes_do_not(sheet, kind):
    hole = hole_of(*surface(sheet, kind, 6.0))
    assert repetition(hole, 0) < AUTO.tune.least_repetition


def test_neither_units_nor_what_is_missing_nor_the_way_it_lies_matters(sheet):
    hole = hole_of(*surface(sheet, "waves", 6.0))
    spoiled = np.where(hole.measured[:, None], hole.normals, [[1.0, 0.0, 0.0]])
    assert repetition(replace(hole, normals=spoiled), 0) == pytest.approx(repetition(hole, 0))
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    turned = replace(hole, positions=hole.positions @ turn, normals=hole.normals @ turn)
    assert repetition(turned, 0) == pytest.approx(repetition(hole, 0), abs=1e-6)


def test_a_plane_has_no_detail(sheet):
    points, faces, unknown = surface(sheet, "waves", 6.0)
    assert repetition(hole_of(points * [1.0, 1.0, 0.0], faces, unknown), 0) == 0.0


def records(mesh, gone, **values):
    points, faces, _ = mesh
    result = inpaint(
        points, faces[~gone[faces].any(axis=1)], parameters=InpaintParameters(**values)
    )
    return [each for each in result.holes if each.status == "filled"]


def test_the_reason_says_why_a_fill_is_smooth(sheet):
    for kind, radius, words in (
        ("bulge", 6.0, "no detail"),
        ("waves", 1.2, "too narrow"),
        ("noise", 6.0, "doesn't predict itself"),
    ):
        mesh = surface(sheet, kind, radius)
        (record,) = records(mesh, mesh[2])
        assert words in record.reason, (kind, record)
        assert record.trust == 0.0


def test_full_detail_is_put_on_whatever_is_found(sheet):
    mesh = surface(sheet, "noise", 6.0)
    (record,) = records(mesh, mesh[2], detail="full", iterations=1)
    assert record.reason == "" or "not known" in record.reason


def test_holes_near_one_another_share_what_was_found_out(sheet):
    points, *_ = mesh = surface(sheet, "waves", 5.0)
    gone = np.hypot(points[:, 0], points[:, 1]) < 4.5
    gone |= np.hypot(points[:, 0] - 14.0, points[:, 1]) < 4.5
    found = records(mesh, gone)
    assert len(found) == 2
    assert found[0].trust == found[1].trust > 0.3


@pytest.mark.parametrize("detail", ["calibrated", "none"])
def test_the_number_of_threads_changes_no_bit(monkeypatch, detail):
    vertices, faces = make_shape("torus", "bumps", count=6000, wavelength=8.0, seed=2)
    gone = np.zeros(len(vertices), dtype=bool)
    for place in (0, 3000):
        gone |= np.linalg.norm(vertices - vertices[place], axis=1) < 3.5
    mesh = vertices, faces[~gone[faces].any(axis=1)]
    quick = replace(AUTO, similar=MaskedDistance(patches=300, angles=1), passes=1)
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("MESHLAB_LOWRANK_THREADS", threads)
        found.append(inpaint(*mesh, parameters=InpaintParameters(detail=detail), pipeline=quick))
    trusts = {hole.trust for hole in found[0].holes}
    assert len(trusts) == (2 if detail == "calibrated" else 1)  # each is worked on by itself
    assert found[0].vertices.tobytes() == found[1].vertices.tobytes()
    assert found[0].faces.tobytes() == found[1].faces.tobytes()
    assert found[0].holes == found[1].holes
