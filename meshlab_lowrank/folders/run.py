"""The batch run: every mesh of a folder, each in a process of its own, resumable."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import datetime, timezone
from itertools import compress
from operator import not_
from pathlib import Path
from typing import Any

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders import plan
from meshlab_lowrank.folders.command import command_line
from meshlab_lowrank.folders.dispatch import BatchCallback, Dispatch
from meshlab_lowrank.folders.file_run import FileJob, FileRecord, run_file
from meshlab_lowrank.folders.hole_pictures import SWITCHED_OFF, Album, draw_holes
from meshlab_lowrank.folders.lock import locked
from meshlab_lowrank.folders.manifest import Manifest
from meshlab_lowrank.folders.ranking import worst_holes
from meshlab_lowrank.folders.settings import check_chain, digest, parameter_texts, refuse_places
from meshlab_lowrank.folders.summary_page import PAGE_NAME, RunFacts, summary_page
from meshlab_lowrank.isolation.memory import available_memory, estimated_memory
from meshlab_lowrank.isolation.pool import MOST_SECONDS, WorkerPool
from meshlab_lowrank.mesh_files import WRITE_SUFFIXES
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.plain_text import gist_line
from meshlab_lowrank.scratch import written_whole
from meshlab_lowrank.threads import available_cores
from meshlab_lowrank.version import __version__


@dataclass(frozen=True)
class BatchResult:
    """What became of a folder.

    Attributes
    ----------
    records : tuple of FileRecord
        One a file, in the order of the names.
    seconds : float
        Wall time.
    problems : tuple of str
        What could not be written beside the outputs, and what to do.
    notes : tuple of str
        What was wrong with the manifest of earlier runs, and which formats become others.
    """

    records: tuple[FileRecord, ...]
    seconds: float
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Tell the gist on a line."""
        counts = ", ".join(f"{count} {status}" for status, count in self.counts.items())
        gist = f"{len(self.records)} files in {self.seconds:.1f} s"
        return gist_line("BatchResult", gist, counts, *self.problems)

    @property
    def counts(self) -> dict[str, int]:
        """Number of files by status."""
        statuses = [record.status for record in self.records]
        return {status: statuses.count(status) for status in dict.fromkeys(statuses)}

    @property
    def complete(self) -> bool:
        """Whether every hole that was to be filled is filled, in every file, and all is noted."""
        return not self.problems and all(record.complete for record in self.records)


