"""The filters change the current mesh in place and leave all else as it was, to the last bit."""

import importlib
import signal
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.errors import StageError
from meshlab_lowrank.filling import Filler
from meshlab_lowrank.filters import placing
from meshlab_lowrank.filters.breeding import Growth
from meshlab_lowrank.filters.growing import coincident, grow
from meshlab_lowrank.filters.placing import Aside, place
from meshlab_lowrank.filters.reading import CustomAttributes, compact_copy, mesh_arrays
from meshlab_lowrank.filters.undoing import Undo


def same_bits(a, b):
    return np.ascontiguousarray(a).tobytes() == np.ascontiguousarray(b).tobytes()


def test_known_vertices_and_faces_keep_row_and_bits(holed_set, fans):
    ms = holed_set()
    mesh = ms.current_mesh()
    vertices, faces = mesh_arrays(mesh)
    out = ms.meshing_inpaint_lowrank()
    n, m = len(vertices), len(faces)
    assert same_bits(mesh.vertex_matrix()[:n], vertices)
    assert np.array_equal(mesh.face_matrix()[:m], faces)
    expected = fans(vertices, faces)
    assert same_bits(mesh.vertex_matrix(), expected.vertices)
    assert np.array_equal(mesh.face_matrix(), expected.faces)
    assert out["new_faces"] == mesh.face_number() - m > 50
    assert out["new_vertices"] == mesh.vertex_number() - n == out["closed_holes"] == 2


@pytest.mark.usefixtures("fans")
def test_the_users_reference_to_the_mesh_stays_good(holed_set):
    ms = holed_set()
    mesh = ms.current_mesh()
    number = mesh.face_number()
    ms.meshing_inpaint_lowrank()
    assert mesh.id() == ms.current_mesh_id() == 0
    assert mesh.face_number() > number
    assert mesh.label() == "sphere"
    assert mesh.is_compact()


@pytest.mark.usefixtures("fans")
def test_other_layers_transform_and_visibility_stay(holed_set):
    ms = holed_set()
    ms.create_cube()
    ms.create_torus()
    cube = ms.mesh(1).vertex_matrix()
    ms.set_current_mesh(0)
    ms.set_current_mesh_visibility(False)
    turn = np.array([[0, -2.0, 0, 5], [2, 0, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])
    ms.set_matrix(transformmatrix=turn, freeze=False)
    vertices = ms.current_mesh().vertex_matrix()
    ms.meshing_inpaint_lowrank()
    assert ms.current_mesh_id() == 0
    assert ms.mesh_number() == 3
    assert not ms.current_mesh().is_visible()
    assert ms.mesh(1).is_visible()
    assert np.array_equal(ms.current_mesh().transform_matrix(), turn)
    assert same_bits(ms.current_mesh().vertex_matrix()[: len(vertices)], vertices)
    assert np.array_equal(ms.mesh(1).vertex_matrix(), cube)
    assert [ms.mesh(i).label() for i in range(3)] == ["sphere", "Box/Cube", "Torus"]


@pytest.mark.usefixtures("fans")
def test_signs_of_zero_and_tiny_and_huge_coordinates_survive(holed_sphere):
    vertices, faces = holed_sphere
    loose = np.array([[-0.0, 0.0, 5e-324], [1e-300, -0.0, -1.0], [0.1, -1e8, 2.0 / 3.0]])
    vertices = np.concatenate([vertices, loose])
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    ms.meshing_inpaint_lowrank()
    assert same_bits(ms.current_mesh().vertex_matrix()[: len(vertices)], vertices)


@pytest.mark.usefixtures("fans")
def test_coincident_and_unreferenced_vertices_stay_apart(holed_sphere):
    vertices, faces = holed_sphere
    vertices = np.concatenate([vertices, vertices[:7], vertices[:7]])
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(vertices, faces))
    ms.meshing_inpaint_lowrank()
    assert ms.current_mesh().vertex_number() == len(vertices) + 2
    assert same_bits(ms.current_mesh().vertex_matrix()[: len(vertices)], vertices)


