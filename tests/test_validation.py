"""What is accepted as a mesh, and the sentence for what isn't."""

from __future__ import annotations

import numpy as np
import pytest

from meshlab_lowrank.errors import InvalidMeshError, LowrankError
from meshlab_lowrank.mesh.validation import check_mesh

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def changed(array, index, value):
    result = array.copy()
    result[index] = value
    return result


def test_arrays_of_the_right_kind_are_passed_on():
    vertices, faces = check_mesh(CORNERS, TETRAHEDRON)
    assert vertices is CORNERS
    assert faces is TETRAHEDRON


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (CORNERS.astype(np.float32), TETRAHEDRON.astype(np.int32)),
        (CORNERS.tolist(), TETRAHEDRON.tolist()),
        (np.asfortranarray(CORNERS), np.asfortranarray(TETRAHEDRON)),
        (CORNERS.astype(int), TETRAHEDRON.astype(np.uint8)),
    ],
)
def test_other_kinds_are_converted(vertices, faces):
    points, triangles = check_mesh(vertices, faces)
    assert (points.dtype, triangles.dtype) == (np.float64, np.int64)
    assert points.flags.c_contiguous
    assert triangles.flags.c_contiguous
    np.testing.assert_array_equal(points, CORNERS)
    np.testing.assert_array_equal(triangles, TETRAHEDRON)


@pytest.mark.parametrize(
    ("vertices", "faces", "sentence"),
    [
        (CORNERS[:, :2], TETRAHEDRON, r"vertices must .* shape \(n, 3\), not \(4, 2\)"),
        (CORNERS.ravel(), TETRAHEDRON, r"vertices must .* not \(12,\)"),
        ([[0, 1, 2], [0, 1]], TETRAHEDRON, "vertices must .* rows of different lengths"),
        (CORNERS.astype(complex), TETRAHEDRON, "vertices must be numbers .* complex128"),
        (CORNERS.astype(str), TETRAHEDRON, "vertices must be numbers"),
        (changed(CORNERS, (2, 1), np.nan), TETRAHEDRON, "1 vertex has NaN .* is vertex 2;"),
        (changed(CORNERS, (slice(1, 3), 0), np.inf), TETRAHEDRON, "2 vertices have .* vertex 1;"),
        (CORNERS, TETRAHEDRON.astype(float), "faces must be numbers that fit int64, not float64"),
        (CORNERS, np.zeros((0, 3), dtype=int), "no faces; give a triangle mesh"),
        (CORNERS, [], "no faces"),
        ([], TETRAHEDRON, "4 faces have vertex indices outside"),
        (CORNERS, [[0, 1, 2, 3]], r"faces must .* not \(1, 4\)"),
        (CORNERS, changed(TETRAHEDRON, (1, 1), 4), r"1 face has .* outside 0 to 3, .* face 1 with"),
        (CORNERS, changed(TETRAHEDRON, (0, 0), -1), "outside 0 to 3, the first is face 0"),
        (CORNERS, changed(TETRAHEDRON, (3, 0), 3), "1 face uses a vertex twice, .* is face 3;"),
        (CORNERS, [[0, 1, 2], [1, 0, 3], [0, 1, 3]], "1 edge has more than two faces; apply "),
        (CORNERS, changed(TETRAHEDRON, 0, [0, 1, 2]), "At 3 edges two .*coherently first"),
    ],
)
def test_bad_meshes_are_refused_with_one_sentence(vertices, faces, sentence):
    with pytest.raises(InvalidMeshError, match=sentence) as caught:
        check_mesh(vertices, faces)
    assert isinstance(caught.value, LowrankError)
    assert isinstance(caught.value, ValueError)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_the_filters_that_are_recommended_exist():
    pymeshlab = pytest.importorskip("pymeshlab")
    names = pymeshlab.filter_list()
    for faces in (
        [[0, 1, 2], [1, 0, 3], [0, 1, 3]],
        changed(TETRAHEDRON, 0, [0, 1, 2]),
        changed(TETRAHEDRON, (3, 0), 3),
    ):
        with pytest.raises(InvalidMeshError) as caught:
            check_mesh(CORNERS, faces)
        assert any(word in names for word in str(caught.value).split())
