"""The circular B-spline surface as stage 1 of preset paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank import InpaintParameters, inpaint, restore_detail
from meshlab_lowrank.cli import main
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.presets import PAPER, pipeline_of
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region
from meshlab_lowrank.stages.stage1b_fair_harmonic import HarmonicFairing
from meshlab_lowrank.stages.stage1b_fair_spline import (
    SplineFairing,
    rim_parameters,
    rim_star,
    rim_tangents,
    spline_surface,
)

SPLINE = {"preset": "paper", "base": "bspline", "detail": "none"}


def bent(points, height):
    points = points - points.mean(axis=0)
    return np.column_stack([points[:, :2], height(*points[:, :2].T)])


def holed(vertices, faces, radius=4.0):
    away = np.linalg.norm(vertices[faces].mean(axis=1)[:, :2], axis=1)
    used, local = np.unique(faces[away > radius], return_inverse=True)
    return vertices[used], local.reshape(-1, 3)


@pytest.fixture(scope="module")
def bowl(sheet):
    points, faces = sheet(24, 22, seed=2)
    return holed(bent(points, lambda x, y: 0.03 * (x**2 + y**2) + 0.1 * np.sin(x)), faces)


def region_of(vertices, faces):
    (loop,) = [each for each in boundary_loops(vertices, faces) if not each.is_rim]
    region = cut_region(vertices, faces, loop.vertices, loop.faces, reach=0.0, rings=6)
    return close_region(region)


def surface_of(region):
    rim = region.vertices[region.loop]
    return spline_surface(region, rim_star(rim)), rim_parameters(rim)


def test_it_interpolates_the_rim_and_goes_on_along_the_tangents(bowl):
    region = region_of(*bowl)
    surface, places = surface_of(region)
    rim = region.vertices[region.loop]
    np.testing.assert_allclose(surface(places, np.zeros(len(places))), rim, atol=1e-9)
    step = 1e-6
    slope = (surface(places, np.full(len(places), step)) - rim) / step
    np.testing.assert_allclose(slope, rim_tangents(region), atol=1e-4)
    normals = np.cross(*np.moveaxis(rim_frames(region), 1, 0))
    across = np.abs(np.einsum("ij,ij->i", slope, normals)) / np.linalg.norm(slope, axis=1)
    assert across.max() < 1e-4


def rim_frames(region):
    """Two tangents (k, 2, 3) of the measured surface at each vertex of the rim."""
    known = region.faces[region.known_faces]
    a, b, c = region.vertices[known].transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)
    frames = []
    for vertex in region.loop:
        normal = areas[(known == vertex).any(axis=1)].sum(axis=0)
        first = np.cross(normal, [1.0, 0.0, 0.0])
        first /= np.linalg.norm(first)
        frames.append([first, np.cross(normal / np.linalg.norm(normal), first)])
    return np.array(frames)


def test_it_is_a_weighted_mean_of_its_control_points(bowl):
    """B-splines of one direction and of the other sum to one, so that it moves as they do."""
    region = region_of(*bowl)
    surface, _ = surface_of(region)
    around, inwards = np.random.default_rng(0).uniform(size=(2, 50))
    ones = replace(surface, rows=type(surface.rows)(*_like(surface.rows)))
    np.testing.assert_allclose(ones(around, inwards), 1.0, atol=1e-12)


def _like(rows):
    return rows.t, np.ones_like(rows.c), rows.k


def test_it_closes_around_the_rim_and_in_a_pole(bowl):
    surface, _ = surface_of(region_of(*bowl))
    inwards = np.linspace(0.0, 1.0, 9)
    begin, end = surface(np.zeros(9), inwards), surface(np.ones(9), inwards)
    np.testing.assert_allclose(begin, end, atol=1e-9)
    pole = surface(np.linspace(0.0, 1.0, 20), np.ones(20))
    assert np.ptp(pole, axis=0).max() < 1e-9


def test_a_plane_stays_one_and_a_bowl_is_met(sheet, bowl):
    points, faces = sheet(24, 22, seed=2)
    slanted = holed(bent(points, lambda x, y: 0.4 * x - 0.2 * y), faces)
    flat = inpaint(*slanted, **SPLINE)
    x, y, z = flat.vertices.T
    assert np.abs(z - 0.4 * x + 0.2 * y).max() < 1e-6
    x, y, z = inpaint(*bowl, **SPLINE).vertices.T
    wrong = np.abs(z - 0.03 * (x**2 + y**2) - 0.1 * np.sin(x)).max()
    assert wrong < 0.15  # a flat fill is wrong by 0.48 in the middle


def test_strong_curvature_at_the_rim_shortens_the_tangents(sheet):
    points, faces = sheet(24, 22, seed=2)
    lengths = []
    for bend in (0.0, 0.6):
        valley = bent(points, lambda x, y, b=bend: 0.5 * b * (np.hypot(x, y) - 4.7) ** 2)
        region = region_of(*holed(valley, faces))
        lengths.append(np.linalg.norm(rim_tangents(region), axis=1).mean())
    assert lengths[1] < 0.7 * lengths[0]


def test_it_is_a_choice_of_preset_paper_and_of_no_other(bowl):
    chosen = pipeline_of(InpaintParameters.paper(base="bspline"))
    assert chosen.fair == SplineFairing()
    assert replace(chosen, fair=PAPER.fair) == pipeline_of(InpaintParameters.paper())
    assert PAPER.fair == HarmonicFairing()
    region = region_of(*bowl)
    (wanted,) = SplineFairing()([region])
    result = inpaint(*bowl, **SPLINE)
    new = wanted.region.to_global(wanted.region.vertices[~region.known_vertices])
    np.testing.assert_allclose(result.vertices[result.new_vertices], new, atol=1e-6)
    other = inpaint(*bowl, **{**SPLINE, "base": "meshlab"}).vertices
    assert np.abs(other - result.vertices).max() > 1e-3
    with pytest.raises(InvalidParameterError, match="base is 'bspline', but preset 'auto'"):
        InpaintParameters(base="bspline")
    with pytest.raises(InvalidParameterError, match="base is 'nurbs'"):
        InpaintParameters.paper(base="nurbs")
    with pytest.raises(InvalidParameterError, match="base is of closing holes"):
        restore_detail(*bowl, np.zeros(len(bowl[0]), dtype=np.bool_), base="bspline")


def test_the_filter_and_the_command_take_it(bowl, tmp_path):
    vertices, faces = bowl
    wanted = inpaint(*bowl, **SPLINE).vertices
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    ms.save_current_mesh(str(tmp_path / "bowl.ply"), save_face_quality=False)
    meshlab_lowrank.filters.meshing_inpaint_lowrank(ms, **SPLINE)
    np.testing.assert_array_equal(ms.current_mesh().vertex_matrix(), wanted)
    options = [f"--{name}={value}" for name, value in SPLINE.items()]
    names = (str(tmp_path / each) for each in ("bowl.ply", "filled.ply"))
    assert main(["inpaint", *names, *options, "--quiet"]) == 0
    ms.load_new_mesh(str(tmp_path / "filled.ply"))
    np.testing.assert_allclose(ms.current_mesh().vertex_matrix(), wanted, atol=1e-5)


def test_what_has_no_star_shaped_rim_is_faired(sheet):
    points, faces = sheet(30, 30, seed=2)
    points = points - points.mean(axis=0)
    x, y, _ = points[faces].mean(axis=1).T
    horseshoe = (np.abs(np.hypot(x, y) - 6.0) < 1.8) & ((y < 0.0) | (np.abs(x) > 3.0))
    used, local = np.unique(faces[~horseshoe], return_inverse=True)
    vertices, faces = points[used], local.reshape(-1, 3)
    region = region_of(vertices, faces)
    assert rim_star(region.vertices[region.loop]) is None
    (splined,), (faired,) = SplineFairing()([region]), HarmonicFairing()([region])
    np.testing.assert_array_equal(splined.region.vertices, faired.region.vertices)


def test_selected_vertices_have_no_loop_to_span(bowl):
    """Their boundary is no chain in order, so they are faired."""
    vertices, faces = bowl
    chosen = np.linalg.norm(vertices[:, :2] - [7.0, 0.0], axis=1) < 1.8
    splined, faired = (
        restore_detail(
            vertices, faces, chosen, parameters=InpaintParameters.paper(base=base, detail="none")
        )
        for base in ("bspline", "meshlab")
    )
    np.testing.assert_array_equal(splined.vertices, faired.vertices)
