"""Damaged meshes of every kind: a valid mesh with the known part unchanged, or our own error.

`damaging` tells how to try more cases.
"""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.result import InpaintResult
from tests.damaging import CASES, Mesh, damaged_meshes

PARAMETERS = st.one_of(
    st.builds(
        InpaintParameters,
        detail=st.sampled_from(["calibrated", "full", "none"]),
        closerim=st.booleans(),
        maxholesize=st.sampled_from([0, 0, 12]),
    ),
    st.builds(InpaintParameters.paper, patchsize=st.just(20)),
)


@CASES
@given(mesh=damaged_meshes(holes=0), parameters=PARAMETERS)
def test_damaged_meshes_end_well(mesh: Mesh, parameters: InpaintParameters) -> None:
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
    around = boundary_edges(new)  # of the fills alone
    if around != filled:  # at seams the vertices of rims are doubled
        assert boundary_edges(at_one_place(result.vertices, len(points))[new]) <= filled < around
    assert sum(hole.new_faces for hole in result.holes) == len(new)
    assert {hole.status for hole in result.holes} <= {"filled", "skipped", "failed"}
    assert all(hole.reason for hole in result.holes if hole.status != "filled")
    if len(result.vertices) > len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        room = 3 * np.linalg.norm(high - low)  # the fill of a flat rim is a balloon
        assert (result.vertices >= low - room).all()
        assert (result.vertices <= high + room).all()


def at_one_place(vertices: FloatArray, n: int) -> IntArray:
    """Give the first n vertices that coincide one number."""
    ids = np.arange(len(vertices))
    _, first, place = np.unique(vertices[:n] + 0.0, axis=0, return_index=True, return_inverse=True)
    ids[:n] = first[place.ravel()]
    return ids


def boundary_edges(faces: IntArray) -> int:
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2)
    joined = np.concatenate([edges, edges[:, ::-1]])
    _, counts = np.unique(joined, axis=0, return_counts=True)
    return int((counts == 1).sum()) // 2
