"""Attributes run on into the fill, and those of known elements stay exactly as they were."""

import struct
import zlib

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.attributes import harmonic_extension
from meshlab_lowrank.filters import breeding, growing

LINEAR = np.array([[0.3, -0.2, 0.1], [0.05, 0.4, 0.2], [-0.1, 0.15, 0.35], [0.2, 0.2, 0.2]])


def disc(n=24):
    """An irregular triangulation of a square, and which vertices are on its border."""
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    i = (x[:-1, :-1] * n + y[:-1, :-1]).ravel()
    faces = np.concatenate([np.stack([i, i + n, i + n + 1], 1), np.stack([i, i + n + 1, i + 1], 1)])
    border = ((points[:, :2] == 0) | (points[:, :2] == n - 1)).any(axis=1)
    chance = np.random.default_rng(1).uniform(-0.2, 0.2, (n * n, 2))
    points[~border, :2] += chance[~border]
    return points, faces, border


def test_a_linear_field_in_the_plane_is_its_own_extension():
    points, faces, known = disc()
    values = points @ LINEAR.T
    given = np.where(known[:, None], values, np.nan)
    extended = harmonic_extension(points, faces, known, given)
    assert np.array_equal(extended[known], values[known])
    assert np.abs(extended - values).max() < 1e-2 * np.ptp(values)


def test_extensions_stay_within_the_known_values_on_slivers():
    points, faces, known = disc()
    points[:, 1] *= 1e-4
    values = np.random.default_rng(2).random((len(points), 3))
    extended = harmonic_extension(points, faces, known, values)
    low, high = values[known].min(axis=0), values[known].max(axis=0)
    assert (extended >= low - 1e-9).all()
    assert (extended <= high + 1e-9).all()


def test_a_constant_is_extended_as_itself():
    points, faces, known = disc()
    extended = harmonic_extension(points, faces, known, np.full((len(points), 1), 0.7))
    assert np.abs(extended - 0.7).max() < 1e-12


def test_vertices_out_of_reach_are_refused():
    points = np.random.default_rng(0).random((6, 3))
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    known = np.arange(6) < 2
    with pytest.raises(meshlab_lowrank.InvalidMeshError, match="3 vertices"):
        harmonic_extension(points, faces, known, np.zeros((6, 1)))


@pytest.fixture
def dressed(holed_sphere):
    """A MeshSet with the holed sphere and every attribute that MeshLab can carry but textures."""
    vertices, faces = holed_sphere
    ms = pymeshlab.MeshSet()
    smooth = 0.5 + 0.25 * vertices @ LINEAR.T  # in 0..1
    ms.add_mesh(
        pymeshlab.Mesh(
            vertices,
            faces,
            v_scalar_array=smooth[:, 0],
            v_color_matrix=smooth,
            v_tex_coords_matrix=smooth[:, :2],
            f_scalar_array=smooth[faces].mean(axis=1)[:, 0],
            f_color_matrix=smooth[faces].mean(axis=1),
        )
    )
    mesh = ms.current_mesh()
    mesh.add_vertex_custom_scalar_attribute(smooth[:, 1], "Roughness")
    mesh.add_vertex_custom_point_attribute(1e3 * smooth[:, :3] - 7.0, "flow")
    mesh.add_face_custom_scalar_attribute(smooth[faces].mean(axis=1)[:, 2], "face_age")
    mesh.add_face_custom_point_attribute(-smooth[faces].mean(axis=1)[:, :3], "axis")
    return ms


def everything(mesh):
    return {
        "quality": mesh.vertex_scalar_array(),
        "colour": mesh.vertex_color_matrix(),
        "texture": mesh.vertex_tex_coord_matrix(),
        "roughness": mesh.vertex_custom_scalar_attribute_array("Roughness"),
        "flow": mesh.vertex_custom_point_attribute_matrix("flow"),
        "face quality": mesh.face_scalar_array(),
        "face colour": mesh.face_color_matrix(),
        "face age": mesh.face_custom_scalar_attribute_array("face_age"),
        "axis": mesh.face_custom_point_attribute_matrix("axis"),
    }


def test_attributes_of_known_elements_are_untouched_and_run_on(dressed):
    mesh = dressed.current_mesh()
    before = everything(mesh)
    n, m = mesh.vertex_number(), mesh.face_number()
    dressed.meshing_inpaint_lowrank(detail="none")
    after = everything(mesh)
    for name, values in before.items():
        assert np.array_equal(after[name][: len(values)], values), name
    new, faces = mesh.vertex_matrix()[n:], mesh.face_matrix()[m:]
    truth = 0.5 + 0.25 * new @ LINEAR.T
    face_truth = (0.5 + 0.25 * mesh.vertex_matrix() @ LINEAR.T)[faces].mean(axis=1)
    assert len(new) > 50
    near = {"atol": 0.02}  # the fields are linear in space, and the fill is not quite flat
    np.testing.assert_allclose(after["quality"][n:], truth[:, 0], **near)
    np.testing.assert_allclose(after["colour"][n:], truth, **near)
    np.testing.assert_allclose(after["texture"][n:], truth[:, :2], **near)
    np.testing.assert_allclose(after["roughness"][n:], truth[:, 1], **near)
    np.testing.assert_allclose((after["flow"][n:] + 7.0) / 1e3, truth[:, :3], **near)
    np.testing.assert_allclose(after["face quality"][m:], face_truth[:, 0], **near)
    np.testing.assert_allclose(after["face colour"][m:], face_truth, **near)
    np.testing.assert_allclose(after["face age"][m:], face_truth[:, 2], **near)
    np.testing.assert_allclose(-after["axis"][m:], face_truth[:, :3], **near)


