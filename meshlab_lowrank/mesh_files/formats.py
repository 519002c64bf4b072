"""The formats of mesh files."""

from __future__ import annotations

from pathlib import Path

from meshlab_lowrank.errors import InvalidParameterError

WRITE_SUFFIXES = (".3ds", ".3mf", ".ctm", ".dae", ".obj", ".off", ".ply", ".stl", ".wrl", ".x3d")
READ_SUFFIXES = (*WRITE_SUFFIXES, ".fbx", ".glb", ".gltf", ".vmi", ".x3dv")


def check_suffix(path: Path, known: tuple[str, ...], verb: str) -> None:
    """Refuse a path whose format is not known."""
    if path.suffix.lower() not in known:
        formats = ", ".join(known)
        msg = (
            f"MeshLab can't {verb} {path.suffix or 'a file without suffix'}; use one of {formats}."
        )
        raise InvalidParameterError(msg)
