"""Damaged meshes of every kind: a valid mesh with the known part unchanged, or our own error.

Set MESHLAB_LOWRANK_FUZZING to a number of cases to try more, each time others.
"""

import os
from collections.abc import Callable

import numpy as np
import pymeshlab
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.result import InpaintResult

CASES = int(os.environ.get("MESHLAB_LOWRANK_FUZZING", "100"))

Mesh = tuple[FloatArray, IntArray]
Generator = np.random.Generator


def grid(rows: int, columns: int, *, around: bool, along: bool) -> IntArray:
    """Triangulate a grid of vertices that may be closed in one or both directions."""
    i, j = np.meshgrid(np.arange(rows - (not around)), np.arange(columns - (not along)))
    a = (i * columns + j).ravel()
    b = ((i + 1) % rows * columns + j).ravel()
    c = ((i + 1) % rows * columns + (j + 1) % columns).ravel()
    d = (i * columns + (j + 1) % columns).ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def torus(chance: Generator) -> Mesh:
    u, v = np.meshgrid(np.arange(18) / 18, np.arange(10) / 10, indexing="ij")
    u, v = 2 * np.pi * u.ravel(), 2 * np.pi * v.ravel()
    radius = 1 + chance.uniform(0, 0.1) * np.sin(6 * u) * np.cos(3 * v)
    ring = 3 + radius * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), radius * np.sin(v)], 1)
    return points, grid(18, 10, around=True, along=True)


def sphere(_: Generator) -> Mesh:
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_sphere(subdiv=2)
    mesh = meshset.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def sheet(chance: Generator) -> Mesh:
    x, y = np.meshgrid(np.arange(12.0), np.arange(14.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), chance.uniform(-0.1, 0.1, x.size)], 1)
    return points, grid(12, 14, around=False, along=False)


def strip(chance: Generator) -> Mesh:
    """Give an open cylinder: two loops bound it; it may be one face wide."""
    columns = int(chance.integers(2, 5))
    angle, height = np.meshgrid(np.arange(16) * np.pi / 8, np.arange(columns), indexing="ij")
    points = np.stack([2 * np.cos(angle), 2 * np.sin(angle), height], -1).reshape(-1, 3)
    return points, grid(16, columns, around=True, along=False)


def two_pieces(chance: Generator) -> Mesh:
    """Give a torus and a piece that is smaller than any patch."""
    points, faces = torus(chance)
    corners = np.array([[0.0, 0, 5], [1, 0, 5], [0, 1, 5], [0, 0, 6]])
    piece = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3]]) + len(points)
    return np.concatenate([points, corners]), np.concatenate([faces, piece])


