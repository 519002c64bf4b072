"""``meshlab-lowrank holes MESH``: the table of boundary loops."""

from __future__ import annotations

import argparse
from pathlib import Path

from meshlab_lowrank.cli import console
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.isolation.pool import run_isolated
from meshlab_lowrank.mesh_files import check_readable

_FUNCTION = "meshlab_lowrank.folders.tasks:holes"


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
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure and show the loops; see `meshlab_lowrank.cli.main` for the exit code."""
    check_readable(args.mesh)
    report = run_isolated(
        {"function": "meshlab_lowrank.folders.tasks:holes", "source": str(args.mesh.absolute())}
    )
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
        columns = [name.replace("_", " ") for name in rows[0]]
        console.say_table(columns, (list(row.values()) for row in rows))
    return 0
