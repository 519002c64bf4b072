"""The lock of an output folder is on the folder itself, and minds the folders above and below."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from meshlab_lowrank.errors import LowrankError
from meshlab_lowrank.folders import lock
from meshlab_lowrank.folders.lock import LOCK_NAME, locked

HOLDER = """
import sys, time
from pathlib import Path
from meshlab_lowrank.folders.lock import locked

with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refuse at once."""
    monkeypatch.setattr(lock, "_PAUSE", 0.0)


@pytest.fixture(params=["folders", "files"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Locks on folders, and what stands in for them where there are none."""

    def unsupported(*_: object, **__: object) -> NoReturn:
        raise OSError(95, "Operation not supported")

    if request.param == "files":
        monkeypatch.setattr(lock, "lock_folder", unsupported)
    elif sys.platform == "win32":
        pytest.skip("needs POSIX")
    return str(request.param)


def refused(folder: Path, words: str) -> bool:
    with pytest.raises(LowrankError, match=words), locked(folder):
        pass
    return True


def free(folder: Path) -> bool:
    with locked(folder):
        return True


@pytest.mark.usefixtures("kind")
def test_folders_above_and_below_are_refused_and_those_beside_are_not(tmp_path: Path) -> None:
    out = tmp_path / "scans" / "out"
    below, beside = out / "a" / "b", tmp_path / "scans" / "out2"
    below.mkdir(parents=True)
    beside.mkdir()
    mine = f"process {os.getpid()}"
    with locked(out):
        assert refused(out, rf"{mine}.* working on {out}; wait")
        assert refused(tmp_path, rf"{mine}.* working on {out}, which is in {tmp_path};")
        assert refused(below, rf"{mine}.* working on {out}, which is above {below};")
        assert free(beside)
        assert refused(out, "Another run")
    assert free(out)
    assert free(tmp_path)
    assert free(below)


def delete(note: Path) -> None:
    note.unlink()


def rename(note: Path) -> None:
    note.rename(note.with_suffix(".old"))


def write_over(note: Path) -> None:
    note.write_text("\x1b[31mnonsense")


def replace(note: Path) -> None:
    note.with_suffix(".new").write_text("1")
    note.with_suffix(".new").replace(note)


def put_a_folder_there(note: Path) -> None:
    note.unlink()
    note.mkdir()


def put_a_pipe_there(note: Path) -> None:
    note.unlink()
    os.mkfifo(note)


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX")
@pytest.mark.parametrize(
    "attack", [delete, rename, write_over, replace, put_a_folder_there, put_a_pipe_there]
)
def test_nothing_that_is_done_to_files_opens_the_lock(
    tmp_path: Path, attack: Callable[[Path], None]
) -> None:
    with locked(tmp_path):
        attack(tmp_path / LOCK_NAME)
        assert refused(tmp_path, r"Another run \(process (unknown|1)\) is working")
    assert free(tmp_path)


def test_the_lock_leaves_nothing_behind(tmp_path: Path) -> None:
    assert free(tmp_path)
    assert sys.platform == "win32" or not list(tmp_path.iterdir())


def test_a_link_is_the_folder_that_it_names(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "out")
    with locked(tmp_path / "out"):
        assert refused(tmp_path / "link", "Another run")


def test_the_lock_falls_with_its_process(tmp_path: Path) -> None:
    holder = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE
    )
    with holder:
        assert holder.stdout
        assert holder.stdout.readline() == b"held\n"
        assert refused(tmp_path, f"process {holder.pid}")
        holder.send_signal(signal.SIGKILL)
    assert free(tmp_path)
