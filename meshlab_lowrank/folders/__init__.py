"""Whole folders of scans: one process a file, a manifest, nothing lost."""

from meshlab_lowrank.folders.dispatch import BatchEvent
from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.run import BatchResult, batch

__all__ = ["BatchEvent", "BatchResult", "FileRecord", "batch"]