def batch(
    in_dir: str | Path,
    out_dir: str | Path,
    *,
    parameters: InpaintParameters | Mapping[str, object] | None = None,
    chain: str | Path | None = None,
    repair: bool = False,
    suffix: str | None = None,
    workers: int | None = None,
    timeout: float | None = None,
    executor: Executor | None = None,
    pictures: bool = True,
    progress: BatchCallback | None = None,
) -> BatchResult:
    """Inpaint every mesh of a folder; run again, do only what is missing or changed.

    Parameters
    ----------
    in_dir, out_dir : str or Path
        The outputs keep the tree and the names of the inputs. ``manifest.jsonl`` in ``out_dir``
        holds a record of each file.
    parameters : InpaintParameters, mapping or None
        Of the filter ``meshing_inpaint_lowrank``; ``refineedgelen`` also as text like ``"2%"``.
        ``{"selected": True}`` fills only holes at faces that are selected in the files.
    chain : str, Path or None
        A chain to run instead of the filter (see `meshlab_lowrank.chains`).
    repair : bool
        Repair each mesh first: merge doubled vertices, remove doubled faces, faces without area
        and those at edges with more than two, and turn faces alike. The measured surface is no
        longer untouched then; the notes of the record say what was changed.
    suffix : str or None
        Format of the outputs, ``".ply"`` say; None: that of the inputs, and PLY where MeshLab only
        reads it.
    workers : int or None
        Most files at a time, with one thread each; None: as many as cores, and where the memory
        holds fewer files of a size, these share the cores. A file starts when the memory that it
        may take is free, or when no other is being worked on.
    timeout : float or None
        Seconds after which a file is given up.
    executor : concurrent.futures.Executor or None
        Runs the files, on other machines if it can; they must see both folders under the same
        paths. None: processes on this machine.
    pictures : bool
        Whether the page shows the worst holes, if PyVista is installed.
    progress : callable or None
        Called with a `BatchEvent` whenever something happens, from several threads.

    Returns
    -------
    BatchResult

    Raises
    ------
    InvalidParameterError
        If the call is wrong: folders, parameters, chain, format.
    LowrankError
        If another run works on ``out_dir`` or the disk is too full.

    See Also
    --------
    inpaint : For arrays.

    Notes
    -----
    Meshes are read and worked on in processes of their own: working folder, output and MeshLab's
    defaults of this process stay alone.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pymeshlab
    >>> import meshlab_lowrank
    >>> folder = Path(tempfile.mkdtemp())
    >>> (folder / "scans").mkdir()
    >>> ms = pymeshlab.MeshSet(verbose=False)
    >>> ms.create_sphere(subdiv=3)
    >>> ms.compute_selection_by_condition_per_face(condselect="z0 > 0.9")
    >>> ms.meshing_remove_selected_faces()
    >>> ms.save_current_mesh(str(folder / "scans" / "sphere.ply"))
    >>> result = meshlab_lowrank.batch(
    ...     folder / "scans", folder / "filled", parameters={"detail": "none"}, pictures=False
    ... )
    >>> [(record.file, record.status) for record in result.records]
    [('sphere.ply', 'done')]
    >>> (folder / "filled" / "sphere.ply").exists()
    True
    """
    started = time.monotonic()
    source, target = Path(in_dir).absolute(), Path(out_dir).absolute()
    _check_options(suffix, workers, timeout)
    texts = parameter_texts(parameters)
    refuse_places(texts)
    files = plan.find_meshes(source, without=target)
    outputs = plan.output_names(files, suffix)
    plan.refuse_overwriting([source / f for f in files], [target / f for f in outputs])
    plan.prepare_output(target)
    memory = available_memory()
    manifest = Manifest(target)
    manifest.check()
    with locked(target), contextlib.closing(WorkerPool(memory)) as pool:
        script = check_chain(chain, pool) if chain else ""
        sizes = [plan.file_size(source / file) for file in files]
        existing = [(target / output).exists() for output in outputs]
        plan.remove_leftovers(target, certain=True)
        plan.check_space(target, sum(compress(sizes, map(not_, existing))))
        count = workers or min(available_cores(), len(files))
        needs = list(map(estimated_memory, files, sizes))
        note = manifest.set_aside()
        last = manifest.last_records()
        jobs = [
            FileJob(
                name=file.as_posix(),
                source=str(source / file),
                target=str(target / output),
                output=output.as_posix(),
                parameters=texts,
                chain=script,
                repair=repair,
                note=plan.note_on_format([file], suffix),
                settings=digest(texts, script, suffix, repair=repair),
                timeout=timeout,
                memory=0 if executor else memory,
                need=0 if executor else need,
                threads=1 if executor or workers else plan.thread_count(count, memory, need),
                previous=last.get(file.as_posix()),
            )
            for file, output, need in zip(files, outputs, needs, strict=True)
        ]
        run = Dispatch(len(jobs), manifest, progress)
        if executor:
            run.go(executor, run_file, jobs)
        else:
            run.go_here(count, pool, jobs)
        plan.remove_leftovers(target, certain=False)  # of workers elsewhere that were lost
        records = tuple(run.records[job.name] for job in jobs)
        known = _over_all_runs(last, records)
        holes = worst_holes(known)
        drawn = draw_holes(holes, source, target, pool) if pictures else Album(missing=SWITCHED_OFF)
        seconds = time.monotonic() - started
        facts = RunFacts(
            source=str(source),
            target=str(target),
            finished=f"{datetime.now(timezone.utc):%Y-%m-%d %H:%M} UTC",
            seconds=seconds,
            version=__version__,
            parameters=texts,
            command=command_line(
                in_dir,
                out_dir,
                texts,
                chain=chain,
                repair=repair,
                suffix=suffix,
                workers=workers,
                timeout=timeout,
                pictures=pictures,
            ),
            worked_on=sum(record.status != "skipped" for record in records),
        )
        try:
            _write_page(target / PAGE_NAME, summary_page(known, facts, drawn))
        except OSError as error:
            run.problems.append(f"{target / PAGE_NAME} can't be written ({error.strerror}).")
    notes = filter(None, (note, plan.note_on_format(files, suffix)))
    return BatchResult(records, seconds, tuple(run.problems), tuple(notes))


def _over_all_runs(
    last: Mapping[str, Mapping[str, Any]], records: Iterable[FileRecord]
) -> list[FileRecord]:
    """Give the record of each file that counts: of this run, or if it was skipped the last."""
    known = {name: FileRecord(**record) for name, record in last.items()}
    known |= {record.file: record for record in records if record.status != "skipped"}
    return [known[name] for name in sorted(known)]


def _check_options(suffix: str | None, workers: int | None, timeout: float | None) -> None:
    if suffix is not None and suffix not in WRITE_SUFFIXES:
        msg = f"MeshLab can't write {suffix}; use one of {', '.join(WRITE_SUFFIXES)}."
        raise InvalidParameterError(msg)
    if workers is not None and workers < 1:
        msg = f"The number of workers is {workers}; give at least 1."
        raise InvalidParameterError(msg)
    if timeout is not None and not 0 < timeout <= MOST_SECONDS:
        msg = f"The timeout is {timeout} s; give more than 0 and at most {MOST_SECONDS:g}."
        raise InvalidParameterError(msg)


def _write_page(path: Path, html: str) -> None:
    with written_whole(path) as place:
        place.write_text(html, encoding="utf-8", errors="backslashreplace")
