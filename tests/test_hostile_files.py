"""Hostile files in a batch run: each costs its own record, and nothing else is touched."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from meshlab_lowrank.folders.manifest import MANIFEST_NAME
from meshlab_lowrank.folders.summary_page import PAGE_NAME
from meshlab_lowrank.mesh_files import READ_SUFFIXES
from meshlab_lowrank.scratch import SCRATCH_PREFIX
from tests import hostile_files, hostile_scenes
from tests.hostile_files import Hostile

COMMAND = [
    sys.executable,
    "-c",
    "import sys; from meshlab_lowrank.cli import main; sys.exit(main())",
    "batch",
]
RAW = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069]")

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs POSIX")


def tree(folder: Path) -> dict[str, object]:
    """Give what lies below a folder, with the content of files and the target of links."""

    def content(path: Path) -> object:
        if path.is_symlink():
            return path.readlink()
        return path.read_bytes() if path.is_file() else path.lstat().st_mode

    return {str(path): content(path) for path in folder.rglob("*")}


def companions(out: Path, records: dict[str, dict[str, object]]) -> list[str]:
    """Name the files in the output folder that are neither meshes nor of the run itself."""
    known = {MANIFEST_NAME, PAGE_NAME, *(str(record["output"]) for record in records.values())}
    files = (path.relative_to(out).as_posix() for path in out.rglob("*") if not path.is_dir())
    return [name for name in files if name not in known and not name.startswith(".")]


@pytest.mark.parametrize(
    ("files", "make", "options"),
    [
        (hostile_files.FILES, hostile_files.make_all, []),
        (hostile_scenes.SCENES, hostile_scenes.make_all, ["--format", "ply"]),
    ],
)
def test_hostile_files_cost_a_record_each_and_nothing_else(
    tmp_path: Path,
    files: tuple[Hostile, ...],
    make: Callable[[Path], None],
    options: list[str],
) -> None:
    work, out, temporary = tmp_path / "a" / "b" / "in", tmp_path / "out", tmp_path / "tmp"
    work.mkdir(parents=True)
    temporary.mkdir()
    make(work)
    before = tree(tmp_path / "a")
    done = subprocess.run(  # noqa: S603
        [*COMMAND, str(work), str(out), *options, "--detail", "none", "--timeout", "60"],
        capture_output=True,
        check=False,
        timeout=120,
        cwd=temporary,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    assert done.returncode == 1
    lines = (out / MANIFEST_NAME).read_text(encoding="utf-8").splitlines()
    records = {record["file"]: record for record in map(json.loads, lines)}
    assert len(lines) == len(records)
    assert {name: record["status"] for name, record in records.items()} == {
        file.name: file.status for file in files
    }
    for file in files:
        record = records[file.name]
        told = " ".join((record["reason"], *record["notes"]))
        assert file.words in told
        assert "bug" not in told
        assert record["traceback"] == ""
        assert "\n" not in record["reason"]
        assert bool(record["output"]) == (record["status"] in ("done", "nothing to fill"))
    for text in (
        done.stdout.decode(),
        done.stderr.decode(),
        (out / PAGE_NAME).read_text(encoding="utf-8"),
    ):
        assert not RAW.search(text)
        assert "Traceback" not in text
        assert "bug" not in text
    assert tree(tmp_path / "a") == before
    assert list(temporary.iterdir()) == []
    assert {path.name for path in tmp_path.iterdir()} == {"a", "out", "tmp"}
    assert not list(out.rglob(f"{SCRATCH_PREFIX}*"))
    assert not [path for path in out.rglob("*") if path.is_symlink()]
    for name in companions(out, records):
        assert name.endswith((".png", ".mtl", ".marks.json"))
        assert not name.endswith(READ_SUFFIXES)


def test_there_are_about_as_many_as_one_would_want() -> None:
    names = [file.name for file in (*hostile_files.FILES, *hostile_scenes.SCENES)]
    assert len(names) == len(set(names)) >= 90
