"""The examples of docs/batch.md and docs/chains.md, as they stand there."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pymeshlab
import pytest

from meshlab_lowrank.chains import load_chain

DOCS = Path(__file__).parent.parent / "docs"


def block(page: str, language: str) -> str:
    found = re.search(
        rf"```{language}\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL
    )
    assert found
    return found[1]


@pytest.fixture
def project(tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """Give a folder with two scans, and an environment in which our command is found."""
    for number in range(2):
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.create_sphere(subdiv=1 + number)
        meshset.compute_selection_by_condition_per_face(condselect="fi < 3")
        meshset.meshing_remove_selected_faces()
        (tmp_path / "scans").mkdir(exist_ok=True)
        meshset.save_current_mesh(str(tmp_path / "scans" / f"scan{number}.ply"))
    command = tmp_path / "bin" / "meshlab-lowrank"
    command.parent.mkdir()
    program = "import sys; from meshlab_lowrank.cli import main; sys.exit(main())"
    command.write_text(f"#!/bin/sh\nexec {sys.executable} -c '{program}' \"$@\"\n")
    command.chmod(0o755)
    path = os.pathsep.join((str(command.parent), os.environ["PATH"]))
    modules = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
    return tmp_path, {**os.environ, "PATH": path, "PYTHONPATH": modules}


@pytest.mark.skipif(not shutil.which("bash"), reason="needs bash")
def test_slurm_example(project: tuple[Path, dict[str, str]]) -> None:
    folder, environment = project
    (folder / "job.sh").write_text(block("batch.md", "bash"))
    for task in ("1", "2", "3"):
        numbers = {"SLURM_ARRAY_TASK_ID": task, "SLURM_CPUS_PER_TASK": "1"}
        command = ["bash", "job.sh"]
        subprocess.run(command, cwd=folder, env={**environment, **numbers}, check=True)  # noqa: S603
    meshes = sorted(path.name for path in (folder / "filled").glob("*.ply"))
    assert meshes == ["scan0.ply", "scan1.ply"]


@pytest.mark.skipif(not shutil.which("snakemake"), reason="needs snakemake")
def test_snakemake_example(project: tuple[Path, dict[str, str]]) -> None:
    folder, environment = project
    (folder / "Snakefile").write_text(block("batch.md", "snakemake"))
    command = ["snakemake", "--cores", "2"]
    subprocess.run(command, cwd=folder, env=environment, check=True)  # noqa: S603
    assert len(list((folder / "filled").glob("*.ply"))) == 2


def test_chain_examples(project: tuple[Path, dict[str, str]]) -> None:
    folder, _ = project
    for name, language in (("chain.mlx", "xml"), ("chain.py", "python")):
        (folder / name).write_text(block("chains.md", language))
        meshset = pymeshlab.MeshSet(verbose=False)
        meshset.load_new_mesh(str(folder / "scans" / "scan1.ply"))
        results = load_chain(folder / name).run(meshset)
        assert [hole["status"] for hole in results[0]["holes"]] == ["filled"]