@pytest.mark.usefixtures("fans")
def test_a_hole_of_three_edges_beside_few_faces():
    ms = pymeshlab.MeshSet()
    ms.create_tetrahedron()
    vertices, faces = mesh_arrays(ms.current_mesh())
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(vertices, faces[1:]))
    ms.meshing_inpaint_lowrank()
    assert ms.current_mesh().face_number() == 6
    assert ms.get_topological_measures()["is_mesh_two_manifold"]
    assert ms.get_hole_measures()["id"] == []


@pytest.mark.parametrize("rows", [1, 40])
def test_growing_gives_any_connectivity(rows):
    """A flat strip of 3 by ``rows`` squares is appended to one triangle beside it."""
    i, j = np.meshgrid(np.arange(rows), np.arange(3), indexing="ij")
    a = (1 + 4 * i + j).ravel()
    strip = np.concatenate([np.column_stack([a, a + 1, a + 5]), np.column_stack([a, a + 5, a + 4])])
    faces = np.array([[0, 1, 2]])
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(np.eye(3), faces))
    count = int(strip.max()) + 1
    nothing = np.zeros(0, dtype=np.int64)
    grown = grow(ms, Growth(strip, count - 3, nothing, nothing), Undo(ms, CustomAttributes()))
    assert np.array_equal(grown.order, np.arange(len(strip)))
    assert same_bits(grown.positions, np.eye(3))
    assert ms.current_mesh().vertex_number() == count
    assert np.array_equal(ms.current_mesh().face_matrix(), np.concatenate([faces, strip]))


@pytest.fixture
def quads():
    """A sheet of squares with a hole in it: vertices, and corners of each square."""
    side = 8
    corner = np.arange(side * side).reshape(side, side)
    points = np.array([[x, y, 0.01 * x * y] for x in range(side) for y in range(side)])
    squares = [
        np.array([corner[x, y], corner[x + 1, y], corner[x + 1, y + 1], corner[x, y + 1]], "u4")
        for x in range(side - 1)
        for y in range(side - 1)
        if not (2 <= x <= 4 and 2 <= y <= 4)
    ]
    return points, squares


@pytest.mark.usefixtures("fans")
@pytest.mark.parametrize("split", [True, False])
def test_polygons_become_triangles_and_can_be_saved(quads, tmp_path, split):
    points, squares = quads
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    lines += ["f " + " ".join(str(corner + 1) for corner in square) for square in squares]
    (tmp_path / "in.obj").write_text("\n".join(lines))
    ms = pymeshlab.MeshSet()
    ms.load_new_mesh(str(tmp_path / "in.obj"))
    faces = ms.current_mesh().face_matrix()
    assert len(faces) == 2 * len(ms.current_mesh().polygonal_face_list())
    if split:
        ms.compute_scalar_by_function_per_face(q="1")
    ms.meshing_inpaint_lowrank()
    filled = ms.current_mesh().face_matrix()
    assert np.array_equal(filled[: len(faces)], faces)
    assert len(filled) > len(faces)
    for suffix in ("obj", "off", "ply"):
        ms.save_current_mesh(str(tmp_path / f"out.{suffix}"))
        again = pymeshlab.MeshSet()
        again.load_new_mesh(str(tmp_path / f"out.{suffix}"))
        assert np.array_equal(again.current_mesh().face_matrix(), filled)


def test_meshes_made_from_lists_of_polygons_are_refused(quads):
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(*quads))
    with pytest.raises(pymeshlab.PyMeshLabException, match="save it to a file and load that"):
        ms.meshing_inpaint_lowrank()


def test_placing_over_any_positions_is_exact():
    chance = np.random.default_rng(3)
    ms = pymeshlab.MeshSet()
    ms.create_sphere(subdiv=2)
    n = ms.current_mesh().vertex_number()
    for scale in (1e-200, 1.0, 1e200):
        target = chance.normal(size=(n, 3)) * scale
        place(ms, target)
        assert same_bits(ms.current_mesh().vertex_matrix(), target)
    assert ms.mesh_number() == 1