def cut_disc(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    centre = points[chance.integers(len(points))]
    size = np.nanmax(np.ptp(points, axis=0))
    distance = np.linalg.norm(points[faces].mean(axis=1) - centre, axis=1)
    return points, faces[~(distance < chance.uniform(0.05, 0.3) * size)]


def cut_band(mesh: Mesh, chance: Generator) -> Mesh:
    """Take out a slice, which may split a component in two."""
    points, faces = mesh
    axis = chance.standard_normal(3)
    height = points[faces].mean(axis=1) @ axis
    low = np.nanquantile(height, chance.uniform(0, 0.9)) if len(height) else 0.0
    return points, faces[~((height >= low) & (height < low + 0.1 * np.nanmax(np.abs(height))))]


def remove_faces(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points, faces[chance.random(len(faces)) > chance.uniform(0, 0.1)]


def duplicate_faces(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points, np.concatenate([faces, chance.permutation(faces)[:2]])


def flip_faces(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    share = chance.choice([0.02, 1.0])
    flipped = chance.random(len(faces)) < share
    return points, np.where(flipped[:, None], faces[:, ::-1], faces)


def collapse_faces(mesh: Mesh, chance: Generator) -> Mesh:
    """Make faces of no area by moving one corner onto another."""
    points, faces = mesh
    points = points.copy()
    for a, b, _ in chance.permutation(faces)[:3]:
        points[a] = points[b]
    return points, faces


def repeat_corner(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    faces = faces.copy()
    if len(faces):
        row = chance.integers(len(faces))
        faces[row, 0] = faces[row, 1]
    return points, faces


def spoil_coordinate(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    points = points.copy()
    points[chance.integers(len(points)), chance.integers(3)] = chance.choice([np.nan, np.inf])
    return points, faces


def stray_vertices(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return np.concatenate([points, chance.standard_normal((5, 3))]), faces


def join_vertices(mesh: Mesh, chance: Generator) -> Mesh:
    """Use one vertex for two, so that loops touch or edges get many faces."""
    points, faces = mesh
    a, b = chance.integers(len(points), size=2)
    return points, np.where(faces == a, b, faces)


def missing_vertex(mesh: Mesh, _: Generator) -> Mesh:
    points, faces = mesh
    return points[:-1], faces


def move_far(mesh: Mesh, chance: Generator) -> Mesh:
    points, faces = mesh
    return points * chance.choice([1e-6, 1.0, 1e6]) + chance.choice([0.0, 1e7]), faces


BASES: tuple[Callable[[Generator], Mesh], ...] = (torus, sphere, sheet, strip, two_pieces)
HOLES = (cut_disc, cut_disc, cut_disc, cut_band, remove_faces)
DAMAGES = (
    duplicate_faces,
    flip_faces,
    collapse_faces,
    repeat_corner,
    spoil_coordinate,
    stray_vertices,
    join_vertices,
    missing_vertex,
    move_far,
)
PARAMETERS = st.one_of(
    st.builds(
        InpaintParameters,
        detail=st.sampled_from(["calibrated", "full", "none"]),
        closerim=st.booleans(),
        maxholesize=st.sampled_from([0, 0, 12]),
    ),
    st.builds(InpaintParameters.paper, patchsize=st.just(20)),
)


@settings(
    max_examples=CASES,
    deadline=None,
    database=None,
    derandomize="MESHLAB_LOWRANK_FUZZING" not in os.environ,
    suppress_health_check=list(HealthCheck),
)
@given(
    seed=st.integers(0, 2**32 - 1),
    base=st.sampled_from(BASES),
    holes=st.lists(st.sampled_from(HOLES), max_size=3),
    damages=st.lists(st.sampled_from(DAMAGES), max_size=2),
    parameters=PARAMETERS,
)
def test_damaged_meshes_end_well(
    seed: int,
    base: Callable[[Generator], Mesh],
    holes: list[Callable[[Mesh, Generator], Mesh]],
    damages: list[Callable[[Mesh, Generator], Mesh]],
    parameters: InpaintParameters,
) -> None:
    chance = np.random.default_rng(seed)
    mesh = base(chance)
    for change in (*holes, *damages):
        mesh = change(mesh, chance)
    before = mesh[0].copy(), mesh[1].copy()
    try:
        result = inpaint(*mesh, parameters=parameters)
    except LowrankError as error:
        sentence = str(error)
        assert sentence.endswith(".")
        assert "\n" not in sentence
    else:
        check_known_part(before, result)
        check_fill(before, result)
    np.testing.assert_array_equal(mesh[0], before[0])
    np.testing.assert_array_equal(mesh[1], before[1])


def check_known_part(before: Mesh, result: InpaintResult) -> None:
    points, faces = before
    n, m = len(points), len(faces)
    assert result.vertices[:n].tobytes() == np.ascontiguousarray(points).tobytes()
    np.testing.assert_array_equal(result.faces[:m], faces)
    np.testing.assert_array_equal(result.new_vertices, np.arange(len(result.vertices)) >= n)
    np.testing.assert_array_equal(result.new_faces, np.arange(len(result.faces)) >= m)


def repeated_edges(faces: np.ndarray) -> int:
    """Number of half-edges that were there already, in the same direction."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2)
    return len(edges) - len(np.unique(edges, axis=0))


def check_fill(before: Mesh, result: InpaintResult) -> None:
    """The fill is finite, manifold, oriented, no larger than the mesh, and closes its loops.

    What was not manifold or oriented before stays so.
    """
    points, faces = before
    assert np.isfinite(result.vertices).all()
    assert result.faces.min(initial=0) >= 0
    assert result.faces.max(initial=-1) < len(result.vertices)
    new = result.faces[result.new_faces]
    assert (new != np.roll(new, 1, axis=1)).all()
    assert repeated_edges(result.faces) == repeated_edges(faces)
    filled = sum(hole.boundary_edges for hole in result.holes if hole.status == "filled")
    assert boundary_edges(result.faces) == boundary_edges(faces) - filled
    assert sum(hole.new_faces for hole in result.holes) == len(new)
    assert {hole.status for hole in result.holes} <= {"filled", "skipped", "failed"}
    assert all(hole.reason for hole in result.holes if hole.status != "filled")
    if len(result.vertices) > len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        room = 3 * np.linalg.norm(high - low)  # the fill of a flat rim is a balloon
        assert (result.vertices >= low - room).all()
        assert (result.vertices <= high + room).all()


def boundary_edges(faces: IntArray) -> int:
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2)
    joined = np.concatenate([edges, edges[:, ::-1]])
    _, counts = np.unique(joined, axis=0, return_counts=True)
    return int((counts == 1).sum()) // 2
