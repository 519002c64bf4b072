"""Whole comparisons: fillers in processes of their own, rows, reports, the command."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import sys
from html.parser import HTMLParser

import numpy as np
import pymeshlab
import pytest
from PIL import Image
from scipy.spatial import Delaunay

import meshlab_lowrank
from meshlab_lowrank.cli import main
from meshlab_lowrank.comparison import gallery
from meshlab_lowrank.comparison.gallery import COLOURS, Gallery, draw_gallery, shown_cases
from meshlab_lowrank.comparison.report import html_report
from meshlab_lowrank.comparison.strip import write_strip
from meshlab_lowrank.comparison.tables import tables, verdicts, write_csv
from meshlab_lowrank.errors import (
    InpaintCancelledError,
    InvalidMeshError,
    InvalidParameterError,
)
from meshlab_lowrank.report import rendering

CHAINS = {
    "truth": "ms.add_mesh(pymeshlab.Mesh(data['vertices'], data['faces']))",
    "moved": (
        "ms.add_mesh(pymeshlab.Mesh(data['part_vertices'] + [0, 0, 0.5], data['part_faces']))\n"
        "    ms.generate_by_merging_visible_meshes(mergevertices=False)"
    ),
    "nothing": "pass",
    "raising": "raise ValueError('out of luck')",
    "crashing": "os.kill(os.getpid(), signal.SIGSEGV)",
    "hanging": "time.sleep(60)",
    "emptying": "ms.add_mesh(pymeshlab.Mesh(data['vertices']))",
}
CHAIN = """
import os, signal, time
from pathlib import Path
import numpy as np
import pymeshlab

data = np.load(Path(__file__).with_name("truth.npz"))

def chain(ms):
    {}
