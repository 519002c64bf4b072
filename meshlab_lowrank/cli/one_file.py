"""What the commands that turn one mesh into another have in common."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from meshlab_lowrank.cli import console
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.folders.file_run import FileJob, FileRecord, run_file
from meshlab_lowrank.folders.ranking import flaws
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.mesh_files import check_readable, check_writable
from meshlab_lowrank.scratch import sweep

_COLUMNS = (
    *("id", "edges", "diameter", "status", "faces", "flaws", "rim°", "trust"),
    *("median error", "largest error", "reason"),
)


def check_paths(source: Path, target: Path) -> None:
    """Refuse a source that can't be read, a target that can't be written or is the source.

    Raises
    ------
    InvalidParameterError
    """
    check_readable(source)
    check_writable(target)
    if os.path.realpath(source) == os.path.realpath(target):
        msg = f"{target} is the input itself; give the output another name."
        raise InvalidParameterError(msg)


def process(
    source: Path,
    target: Path,
    pool: WorkerPool,
    *,
    parameters: dict[str, str] | None = None,
    chain: str = "",
    repair: bool = False,
    picture: Path | None = None,
    quiet: bool = False,
) -> FileRecord:
    """Fill the holes of one file, or run a chain on it, and show the progress unless quiet."""
    job = FileJob(
        name=str(source),
        source=str(source.absolute()),
        target=str(target.absolute()),
        output=str(target),
        parameters=parameters or {},
        chain=chain,
        repair=repair,
        picture=str(picture.absolute()) if picture else "",
    )
    sweep(target.absolute().parent)
    with console.file_progress(source.name, quiet=quiet) as show:
        return run_file(job, pool=pool, on_event=show)


def show_record(record: FileRecord, *, as_json: bool, quiet: bool = False) -> int:
    """Show what became of a file.

    Parameters
    ----------
    record : FileRecord
    as_json : bool
    quiet : bool
        Leave the table of holes out.

    Returns
    -------
    int
        The exit code.
    """
    code = 0 if record.complete else 1
    if as_json:
        error = {} if record.output else {"error": record.reason}
        console.say_json({**record.as_dict(), **error})
    if not record.output:
        name = Path(record.file).name
        console.tell(record.reason if name in record.reason else f"{name}: {record.reason}")
        return code
    if as_json:
        return code
    for note in record.notes:
        console.tell(note)
    if record.holes:
        if not quiet:
            console.say_table(_COLUMNS, map(_row, record.holes))
        filled = sum(hole["status"] == "filled" for hole in record.holes)
        console.say(f"{filled} of {len(record.holes)} boundary loops filled.")
    console.say(f"{record.status}: {record.output} written after {record.seconds:.1f} s")
    if record.reason:
        console.say(record.reason)
    return code


def _error(hole: dict[str, Any], name: str) -> str:
    if not hole["new_vertices"]:
        return "-"
    return "?" if hole[name] is None else f"{hole[name]:.3g}"


def _row(hole: dict[str, Any]) -> list[object]:
    """Give what stands of a hole in the table."""
    angle, trust = hole["rim_angle"], hole["trust"]
    return [
        hole["id"],
        hole["boundary_edges"],
        hole["diameter"],
        hole["status"],
        hole["new_faces"],
        flaws(hole),
        "-" if angle is None else f"{angle:.0f}",
        "?" if trust is None else f"{trust:.2f}",
        *(_error(hole, name) for name in ("median_error", "largest_error")),
        hole["reason"],
    ]
