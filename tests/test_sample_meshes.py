"""The generator of sample meshes and the files it made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pymeshlab
import pytest

from sample_meshes import generate
from sample_meshes.bodies import BODIES
from sample_meshes.details import DETAILS
from sample_meshes.holes import boundary_edges, disc, geodesic_distance, punch
from sample_meshes.shapes import make_shape
from sample_meshes.triangles import edges_of, mean_edge

FOLDER = Path(generate.__file__).parent
CHARTED = ("torus", "ring", "capsule")
WAVES = [name for name, detail in DETAILS.items() if detail.wave is not None]


def load(path):
    mesh_set = pymeshlab.MeshSet(verbose=False)
    mesh_set.load_new_mesh(str(path))
    mesh = mesh_set.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def side_counts(faces):
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(sides, axis=0, return_counts=True)[1]


def volume(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("md,md->", a, np.cross(b, c))) / 6


def assert_closed(vertices, faces):
    assert (side_counts(faces) == 2).all()
    assert len(boundary_edges(faces)) == 0  # also: neighbours are oriented alike
    assert np.array_equal(np.unique(faces), np.arange(len(vertices)))
    assert volume(vertices, faces) > 0
    mesh_set = pymeshlab.MeshSet(verbose=False)
    mesh_set.add_mesh(pymeshlab.Mesh(vertices, faces))
    assert mesh_set.get_topological_measures()["is_mesh_two_manifold"]
    mesh_set.compute_selection_by_self_intersections_per_face()
    assert mesh_set.current_mesh().selected_face_number() == 0


@pytest.mark.parametrize("triangulation", ["regular", "irregular"])
@pytest.mark.parametrize(
    ("body", "detail"),
    [
        ("torus", "scales"),
        ("ring", "rope"),
        ("capsule", "bricks"),
        ("sphere", "pebbles"),
        ("ellipsoid", "smooth"),
        ("blob", "bumps_jittered"),
    ],
)
def test_shapes_are_closed_and_of_the_asked_size(body, detail, triangulation):
    vertices, faces = make_shape(
        body, detail, count=3000, wavelength=9.0, amplitude=0.4, triangulation=triangulation
    )
    assert_closed(vertices, faces)
    genus = 1 if body in {"torus", "ring"} else 0
    assert len(vertices) - len(edges_of(faces)) + len(faces) == 2 - 2 * genus
    assert mean_edge(vertices, faces) == pytest.approx(1.0, abs=1e-12)
    assert abs(len(vertices) - 3000) < 300
    degrees = np.bincount(edges_of(faces).ravel())
    share_of_sixes = (degrees == 6).mean()
    assert share_of_sixes > 0.6 if triangulation == "regular" else share_of_sixes < 0.5


@pytest.mark.parametrize("triangulation", ["regular", "irregular"])
def test_same_seed_same_bytes(triangulation):
    def make(seed):
        return make_shape(
            "torus", "bumps_jittered", count=1500, triangulation=triangulation, seed=seed
        )

    first, second, other = make(3), make(3), make(4)
    assert first[0].tobytes() == second[0].tobytes()
    assert first[1].tobytes() == second[1].tobytes()
    assert other[0].tobytes() != first[0].tobytes()


@pytest.mark.parametrize("detail", list(DETAILS))
def test_details_have_the_asked_height_and_close_without_a_seam(detail):
    rng = np.random.default_rng(0)
    for body in CHARTED if detail in WAVES else ("torus", "blob"):
        dense = BODIES[body](2500, 0.4)
        height = DETAILS[detail].height(dense, 8.0, rng)
        assert height.shape == (len(dense.vertices),)
        assert np.isfinite(height).all()
        if detail in {"ribs", "rope", "knurl", "eggbox", "bumps", "dimples", "chevrons"}:
            a, b = edges_of(dense.faces).T
            step = np.abs(height[a] - height[b]) * (dense.fade[a] > 0)
            assert step.max() < 0.4 * np.ptp(height)


def test_waves_need_a_chart():
    with pytest.raises(ValueError, match="needs a body with a chart"):
        make_shape("sphere", "grooves", count=1000)


def test_geodesic_distance_on_a_sphere():
    vertices, faces = make_shape("sphere", "smooth", count=4000, triangulation="irregular")
    unit = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    radius = np.linalg.norm(vertices, axis=1).mean()
    true = radius * np.arccos(np.clip(unit @ unit[17], -1, 1))
    near = (true > 3) & (true < 1.5 * radius)
    error = geodesic_distance(vertices, faces, 17)[near] / true[near] - 1
    assert np.abs(error).mean() < 0.02
    assert np.abs(error).max() < 0.1


@pytest.mark.parametrize("outline", ["round", "irregular"])
@pytest.mark.parametrize("triangulation", ["regular", "irregular"])
def test_punch_leaves_one_simple_loop_and_the_truth(triangulation, outline):
    vertices, faces = make_shape("torus", "scales", count=4000, triangulation=triangulation)
    for seed in range(4):
        cut = punch(vertices, faces, 500 * seed, 7.0, outline=outline, seed=seed)
        assert np.array_equal(cut.vertices, vertices[cut.vertex_ids])
        kept = np.setdiff1d(np.arange(len(faces)), cut.removed_faces)
        assert np.array_equal(cut.vertex_ids[cut.faces], faces[kept])
        assert (faces[cut.removed_faces] == 500 * seed).any()
        assert len(generate.loop_sizes(cut.faces)) == 1
        starts = boundary_edges(cut.faces)[:, 0]
        assert len(np.unique(starts)) == len(starts)
        removed = faces[cut.removed_faces]
        inner = len(np.unique(removed))
        assert inner - len(edges_of(removed)) + len(removed) == 1


def test_discs_have_the_asked_radius():
    vertices, faces = make_shape("sphere", "smooth", count=6000)
    radius = np.linalg.norm(vertices, axis=1).mean()
    for outline, least, most in (("round", 0.93, 1.07), ("irregular", 0.6, 1.4)):
        mask = disc(vertices, faces, np.array([0.0, 0.0, 100.0]), 8.0, outline=outline, seed=1)
        rim = vertices[boundary_edges(faces[mask])[:, 0]]
        top = vertices[np.linalg.norm(vertices - [0, 0, 100.0], axis=1).argmin()]
        cosine = rim @ top / np.linalg.norm(rim, axis=1) / np.linalg.norm(top)
        reach = radius * np.arccos(cosine) / 8.0
        assert reach.min() > least
        assert reach.max() < most
    assert reach.max() > 1.2
    assert reach.min() < 0.8


def test_a_disc_that_meets_itself_is_refused():
    vertices, faces = make_shape("torus", "smooth", count=2000)
    with pytest.raises(ValueError, match="choose a smaller radius"):
        disc(vertices, faces, 0, 40.0)


def test_generator_repeats_itself_byte_for_byte(tmp_path, monkeypatch, capsys):
    small = replace(generate.SAMPLES[-1], count=1500, holes=(generate.Hole((1, 0, 0), 5.0),))
    monkeypatch.setattr(generate, "SAMPLES", (small,))
    for folder in ("first", "second"):
        generate.main([str(tmp_path / folder)])
    names = sorted(path.name for path in (tmp_path / "first").iterdir())
    assert names == ["README.md", f"{small.name}.ply", f"{small.name}_holes.ply"]
    for name in names:
        first, second = (tmp_path / folder / name for folder in ("first", "second"))
        assert first.read_bytes() == second.read_bytes()
    assert small.name in capsys.readouterr().out


@pytest.mark.parametrize("sample", generate.SAMPLES, ids=lambda sample: sample.name)
def test_tracked_samples_are_pairs(sample):
    vertices, faces = load(FOLDER / f"{sample.name}.ply")
    damaged, kept = load(FOLDER / f"{sample.name}_holes.ply")
    assert_closed(vertices, faces)
    assert 6000 <= len(vertices) <= 10000
    assert len(generate.loop_sizes(kept)) == len(sample.holes)
    whole = {corners.tobytes() for corners in vertices[faces]}
    assert all(corners.tobytes() in whole for corners in damaged[kept])
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    rows = (
        generate.table_row(sample, False, vertices, faces),
        generate.table_row(sample, True, damaged, kept),
    )
    assert all(row in readme for row in rows)


def test_tracked_samples_are_small():
    assert sum(path.stat().st_size for path in FOLDER.glob("*.ply")) < 6_000_000
