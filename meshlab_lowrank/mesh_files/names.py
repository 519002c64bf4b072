"""Names from inside a mesh file: what they stand for, and under which name it may go along."""

from __future__ import annotations

import stat
from pathlib import Path, PurePosixPath
from typing import NoReturn

from meshlab_lowrank.errors import InvalidMeshError
from meshlab_lowrank.mesh_files.formats import WRITE_SUFFIXES
from meshlab_lowrank.plain_text import plain

IMAGE_SUFFIXES = frozenset({".bmp", ".gif", ".jpeg", ".jpg", ".png", ".tga", ".tif", ".tiff"})
_IMAGE_STARTS = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"BM", b"II*\0", b"MM\0*")  # TGA has none
_OF_OUTPUTS = (*WRITE_SUFFIXES, ".html", ".jsonl")  # so that no folder is called
_LONGEST = 200  # characters; file systems have 255 bytes
_KINDS = {
    stat.S_IFBLK: "a device",
    stat.S_IFCHR: "a device",
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def kind_of(path: Path) -> str:
    """Tell what a path is if it is no regular file, with links followed; empty if it is one.

    Raises
    ------
    OSError
        If it is out of reach.
    """
    return _KINDS.get(stat.S_IFMT(path.stat().st_mode), "")


def find_companion(mesh: Path, name: str) -> Path | None:
    """Find the regular file that a name in a mesh file stands for.

    Parameters
    ----------
    mesh : Path
    name : str
        As it stands in the file.

    Returns
    -------
    Path or None
        Without links; None if there is no such file, it is hidden, or it lies outside the folder
        of the mesh and those below.

    Raises
    ------
    InvalidMeshError
        If the name stands for something that isn't a regular file: opening it could hang.
    """
    folder = mesh.absolute().parent
    wanted = name.strip().strip('"').replace("\\", "/")
    if not wanted:
        return None
    try:
        found, root = (folder / wanted).resolve(), folder.resolve()
        kind = kind_of(found)
    except (OSError, RuntimeError, ValueError):  # nothing there, links in a circle, a null byte
        return None
    if kind:
        msg = f"{mesh.name} names {name}, which is {kind} and no file; take the name out of it."
        raise InvalidMeshError(msg)
    if not found.is_relative_to(root):
        return None
    hidden = any(part.startswith(".") for part in found.relative_to(root).parts)
    return None if hidden else found


def find_image(mesh: Path, name: str) -> Path | None:
    """Find the image that a name in a mesh file stands for; see `find_companion`."""
    found = find_companion(mesh, name)
    if found is None or found.suffix.lower() not in IMAGE_SUFFIXES:
        return None
    try:
        with found.open("rb") as file:
            start = file.read(8)
    except OSError:
        return None
    known = start.startswith(_IMAGE_STARTS) or found.suffix.lower() == ".tga"
    return found if known else None


def refuse_name(mesh: Path, name: str) -> NoReturn:
    """Refuse a mesh file for a name in it that leads elsewhere."""
    msg = (
        f"{mesh.name} names {name}, which is not opened; only images and buffers that lie in the "
        "folder of the mesh or below are."
    )
    raise InvalidMeshError(msg)


def safe_name(name: str) -> str:
    """Give a name from a mesh file as that of an output below some folder.

    Parameters
    ----------
    name : str
        As it stands in the file.

    Returns
    -------
    str
        With forward slashes; empty if no output may have it: it leads out of the folder, is hidden,
        is not plain text, or could be in the way of the other outputs.
    """
    parts = PurePosixPath(name.replace("\\", "/")).parts
    *folders, _ = parts or [""]
    if not parts or len(name) > _LONGEST or not all(map(_is_safe, parts)):
        return ""
    if any(folder.lower().endswith(_OF_OUTPUTS) for folder in folders):
        return ""
    return "/".join(parts)


def as_path(name: str) -> str:
    """Give a name without the steps in it that lead nowhere, as in ``./a.png``."""
    return PurePosixPath(name).as_posix()


def _is_safe(part: str) -> bool:
    strange = part.startswith(".") or part.strip() != part or set(part) & set('/:*?"<>|')
    return not strange and plain(part) == part