def test_both_ways_of_breeding_faces_give_the_same_mesh(holed_sphere, monkeypatch):
    vertices, faces = holed_sphere
    smooth = 0.5 + 0.25 * vertices @ LINEAR.T
    found = []
    for tearing in (True, False):
        asked = []

        def can_tear(mesh, tearing=tearing, asked=asked):
            asked.append(breeding.can_tear(mesh))
            return tearing

        monkeypatch.setattr(growing, "can_tear", can_tear)
        ms = pymeshlab.MeshSet()
        ms.add_mesh(
            pymeshlab.Mesh(
                vertices,
                faces,
                v_scalar_array=smooth[:, 0],
                v_color_matrix=smooth,
                f_color_matrix=smooth[faces].mean(axis=1),
            )
        )
        mesh = ms.current_mesh()
        mesh.add_vertex_custom_scalar_attribute(smooth[:, 1], "Roughness")
        mesh.add_vertex_custom_point_attribute(smooth[:, :3], "flow")
        mesh.add_face_custom_scalar_attribute(smooth[faces].mean(axis=1)[:, 2], "face_age")
        ms.compute_selection_by_condition_per_face(condselect="fi < 9")
        ms.meshing_inpaint_lowrank(detail="none")
        assert asked == [True]
        found.append(
            {
                "vertices": mesh.vertex_matrix(),
                "faces": mesh.face_matrix(),
                "selected vertices": mesh.vertex_selection_array(),
                "selected faces": mesh.face_selection_array(),
                "quality": mesh.vertex_scalar_array(),
                "colour": mesh.vertex_color_matrix(),
                "roughness": mesh.vertex_custom_scalar_attribute_array("Roughness"),
                "flow": mesh.vertex_custom_point_attribute_matrix("flow"),
                "face colour": mesh.face_color_matrix(),
                "face age": mesh.face_custom_scalar_attribute_array("face_age"),
                "trust": mesh.vertex_custom_scalar_attribute_array("inpaint_trust"),
                "inpainted": mesh.face_custom_scalar_attribute_array("inpainted"),
            }
        )
        n = len(vertices)
        assert np.array_equal(found[-1]["quality"][:n], smooth[:, 0])
        assert np.array_equal(found[-1]["roughness"][:n], smooth[:, 1])
    for name, values in found[0].items():
        assert np.array_equal(values, found[1][name]), name


def test_nothing_is_torn_that_would_lose_attributes(holed_sphere):
    vertices, faces = holed_sphere
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    ms.compute_curvature_principal_directions_per_vertex()
    mesh = ms.current_mesh()
    directions = mesh.vertex_curvature_principal_dir1_matrix()
    assert not breeding.can_tear(mesh)
    ms.meshing_inpaint_lowrank(detail="none")
    after = mesh.vertex_curvature_principal_dir1_matrix()
    assert np.array_equal(after[: len(directions)], directions)


@pytest.mark.usefixtures("fans")
def test_no_attribute_is_switched_on():
    ms = pymeshlab.MeshSet()
    ms.create_sphere()
    ms.compute_selection_by_condition_per_face(condselect="fi < 7")
    ms.meshing_remove_selected_faces()
    mesh = ms.current_mesh()
    out = ms.meshing_inpaint_lowrank(showtrust="none")
    assert out["new_faces"] > 0
    assert not mesh.has_vertex_color()
    assert not mesh.has_vertex_scalar()
    assert not mesh.has_vertex_tex_coord()
    assert not mesh.has_face_color()
    assert not mesh.has_face_scalar()
    assert not mesh.has_wedge_tex_coord()
    names = ("vs__inpainted", "vs__inpaint_trust", "vs__inpaint_error", "fs__inpainted")
    marks = {f"__ca_{name}" for name in names}
    assert set(ms.filter_parameter_values("ply")) == {"binary"} | marks


@pytest.mark.usefixtures("fans")
def test_trust_is_on_the_new_vertices(holed_set):
    ms = holed_set()
    ms.meshing_inpaint_lowrank()
    trust = ms.current_mesh().vertex_custom_scalar_attribute_array("inpaint_trust")
    assert np.array_equal(trust, [1.0] * (len(trust) - 2) + [0.25] * 2)


