"""A folder for MeshLab to read from that holds a mesh file and what it may open beside it.

Mesh files name others: material libraries, textures, buffers. MeshLab opens whatever they name, a
pipe or a device too, and writes textures under these names. So it reads from a folder of its own,
with links to what was checked, and where names lead elsewhere from a copy with other names.
"""

from __future__ import annotations

import contextlib
import filecmp
import hashlib
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from meshlab_lowrank.mesh_files.names import as_path, find_image, safe_name
from meshlab_lowrank.scratch import scratch_folder

LEFT_OUT = "left_out_"  # begins names of textures that aren't there: the others keep their place
_NO_PLAIN_CHARACTER = re.compile(r"[^\w.-]", re.ASCII)  # formats write others in ways of their own
_LONGEST_STEM = 100


@dataclass
class Stage:
    """What MeshLab reads instead of a mesh file.

    Attributes
    ----------
    source : Path
        The mesh file.
    folder : Path
        An empty one.
    target : Path or None
        The mesh that will be made of it: nothing that lies beside is to be overwritten.
    textures : dict of str to Path
        Images by the names that MeshLab finds them under.
    images : dict of str to bytes
        Images that stand in the source itself, by the names that were chosen for them.
    materials : dict of str to str
        Text of the material libraries by their names in the source.
    notes : list of str
    verbatim : bool
        Whether the source names everything as it will be named, so that it may be copied.
    """

    source: Path
    folder: Path
    target: Path | None = None
    textures: dict[str, Path] = field(default_factory=dict)
    images: dict[str, bytes] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    verbatim: bool = True
    _left_out: int = 0

    @property
    def path(self) -> Path:
        """Where MeshLab finds the mesh."""
        return self.folder / plain_name(self.source.name)

    def link(self, source: Path, name: str) -> None:
        """Let MeshLab find a file under a name."""
        place = self.folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        try:
            place.symlink_to(source.resolve())
        except FileExistsError:
            return
        except (OSError, NotImplementedError):  # a file system or user without links
            shutil.copyfile(source, place)

    def link_source(self) -> None:
        """Let MeshLab find the mesh as it stands."""
        self.link(self.source, self.path.name)

    def embedded(self, image: bytes, number: int, suffix: str) -> str:
        """Lay an image that stands in the source beside it, and give the name that it got."""
        stem = plain_name((self.target or self.source).name).rpartition(".")[0]
        wanted = f"{_NO_PLAIN_CHARACTER.sub('_', stem)[:_LONGEST_STEM]}_texture{number}{suffix}"
        place = self.folder / "image"
        place.write_bytes(image)
        taken = (self.folder / wanted).exists()
        chosen = _by_content(wanted, place) if taken else self._free_name(wanted, place)
        place.replace(self.folder / chosen)
        self.images[chosen] = image
        return chosen

    def left_out(self) -> str:
        """Give a name for a texture that isn't there, so that the others keep their place."""
        self._left_out += 1
        self.verbatim = False
        return f"{LEFT_OUT}{self._left_out}.png"

    def texture(self, name: str) -> str:
        """Check a texture that the source names, and give the name that MeshLab shall see."""
        image = find_image(self.source, name)
        wanted = safe_name(name)
        if image is None:
            if wanted:
                return wanted
            self.notes.append(
                f"The texture {name} is left out, since it is no image that lies below the "
                "folder of the mesh."
            )
            return self.left_out()
        if not wanted:
            root = self.source.absolute().parent.resolve()
            wanted = safe_name(image.relative_to(root).as_posix()) or f"texture{image.suffix}"
        chosen = self._free_name(wanted, image)
        if chosen not in self.textures:
            self.textures[chosen] = image
            self.link(image, chosen)
        self.verbatim &= chosen == as_path(name)
        return chosen

    def is_free_for(self, name: str, text: str) -> bool:
        """Whether a text can lie beside the output under a name without changing what is there."""
        if self.target is None or name == f"{plain_name(self.target.name)}.mtl":
            return True
        place = self.folder / "text"
        place.write_text(text, encoding="utf-8", errors="surrogateescape")
        return is_free(self.target.parent / name, place)

    def _free_name(self, wanted: str, image: Path) -> str:
        """Give a texture another name where a different file has this one."""
        if self._is_free(wanted, image):
            return wanted
        return _by_content(wanted, image)

    def _is_free(self, wanted: str, image: Path) -> bool:
        if wanted in self.textures:
            return self.textures[wanted] == image
        return self.target is None or is_free(self.target.parent / wanted, image)


def _by_content(wanted: str, image: Path) -> str:
    path = PurePosixPath(wanted)
    digest = hashlib.sha256(image.read_bytes()).hexdigest()
    return path.with_name(f"{path.stem}_{digest[:12]}{path.suffix}").as_posix()


def is_free(place: Path, source: Path) -> bool:
    """Whether a file can be put in a place without changing what is there."""
    if place.is_symlink() or place.exists():
        return place.is_file() and filecmp.cmp(place, source, shallow=False)
    return True


def plain_name(name: str) -> str:
    """Give a name that MeshLab can open: it takes text only."""
    if safe_name(name):
        return name
    suffix = PurePosixPath(name).suffix
    stem = "".join(char if char.isascii() and char.isalnum() else "_" for char in name)
    return f"{stem[:100]}_{hashlib.sha256(name.encode(errors='replace')).hexdigest()[:8]}{suffix}"


@contextlib.contextmanager
def staged(source: Path, scratch: Path | None, target: Path | None) -> Iterator[Stage]:
    """Make the folder from which MeshLab reads a mesh file, for as long as it takes.

    Parameters
    ----------
    source : Path
    scratch : Path or None
        Folder to make it in; None: that of temporary files.
    target : Path or None
        The mesh that will be made of it.

    Yields
    ------
    Stage
        Empty.
    """
    with scratch_folder(scratch) as folder:
        yield Stage(source, folder, target)
