"""Whole folders of scans: one process a file, a manifest, nothing lost."""

from meshlab_lowrank.folders.file_run import FileRecord
from meshlab_lowrank.folders.run import BatchEvent, BatchResult, batch

__all__ = ["BatchEvent", "BatchResult", "FileRecord", "batch"]