@pytest.mark.usefixtures("fans")
def test_qualities_that_are_not_numbers_stay_and_do_not_spread(holed_sphere):
    vertices, faces = holed_sphere
    quality = np.full(len(vertices), np.nan)
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(vertices, faces, v_scalar_array=quality))
    ms.meshing_inpaint_lowrank()
    after = ms.current_mesh().vertex_scalar_array()
    assert np.isnan(after[: len(vertices)]).all()
    assert np.isfinite(after[len(vertices) :]).all()


def write_png(path, colour):
    rows = b"".join(b"\0" + bytes(colour) * 4 for _ in range(4))
    parts = [
        (b"IHDR", struct.pack(">IIBBBBB", 4, 4, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    ]
    data = b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in parts
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + data)


@pytest.fixture
def textured(tmp_path):
    """A sheet whose left half has texture a and right half texture b, with three holes.

    The first hole lies in the left half, the second in the right one, the third between them.
    Texture coordinates are the positions over 24.
    """
    n = 24
    points, faces, _ = disc(n)
    middle = points[faces].mean(axis=1)
    centres = np.array([[5.0, 12.0, 0.0], [18.0, 12.0, 0.0], [11.4, 5.0, 0.0]])
    faces = faces[(np.linalg.norm(middle[:, None] - centres, axis=2) > 2.2).all(axis=1)]
    left = points[faces].mean(axis=1)[:, 0] < 11.5
    write_png(tmp_path / "a.png", (255, 0, 0))
    write_png(tmp_path / "b.png", (0, 255, 0))
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n")
    lines = ["mtllib m.mtl"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"vt {x / n!r} {y / n!r}" for x, y, _ in points.tolist()] + ["vt 0 0"]
    for name, half in (("a", left), ("b", ~left)):
        lines.append(f"usemtl {name}")
        lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in (faces[half] + 1).tolist()]
    (tmp_path / "sheet.obj").write_text("\n".join(lines) + "\n")
    ms = pymeshlab.MeshSet()
    ms.load_new_mesh(str(tmp_path / "sheet.obj"))
    return ms


def texture_of_faces(ms):
    mesh = ms.current_mesh()
    result = np.full(mesh.face_number(), -1)
    for texture in range(mesh.texture_number()):
        ms.compute_selection_by_condition_per_face(condselect=f"ti == {texture}")
        result[mesh.face_selection_array()] = texture
    return result


def test_textures_run_on_where_the_rim_lies_in_one_chart(textured):
    mesh = textured.current_mesh()
    faces, wedges = mesh.face_matrix(), mesh.wedge_tex_coord_matrix()
    known = texture_of_faces(textured)
    out = textured.meshing_inpaint_lowrank(detail="none")
    m = len(faces)
    assert out["closed_holes"] == 3
    assert mesh.texture_number() == 2
    assert set(mesh.textures()) == {"a.png", "b.png"}
    assert np.array_equal(mesh.wedge_tex_coord_matrix()[: 3 * m], wedges)
    assert np.array_equal(mesh.face_matrix()[:m], faces)
    textures = texture_of_faces(textured)
    assert np.array_equal(textures[:m], known)

    corners = mesh.vertex_matrix()[mesh.face_matrix()[m:]]
    middle = corners.mean(axis=1)
    found = mesh.wedge_tex_coord_matrix()[3 * m :].reshape(-1, 3, 2)
    hole = np.where(middle[:, 1] < 8, 2, np.where(middle[:, 0] < 11.5, 0, 1))
    assert (textures[m:][hole == 0] == 0).all()
    assert (textures[m:][hole == 1] == 1).all()
    np.testing.assert_allclose(found[hole < 2], corners[hole < 2][..., :2] / 24, atol=2e-3)
    between = found[hole == 2].reshape(-1, 2)
    assert (between == between[0]).all()  # one texel
    assert out["untextured_faces"] == (hole == 2).sum() > 0


def test_texture_coordinates_of_wedges_keep_their_seams(textured):
    """A vertex with other coordinates in each face keeps them all."""
    mesh = textured.current_mesh()
    chance = np.random.default_rng(4).random((3 * mesh.face_number(), 2))
    sheet = pymeshlab.Mesh(mesh.vertex_matrix(), mesh.face_matrix(), w_tex_coords_matrix=chance)
    ms = pymeshlab.MeshSet()
    ms.add_mesh(sheet)
    wedges = ms.current_mesh().wedge_tex_coord_matrix()
    out = ms.meshing_inpaint_lowrank(detail="none")
    assert out["untextured_faces"] == out["new_faces"] > 0
    assert np.array_equal(ms.current_mesh().wedge_tex_coord_matrix()[: len(wedges)], wedges)
    assert np.isfinite(ms.current_mesh().vertex_tex_coord_matrix()).all()
    assert np.abs(ms.current_mesh().vertex_tex_coord_matrix()).max() <= 1
