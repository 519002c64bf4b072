"""``meshlab-lowrank holes MESH``: the table of boundary loops."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from meshlab_lowrank.cli import console
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.isolation.pool import run_isolated
from meshlab_lowrank.mesh_files import check_readable
from meshlab_lowrank.report.hole_map import check_picture

_FUNCTION = "meshlab_lowrank.folders.tasks:holes"
_DIGITS = 9  # of a place at most; else a hundredth of the hole
_COLUMNS = (
    *("id", "edges", "perimeter", "diameter", "centre", "normal", "component", "vertex", "shape"),
)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "holes",
        help="list the boundary loops of a mesh",
        description="List the boundary loops of a mesh, and say of each whether it can be filled.",
        **guide(
            ["holes scan.ply", "holes scan.ply --json"],
            done="the loops were listed",
            page="docs/filters.md",
        ),
    )
    parser.add_argument("mesh", type=Path, metavar="MESH", help="mesh file")
    parser.add_argument("--json", action="store_true", help="write one JSON document")
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="FILE",
        help="write one .png or .jpg with the holes numbered",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure and show the loops; see `meshlab_lowrank.cli.main` for the exit code."""
    check_readable(args.mesh)
    job = {"function": _FUNCTION, "source": str(args.mesh.absolute())}
    if args.picture:
        check_picture(args.picture)
        job["picture"] = str(args.picture.absolute())
    report = run_isolated(job)
    rows, size = report["holes"], {name: report[name] for name in ("vertices", "faces")}
    if args.json:
        console.say_json({"mesh": str(args.mesh), **size, "notes": report["notes"], "holes": rows})
        return 0
    for note in report["notes"]:
        console.tell(note)
    console.say(
        f"{args.mesh.name}: {size['vertices']} vertices, {size['faces']} faces, "
        f"{len(rows)} boundary loops"
    )
    if rows:
        console.say_table(_COLUMNS, map(_cells, rows))
    for row in rows:
        if row["reason"]:
            console.say(f"Hole {row['id']}: {row['reason']}")
    return 0


def _cells(row: dict[str, Any]) -> list[object]:
    """Give a row of the table; the reasons would leave no room for the rest."""
    digits = 2 - math.floor(math.log10(row["diameter"])) if row["diameter"] else _DIGITS
    place = " ".join(f"{value:.{min(max(digits, 0), _DIGITS)}f}" for value in row["centre"])
    normal = " ".join(f"{value + 0.0:.2f}" for value in row["normal"])
    facts = (row[name] for name in ("id", "boundary_edges", "perimeter", "diameter"))
    return [*facts, place, normal, row["component"], row["vertex"], row["shape"]]
