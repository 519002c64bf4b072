"""``meshlab-lowrank compare MESH``: our fill beside those of others."""

from __future__ import annotations

import argparse
import os
import shlex
from pathlib import Path

from meshlab_lowrank.cli import console
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.comparison.comparing import Comparison, compare
from meshlab_lowrank.comparison.fillers import FILLERS, usual_fillers
from meshlab_lowrank.comparison.gallery import draw_gallery
from meshlab_lowrank.comparison.report import html_report, versions
from meshlab_lowrank.comparison.strip import write_strip
from meshlab_lowrank.comparison.tables import (
    hole_name,
    not_installed,
    tables,
    verdicts,
    write_csv,
)
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.mesh_files import check_readable
from meshlab_lowrank.result import ProgressEvent
from meshlab_lowrank.scratch import written_whole

_PICTURES = (".png", ".jpg", ".jpeg")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "compare",
        help="compare hole fillers on a mesh",
        description="Fill the holes of a mesh by several fillers and compare what comes out.",
        **guide(
            [
                "compare scan.ply --html report.html",
                "compare scan.ply --truth whole.ply --fillers close-refine,lowrank",
                "compare whole.ply --radius 6 --holes 0 --csv figures.csv",
            ],
            done="every filler that was asked for filled something",
            page="docs/comparison.md",
            more=["fillers:", *(f"  {f.name:20} {f.explanation}" for f in FILLERS.values()), ""],
        ),
    )
    add = parser.add_argument
    add("mesh", type=Path, metavar="MESH", help="mesh with holes")
    add("--truth", type=Path, metavar="GT", help="the same surface without holes, in place")
    add(
        "--fillers",
        metavar="NAMES",
        help="fillers to run, with commas between (all but published ones)",
    )
    add(
        "--add",
        action="append",
        default=[],
        metavar="CHAIN",
        help="also run this .mlx filter script or Python file with chain(ms)",
    )
    add("--holes", type=int, default=4, metavar="COUNT", help="largest holes to compare (4)")
    add(
        "--places",
        type=int,
        metavar="COUNT",
        help="copies of each hole punched where the surface is known (3; 0 with --truth)",
    )
    add("--radius", type=float, metavar="EDGES", help="punch round holes of this radius instead")
    add("--closerim", action="store_true", help="take outer rims of sheets for holes too")
    add("--seed", type=int, default=0, help="seed of the punched places (0)")
    add("--timeout", type=float, default=600.0, metavar="SECONDS", help="limit of a run (600)")
    add("--html", type=Path, metavar="FILE", help="write one page with tables and pictures")
    add("--picture", type=Path, metavar="FILE", help="write one .png or .jpg with all fills")
    add("--csv", type=Path, metavar="FILE", help="write one line a hole and filler")
    add("--json", action="store_true", help="write one JSON document")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Compare and show; see `meshlab_lowrank.cli.main` for the exit code."""
    _check_files(args)
    names = args.fillers.split(",") if args.fillers else usual_fillers()
    with console.file_progress(args.mesh.name) as show:

        def progress(event: ProgressEvent) -> None:
            show({"stage": event.stage, "fraction": event.fraction})

        comparison = compare(
            args.mesh,
            fillers=[*names, *args.add],
            truth=args.truth,
            places=args.places,
            holes=args.holes,
            radius=args.radius,
            closerim=args.closerim,
            seed=args.seed,
            timeout=args.timeout,
            progress=progress,
        )
        missing = ""
        if args.html or args.picture:
            show({"stage": "drawing the pictures", "fraction": 1.0})
            gallery = draw_gallery(comparison)
            missing = gallery.missing
        if args.html:
            html = html_report(comparison, gallery, _command(args))
            with written_whole(args.html) as place:
                place.write_text(html, encoding="utf-8", errors="backslashreplace")
        if args.picture and not missing:
            write_strip(comparison, gallery, args.picture)
    if args.csv:
        write_csv(comparison, args.csv)
    for note in (*comparison.notes, *([missing] if missing else [])):
        console.tell(note)
    if args.json:
        console.say_json({**comparison.as_dict(), "versions": versions()})
    else:
        _show(comparison)
    undone = _undone(comparison, named=bool(args.fillers))
    for sentence in undone:
        console.tell(sentence)
    return 1 if undone or missing else 0


def _show(comparison: Comparison) -> None:
    for table in tables(comparison):
        console.say(table.caption)
        rows = (
            [cell + ("*" if (i, j) in table.best else "") for j, cell in enumerate(row)]
            for i, row in enumerate(table.rows)
        )
        console.say_table(table.columns, rows)
        console.say("")
    for hole in dict.fromkeys(case.hole for case in comparison.cases):
        for sentence in verdicts(comparison, hole):
            console.say(f"{hole_name(hole)}. {sentence}")
    for sentence in not_installed(comparison):
        console.say(sentence)


def _undone(comparison: Comparison, *, named: bool) -> list[str]:
    """Tell which fillers that were asked for filled nothing, and why."""
    sentences = []
    for filler in comparison.fillers:
        rows = [row for row in comparison.rows if row.filler == filler]
        if any(row.status == "filled" for row in rows):
            continue
        if named or rows[0].status != "not installed":
            sentences.append(f"{filler} filled nothing: {rows[0].status}, {rows[0].reason}")
    return sentences


def _check_files(args: argparse.Namespace) -> None:
    check_readable(args.mesh)
    if args.truth:
        check_readable(args.truth)
    if args.picture and args.picture.suffix.lower() not in _PICTURES:
        msg = f"{args.picture} can't be written: give a name that ends in {', '.join(_PICTURES)}."
        raise InvalidParameterError(msg)
    for target in (args.html, args.picture, args.csv):
        if target and not os.access(target.absolute().parent, os.W_OK):
            msg = f"{target} can't be written: there is no folder {target.parent} to write to."
            raise InvalidParameterError(msg)


def _command(args: argparse.Namespace) -> str:
    """Give the command line again, without what holds by default."""
    words = ["meshlab-lowrank", "compare", str(args.mesh)]
    for name in ("truth", "fillers", "places", "radius", "html", "picture", "csv"):
        if getattr(args, name) is not None:
            words += [f"--{name}", str(getattr(args, name))]
    for name, default in (("holes", 4), ("seed", 0), ("timeout", 600.0)):
        if getattr(args, name) != default:
            words += [f"--{name}", str(getattr(args, name))]
    words += [word for chain in args.add for word in ("--add", chain)]
    words += ["--closerim"] * args.closerim + ["--json"] * args.json
    return shlex.join(words)
