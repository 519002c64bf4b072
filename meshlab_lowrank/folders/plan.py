"""Before a batch run: which files, to where, is there room."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.mesh_files import READ_SUFFIXES, WRITE_SUFFIXES
from meshlab_lowrank.scratch import SCRATCH_PREFIX, sweep
from meshlab_lowrank.threads import available_cores

_OUTPUT_PER_INPUT = 3  # single precision becomes double, and there are new faces
INSTEAD = ".ply"  # keeps positions to the bit, colours, textures and marks


def find_meshes(folder: Path, *, without: Path) -> list[Path]:
    """List the mesh files of a folder and of those below it.

    Parameters
    ----------
    folder : Path
    without : Path
        A folder that is left out, as hidden ones are.

    Returns
    -------
    list of Path
        Relative to ``folder``, sorted.

    Raises
    ------
    InvalidParameterError
        If there is no such folder or no mesh in it.
    """
    if not folder.is_dir():
        msg = f"There is no folder {folder}; check the name."
        raise InvalidParameterError(msg)
    left_out = os.path.realpath(without)
    found = []
    for place, folders, names in os.walk(folder):
        here = Path(place)
        folders[:] = [
            name
            for name in folders
            if not name.startswith(".") and os.path.realpath(here / name) != left_out
        ]
        found += [
            (here / name).relative_to(folder)
            for name in names
            if not name.startswith(".") and Path(name).suffix.lower() in READ_SUFFIXES
        ]
    if not found:
        msg = f"There is no mesh in {folder}; give a folder with {', '.join(READ_SUFFIXES)} files."
        raise InvalidParameterError(msg)
    return sorted(found)


def output_names(files: Sequence[Path], suffix: str | None) -> list[Path]:
    """Name the outputs: as the inputs, or with another suffix, that of PLY where MeshLab needs one.

    Where two inputs would get the same output, the old suffix stays in the name.

    Parameters
    ----------
    files : sequence of Path
    suffix : str or None
        With its dot; None keeps that of each input that MeshLab can write.

    Returns
    -------
    list of Path

    Raises
    ------
    InvalidParameterError
        If two inputs would still get the same output.
    """
    suffixes = [suffix or (INSTEAD if is_read_only(file) else file.suffix) for file in files]
    plain = [file.with_suffix(new) for file, new in zip(files, suffixes, strict=True)]
    count = Counter(plain)
    names = [
        name if count[name] == 1 or file.suffix == new else file.with_name(file.name + new)
        for file, name, new in zip(files, plain, suffixes, strict=True)
    ]
    name, uses = Counter(names).most_common(1)[0]
    if uses > 1:
        msg = f"{uses} inputs would be written to {name}; rename one or keep the formats."
        raise InvalidParameterError(msg)
    return names


def is_read_only(file: Path) -> bool:
    """Whether MeshLab reads the format of a file but can't write it."""
    return file.suffix.lower() not in WRITE_SUFFIXES


def note_on_format(files: Sequence[Path], suffix: str | None) -> str:
    """Say which formats become another without being asked to; nothing if none does."""
    suffixes = sorted({file.suffix.lower() for file in files if is_read_only(file)})
    if suffix or not suffixes:
        return ""
    return (
        f"MeshLab can't write {' and '.join(suffixes)}, so the output is {INSTEAD[1:].upper()}; "
        "--format chooses another."
    )


def file_size(path: Path) -> int:
    """Size in bytes; 0 if the file is out of reach."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def refuse_overwriting(sources: Sequence[Path], targets: Sequence[Path]) -> None:
    """Refuse outputs that are inputs.

    Raises
    ------
    InvalidParameterError
    """
    inputs = {os.path.realpath(source) for source in sources}  # resolve() fails on circles
    for target in targets:
        if os.path.realpath(target) in inputs:
            msg = f"{target} is an input and would be overwritten; choose another output folder."
            raise InvalidParameterError(msg)


def prepare_output(folder: Path) -> None:
    """Make the folder of the outputs and see that it can be written to.

    Raises
    ------
    InvalidParameterError
        If it can't.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        msg = f"{folder} can't be written to ({error.strerror}); choose another output folder."
        raise InvalidParameterError(msg) from error


def remove_leftovers(folder: Path, *, certain: bool) -> None:
    """Delete what killed runs left in the making; only under the lock.

    Parameters
    ----------
    folder : Path
    certain : bool
        Whether nobody can be at work there.
    """
    for place in {path.parent for path in folder.rglob(f"{SCRATCH_PREFIX}*")}:
        sweep(place, certain=certain)


def check_space(folder: Path, input_bytes: int) -> None:
    """Refuse to start when the outputs would probably not fit.

    Parameters
    ----------
    folder : Path
    input_bytes : int
        Size of the inputs that have no output yet.

    Raises
    ------
    LowrankError
    """
    needed, free = _OUTPUT_PER_INPUT * input_bytes, shutil.disk_usage(folder).free
    if free < needed:
        msg = (
            f"{folder} has {free / 1e6:.0f} MB free, the outputs may take {needed / 1e6:.0f} MB; "
            "make room or choose another output folder."
        )
        raise LowrankError(msg)


def thread_count(workers: int, memory: int, need: int) -> int:
    """Threads for a file: the cores, shared among as many files of its size as fit at a time.

    Parameters
    ----------
    workers : int
        Most files at a time.
    memory : int
        Available bytes; 0 if not known.
    need : int
        Bytes that the file may take.

    Returns
    -------
    int
        At least 1.
    """
    files = min(workers, memory // need) if memory else workers
    return max(1, available_cores() // max(1, files))
