"""``meshlab-lowrank inpaint IN OUT``: fill the holes of one mesh."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from typing import get_args

from meshlab_lowrank.cli import one_file
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.filters.trust_showing import ShowTrust
from meshlab_lowrank.folders.settings import parameter_texts
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.parameters import Base, Continuity, Detail, Preset
from meshlab_lowrank.report.hole_map import check_picture

_NAMES = (
    "maxholesize",
    "minholesize",
    "maxholelength",
    "minholelength",
    "selected",
    "closerim",
    "preset",
    "base",
    "detail",
    "continuity",
    "patchsize",
    "ringnumber",
    "similarpatches",
    "iterations",
    "refineedgelen",
    "seed",
    "showtrust",
)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "inpaint",
        help="fill the holes of a mesh",
        description="Fill the holes of a mesh and bring back the lost detail.",
        **guide(
            [
                "inpaint scan.ply whole.ply",
                "inpaint scan.ply whole.ply --maxholesize 400 --refineedgelen 0.5%",
                "inpaint scan.obj whole.obj --repair --detail none",
            ],
            done="every hole that was to be filled is filled",
            page="docs/filters.md",
        ),
    )
    parser.add_argument("source", type=Path, metavar="IN", help="mesh with holes")
    parser.add_argument("target", type=Path, metavar="OUT", help="mesh to write")
    group = parser.add_argument_group("which holes; all of what is given must hold")
    group.add_argument("--holes", metavar="IDS", help="fill these of the table of holes, as in 3,7")
    group.add_argument("--near", metavar="X,Y,Z", help="fill the hole whose rim is nearest to this")
    add_parameters(parser)
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="FILE",
        help="write one .png or .jpg with the fills coloured by how far they may be off",
    )
    parser.add_argument("--json", action="store_true", help="write one JSON document")
    add_quiet(parser)
    add_repair(parser)
    parser.set_defaults(run=run)


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add the option that leaves out all but errors and the summary."""
    parser.add_argument("--quiet", action="store_true", help="tell errors and the summary only")


def add_repair(parser: argparse.ArgumentParser) -> None:
    """Add the option that repairs the mesh first."""
    parser.add_argument(
        "--repair",
        action="store_true",
        help="first merge doubled vertices, remove doubled faces, faces without area and those "
        "that are too many at an edge, and turn faces alike",
    )


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """Add an option for each parameter of the filter ``meshing_inpaint_lowrank``."""
    group = parser.add_argument_group("parameters of the filter")
    add = group.add_argument
    add("--maxholesize", type=int, metavar="EDGES", help="fill loops up to this size (0: no limit)")
    add("--minholesize", type=int, metavar="EDGES", help="fill loops from this size on (0)")
    add("--maxholelength", type=float, metavar="LENGTH", help="fill loops up to this perimeter")
    add("--minholelength", type=float, metavar="LENGTH", help="fill loops from this perimeter on")
    add(
        "--selected",
        action="store_true",
        default=None,
        help="fill only holes at faces that are selected in the file (PLY with flags)",
    )
    add("--closerim", action="store_true", default=None, help="fill outer rims of sheets too (no)")
    add("--preset", choices=get_args(Preset), help="stages of the method (auto)")
    add("--base", choices=get_args(Base), help="stage 1 of preset paper (meshlab)")
    add(
        "--detail",
        choices=get_args(Detail),
        help="how much detail to put on (calibrated; paper: full)",
    )
    add(
        "--continuity",
        choices=get_args(Continuity),
        help="how fills go on from the rim (auto: creases joined, cuts capped, all else smooth)",
    )
    add(
        "--patchsize",
        type=int,
        metavar="SAMPLES",
        help="samples of a patch (about 130; paper: 100)",
    )
    add(
        "--ringnumber",
        type=int,
        metavar="RINGS",
        help="rings around the hole to learn from (30; paper: 8)",
    )
    add(
        "--similarpatches",
        type=int,
        metavar="COUNT",
        help="similar patches in a group (8; paper: 10)",
    )
    add("--iterations", type=int, metavar="PASSES", help="passes over the method (4; paper: 1)")
    add(
        "--refineedgelen",
        metavar="LENGTH",
        help="edge length of the fill: 0.5 in the units of the mesh, or 1%% of the diagonal of its "
        "bounding box (that of the surroundings)",
    )
    add("--seed", type=int, help="seed of random choices (0)")
    add(
        "--showtrust",
        choices=get_args(ShowTrust),
        help="where vertices show how far they can be trusted, if the mesh has nothing there "
        "(quality, in PLY files)",
    )


def parameters_of(args: argparse.Namespace) -> dict[str, str]:
    """Check the options of `add_parameters` and give them as text."""
    names = (*_NAMES, *(name for name in ("holes", "near") if hasattr(args, name)))
    return parameter_texts({name: getattr(args, name) for name in names})


def run(args: argparse.Namespace) -> int:
    """Fill and show; see `meshlab_lowrank.cli.main` for the exit code."""
    parameters = parameters_of(args)
    one_file.check_paths(args.source, args.target)
    if args.picture:
        check_picture(args.picture)
    with contextlib.closing(WorkerPool()) as pool:
        record = one_file.process(
            args.source,
            args.target,
            pool,
            parameters=parameters,
            repair=args.repair,
            picture=args.picture,
            quiet=args.quiet,
        )
    return one_file.show_record(record, as_json=args.json, quiet=args.quiet)
