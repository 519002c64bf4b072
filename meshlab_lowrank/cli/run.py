"""``meshlab-lowrank run CHAIN IN OUT``: a chain of filters on one mesh."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path

from meshlab_lowrank.chains import ready_chains
from meshlab_lowrank.cli import one_file
from meshlab_lowrank.cli.guide import guide
from meshlab_lowrank.cli.inpaint import add_quiet
from meshlab_lowrank.folders.settings import check_chain
from meshlab_lowrank.isolation.pool import WorkerPool


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    names = ", ".join(ready_chains())
    parser = subparsers.add_parser(
        "run",
        help="run a chain of filters on a mesh",
        description="Run a chain of filters, MeshLab's own and ours, on a mesh.",
        **guide(
            ["run clean-and-inpaint scan.ply out.ply", "run chain.mlx scan.ply out.ply"],
            done="every step was done, and every hole that was to be filled is filled",
            page="docs/chains.md",
        ),
    )
    parser.add_argument("chain", metavar="CHAIN", help=f".mlx or .py file, or one of {names}")
    parser.add_argument("source", type=Path, metavar="IN", help="mesh to read")
    parser.add_argument("target", type=Path, metavar="OUT", help="mesh to write")
    parser.add_argument("--json", action="store_true", help="write one JSON document")
    add_quiet(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the chain and show; see `meshlab_lowrank.cli.main` for the exit code."""
    one_file.check_paths(args.source, args.target)
    with contextlib.closing(WorkerPool()) as pool:
        chain = check_chain(args.chain, pool)
        record = one_file.process(args.source, args.target, pool, chain=chain, quiet=args.quiet)
    return one_file.show_record(record, as_json=args.json, quiet=args.quiet)
