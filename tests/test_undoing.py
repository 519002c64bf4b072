"""Whatever a filter raises, at whatever step: the MeshSet is as it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from tests.snapshots import MARKS, differing, snapshot


class Trap:
    """Counts the calls of MeshLab's filters, and raises in the place of one."""

    def __init__(self) -> None:
        self.calls, self.at = 0, -1

    def __call__(self, plain: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        self.calls += 1
        if self.calls - 1 == self.at:
            msg = "out of memory"
            raise MemoryError(msg)
        return plain(*arguments, **options)


@pytest.fixture
def trap(monkeypatch: pytest.MonkeyPatch) -> Iterator[Trap]:
    found = Trap()
    plain = pymeshlab.MeshSet.apply_filter
    monkeypatch.setattr(
        pymeshlab.MeshSet, "apply_filter", lambda *given, **options: found(plain, *given, **options)
    )
    return found


def plain(ms: pymeshlab.MeshSet) -> None:
    pass


def graded(ms: pymeshlab.MeshSet) -> None:
    ms.compute_scalar_by_function_per_vertex(q="sin(vi)", normalize=False, map=False)
    ms.compute_color_by_function_per_vertex(x="vi / 20", y="99 + 90 * sin(vi)", z="30", a="200")


def selected(ms: pymeshlab.MeshSet) -> None:
    ms.compute_color_by_function_per_face(r="99 + 90 * sin(fi)", g="fi / 20", b="9", a="100")
    ms.compute_selection_by_condition_per_face(condselect="sin(fi) > 0.5")
    ms.compute_selection_by_condition_per_vertex(condselect="sin(vi) > 0.5")


def marked(ms: pymeshlab.MeshSet) -> None:
    """Marks of an earlier run, and a selection that must not be taken for them."""
    ms.compute_new_custom_scalar_attribute_per_vertex(name="inpainted", expr="vi > 2000")
    ms.compute_new_custom_scalar_attribute_per_vertex(name="inpaint_trust", expr="sin(vi)")
    ms.compute_new_custom_scalar_attribute_per_face(name="inpainted", expr="fi > 4000")
    ms.compute_new_custom_scalar_attribute_per_face(name="Depth", expr="fi / 3")
    ms.compute_new_custom_point_attribute_per_vertex(
        name="direction", x_expr="x", y_expr="vi", z_expr="2"
    )
    ms.compute_selection_by_condition_per_face(condselect="sin(fi) > 0.5")


def textured(ms: pymeshlab.MeshSet) -> None:
    ms.compute_texcoord_by_function_per_wedge(
        **{f"u{i}": f"vi{i} / 3000 + fi / 9" for i in range(3)},
        **{f"v{i}": f"sin(vi{i})" for i in range(3)},
    )
    # MeshLab switches these on and leaves them undefined
    ms.compute_texcoord_by_function_per_vertex(u="0", v="0")


def charted(ms: pymeshlab.MeshSet) -> None:
    ms.compute_texcoord_by_function_per_vertex(u="vi / 3000", v="sin(vi)")
    ms.compute_scalar_by_function_per_face(q="sin(fi)", normalize=False, map=False)


def turned(ms: pymeshlab.MeshSet) -> None:
    ms.create_cube()
    ms.set_current_mesh(0)
    ms.set_matrix(transformmatrix=np.diag([2.0, 3.0, 1.0, 1.0]), freeze=False)


DRESSES = (plain, graded, selected, marked, textured, charted, turned)


def bad_edges(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add a fin, at whose edge three faces meet."""
    tip = vertices[faces[0]].mean(axis=0, keepdims=True) * 1.2
    return np.concatenate([vertices, tip]), np.concatenate(
        [faces, [[faces[0, 0], faces[0, 1], len(vertices)]]]
    )


def changes(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Name what is not as it was, but for normals and what MeshLab can't take away again."""
    lasting = {f"0 {kind} {name}" for kind in ("vertex", "face") for name in MARKS}
    lasting.add("0 vertex texture")

    def exempt(name: str) -> bool:
        return name == "0 vertex normals" or (name in lasting and name not in before)

    return differing(before, after, exempt=exempt)


def check(
    make: Callable[[], pymeshlab.MeshSet],
    work: Callable[[pymeshlab.MeshSet], Any],
    trap: Trap,
    script: Path,
    *,
    share: float,
) -> None:
    """Raise at each of some steps, and at every one of the last dozen."""
    trap.at = -1
    ms = make()
    trap.calls = 0
    work(ms)
    total = trap.calls
    assert total > 5
    chance = np.random.default_rng(0)
    for step in range(total):
        if step < total - 12 and chance.random() > share:
            continue
        trap.at = -1
        ms = make()
        before = snapshot(ms, script=script)
        trap.calls, trap.at = 0, step
        with pytest.raises((MemoryError, meshlab_lowrank.LowrankError)):
            work(ms)
        trap.at = -1
        assert not changes(before, snapshot(ms, script=script)), step
        work(ms)  # nothing that is left over is in the way


@pytest.mark.usefixtures("fans")
@pytest.mark.parametrize("dress", DRESSES)
def test_a_filling_that_fails_leaves_all_as_it_was(
    holed_sphere: tuple[np.ndarray, np.ndarray],
    dress: Callable[[pymeshlab.MeshSet], None],
    trap: Trap,
    tmp_path: Path,
) -> None:
    def make() -> pymeshlab.MeshSet:
        ms = pymeshlab.MeshSet(verbose=False)
        ms.add_mesh(pymeshlab.Mesh(*holed_sphere), "sphere")
        dress(ms)
        return ms

    check(make, lambda ms: ms.meshing_inpaint_lowrank(), trap, tmp_path / "script.mlx", share=0.3)


def test_a_fin_elsewhere_makes_no_difference(
    holed_sphere: tuple[np.ndarray, np.ndarray], trap: Trap, tmp_path: Path
) -> None:
    """Vertices at bad edges are torn apart while a fill is written."""

    def make() -> pymeshlab.MeshSet:
        ms = pymeshlab.MeshSet(verbose=False)
        ms.add_mesh(pymeshlab.Mesh(*bad_edges(*holed_sphere)), "sphere")
        graded(ms)
        return ms

    def work(ms: pymeshlab.MeshSet) -> Any:
        return ms.meshing_inpaint_lowrank(detail="none")

    check(make, work, trap, tmp_path / "script.mlx", share=0.05)


def test_a_moving_that_fails_leaves_all_as_it_was(trap: Trap, tmp_path: Path) -> None:
    def make() -> pymeshlab.MeshSet:
        ms = pymeshlab.MeshSet(verbose=False)
        ms.create_sphere(subdiv=3)
        graded(ms)
        turned(ms)
        ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
        return ms

    def work(ms: pymeshlab.MeshSet) -> Any:
        return ms.apply_coord_inpaint_lowrank(detail="none")

    check(make, work, trap, tmp_path / "script.mlx", share=0.5)


@pytest.mark.usefixtures("fans")
@pytest.mark.parametrize("dress", [selected, marked])
def test_a_selection_is_gone_from_the_marks_when_all_is_well(
    holed_sphere: tuple[np.ndarray, np.ndarray], dress: Callable[[pymeshlab.MeshSet], None]
) -> None:
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(*holed_sphere), "sphere")
    dress(ms)
    mesh, m = ms.current_mesh(), len(holed_sphere[1])
    old = mesh.face_custom_scalar_attribute_array("inpainted") if dress is marked else np.zeros(m)
    ms.meshing_inpaint_lowrank()
    marks = mesh.face_custom_scalar_attribute_array("inpainted")
    assert np.array_equal(marks, np.append(old, np.ones(mesh.face_number() - m)))
