"""Manifests that were damaged or meant to do harm: bad lines go aside, good ones stay."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshlab_lowrank.cli import main
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders import FileRecord, batch, manifest_lines
from meshlab_lowrank.folders.manifest import ASIDE_NAME, MANIFEST_NAME, Manifest
from meshlab_lowrank.records import RecordError, checked_report
from tests.hostile_files import ply

HOLE = {"id": 0, "status": "filled", "reason": "", "boundary_edges": 8, "perimeter": 1.0}
HOLE |= {"diameter": 1.0, "trust": None}


def line(**changes: Any) -> bytes:
    return json.dumps({"file": "a.ply", "status": "done", **changes}).encode()


BAD = {
    "notes null": line(notes=None),
    "notes numbers": line(notes=[1]),
    "seconds text": line(seconds="3"),
    "seconds true": line(seconds=True),
    "seconds nan": line(seconds=float("nan")),
    "seconds infinite": b'{"file": "a.ply", "status": "done", "seconds": 1e999}',
    "holes a dict": line(holes={"id": 1}),
    "hole a number": line(holes=[1]),
    "hole incomplete": line(holes=[{"id": 1}]),
    "hole of another status": line(holes=[{**HOLE, "status": "well"}]),
    "hole with a text for its size": line(holes=[{**HOLE, "boundary_edges": "8"}]),
    "parameters a list": line(parameters=[]),
    "file a number": line(file=3),
    "file empty": line(file=""),
    "file missing": b'{"status": "done"}',
    "twice": b'{"file": "a.ply", "status": "done", "status": "failed"}',
    "a list": b"[]",
    "null": b"null",
    "a number": b"7",
    "deep": b'{"file": "a.ply", "status": "done", "holes": ' + b"[" * 100_000,
    "deep and closed": line(notes="x").replace(b'"x"', b"[" * 900 + b"]" * 900),
    "not utf-8": b'{"file": "\xff", "status": "done"}',
    "cut": b'{"file": "c.ply", "sta',
    "null bytes": b"\0" * 100,
    "long number": b'{"file": "a.ply", "status": "done", "attempts": ' + b"9" * 5000 + b"}",
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
def test_a_bad_line_is_set_aside_and_the_good_ones_stay(tmp_path: Path, bad: bytes) -> None:
    good = [line(file="b.ply", holes=[HOLE]), line(file="c.ply", notes=["x"], later=[1])]
    manifest = Manifest(tmp_path)
    manifest.path.write_bytes(b"\n".join([good[0], bad, b"", good[1], bad]))
    assert manifest.last_records().keys() == {"b.ply", "c.ply"}
    note = manifest.set_aside()
    assert note.startswith(f"2 lines of {manifest.path} can't be read;")
    assert manifest.path.read_bytes().splitlines() == good
    assert (tmp_path / ASIDE_NAME).read_bytes() == (bad + b"\n") * 2
    assert manifest.set_aside() == ""
    assert {path.name for path in tmp_path.iterdir()} == {MANIFEST_NAME, ASIDE_NAME}


def test_records_come_back_as_they_were_written(tmp_path: Path) -> None:
    hole = {**HOLE, "shape": "cut", "perimeter": float("inf"), "new_vertices": 0, "new_faces": 3}
    hole |= {"crossings": 2, "creases": 3, "folded_edges": 0, "flat_faces": 0, "trust": 0.5}
    hole |= {"rim_angle": 12.5, "edge_ratio": None, "median_error": 0.25, "largest_error": None}
    record = FileRecord(file="not utf-8 \udcff.ply", status="done", holes=[hole], seconds=2.0)
    manifest = Manifest(tmp_path)
    manifest.append(record.as_dict())
    assert manifest.last_records() == {record.file: record.as_dict()}
    assert manifest.set_aside() == ""


def test_a_line_without_end_is_not_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(manifest_lines, "_LONGEST", 100)
    manifest = Manifest(tmp_path)
    long = b"[" * 250 + line(file="x.ply")
    manifest.path.write_bytes(line() + b"\n" + long + b"\n" + line(file="b.ply"))
    assert manifest.last_records().keys() == {"a.ply", "b.ply"}
    assert manifest.set_aside()
    assert (tmp_path / ASIDE_NAME).read_bytes() == long + b"\n"
    assert manifest.last_records().keys() == {"a.ply", "b.ply"}


def test_what_cannot_be_set_aside_is_passed_over(tmp_path: Path) -> None:
    manifest = Manifest(tmp_path)
    manifest.path.write_bytes(line() + b"\nrubbish\n")
    (tmp_path / ASIDE_NAME).mkdir()
    before = manifest.path.read_bytes()
    assert "could not be set aside" in manifest.set_aside()
    assert manifest.path.read_bytes() == before
    assert manifest.last_records().keys() == {"a.ply"}


def test_a_run_tells_of_bad_lines_and_does_the_files_again(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scans, out = tmp_path / "in", tmp_path / "out"
    scans.mkdir()
    for name in ("a.ply", "b.ply"):
        (scans / name).write_bytes(ply())
    call = ["batch", str(scans), str(out), "--detail", "none", "--no-pictures"]
    assert main(call) == 0
    path = out / MANIFEST_NAME
    first = {
        json.loads(text)["file"]: text for text in path.read_text(encoding="utf-8").splitlines()
    }
    assert first.keys() == {"a.ply", "b.ply"}
    path.write_text(
        first["a.ply"].replace('"notes": [', '"notes": null, "x": [') + "\n" + first["b.ply"]
    )
    capfd.readouterr()
    assert main([*call, "--json"]) == 0
    told = capfd.readouterr()
    document = json.loads(told.out)
    assert document["counts"] == {"done": 1, "skipped": 1}
    assert len(document["notes"]) == 1
    assert document["notes"][0] in told.err
    assert len(path.read_text(encoding="utf-8").splitlines()) == 2


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs POSIX")
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("pipe", "a pipe"),
        ("folder", "a folder"),
        ("/dev/full", "a device"),
        ("/dev/zero", "a device"),
        ("nowhere", "a link to nothing"),
    ],
)
def test_a_manifest_that_is_no_file_is_refused(tmp_path: Path, kind: str, words: str) -> None:
    scans, out = tmp_path / "in", tmp_path / "out"
    scans.mkdir()
    out.mkdir()
    (scans / "a.ply").write_bytes(ply())
    path = out / MANIFEST_NAME
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to(kind)
    with pytest.raises(InvalidParameterError, match=f"{words}; take it away"):
        batch(scans, out, pictures=False)
    assert list(out.iterdir()) == [path]


def test_an_output_that_the_manifest_names_elsewhere_is_not_believed(tmp_path: Path) -> None:
    scans, out = tmp_path / "in", tmp_path / "out"
    scans.mkdir()
    (scans / "a.ply").write_bytes(ply())
    options: dict[str, Any] = {"pictures": False, "parameters": {"detail": "none"}}
    batch(scans, out, **options)
    path = out / MANIFEST_NAME
    path.write_text(
        path.read_text(encoding="utf-8").replace('"output": "a.ply"', '"output": "../in/a.ply"')
    )
    (record,) = batch(scans, out, **options).records
    assert (record.status, record.output) == ("done", "a.ply")


@pytest.mark.parametrize(
    "report",
    [3, "text", [], {"holes": 3}, {"holes": [{}]}, {"notes": "text"}, {"notes": [object()]},
     {"holes": [{**HOLE, "perimeter": float("nan")}]}, {"untextured_faces": "3"}],
)  # fmt: skip
def test_what_is_no_report_of_a_filter(report: object) -> None:
    with pytest.raises(RecordError):
        checked_report(report)


def test_reports_keep_what_is_read_of_them() -> None:
    numbers = {"id": np.int64(0), "perimeter": np.float64(1.0)}
    report = {"closed_holes": 1, "holes": [{**HOLE, **numbers}], "matrix": object()}
    (hole,) = checked_report(report)["holes"]
    assert hole == {**hole, **HOLE}
    assert hole["shape"] == "hole"
    assert checked_report(report).keys() == {"closed_holes", "holes"}
    assert checked_report({}) == {}
