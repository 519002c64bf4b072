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
from meshlab_lowrank.mesh.clamped_plate import clamped_plate
from meshlab_lowrank.presets import PAPER, pipeline_of
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_region
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region
from meshlab_lowrank.stages.stage1b_fair_harmonic import HarmonicFairing
from meshlab_lowrank.stages.stage1b_fair_spline import SplineFairing, rim_star, spline_surface

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
    star = rim_star(region.vertices[region.loop])
    return spline_surface(region, star), star


def test_it_interpolates_the_rim_and_goes_on_along_the_tangents(bowl):
    region = region_of(*bowl)
    surface, star = surface_of(region)
    angles, rim = star.angles(), region.vertices[region.loop]
    np.testing.assert_allclose(surface(angles, np.zeros(len(rim))), star.height, atol=1e-9)
    step = 1e-5
    inside = (1.0 - step) * star.flat
    ahead = star.in_space(inside, surface(angles, np.full(len(rim), step)))
    straight = star.in_space(star.flat, star.height)
    direction = ahead - straight
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    normals = measured_normals(region)
    assert np.abs(np.einsum("ij,ij->i", direction, normals)).max() < 1e-3
    assert np.linalg.norm(straight - rim, axis=1).max() < 0.5  # but for the zigzag


def measured_normals(region):
    known = region.faces[region.known_faces]
    a, b, c = region.vertices[known].transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)
    normals = [areas[(known == vertex).any(axis=1)].sum(axis=0) for vertex in region.loop]
    return np.array(normals) / np.linalg.norm(normals, axis=1)[:, None]


def test_it_is_a_weighted_mean_of_its_control_points(bowl):
    """B-splines of one direction and of the other sum to one."""
    surface, _ = surface_of(region_of(*bowl))
    rows = surface.rows
    ones = replace(surface, rows=type(rows)(rows.t, np.ones_like(rows.c), rows.k))
    chance = np.random.default_rng(0)
    angles, inwards = chance.uniform(0.0, 2.0 * np.pi, 50), chance.uniform(0.0, 1.0, 50)
    np.testing.assert_allclose(ones(angles, inwards), 1.0, atol=1e-12)


def test_it_closes_around_the_rim_and_in_a_pole(bowl):
    surface, _ = surface_of(region_of(*bowl))
    inwards = np.linspace(0.0, 1.0, 9)
    begin, end = surface(np.zeros(9), inwards), surface(np.full(9, 2.0 * np.pi), inwards)
    np.testing.assert_allclose(begin, end, atol=1e-9)
    pole = surface(np.linspace(0.0, 2.0 * np.pi, 20), np.ones(20))
    assert np.ptp(pole) < 1e-6


@pytest.mark.parametrize("m", [0, 1, 3])
def test_a_clamped_plate_is_biharmonic(m):
    """(1 + 2 rho^2) rho^m cos(m phi) is, and is found from its rim."""
    angles = 2.0 * np.pi * np.arange(96) / 96
    wave = np.cos(m * angles)
    outwards = np.repeat(np.linspace(1.0, 0.0, 6)[:, None], 96, axis=1)
    found = clamped_plate(angles, 3.0 * wave, -(3.0 * m + 4.0) * wave, outwards)
    np.testing.assert_allclose(found, (1.0 + 2.0 * outwards**2) * outwards**m * wave, atol=0.02)
    beyond = clamped_plate(angles, 3.0 * wave, 0.5 * wave, np.full((1, 96), 1.2))
    np.testing.assert_allclose(beyond[0], 2.9 * wave, atol=0.02)


def test_a_plane_stays_one_and_a_bowl_is_met(sheet, bowl):
    points, faces = sheet(24, 22, seed=2)
    slanted = holed(bent(points, lambda x, y: 0.4 * x - 0.2 * y), faces)
    flat = inpaint(*slanted, **SPLINE)
    x, y, z = flat.vertices.T
    assert np.abs(z - 0.4 * x + 0.2 * y).max() < 1e-6
    x, y, z = inpaint(*bowl, **SPLINE).vertices.T
    wrong = np.abs(z - 0.03 * (x**2 + y**2) - 0.1 * np.sin(x)).max()
    assert wrong < 0.15  # a flat fill is wrong by 0.48 in the middle


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
