"""Cuts are capped flat, and what closes like a sphere goes on smoothly."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from meshlab_lowrank.errors import InvalidParameterError, StageError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.fairing import fair_surfaces, membrane
from meshlab_lowrank.mesh.geometry import edge_lengths, face_normals
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.stages import stage1b_fair_harmonic
from meshlab_lowrank.stages.stage0_boundary_loops import boundary_loops
from meshlab_lowrank.stages.stage0_region import cut_rings
from meshlab_lowrank.stages.stage0_shape import is_cut
from meshlab_lowrank.stages.stage1a_close_meshlab import close_region
from meshlab_lowrank.stages.stage1b_fair_harmonic import fair_region, fair_regions


def open_cube(sides):
    """A cube of side 1 without its upper face, with so many edges along a side."""
    places: dict[tuple[float, ...], int] = {}
    faces = []

    def at(*place):
        return places.setdefault(place, len(places))

    for axis, level in product(range(3), (0.0, 1.0)):
        if (axis, level) == (2, 1.0):
            continue
        u, w = (other for other in range(3) if other != axis)
        for i, j in product(range(sides), repeat=2):
            corners = []
            for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                place = [level] * 3
                place[u], place[w] = (i + di) / sides, (j + dj) / sides
                corners.append(at(*place))
            if (level == 1.0) == (axis == 1):  # u, w and the axis make a left-handed frame at 1
                corners.reverse()
            faces += [corners[:3], [corners[0], *corners[2:]]]
    return np.array(list(places)), np.array(faces)


def tube(sides, rings):
    u, w = np.divmod(np.arange(sides * (rings + 1)), rings + 1)
    a = (np.arange(sides)[:, None] * (rings + 1) + np.arange(rings)).ravel()
    b = (a + rings + 1) % len(u)
    faces = np.concatenate([np.stack([a, b, b + 1], axis=1), np.stack([a, b + 1, a + 1], axis=1)])
    angle = 2.0 * np.pi * (u + 0.5 * (w % 2)) / sides
    height = w * 2.0 * np.pi / sides
    return np.stack([np.cos(angle), np.sin(angle), height], axis=1), faces


def capless(angle, noise=0.0, count=3000):
    """A unit sphere without the cap up to an angle from its pole; noise in edge lengths."""
    i = np.arange(count) + 0.5
    polar, around = np.arccos(1.0 - 2.0 * i / count), np.pi * (1.0 + np.sqrt(5.0)) * i
    points = np.stack(
        [np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)], axis=1
    )
    faces = ConvexHull(points).simplices.astype(np.int64)
    outward = (face_normals(points, faces) * points[faces].mean(axis=1)).sum(axis=1) > 0.0
    faces[~outward] = faces[~outward][:, ::-1]
    faces = faces[(points[faces][:, :, 2] < np.cos(angle)).all(axis=1)]
    chance = np.random.default_rng(0).normal(size=(count, 1))
    return points * (1.0 + noise * edge_lengths(points, faces).mean() * chance), faces


def region_of(mesh):
    vertices, faces = mesh
    loop = max(boundary_loops(vertices, faces), key=lambda found: len(found.vertices))
    (region,) = cut_rings(vertices, faces, [loop.vertices], [loop.faces], rings=9)
    return region


@pytest.mark.parametrize("sides", [1, 2, 4, 8, 16])
def test_a_cube_is_capped_in_the_plane_of_its_missing_face(sides):
    result = inpaint(*open_cube(sides))
    (hole,) = result.holes
    assert (hole.status, hole.shape, hole.trust) == ("filled", "cut", 0.0)
    assert "capped flat" in hole.reason
    new = result.faces[result.new_faces]
    assert np.abs(result.vertices[new][:, :, 2] - 1.0).max() < 1e-6
    assert face_normals(result.vertices, new)[:, 2].min() > 0.999


def test_both_ends_of_a_tube_are_capped_alike():
    result = inpaint(*tube(32, 30))
    assert [hole.shape for hole in result.holes] == ["cut", "cut"]
    height = result.vertices[result.faces[result.new_faces]][:, :, 2]
    ends = 30 * 2.0 * np.pi / 32 * np.array([0.0, 1.0])
    assert np.abs(height[..., None] - ends).min(axis=2).max() < 1e-6
    (first, second) = (hole.new_faces for hole in result.holes)
    assert abs(first - second) < 0.1 * first


@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("degrees", [20, 45, 60, 90, 110])
def test_a_sphere_is_closed_as_a_sphere(degrees, noise):
    assert not is_cut(region_of(capless(np.radians(degrees), noise)))


def test_what_a_cut_is_does_not_depend_on_place_size_or_turn():
    q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn = 1e3 * q * np.sign(np.linalg.det(q))
    for vertices, faces in (open_cube(8), tube(32, 30), capless(np.radians(60))):
        moved = vertices @ turn.T + 1e4
        assert is_cut(region_of((moved, faces))) == is_cut(region_of((vertices, faces)))


def test_the_cap_of_a_flared_end_is_flat_too():
    vertices, faces = tube(32, 30)
    wider = 1.0 + 0.5 * np.maximum(vertices[:, 2] - 4.0, 0.0)  # to 63 degrees from the cap
    vertices = vertices * np.column_stack([wider, wider, np.ones(len(wider))])
    result = inpaint(vertices, faces)
    assert [hole.shape for hole in result.holes] == ["cut", "cut"]
    assert not any("tangents" in hole.reason for hole in result.holes)
    assert [hole.folded_edges for hole in result.holes] == [0, 0]
    new = result.vertices[result.new_vertices, 2]
    ends = np.array([vertices[:, 2].min(), vertices[:, 2].max()])
    assert np.abs(new[:, None] - ends).min(axis=1).max() < 1e-6


def test_a_tube_may_be_continued_smoothly():
    rounded = inpaint(*tube(32, 30), parameters=InpaintParameters(continuity="smooth"))
    assert [hole.shape for hole in rounded.holes] == ["hole", "hole"]
    assert rounded.vertices[:, 2].max() > 30 * 2.0 * np.pi / 32 + 0.2


@pytest.mark.parametrize("seed", [0, 1])
def test_a_smooth_tube_has_no_detail_however_its_ends_are_continued(seed):
    parameters = InpaintParameters(continuity="smooth", seed=seed)
    result = inpaint(*tube(32, 20), parameters=parameters)
    assert [hole.trust for hole in result.holes] == [0.0, 0.0]
    smooth = inpaint(
        *tube(32, 20), parameters=InpaintParameters(continuity="smooth", detail="none")
    )
    assert np.array_equal(result.vertices, smooth.vertices)


def test_each_continuity_does_what_it_says():
    vertices, faces = capless(np.radians(45))
    top = {}
    for kind in ("flat", "tangent", "smooth", "auto"):
        parameters = InpaintParameters(continuity=kind, detail="none")
        result = inpaint(vertices, faces, parameters=parameters)
        top[kind] = result.vertices[result.new_vertices]
        (hole,) = result.holes
        assert hole.shape == "hole"
        above = top[kind][:, 2].max() - vertices[np.unique(faces), 2].max()
        expected = "It is capped flat, as asked." if kind == "flat" else ""
        if above > 0.1 * hole.diameter:
            share = f"{above / hole.diameter:.2g}"
            expected = f"It leaves the bounding box of its surroundings by {share} of the hole's"
        assert hole.reason.startswith(expected)
        assert bool(hole.reason) == bool(expected)
    rim = vertices[boundary_loops(vertices, faces)[0].vertices][:, 2]
    assert rim.min() <= top["flat"][:, 2].min()
    assert top["flat"][:, 2].max() <= rim.max()
    miss = {kind: np.abs(np.linalg.norm(new, axis=1) - 1.0).max() for kind, new in top.items()}
    assert miss["smooth"] == miss["auto"] < 0.5 * miss["tangent"] < 0.2 * miss["flat"]


def test_an_unknown_continuity_is_refused():
    with pytest.raises(InvalidParameterError, match="continuity is 'curvy'"):
        InpaintParameters(continuity="curvy")  # type: ignore[arg-type]


def test_a_membrane_is_flat_in_a_flat_rim_and_least_in_area(sheet):
    points, faces = sheet(14, 14)
    middle = points[:, :2].mean(axis=0)
    unknown = np.linalg.norm(points[:, :2] - middle, axis=1) < 4.0
    bulged = points.copy()
    bulged[unknown, 2] = 1.0
    assert np.abs(membrane(bulged, faces, unknown)[:, 2]).max() < 1e-9
    points[:, 2] = 0.3 * points[:, 0] * np.sin(points[:, 1])
    spanned = membrane(points, faces, unknown, passes=20)

    def area(positions):
        a, b, c = (positions[faces[:, i]] for i in range(3))
        return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

    chance = np.random.default_rng(0)
    assert np.array_equal(spanned[~unknown], points[~unknown])
    for _ in range(20):
        shaken = spanned.copy()
        shaken[unknown] += 0.02 * chance.normal(size=(unknown.sum(), 3))
        assert area(shaken) > area(spanned)


@pytest.mark.parametrize("failing", [(None,), (None, 2)])
def test_where_no_smooth_shape_is_determined_a_simpler_one_is_taken(monkeypatch, failing):
    region = close_region(region_of(capless(np.radians(30))))

    def fails(*arguments, order):
        if order in failing:
            raise StageError
        return fair_surfaces(*arguments, order=order)

    tangent = fair_region(region, order=2)
    flat = membrane(region.vertices, region.faces, ~region.known_vertices)
    monkeypatch.setattr(stage1b_fair_harmonic, "fair_surfaces", fails)
    (result,) = fair_regions([region])
    expected = tangent.vertices if len(failing) == 1 else flat
    assert np.array_equal(result.region.vertices, expected)
    assert ("tangents" if len(failing) == 1 else "flat") in result.note