def test_moving_the_selection_changes_nothing_else(holed_set):
    ms = holed_set()
    ms.meshing_close_holes(maxholesize=100, selected=False, newfaceselected=True)
    ms.meshing_surface_subdivision_midpoint(
        iterations=2, threshold=pymeshlab.PureValue(0), selected=True
    )
    mesh = ms.current_mesh()
    vertices, faces = mesh_arrays(mesh)
    chosen = mesh.face_selection_array()
    out = ms.apply_coord_inpaint_lowrank(detail="none")
    inside = np.zeros(len(vertices), dtype=bool)
    inside[faces[chosen]] = True
    inside[faces[~chosen]] = False
    moved = (mesh.vertex_matrix() != vertices).any(axis=1)
    assert same_bits(mesh.vertex_matrix()[~inside], vertices[~inside])
    assert out["moved_vertices"] == inside.sum() >= moved.sum() > 0
    assert np.array_equal(mesh.face_matrix(), faces)
    assert np.array_equal(mesh.face_selection_array(), chosen)
    assert len(out["holes"]) == out["closed_holes"] == 2
    assert mesh.id() == ms.current_mesh_id() == 0


def test_measuring_changes_nothing(holed_set):
    ms = holed_set()
    ms.compute_selection_by_condition_per_face(condselect="fi < 5")
    mesh = ms.current_mesh()
    before = mesh.vertex_matrix(), mesh.face_matrix(), mesh.vertex_normal_matrix()
    table = ms.get_hole_measures()
    assert sorted(table["boundary_edges"]) == sorted(
        meshlab_lowrank.measure_holes(*mesh_arrays(mesh))["boundary_edges"]
    )
    assert len({len(column) for column in table.values()}) == 1
    after = mesh.vertex_matrix(), mesh.face_matrix(), mesh.vertex_normal_matrix()
    assert all(map(same_bits, before, after))
    assert mesh.selected_face_number() == 5


def test_a_compact_copy_is_the_same_mesh(holed_set):
    ms = holed_set()
    mesh = ms.current_mesh()
    scratch = compact_copy(mesh)
    assert same_bits(scratch.current_mesh().vertex_matrix(), mesh.vertex_matrix())
    assert np.array_equal(scratch.current_mesh().face_matrix(), mesh.face_matrix())


@pytest.mark.usefixtures("fans")
def test_an_interrupt_waits_until_the_mesh_is_whole(holed_set, monkeypatch):
    module = importlib.import_module("meshlab_lowrank.filters.meshing_inpaint_lowrank")

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        return grow(*arguments)

    monkeypatch.setattr(module, "grow", interrupted)
    ms = holed_set()
    with pytest.raises(KeyboardInterrupt):
        ms.meshing_inpaint_lowrank()
    assert ms.get_hole_measures()["id"] == []
    assert ms.mesh_number() == 1
    with pytest.raises(KeyboardInterrupt):  # as before
        signal.raise_signal(signal.SIGINT)


@pytest.mark.usefixtures("fans")
def test_works_in_a_thread(holed_set):
    ms = holed_set()
    with ThreadPoolExecutor(1) as executor:
        out = executor.submit(ms.meshing_inpaint_lowrank).result()
    assert out["closed_holes"] == 2
    assert ms.get_hole_measures()["id"] == []


@pytest.mark.usefixtures("fans")
def test_a_fill_that_is_not_found_again_is_reported(holed_set, monkeypatch):
    module = importlib.import_module("meshlab_lowrank.filters.meshing_inpaint_lowrank")

    def careless(writer, *_, **__):
        writer._ms.compute_coord_by_function(x="x + 1", y="y", z="z", onselected=False)

    monkeypatch.setattr(module.AttributeWriter, "write", careless)
    with pytest.raises(meshlab_lowrank.LowrankError, match="load the mesh again"):
        holed_set().meshing_inpaint_lowrank()


def test_moving_what_is_aside_is_exact_to_the_last_bit():
    chance = np.random.default_rng(5)
    ms = pymeshlab.MeshSet()
    ms.create_sphere(subdiv=2)
    mesh = ms.current_mesh()
    before = mesh.vertex_matrix()
    for scale in (1e-200, 1.0, 1e200):
        ms.compute_selection_by_condition_per_vertex(condselect="3 * rint(vi / 3) == vi")
        aside = Aside(ms)
        target = chance.normal(size=(len(aside.ids), 3)) * scale
        target[0] = [-0.0, 0.0, 5e-324]
        aside.move(target)
        assert same_bits(mesh.vertex_matrix()[::3], target)
        assert same_bits(mesh.vertex_matrix()[1::3], before[1::3])
    assert ms.mesh_number() == 1


