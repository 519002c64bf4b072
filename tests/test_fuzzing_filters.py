"""A MeshSet that anything was done to: the filters fill it, or leave it as it was.

`damaging` tells how to try more cases.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest
from hypothesis import given
from hypothesis import strategies as st

import meshlab_lowrank
from tests.damaging import CASES, Generator, Mesh, damaged_meshes
from tests.snapshots import MARKS, differing, same, snapshot


def select_faces(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    number = chance.integers(1, 9)
    ms.compute_selection_by_condition_per_face(condselect=f"sin({number} * fi) > 0.5")


def select_vertices(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    number = chance.integers(1, 9)
    ms.compute_selection_by_condition_per_vertex(condselect=f"sin({number} * vi) > 0.8")


def delete_selected(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    """Delete what is selected, but never everything."""
    mesh = ms.current_mesh()
    if mesh.selected_face_number() * 2 < mesh.face_number():
        if chance.random() < 0.5:
            ms.meshing_remove_selected_faces()
        else:
            ms.meshing_remove_selected_vertices_and_faces()


def add_layer(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    current = ms.current_mesh_id()
    ms.create_cube()
    ms.compute_selection_by_condition_per_face(condselect="fi < 3")
    if chance.random() < 0.3:
        ms.delete_current_mesh()
    ms.set_current_mesh(current)


def turn_layer(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    matrix = np.eye(4)
    matrix[:3] = chance.standard_normal((3, 4))
    ms.set_matrix(transformmatrix=matrix, freeze=False)


def hide_layer(ms: pymeshlab.MeshSet, _: Generator) -> None:
    ms.set_current_mesh_visibility(False)


def colour(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    if chance.random() < 0.5:
        ms.compute_color_by_function_per_vertex(x="99 + 90 * sin(vi)", y="vi / 20", z="30", a="200")
    else:
        ms.compute_color_by_function_per_face(r="99 + 90 * sin(fi)", g="fi / 20", b="9", a="100")


def grade(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    switches = {"normalize": False, "map": False}
    if chance.random() < 0.7:
        ms.compute_scalar_by_function_per_vertex(q="vi / 7", **switches)
    else:
        ms.compute_scalar_by_function_per_face(q="fi / 7", **switches)


def add_attribute(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    name = str(chance.choice(["Depth", "layer_2", *MARKS]))
    if chance.random() < 0.5:
        ms.compute_new_custom_scalar_attribute_per_vertex(name=name, expr="vi > 40")
    else:
        ms.compute_new_custom_scalar_attribute_per_face(name=name, expr="fi > 40")


def add_texture_coordinates(ms: pymeshlab.MeshSet, chance: Generator) -> None:
    if chance.random() < 0.5:
        ms.compute_texcoord_by_function_per_vertex(u="vi / 100", v="vi / 50")
    else:
        ms.compute_texcoord_by_function_per_wedge(
            **{f"u{i}": f"vi{i} / 100" for i in range(3)},
            **{f"v{i}": f"vi{i} / 50" for i in range(3)},
        )
        # MeshLab switches these on and leaves them undefined
        ms.compute_texcoord_by_function_per_vertex(u="0", v="0")


def bend_normals(ms: pymeshlab.MeshSet, _: Generator) -> None:
    ms.compute_normal_by_function_per_vertex(x="1", y="vi", z="0")


def fill_first(ms: pymeshlab.MeshSet, _: Generator) -> None:
    run(lambda: ms.meshing_inpaint_lowrank(detail="none", maxholesize=12))


def begin_script(ms: pymeshlab.MeshSet, _: Generator) -> None:
    if ms.current_mesh().face_number():
        ms.compute_normal_per_vertex()


STEPS = (
    select_faces,
    select_vertices,
    delete_selected,
    add_layer,
    turn_layer,
    hide_layer,
    colour,
    grade,
    add_attribute,
    add_texture_coordinates,
    bend_normals,
    fill_first,
    begin_script,
)


def fill(ms: pymeshlab.MeshSet, chance: Generator) -> Any:
    return ms.meshing_inpaint_lowrank(
        detail=str(chance.choice(["none", "none", "calibrated", "full"])),
        selected=bool(chance.random() < 0.2),
        closerim=bool(chance.random() < 0.3),
    )


def restore(ms: pymeshlab.MeshSet, chance: Generator) -> Any:
    return ms.apply_coord_inpaint_lowrank(detail=str(chance.choice(["none", "full"])))


def measure(ms: pymeshlab.MeshSet, _: Generator) -> Any:
    return ms.get_hole_measures()


def run(work: Callable[[], Any]) -> Any:
    """Run a filter; None if it raises what it may."""
    try:
        return work()
    except (meshlab_lowrank.LowrankError, pymeshlab.PyMeshLabException) as error:
        sentence = str(error)
        assert sentence.endswith("."), sentence
        assert "\n" not in sentence
        return None


def check(ms: pymeshlab.MeshSet, work: Callable[[], Any], script: Path) -> None:
    """Run a filter and compare the MeshSet before and after."""
    before = snapshot(ms, script=script)
    report = run(work)
    after = snapshot(ms, script=script)
    own = f"{before['current']} "
    grown = isinstance(report, dict) and report.get("new_faces", 0) > 0
    moved = isinstance(report, dict) and report.get("moved_vertices", 0) > 0
    if not (grown or moved):
        marks = tuple(f"{own}{kind} {name}" for kind in ("vertex", "face") for name in MARKS)
        wrong = differing(before, after, exempt=lambda name: name in marks and name not in before)
        selected = {f"{own}selected {kind}" for kind in ("vertices", "faces")}
        assert not set(wrong) - (selected if report is not None else set()), wrong
        return
    n, m = len(before[f"{own}vertices"]), len(before[f"{own}faces"])
    wrong = differing(before, after, exempt=lambda name: name.startswith(own))
    assert not wrong, wrong
    lost = (f"{own}selected", f"{own}vertex normals", f"{own}transform", f"{own}layer")
    for name in (name for name in before if name.startswith(own) and not name.startswith(lost)):
        if moved and name == f"{own}vertices":
            continue
        rows = m if " face" in name or name.endswith("wedge texture") else n
        rows *= 3 if name.endswith("wedge texture") else 1
        assert same(before[name][:rows], after[name][:rows]), name
    for name in (f"{own}layer", f"{own}transform"):
        assert same(before[name], after[name]), name
    if grown:
        chosen = after[f"{own}selected faces"]
        assert not chosen[:m].any()
        assert chosen[m:].all()


@CASES
@given(
    mesh=damaged_meshes(holes=1),
    seed=st.integers(0, 2**32 - 1),
    steps=st.lists(st.sampled_from(STEPS), max_size=5),
    work=st.sampled_from([fill, fill, fill, restore, measure]),
)
def test_a_meshset_is_filled_or_left_as_it_was(
    tmp_path_factory: pytest.TempPathFactory,
    mesh: Mesh,
    seed: int,
    steps: list[Callable[[pymeshlab.MeshSet, Generator], None]],
    work: Callable[[pymeshlab.MeshSet, Generator], Any],
) -> None:
    chance = np.random.default_rng(seed)
    ms = mesh_set(mesh)
    if ms is None:
        return
    for step in steps:
        step(ms, chance)
    script = tmp_path_factory.getbasetemp() / "script.mlx"
    check(ms, lambda: work(ms, chance), script)


def mesh_set(mesh: Mesh) -> pymeshlab.MeshSet | None:
    """None where PyMeshLab refuses the arrays."""
    ms = pymeshlab.MeshSet(verbose=False)
    try:
        ms.add_mesh(pymeshlab.Mesh(*mesh), "scan")
    except pymeshlab.PyMeshLabException:
        return None
    return ms
