"""The smooth base: a low-pass that knows nothing of the triangulation or of where the mesh lies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meshlab_lowrank.mesh.energies import harmonic_energy
from meshlab_lowrank.mesh.geometry import vertex_normals
from meshlab_lowrank.mesh.sampling import spread_points
from meshlab_lowrank.stages.stage1e_base_low_pass import (
    _coarsely_smoothed,
    smooth_base,
)
from sample_meshes.shapes import make_shape


@pytest.fixture(scope="module")
def flat(sheet):
    """Sheet of 50 x 50 with a hole of radius 7 in the middle: vertices, faces, known."""
    vertices, faces = sheet(58, 50)
    vertices -= vertices.mean(axis=0)
    return vertices, faces, np.hypot(*vertices[:, :2].T) > 7.0


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def raised(vertices, height):
    return np.column_stack([vertices[:, :2], height(*vertices[:, :2].T)])


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("cutoff", [6.0, 12.0, 20.0])
def test_a_plane_stays_a_plane(flat, cutoff):
    vertices, faces, known = flat
    turn = rotation(3)
    base = smooth_base(vertices @ turn.T + 5.0, faces, known, cutoff=cutoff)
    assert np.abs(((base - 5.0) @ turn)[:, 2]).max() < 1e-5


@pytest.mark.parametrize("bend", [(0.004, 0.004), (0.004, -0.004), (0.004, 0.0)])
def test_a_bent_surface_is_continued_into_the_hole(flat, bend):
    vertices, faces, known = flat
    truth = raised(vertices, lambda x, y: bend[0] * x**2 + bend[1] * y**2)
    start = truth.copy()
    start[~known, 2] = 1.0
    base = smooth_base(start, faces, known, cutoff=14.0)
    error = np.abs(base[:, 2] - truth[:, 2])
    inner = np.hypot(*vertices[:, :2].T) < 18.0
    assert error[~known].max() < 0.2 * np.ptp(truth[~known, 2])
    assert error[inner].max() < 0.05 * np.ptp(truth[inner, 2])


def test_what_lies_in_the_hole_counts_for_little(flat):
    vertices, faces, known = flat
    bumpy = raised(vertices, lambda x, y: np.where(np.hypot(x, y) < 7.0, np.cos(x), 0.0))
    base = smooth_base(bumpy, faces, known, cutoff=16.0)
    assert np.abs(base[:, 2]).max() < 0.1


def test_short_waves_go_and_long_waves_stay(sheet):
    vertices, faces = sheet(70, 60)
    cutoff = 12.0
    pull = np.ones(len(vertices))
    inner = np.abs(vertices[:, 0] - 30.0) < 20.0
    inner &= np.abs(vertices[:, 1] - 30.0) < 20.0
    for wavelength, least, most in [(cutoff / 3, 0.0, 0.1), (5 * cutoff, 0.9, 1.1)]:
        wave = 0.3 * np.sin(2 * np.pi * vertices[:, 0] / wavelength)
        base = smooth_base(np.column_stack([vertices[:, :2], wave]), faces, pull, cutoff=cutoff)
        kept = rms(base[inner, 2]) / rms(wave[inner])
        assert least <= kept <= most


def test_it_moves_with_the_mesh():
    vertices, faces = make_shape("torus", "bumps", count=2000, seed=1)
    known = np.linalg.norm(vertices - vertices[700], axis=1) > 5.0
    turn = rotation(5)
    expected = smooth_base(vertices, faces, known, cutoff=14.0) @ turn.T + [3.0, -8.0, 1.0]
    moved = smooth_base(vertices @ turn.T + [3.0, -8.0, 1.0], faces, known, cutoff=14.0)
    np.testing.assert_allclose(moved, expected, atol=1e-5)


def test_it_scales_with_the_mesh_and_its_cutoff():
    vertices, faces = make_shape("torus", "bumps", count=2000, seed=1)
    pull = np.ones(len(vertices))
    expected = 1024.0 * smooth_base(vertices, faces, pull, cutoff=14.0)
    scaled = smooth_base(1024.0 * vertices, faces, pull, cutoff=14.0 * 1024.0)
    np.testing.assert_allclose(scaled, expected, atol=1e-2)


def test_detail_goes_and_the_body_stays():
    body, faces = make_shape("torus", "smooth", count=4000)
    around = np.hypot(body[:, 0], body[:, 1])
    middle = 0.5 * (around.max() + around.min())
    turn, tube = np.arctan2(body[:, 1], body[:, 0]), np.arctan2(body[:, 2], around - middle)
    waves = np.rint(2.0 * np.pi * middle / 6.0), np.rint(np.pi * np.ptp(around) / 6.0)
    height = 0.5 * np.cos(waves[0] * turn) * np.cos(waves[1] * tube)
    detailed = body + height[:, None] * vertex_normals(body, faces)
    everywhere = np.ones(len(body))
    expected = smooth_base(body, faces, everywhere, cutoff=12.0)
    base = smooth_base(detailed, faces, everywhere, cutoff=12.0)
    assert rms(expected - body) < 0.05 * np.ptp(around)
    along = np.einsum("ij,ij->i", base - expected, vertex_normals(body, faces))
    assert rms(along) < 0.2 * rms(height)


@pytest.mark.parametrize(("rows", "columns"), [(3, 3), (4, 5), (7, 7)])
def test_tiny_meshes_have_a_base(sheet, rows, columns):
    vertices, faces = sheet(rows, columns)
    base = smooth_base(vertices, faces, np.ones(len(vertices)), cutoff=12.0)
    assert base.shape == vertices.shape
    assert np.isfinite(base).all()
    np.testing.assert_allclose(base[:, 2], 0.0, atol=1e-9)


def test_linear_functions_have_no_energy(sheet):
    vertices, faces = sheet(20, 20)
    energy = harmonic_energy(vertices, faces, 3)
    for function in (np.ones(len(vertices)), vertices[:, 0], vertices[:, 1]):
        np.testing.assert_allclose(energy @ function, 0.0, atol=1e-9)


def test_the_energy_is_symmetric_and_never_negative(sheet):
    vertices, faces = sheet(12, 12)
    energy = harmonic_energy(vertices, faces, 3).toarray()
    np.testing.assert_allclose(energy, energy.T, atol=1e-12 * np.abs(energy).max())
    assert np.linalg.eigvalsh(energy)[0] > -1e-10 * np.abs(energy).max()


def test_the_energy_is_the_integral_of_the_squared_gradient_of_the_laplacian(sheet):
    vertices, faces = sheet(81, 70, jitter=0.0)
    x, y = vertices[:, 0], vertices[:, 1]
    k = 2.0 * np.pi / 20.0
    window = np.exp(-((x - x.mean()) ** 2 + (y - y.mean()) ** 2) / 100.0)
    energy = harmonic_energy(vertices, faces, 3)

    def exact(wave):  # by Fourier transform on a square grid
        axis = np.arange(-60.0, 60.0, 0.5)
        u, v = np.meshgrid(axis, axis, indexing="ij")
        f = np.exp(-(u**2 + v**2) / 100.0) * np.cos(wave * u)
        q = 2.0 * np.pi * np.fft.fftfreq(len(axis), 0.5)
        squared = q[:, None] ** 2 + q**2
        return float((squared**3 * np.abs(np.fft.fft2(f)) ** 2).mean() * 0.25)

    for wave in (0.0, k):
        f = window * np.cos(wave * (x - x.mean()))
        assert f @ energy @ f == pytest.approx(exact(wave), rel=0.2)


@pytest.mark.parametrize("distance", [0.5, 1.5, 4.0, 100.0])
def test_spread_points_are_apart_and_leave_no_gap(sheet, distance):
    points, _ = sheet(25, 25, jitter=0.2)
    chosen = spread_points(points, distance)
    assert (np.diff(chosen) > 0).all()
    if len(chosen) > 1:
        assert cKDTree(points[chosen]).query(points[chosen], k=2)[0][:, 1].min() > distance
    assert cKDTree(points[chosen]).query(points)[0].max() <= distance


@pytest.mark.parametrize("time", [0.3, 1.0])
def test_the_first_smoothing_keeps_a_curved_body(time):
    # Coordinates are eigenfunctions of the sphere's Laplacian with eigenvalue 2 / r^2, so D
    # scales it by d = 1 / (1 + 2 time / r^2), and 3 d^2 - 2 d^3 = 1 - 3 (1 - d)^2 + ...
    vertices, faces = make_shape("sphere", "smooth", count=3000)
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True) * 4.0
    smoothed = _coarsely_smoothed(vertices, faces, time)
    d = 1.0 / (1.0 + 2.0 * time / 16.0)
    shrunk = np.linalg.norm(smoothed, axis=1).mean() / 4.0
    assert shrunk == pytest.approx(3.0 * d**2 - 2.0 * d**3, abs=0.25 * (1.0 - d) ** 2 + 1e-4)
    assert 1.0 - shrunk < 0.5 * (1.0 - d)
