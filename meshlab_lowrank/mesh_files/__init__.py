"""Reading and writing mesh files through pymeshlab, with the checks that its loaders leave out."""

from meshlab_lowrank.mesh_files.formats import READ_SUFFIXES, WRITE_SUFFIXES
from meshlab_lowrank.mesh_files.hashing import sha256_of
from meshlab_lowrank.mesh_files.marks import (
    INPAINT_ERROR,
    INPAINT_TRUST,
    INPAINTED,
    Marks,
    marks_path,
    read_marks,
)
from meshlab_lowrank.mesh_files.mesh_marks import marks_of, put_marks, take_marks
from meshlab_lowrank.mesh_files.meshlab_output import captured_output, meshlab_reason
from meshlab_lowrank.mesh_files.names import kind_of
from meshlab_lowrank.mesh_files.reading import LoadedMesh, check_readable, load_mesh
from meshlab_lowrank.mesh_files.staging import is_free, plain_name
from meshlab_lowrank.mesh_files.writing import check_writable, copy_mesh, save_mesh

__all__ = [
    "INPAINTED",
    "INPAINT_ERROR",
    "INPAINT_TRUST",
    "READ_SUFFIXES",
    "WRITE_SUFFIXES",
    "LoadedMesh",
    "Marks",
    "captured_output",
    "check_readable",
    "check_writable",
    "copy_mesh",
    "is_free",
    "kind_of",
    "load_mesh",
    "marks_of",
    "marks_path",
    "meshlab_reason",
    "plain_name",
    "put_marks",
    "read_marks",
    "save_mesh",
    "sha256_of",
    "take_marks",
]
