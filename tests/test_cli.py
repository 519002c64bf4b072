import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank.cli import main
from meshlab_lowrank.mesh_files import load_mesh

CAPTURE = pytest.CaptureFixture[str]


def write_sphere(path: Path, *, openings: int = 1, subdiv: int = 3) -> Path:
    """Write a sphere with round holes around the ends of the axes."""
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.create_sphere(subdiv=subdiv)
    mesh = meshset.current_mesh()
    vertices, faces = mesh.vertex_matrix(), mesh.face_matrix()
    for axis in np.eye(3)[:openings]:
        faces = faces[(vertices[faces].mean(axis=1) @ axis) < 0.92]
    meshset.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshset.meshing_remove_unreferenced_vertices()
    meshset.save_current_mesh(str(path))
    return path


def write_off(path: Path, vertices: str, faces: str) -> Path:
    counts = f"{len(vertices.split(','))} {len(faces.split(','))} 0"
    rows = [row.strip() for row in (*vertices.split(","), *faces.split(","))]
    path.write_text("\n".join(["OFF", counts, *rows]) + "\n")
    return path


def boundary_edges(path: Path) -> int:
    loaded = load_mesh(path)
    return int(loaded.meshset.get_topological_measures()["boundary_edges"])


def test_version(capsys: CAPTURE) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"meshlab-lowrank {meshlab_lowrank.__version__}\n"


