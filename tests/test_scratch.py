"""Folders for what is in the making: gone at the end, swept away if their process was killed."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path
from typing import NoReturn

import pytest

from meshlab_lowrank import scratch
from meshlab_lowrank.scratch import SCRATCH_PREFIX, scratch_folder, sweep, written_whole

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX")


def dead_folder(parent: Path) -> Path:
    """What a killed process left."""
    folder = parent / f"{SCRATCH_PREFIX}dead"
    folder.mkdir()
    (folder / "half.ply").write_text("ply")
    return folder


def unsupported(*_: object, **__: object) -> NoReturn:
    raise OSError(95, "Operation not supported")


@pytest.mark.parametrize("error", [None, KeyboardInterrupt, OSError])
def test_a_scratch_folder_goes_however_its_work_ends(
    tmp_path: Path, error: type[BaseException] | None
) -> None:
    try:
        with scratch_folder(tmp_path) as folder:
            (folder / "a").write_text("")
            if error:
                raise error
    except (KeyboardInterrupt, OSError):
        assert error
    assert not list(tmp_path.iterdir())


@POSIX
def test_what_is_dead_is_swept_and_what_is_in_use_is_not(tmp_path: Path) -> None:
    dead = dead_folder(tmp_path)
    (tmp_path / "mine").mkdir()
    link = tmp_path / f"{SCRATCH_PREFIX}link"
    link.symlink_to(tmp_path / "mine")
    with scratch_folder(tmp_path) as folder:
        sweep(tmp_path)
        assert folder.is_dir()
        assert not dead.exists()
    assert {path.name for path in tmp_path.iterdir()} == {"mine", link.name}


def test_without_locks_only_what_is_certain_is_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scratch, "lock_folder", unsupported)
    dead = dead_folder(tmp_path)
    with scratch_folder(tmp_path) as folder:
        sweep(tmp_path)
        assert folder.is_dir()
    assert dead.exists()
    assert not folder.exists()
    sweep(tmp_path, certain=True)
    assert not dead.exists()


@POSIX
def test_a_folder_that_is_swept_before_it_is_locked_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lock_folder, names = scratch.lock_folder, []

    def late(folder: Path) -> int | None:
        names.append(folder)
        if len(names) == 1:
            folder.rmdir()
        return lock_folder(folder)

    monkeypatch.setattr(scratch, "lock_folder", late)
    with scratch_folder(tmp_path) as folder:
        assert folder.is_dir()
    assert len(set(names)) == 2


def test_an_interrupt_while_a_folder_is_removed_leaves_it_to_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> NoReturn:
        raise KeyboardInterrupt

    with (
        monkeypatch.context() as patched,
        pytest.raises(KeyboardInterrupt),
        scratch_folder(tmp_path),
    ):
        patched.setattr(scratch.shutil, "rmtree", interrupted)
    assert list(tmp_path.iterdir())
    scratch.remove_all()
    assert not list(tmp_path.iterdir())


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "report.html"
    target.write_text("old")

    def fill_the_disk() -> None:
        with written_whole(target) as place:
            place.write_text("ha")
            raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left") as caught:
        fill_the_disk()
    assert caught.value.filename == str(target)
    assert target.read_text(encoding="utf-8") == "old"
    dead_folder(tmp_path)
    with written_whole(target) as place:
        place.write_text("new")
        assert target.read_text(encoding="utf-8") == "old"
    assert target.read_text(encoding="utf-8") == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@POSIX
def test_what_is_no_ordinary_file_is_not_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "a.csv", tmp_path / "b.csv"
    link.symlink_to(target)
    with written_whole(link) as place:
        place.write_text("text")
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == "text"
    with written_whole(Path(os.devnull)) as place:
        place.write_text("text")
    assert stat.S_ISCHR(Path(os.devnull).stat().st_mode)
