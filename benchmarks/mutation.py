"""Change the method's code at random places and see which changes no test notices.

    python -m benchmarks.mutation
    python -m benchmarks.mutation --modules meshlab_lowrank/pipeline.py --sample 0

Needs the extra `mutation`. The tree is copied to a temporary folder, so nothing of it changes.
cosmic-ray makes the mutants; of each module as many are drawn as of any other, with a seed; each is
tried on the test files that are given, in their order, until one fails. Mutants of annotations are
left out. A mutant that runs into the time limit counts as killed.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

MODULES = (
    "meshlab_lowrank/hole.py",
    "meshlab_lowrank/pipeline.py",
    "meshlab_lowrank/presets.py",
    "meshlab_lowrank/solving.py",
    "meshlab_lowrank/tuning",
    "meshlab_lowrank/stages",
)
TESTS = (
    "tests/test_parameters.py",
    "tests/test_ridge_completion.py",
    "tests/test_svt.py",
    "tests/test_npc.py",
    "tests/test_refinement.py",
    "tests/test_masked_distance.py",
    "tests/test_ring_patches.py",
    "tests/test_grid_patches.py",
    "tests/test_vertex_update.py",
    "tests/test_direct_update.py",
    "tests/test_smooth_base.py",
    "tests/test_repeat_length.py",
    "tests/test_fake_holes.py",
    "tests/test_front_diffusion.py",
    "tests/test_round_diffusion.py",
    "tests/test_region.py",
    "tests/test_fairing.py",
    "tests/test_recover.py",
    "tests/test_wiring.py",
)
CONFIG = """[cosmic-ray]
module-path = {modules!r}
timeout = {timeout}
excluded-modules = []
test-command = {command!r}

[cosmic-ray.distributor]
name = "local"
"""


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.mutation",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--modules", nargs="+", default=list(MODULES), help="files and folders")
    parser.add_argument("--tests", nargs="+", default=list(TESTS), help="test files, in order")
    parser.add_argument("--sample", type=int, default=150, help="mutants in all; 0: every one")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--timeout", type=float, default=180.0, help="seconds a mutant")
    return parser.parse_args(arguments)


def files_of(modules: Iterable[str], root: Path) -> list[str]:
    """List the Python files among files and folders."""
    found: list[str] = []
    for module in modules:
        path = root / module
        inside = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        found += [str(file.relative_to(root)) for file in inside if file.name != "__init__.py"]
    return found


def annotation_spans(path: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Give begin and end (line, column) of every annotation of a file."""
    spans = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for name in ("annotation", "returns"):
            part = getattr(node, name, None)
            if isinstance(part, ast.expr) and part.end_lineno and part.end_col_offset:
                end = (part.end_lineno, part.end_col_offset)
                spans.append(((part.lineno, part.col_offset), end))
    return spans


def draw(session: Path, root: Path, sample: int, seed: int) -> int:
    """Mark all but a sample of a session's mutants as skipped; give the number of the sample."""
    from cosmic_ray.work_db import WorkDB, use_db  # noqa: PLC0415  an extra
    from cosmic_ray.work_item import WorkerOutcome, WorkResult  # noqa: PLC0415

    chance = random.Random(seed)
    with use_db(str(session), WorkDB.Mode.open) as database:
        by_module: dict[str, list[str]] = defaultdict(list)
        skipped = []
        for item in database.work_items:
            (mutation,) = item.mutations
            spans = annotation_spans(root / mutation.module_path)
            if any(begin <= mutation.start_pos < end for begin, end in spans):
                skipped.append(item.job_id)
            else:
                by_module[str(mutation.module_path)].append(item.job_id)
        for jobs in by_module.values():
            jobs.sort()
            chance.shuffle(jobs)
        rounds = (jobs[i] for i in range(10**6) for jobs in by_module.values() if i < len(jobs))
        total = sum(map(len, by_module.values()))
        chosen = {job for job, _ in zip(rounds, range(sample or total), strict=False)}
        rest = [job for jobs in by_module.values() for job in jobs if job not in chosen]
        for job in skipped + rest:
            database.set_result(job, WorkResult(worker_outcome=WorkerOutcome.SKIPPED))
    print(f"{len(chosen)} of {total} mutants of {len(by_module)} modules", flush=True)
    return len(chosen)


def report(session: Path) -> None:
    """Print the score of each module and what survived."""
    from cosmic_ray.work_db import WorkDB, use_db  # noqa: PLC0415  an extra
    from cosmic_ray.work_item import WorkerOutcome  # noqa: PLC0415

    score: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    with use_db(str(session), WorkDB.Mode.open) as database:
        for item, result in database.completed_work_items:
            if result.worker_outcome == WorkerOutcome.SKIPPED:
                continue
            (mutation,) = item.mutations
            counts = score[str(mutation.module_path)]
            counts[0] += result.is_killed
            counts[1] += 1
            if not result.is_killed:
                lines = (result.diff or "").splitlines()
                changed = [
                    line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")
                ]
                print(f"\n{mutation.module_path}:{mutation.start_pos[0]}", *changed, sep="\n")
    print()
    for module, (killed, total) in sorted(score.items()):
        print(f"{killed:4d} of {total:4d}  {module}")
    killed, total = (sum(counts[i] for counts in score.values()) for i in (0, 1))
    print(f"{killed:4d} of {total:4d}  in all: {killed / max(total, 1):.2f}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw mutants, try the tests on them, report."""
    options = parse(arguments)
    root = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "tree"
        ignored = shutil.ignore_patterns(".git", ".venv", "results", "*cache*", "build")
        shutil.copytree(root, copy, symlinks=True, ignore=ignored)
        session = Path(folder) / "session.sqlite"
        config = Path(folder) / "config.toml"
        command = " ".join([sys.executable, "-m", "pytest", "-q", "-x", *options.tests])
        modules = files_of(options.modules, copy)
        config.write_text(
            CONFIG.format(modules=modules, timeout=options.timeout, command=command),
            encoding="utf-8",
        )
        environment = {**os.environ, "PYTHONPATH": str(copy)}

        def cosmic_ray(*words: str) -> None:
            subprocess.run(
                [sys.executable, "-m", "cosmic_ray.cli", *words],
                cwd=copy,
                env=environment,
                check=True,
            )

        cosmic_ray("init", str(config), str(session))
        draw(session, copy, options.sample, options.seed)
        subprocess.run(command.split(), cwd=copy, env=environment, check=True)
        cosmic_ray("exec", str(config), str(session))
        report(session)
    return 0


if __name__ == "__main__":
    sys.exit(main())