def test_holes_lists_every_loop(tmp_path: Path, capsys: CAPTURE) -> None:
    mesh = write_sphere(tmp_path / "a.ply", openings=2)
    assert main(["holes", str(mesh)]) == 0
    text = capsys.readouterr().out
    assert "2 boundary loops" in text
    assert "centre" in text
    assert main(["holes", str(mesh), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(document["holes"]) == 2
    edges = sum(hole["boundary_edges"] for hole in document["holes"])
    assert edges == boundary_edges(mesh)
    normals = [hole["normal"] for hole in document["holes"]]
    np.testing.assert_allclose(np.abs(normals).max(axis=0), [1.0, 1.0, 0.0], atol=0.05)
    assert all(len(hole["centre"]) == 3 for hole in document["holes"])


def test_inpaint_fills_and_keeps_the_known_part(tmp_path: Path, capsys: CAPTURE) -> None:
    source, target = write_sphere(tmp_path / "a.ply", openings=2), tmp_path / "b.ply"
    assert main(["inpaint", str(source), str(target)]) == 0
    text = capsys.readouterr().out
    assert "2 of 2 boundary loops filled" in text
    assert boundary_edges(target) == 0
    before, after = load_mesh(source), load_mesh(target)
    known = before.meshset.current_mesh().vertex_matrix()
    filled = after.meshset.current_mesh().vertex_matrix()
    assert np.array_equal(filled[: len(known)], known)


def test_quiet_tells_the_summary_only(tmp_path: Path, capsys: CAPTURE) -> None:
    mesh, out = write_sphere(tmp_path / "a.ply"), tmp_path / "out.ply"
    call = ["inpaint", str(mesh), str(out), "--detail", "none", "--quiet"]
    assert main(call) == 0
    told = capsys.readouterr()
    assert told.err == ""
    assert [line.split(":")[0] for line in told.out.splitlines()] == [
        "1 of 1 boundary loops filled.",
        "done",
    ]
    assert main([*call[:1], str(tmp_path / "missing.ply"), *call[2:]]) != 0
    assert "missing.ply" in capsys.readouterr().err


def test_many_holes_are_counted_and_not_told_one_by_one(tmp_path: Path, capsys: CAPTURE) -> None:
    mesh = tmp_path / "a.ply"
    sphere = pymeshlab.MeshSet(verbose=False)
    sphere.create_sphere(subdiv=5)
    vertices = sphere.current_mesh().vertex_matrix()
    faces = sphere.current_mesh().face_matrix()
    gone = np.zeros(len(vertices), dtype=bool)
    gone[np.linspace(500, len(vertices) - 1, 40).astype(int)] = True
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.add_mesh(pymeshlab.Mesh(vertices, faces[~gone[faces].any(axis=1)]))
    meshset.save_current_mesh(str(mesh))
    assert main(["inpaint", str(mesh), str(tmp_path / "out.ply")]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert any("holes done" in line or "holes: closing" in line for line in lines)
    assert len(lines) < 20


def test_inpaint_json_is_the_only_output(tmp_path: Path, capfd: CAPTURE) -> None:
    source, target = write_sphere(tmp_path / "a.ply"), tmp_path / "b.obj"
    assert main(["inpaint", str(source), str(target), "--detail", "none", "--json"]) == 0
    document = json.loads(capfd.readouterr().out)
    assert document["status"] == "done"
    assert document["output"] == str(target)
    assert [hole["status"] for hole in document["holes"]] == ["filled"]


def test_a_trust_that_is_not_known_is_null(tmp_path: Path, capsys: CAPTURE) -> None:
    source, target = write_sphere(tmp_path / "a.ply"), tmp_path / "b.ply"
    call = ["inpaint", str(source), str(target), "--preset", "paper", "--patchsize", "20"]
    assert main([*call, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [hole["trust"] for hole in document["holes"]] == [None]
    assert "not known" in document["holes"][0]["reason"]
    assert main(call) == 0
    assert "?" in capsys.readouterr().out


def test_options_reach_the_filter(tmp_path: Path, capsys: CAPTURE) -> None:
    source, target = write_sphere(tmp_path / "a.ply"), tmp_path / "b.ply"
    call = ["inpaint", str(source), str(target), "--json"]
    assert main([*call, "--maxholesize", "3"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["status"] == "nothing to fill"
    assert [hole["status"] for hole in document["holes"]] == ["skipped"]
    assert "maxholesize" in document["reason"]
    sizes = []
    for length in ("10%", "3%"):
        main([*call, "--detail", "none", "--refineedgelen", length])
        sizes.append(json.loads(capsys.readouterr().out)["holes"][0]["new_vertices"])
    assert sizes[1] > 2 * sizes[0]


def test_a_closed_mesh_is_copied(tmp_path: Path, capsys: CAPTURE) -> None:
    source, target = write_sphere(tmp_path / "a.ply", openings=0), tmp_path / "b.ply"
    assert main(["inpaint", str(source), str(target)]) == 0
    assert "no hole" in capsys.readouterr().out
    assert target.read_bytes() == source.read_bytes()


@pytest.mark.parametrize(
    ("name", "content", "words", "code"),
    [
        ("missing.ply", None, "no file", 2),
        ("format.foo", b"", "can't read .foo", 2),
        ("garbage.ply", b"\0\1\2", "can't be read", 1),
        ("nan.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 2 3 4\n", "aren't finite", 1),
    ],
)
def test_bad_input_gets_one_sentence_and_nothing_is_overwritten(
    tmp_path: Path, capfd: CAPTURE, *, name: str, content: bytes | None, words: str, code: int
) -> None:
    source, target = tmp_path / name, tmp_path / "out.ply"
    target.write_text("precious")
    if content is not None:
        source.write_bytes(content)
    for call in (["holes", str(source)], ["inpaint", str(source), str(target), "--json"]):
        assert main(call) == code
        output = capfd.readouterr()
        sentences = [line for line in output.err.splitlines() if "% " not in line]
        assert len(sentences) == 1
        assert words in sentences[0]
        if "--json" in call:
            assert json.loads(output.out)["error"] == sentences[0]
        else:
            assert output.out == ""
    assert target.read_text(encoding="utf-8") == "precious"
    assert sorted(path.name for path in tmp_path.iterdir() if path != source) == ["out.ply"]


def test_non_manifold_edges_are_counted_and_the_repair_is_named(
    tmp_path: Path, capsys: CAPTURE
) -> None:
    source = write_off(
        tmp_path / "fins.off",
        "0 0 0, 1 0 0, 0 1 0, 0 -1 0, 0 0 1",
        "3 0 1 2, 3 0 3 1, 3 0 1 4",
    )
    assert main(["inpaint", str(source), str(tmp_path / "out.ply")]) == 0
    message = capsys.readouterr().err
    assert "1 edge has more than two faces" in message
    assert "meshing_repair_non_manifold_edges" in message
    assert "--repair" in message


@pytest.mark.parametrize(
    "options",
    [
        ["--maxholesize", "-1"],
        ["--refineedgelen", "thin"],
        ["--iterations", "0"],
    ],
)
def test_wrong_values_are_wrong_calls(tmp_path: Path, capsys: CAPTURE, options: list[str]) -> None:
    source, target = write_sphere(tmp_path / "a.ply"), tmp_path / "b.ply"
    assert main(["inpaint", str(source), str(target), *options]) == 2
    assert options[0].lstrip("-") in capsys.readouterr().err
    assert not target.exists()


def test_wrong_targets_are_wrong_calls(tmp_path: Path, capsys: CAPTURE) -> None:
    source = write_sphere(tmp_path / "a.ply")
    before = source.read_bytes()
    for target in (source, tmp_path / "no" / "b.ply", tmp_path / "b.foo", tmp_path):
        assert main(["inpaint", str(source), str(target)]) == 2
        assert capsys.readouterr().err.endswith(".\n")
    assert source.read_bytes() == before


def test_run_a_ready_chain(tmp_path: Path, capsys: CAPTURE) -> None:
    source, target = write_sphere(tmp_path / "a.ply"), tmp_path / "b.ply"
    assert main(["run", "meshlab-fill", str(source), str(target)]) == 0
    assert boundary_edges(target) == 0
    capsys.readouterr()
    assert main(["run", "clean-and-inpaint", str(source), str(target), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [hole["status"] for hole in document["holes"]] == ["filled"]
    assert boundary_edges(target) == 0


def test_batch_writes_a_manifest_a_page_and_one_document(tmp_path: Path, capfd: CAPTURE) -> None:
    scans, out = tmp_path / "scans", tmp_path / "out"
    scans.mkdir()
    write_sphere(scans / "good.ply")
    (scans / "bad.ply").write_text("no mesh")
    call = ["batch", str(scans), str(out), "--detail", "none", "--json"]
    assert main(call) == 1
    document = json.loads(capfd.readouterr().out)
    assert document["counts"] == {"failed": 1, "done": 1}
    assert {path.name for path in out.iterdir() if not path.name.startswith(".")} == {
        "good.ply",
        "manifest.jsonl",
        "summary.html",
    }
    page = (out / "summary.html").read_text(encoding="utf-8")
    assert page.index("bad.ply") < page.index("Holes, the worst first")
    assert "batch" in page
    assert "--detail none" in page
    assert main(["batch", str(scans), str(out), "--chain", "meshlab-fill", "--seed", "3"]) == 2
    assert "--seed" in capfd.readouterr().err


def test_the_console_script_says_nothing_of_its_own(tmp_path: Path) -> None:
    source = write_sphere(tmp_path / "a.ply", openings=0)
    program = "import sys; from meshlab_lowrank.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", program, "holes", str(source), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stderr == ""
    assert json.loads(done.stdout)["holes"] == []