"""


def sheet(half=16):
    grid = np.arange(-half, half + 1.0)
    x, y = (a.ravel() for a in np.meshgrid(grid, grid))
    inner = (np.abs(x) < half) & (np.abs(y) < half)
    x, y = np.stack([x, y]) + np.random.default_rng(0).uniform(-0.2, 0.2, (2, len(x))) * inner
    faces = Delaunay(np.stack([x, y], axis=1)).simplices.astype(np.int64)
    vertices = np.stack([x, y, np.zeros_like(x)], axis=1)
    u, v = (
        vertices[faces[:, 1]] - vertices[faces[:, 0]],
        vertices[faces[:, 2]] - vertices[faces[:, 0]],
    )
    turned = np.cross(u, v)[:, 2] < 0
    return vertices, np.where(turned[:, None], faces[:, ::-1], faces)


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    """A flat sheet with a round hole, its truth, and chains beside it."""
    folder = tmp_path_factory.mktemp("flat")
    vertices, faces = sheet()
    part = np.linalg.norm(vertices[faces].mean(axis=1), axis=1) < 5
    used, local = np.unique(faces[part], return_inverse=True)
    np.savez(
        folder / "truth.npz",
        vertices=vertices,
        faces=faces,
        part_vertices=vertices[used],
        part_faces=local.reshape(-1, 3),
    )
    for name, body in CHAINS.items():
        (folder / f"{name}.py").write_text(CHAIN.format(body))
    return folder, (vertices, faces[~part]), (vertices, faces)


@pytest.fixture(scope="module")
def comparison(flat):
    """Chains that do all that a filler can do, with the truth."""
    folder, damaged, truth = flat
    chains = [folder / f"{name}.py" for name in CHAINS]
    return meshlab_lowrank.compare(damaged, fillers=["close", *chains], truth=truth, timeout=4.0)


def row(comparison, filler):
    return comparison.select(comparison.cases[0], filler)


def test_the_truth_scores_nothing(comparison):
    error = row(comparison, "truth.py").error
    assert row(comparison, "truth.py").status == "filled"
    assert error.maximum < 1e-9
    assert error.normal_error < 1e-6
    assert row(comparison, "truth.py").hausdorff["max"] < 1e-6


def test_the_truth_moved_scores_the_distance(comparison):
    error = row(comparison, "moved.py").error
    assert error.rms == pytest.approx(0.5, rel=1e-9)
    assert error.maximum == pytest.approx(0.5, rel=1e-9)
    assert error.normal_error < 1e-6


def test_a_flat_fill_of_a_flat_hole_is_right(comparison):
    assert row(comparison, "close").status == "filled"
    assert row(comparison, "close").error.maximum < 1e-9
    assert row(comparison, "close").shape.rim_angle < 1e-6
    assert row(comparison, "close").seconds > 0


def test_whatever_a_filler_does_is_a_row(comparison):
    statuses = {name: row(comparison, f"{name}.py").status for name in CHAINS}
    assert statuses == {
        "truth": "filled",
        "moved": "left open",
        "nothing": "left open",
        "raising": "failed",
        "crashing": "crashed",
        "hanging": "timed out",
        "emptying": "failed",
    }
    assert "out of luck" in row(comparison, "raising.py").reason
    assert "SIGSEGV" in row(comparison, "crashing.py").reason
    assert "4 s" in row(comparison, "hanging.py").reason
    assert row(comparison, "crashing.py").error is None


def test_outer_rims_are_left_out_unless_asked_for(comparison):
    assert [case.name for case in comparison.cases] == ["hole 1"]
    assert any("rim" in note for note in comparison.notes)


def test_json_and_csv_hold_every_row(comparison, tmp_path):
    document = json.loads(json.dumps(comparison.as_dict(), allow_nan=False))
    assert len(document["rows"]) == 1 + len(CHAINS)
    write_csv(comparison, tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["filler"] for line in lines] == [r["filler"] for r in document["rows"]]
    assert float(lines[0]["rms"]) == document["rows"][0]["rms"]
    assert lines[-1]["rms"] == ""
    assert {"dihedral_to_truth", "looks_right"} <= set(lines[0])


def test_tables_mark_the_best(comparison):
    errors = tables(comparison)[0]
    names = [cells[0] for cells in errors.rows]
    best = {names[i] for i, j in errors.best if errors.columns[j] == "RMS, edges"}
    assert best == {"close", "truth.py"}
    assert "dihedral to truth" in errors.columns
    assert any("crashing.py" in sentence for sentence in verdicts(comparison, 1))


class Document(HTMLParser):
    """Collects what a page refers to, and checks that its tags are closed."""

    VOID = ("meta", "img", "br", "link")

    def __init__(self, text):
        super().__init__()
        self.open, self.sources, self.alternatives = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.sources += [values[name] for name in ("src", "href") if name in values]
        if tag == "img":
            self.alternatives.append(values["alt"])
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_needs_nothing_else(comparison):
    gallery = draw_gallery(comparison)
    text = html_report(comparison, gallery, "meshlab-lowrank compare <mesh>")
    document = Document(text)
    assert document.open == []
    assert all(source.startswith("data:image/") for source in document.sources)
    assert all(document.alternatives)
    assert not re.search(r"https?://", text)
    assert "compare &lt;mesh&gt;" in text
    assert "crashing.py" in text
    assert bool(gallery.missing) == (not document.sources)


def test_the_page_goes_without_pictures_where_there_is_no_renderer(comparison, monkeypatch):
    monkeypatch.setattr(rendering.importlib.util, "find_spec", lambda _: None)
    text = html_report(comparison, draw_gallery(comparison))
    assert "<img" not in text
    assert "pip install" in text


def test_a_renderer_that_dies_costs_the_pictures_only(comparison, monkeypatch):
    monkeypatch.setattr(rendering.importlib.util, "find_spec", lambda _: True)
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    gallery = draw_gallery(comparison)
    assert not gallery.files
    assert "libegl1" in gallery.missing
    assert "truth.py" in html_report(comparison, gallery)


def test_pictures_are_drawn_without_a_screen(comparison, monkeypatch, tmp_path):
    pytest.importorskip("pyvista")
    monkeypatch.delenv("DISPLAY", raising=False)
    drawn = draw_gallery(comparison)
    if "OpenGL" in drawn.missing:
        pytest.skip(drawn.missing)
    for data in drawn.files.values():
        image = np.asarray(Image.open(io.BytesIO(data)).convert("L"), dtype=float)
        assert image.min() < 250  # not blank
    write_strip(comparison, drawn, tmp_path / "strip.png")
    with Image.open(tmp_path / "strip.png") as strip:
        assert strip.width > 1000
    text = html_report(comparison, drawn)
    assert text.count("<img") == 2 + 2 * 3 + 1  # hole, truth; three fills and errors; open


def grey(shade):
    file = io.BytesIO()
    Image.new("RGB", (50, 50), (shade, shade, shade)).save(file, "png")
    return file.getvalue()


def strip_of(comparison, path, *, errors):
    """Give the strip of grey pictures as an array."""
    files = {}
    for case in shown_cases(comparison):
        for filler in ("", "truth", *comparison.fillers):
            files[case.name, filler, "surface"] = grey(120)
            if errors and filler in comparison.fillers:
                files[case.name, filler, "errors"] = grey(60)
    write_strip(comparison, Gallery(files, ""), path)
    with Image.open(path) as strip:
        return np.asarray(strip.convert("RGB"), dtype=int)


def test_the_strip_has_margins_numbers_and_a_scale(comparison, tmp_path):
    strip = strip_of(comparison, tmp_path / "strip.png", errors=True)
    for side in (strip[:12], strip[-12:], strip[:, :12], strip[:, -12:]):
        assert (side == 255).all()
    title = strip[: strip.shape[0] // 20, :150]
    assert (title.sum(axis=2) < 200).any()  # ink
    ends = [np.array(list(bytes.fromhex(colour[1:]))) for colour in (COLOURS[0], COLOURS[-1])]
    assert all((strip == end).all(axis=2).any() for end in ends)
    low, high = ((strip == end).all(axis=2).any(axis=0).argmax() for end in ends)
    assert low < high
    alone = strip_of(comparison, tmp_path / "alone.png", errors=False)
    assert not (alone == ends[1]).all(axis=2).any()
    assert alone.shape[0] < strip.shape[0]


def test_fills_that_tell_how_wrong_they_may_be_have_bars(flat):
    _, damaged, truth = flat
    wavy, whole = (
        (np.column_stack([v[:, :2], np.cos(0.7 * v[:, 0]) * np.cos(0.5 * v[:, 1])]), f)
        for v, f in (damaged, truth)
    )
    both = meshlab_lowrank.compare(wavy, fillers=["close", "lowrank-none"], truth=whole)
    plain, ours = row(both, "close"), row(both, "lowrank-none")
    assert plain.bars is None
    assert 0.0 < ours.bars.median < ours.bars.largest < 3.0
    assert 0.2 < ours.bars.within <= 1.0
    assert ours.as_dict()["within_error_bar"] == ours.bars.within
    assert plain.as_dict()["within_error_bar"] is None
    columns = {column for table in tables(both) for column in table.columns}
    assert {"within the bar", "median error bar, edges", "largest error bar, edges"} <= columns
    case = both.cases[0]
    pictures = gallery._pictures(both)
    assert pictures[case.name, "lowrank-none", "bars"].errors.distances.max() == ours.bars.largest
    assert (case.name, "close", "bars") not in pictures
    files = {key: grey(90) for key in pictures}
    text = html_report(both, Gallery(files, ""))
    assert "error bars of lowrank-none" in text
    assert "not exceeded in 68 % of cases" in text


def test_a_mesh_without_holes_is_punched(flat):
    vertices, faces = flat[2]
    waves = vertices + [0, 0, 1] * np.sin(vertices[:, :1])
    events = []
    ms = pymeshlab.MeshSet(verbose=False)
    ms.add_mesh(pymeshlab.Mesh(waves, faces), "waves")
    result = meshlab_lowrank.compare(
        ms, fillers=["close"], radius=4, places=2, progress=events.append
    )
    assert result.name == "waves"
    assert [case.place for case in result.cases] == [1, 2]
    assert all(row.error.rms > 0.1 for row in result.rows)
    assert all(row.run_holes >= 1 for row in result.rows)
    assert [event.fraction for event in events] == sorted(event.fraction for event in events)
    assert "copies" in tables(result)[0].caption
    (summary,) = result.as_dict()["over_places"]
    rms = sorted(row.error.rms / row.edge_length for row in result.rows)
    assert (summary["places"], summary["filled"]) == (2, 2)
    assert summary["rms_in_edges"] == {"median": sum(rms) / 2, "least": rms[0], "most": rms[1]}


def test_a_meshset_is_left_as_it_is(flat):
    vertices, faces = flat[1]
    ms = pymeshlab.MeshSet(verbose=False)
    ms.create_cube()
    ms.add_mesh(pymeshlab.Mesh(vertices, faces), "damaged")
    ms.compute_selection_by_condition_per_face(condselect="fi < 7")
    before = state(ms)
    result = meshlab_lowrank.compare(ms, fillers=["close"], places=0)
    assert result.rows[0].status == "filled"
    assert len(before) == len(state(ms))
    for one, other in zip(before, state(ms), strict=True):
        np.testing.assert_array_equal(one, other)


def state(ms):
    mesh = ms.current_mesh()
    return [
        [ms.mesh_number(), ms.current_mesh_id()],
        mesh.vertex_matrix(),
        mesh.face_matrix(),
        mesh.face_selection_array(),
        mesh.vertex_selection_array(),
    ]


@pytest.mark.parametrize(
    "changes", [{"places": -1}, {"holes": -1}, {"radius": 0.0}, {"timeout": float("nan")}]
)
def test_values_out_of_range_are_refused(flat, changes):
    with pytest.raises(InvalidParameterError, match=next(iter(changes))):
        meshlab_lowrank.compare(flat[1], fillers=["close"], **changes)


def test_a_filler_given_twice_is_refused(flat):
    with pytest.raises(InvalidParameterError, match="twice"):
        meshlab_lowrank.compare(flat[1], fillers=["close", "close"])


def test_a_mesh_without_holes_needs_a_radius(flat):
    with pytest.raises(InvalidMeshError, match="radius"):
        meshlab_lowrank.compare(flat[2], fillers=["close"])


def test_a_comparison_can_be_stopped(flat):
    with pytest.raises(InpaintCancelledError):
        meshlab_lowrank.compare(flat[1], fillers=["close"], progress=lambda _: False)


def test_the_command_writes_one_json_document(flat, tmp_path, capsys):
    folder, (vertices, faces), truth = flat
    for name, mesh in (("damaged", (vertices, faces)), ("truth", truth)):
        ms = pymeshlab.MeshSet(verbose=False)
        ms.add_mesh(pymeshlab.Mesh(*mesh))
        ms.save_current_mesh(str(tmp_path / f"{name}.ply"))
    call = ["compare", str(tmp_path / "damaged.ply"), "--truth", str(tmp_path / "truth.ply")]
    chain = ["--add", str(folder / "raising.py"), "--csv", str(tmp_path / "rows.csv")]
    capsys.readouterr()  # pymeshlab tells what it wrote
    assert main([*call, "--fillers", "close", *chain, "--json"]) == 1
    output = capsys.readouterr()
    document = json.loads(output.out)
    assert [row["status"] for row in document["rows"]] == ["filled", "failed"]
    assert "raising.py filled nothing" in output.err
    assert (tmp_path / "rows.csv").read_text(encoding="utf-8").count("\n") == 3

    assert main([*call, "--fillers", "close"]) == 0
    assert "errors against the truth" in capsys.readouterr().out
    assert main([*call, "--fillers", "no-such"]) == 2
    assert main([*call, "--html", str(tmp_path / "no" / "page.html")]) == 2