def test_vertices_that_coincide_are_found():
    points = np.random.default_rng(6).integers(0, 9, (400, 3)).astype(np.float64)
    points[::2] = np.where(points[::2] == 0.0, -0.0, points[::2])
    _, place, count = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    assert np.array_equal(coincident(points), count[place.ravel()] > 1)
    assert not coincident(np.random.default_rng(7).random((400, 3))).any()


@pytest.mark.usefixtures("fans")
def test_vertices_that_coincide_stay_apart(holed_sphere):
    """A second sphere in the place of the first, and loose vertices on both."""
    vertices, faces = holed_sphere
    n = len(vertices)
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(np.concatenate([vertices] * 3), np.concatenate([faces, faces + n])))
    mesh = ms.current_mesh()
    before = mesh.vertex_matrix(), mesh.face_matrix()
    out = ms.meshing_inpaint_lowrank()
    assert out["closed_holes"] == 4
    assert same_bits(mesh.vertex_matrix()[: 3 * n], before[0])
    assert np.array_equal(mesh.face_matrix()[: 2 * len(faces)], before[1])


def test_the_report_on_moved_vertices_agrees_with_itself(holed_set, monkeypatch):
    ms = holed_set()
    ms.meshing_close_holes(
        maxholesize=100,
        selected=False,
        newfaceselected=True,
        refinehole=True,
        refineholeedgelen=pymeshlab.PercentageValue(2),
    )
    mesh = ms.current_mesh()
    vertices, faces = mesh_arrays(mesh)
    chosen = mesh.face_selection_array()
    out = ms.apply_coord_inpaint_lowrank(detail="none")
    assert [hole["status"] for hole in out["holes"]] == ["filled", "filled"]
    for name in ("new_faces", "new_vertices", "moved_vertices"):
        assert out[name] == sum(hole[name] for hole in out["holes"]), name
    assert out["new_faces"] == out["new_vertices"] == 0 < out["moved_vertices"]
    inside = np.setdiff1d(faces[chosen], faces[~chosen])
    assert out["moved_vertices"] == len(inside)
    patch = faces[np.isin(faces, inside).any(axis=1)]
    sides = np.sort(np.concatenate([patch[:, [0, 1]], patch[:, [1, 2]], patch[:, [2, 0]]]))
    sides, count = np.unique(sides, axis=0, return_counts=True)
    rim = vertices[sides[count == 1]]
    assert sum(hole["boundary_edges"] for hole in out["holes"]) == len(rim)
    length = np.linalg.norm(rim[:, 0] - rim[:, 1], axis=1).sum()
    assert sum(hole["perimeter"] for hole in out["holes"]) == pytest.approx(length)

    def failing(_, regions, recut):  # noqa: ARG001
        return [StageError("It fails.")] * len(regions)

    monkeypatch.setattr(Filler, "restore", failing)
    out = ms.apply_coord_inpaint_lowrank(detail="none")
    assert (out["closed_holes"], out["failed_holes"], out["moved_vertices"]) == (0, 2, 0)
    assert all(hole["moved_vertices"] == 0 for hole in out["holes"])


def test_values_handed_over_lie_in_a_grid_of_their_own_extent(monkeypatch):
    given = []
    layer = placing._layer

    def spy(ms, mesh):
        given.append(np.ptp(mesh.vertex_matrix(), axis=0))
        return layer(ms, mesh)

    monkeypatch.setattr(placing, "_layer", spy)
    for count in (1, 40):
        ms = pymeshlab.MeshSet(verbose=False)
        points = np.random.default_rng(count).random((count + 3, 3))
        ms.add_mesh(pymeshlab.Mesh(points, np.array([[0, 1, 2]])))
        ms.compute_selection_by_condition_per_vertex(condselect="vi > 2")
        aside = Aside(ms)
        aside.move(-points[3:])
        moved = ms.current_mesh().vertex_matrix()
        assert np.array_equal(moved, np.concatenate([points[:3], -points[3:]]))
    assert given[0].all()  # a single one would be a box without extent
    assert np.array_equal(given[1], [0.0, 39.0, 0.0])
