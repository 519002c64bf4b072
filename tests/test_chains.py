from pathlib import Path

import pymeshlab
import pytest

from meshlab_lowrank.chains import PythonChain, ScriptChain, load_chain, ready_chains
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.filters.text_values import filter_value
from meshlab_lowrank.folders.settings import check_chain
from meshlab_lowrank.isolation.pool import WorkerPool

SCRIPT = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Subdivision Surfaces: Midpoint">
  <Param name="Iterations" type="RichInt" value="1"
         description="Iterations"/>
  <Param name="Threshold" type="RichAbsPerc" value="0" min="0" max="2"/>
  <Param name="Selected" type="RichBool" value="false"/>
 </filter>
 <filter name="Invert Faces Orientation"/>
</FilterScript>
"""


def write(folder: Path, text: str, name: str = "chain.mlx") -> Path:
    (folder / name).write_text(text)
    return folder / name


def cube() -> pymeshlab.MeshSet:
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_cube()
    return meshset


def test_a_script_does_what_meshlab_does_with_it(tmp_path: Path) -> None:
    path = write(tmp_path, SCRIPT)
    ours, theirs = cube(), cube()
    steps: list[tuple[int, str]] = []
    load_chain(path).run(ours, lambda number, name: steps.append((number, name)))
    theirs.load_filter_script(str(path))
    theirs.apply_filter_script()
    for get in ("vertex_matrix", "face_matrix"):
        expected = getattr(theirs.current_mesh(), get)()
        assert (getattr(ours.current_mesh(), get)() == expected).all()
    assert ours.current_mesh().face_number() == 4 * cube().current_mesh().face_number()
    assert steps == [(0, "Subdivision Surfaces: Midpoint"), (1, "Invert Faces Orientation")]


def test_a_script_that_meshlab_saved_is_understood(tmp_path: Path) -> None:
    meshset = cube()
    meshset.meshing_surface_subdivision_midpoint(iterations=1)
    meshset.meshing_close_holes(maxholesize=12, selected=False)
    meshset.save_filter_script(str(tmp_path / "saved.mlx"))
    chain = load_chain(tmp_path / "saved.mlx")
    assert isinstance(chain, ScriptChain)
    names = [step.name for step in chain.steps]
    assert names[-2:] == ["Subdivision Surfaces: Midpoint", "Close Holes"]
    for number in range(chain.length):
        chain.check(number)


@pytest.mark.parametrize(
    ("old", "new", "line", "reason"),
    [
        ("Invert Faces Orientation", "Invert Everything", 9, "no filter 'Invert Everything'"),
        ('"Iterations" ', '"Rounds" ', 4, "no parameter 'Rounds'"),
        ('value="1"', 'value="one"', 4, "'one'"),
        ('value="false"', 'value="2"', 7, "'2'"),
        (' type="RichInt"', "", 4, "no type"),
        ("</filter>", "</filtr>", 8, "mismatched tag"),
        ('<filter name="Invert Faces Orientation"/>', "<step/>", 9, "<step>"),
    ],
)
def test_mistakes_name_their_line(
    tmp_path: Path, old: str, new: str, line: int, reason: str
) -> None:
    path = write(tmp_path, SCRIPT.replace(old, new))
    pool = WorkerPool()
    try:
        with pytest.raises(InvalidParameterError) as caught:
            check_chain(path, pool)
    finally:
        pool.close()
    assert f"chain.mlx, line {line}: " in str(caught.value)
    assert reason in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [("maxholsize", "3", "not found"), ("maxholesize", "-3", "at least 0"), ("detail", "x", "'x'")],
)
def test_mistakes_in_our_parameters_name_their_line(
    tmp_path: Path, name: str, value: str, reason: str
) -> None:
    text = f'<FilterScript>\n<filter name="meshing_inpaint_lowrank">\n<Param name="{name}" '
    path = write(tmp_path, f'{text}value="{value}"/></filter></FilterScript>')
    with pytest.raises(InvalidParameterError, match=f"line 3: .*{reason}"):
        load_chain(path).check(0)


def test_a_mistake_is_found_in_a_run_too(tmp_path: Path) -> None:
    chain = load_chain(write(tmp_path, SCRIPT.replace('"Iterations" ', '"Rounds" ')))
    with pytest.raises(InvalidParameterError, match="line 4"):
        chain.run(cube())


def test_a_failing_step_names_its_line(tmp_path: Path) -> None:
    text = '<FilterScript>\n<filter name="Delete ALL Faces"/>\n<filter name="Close Holes"/>\n'
    chain = load_chain(write(tmp_path, text + "</FilterScript>"))
    with pytest.raises(LowrankError, match="line 3, Close Holes: "):
        chain.run(cube())


def test_an_empty_script_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidParameterError, match="no filter"):
        load_chain(write(tmp_path, "<FilterScript/>"))


def test_ready_chains_are_right() -> None:
    assert set(ready_chains()) == {"clean-and-inpaint", "inpaint-and-decimate", "meshlab-fill"}
    pool = WorkerPool()
    try:
        for name, path in ready_chains().items():
            assert check_chain(name, pool) == str(path)
    finally:
        pool.close()


def test_an_unknown_chain_lists_the_ready_ones(tmp_path: Path) -> None:
    with pytest.raises(InvalidParameterError, match="meshlab-fill"):
        load_chain("no-such-chain")
    with pytest.raises(InvalidParameterError, match=r"\.mlx"):
        load_chain(write(tmp_path, "", "chain.txt"))


def test_a_python_chain_runs_and_returns_what_it_found(tmp_path: Path) -> None:
    text = "def chain(ms):\n    ms.meshing_invert_face_orientation()\n    return {'holes': []}\n"
    chain = load_chain(write(tmp_path, text, "chain.py"))
    assert isinstance(chain, PythonChain)
    assert chain.run(cube()) == [{"holes": []}]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def chain(ms:\n", "line 1"),
        ("def other(ms):\n    pass\n", r"no function chain\(ms\)"),
    ],
)
def test_python_that_is_no_chain_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(InvalidParameterError, match=reason):
        load_chain(write(tmp_path, text, "chain.py"))


def test_a_failing_python_chain_names_its_line(tmp_path: Path) -> None:
    text = "def chain(ms):\n    ms.meshing_close_holes(\n        nothing=1)\n"
    chain = load_chain(write(tmp_path, text, "chain.py"))
    with pytest.raises(LowrankError, match=r"chain\.py, line 2: .*nothing"):
        chain.run(cube())


def test_values_of_our_parameters_are_read_from_text() -> None:
    assert filter_value("closerim", "true") is True
    assert filter_value("maxholesize", "40") == 40
    assert filter_value("preset", "paper") == "paper"
    length = filter_value("refineedgelen", "2.5%")
    assert isinstance(length, pymeshlab.PercentageValue)
    assert length.value() == 2.5
    length = filter_value("refineedgelen", "3")
    assert isinstance(length, pymeshlab.PureValue)
    assert length.value() == 3
