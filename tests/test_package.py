"""The package as it is installed: what it holds, what it imports, what it binds."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pymeshlab
import pytest

import meshlab_lowrank
from meshlab_lowrank import filters

ROOT = Path(__file__).parents[1]


@pytest.fixture
def project():
    tomllib = pytest.importorskip("tomllib")
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_every_package_is_listed(project):
    inner = (ROOT / "meshlab_lowrank").rglob("__init__.py")
    names = {".".join(path.parent.relative_to(ROOT).parts) for path in inner}
    assert set(project["tool"]["setuptools"]["packages"]) == names | {"meshlab_lowrank.filters"}


def test_a_wheel_holds_everything_inside_the_package(tmp_path):
    pytest.importorskip("setuptools", minversion="77")
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "LICENSE", "README.md"):
        shutil.copy(ROOT / name, source)
    for name in ("meshlab_lowrank", "filters"):
        shutil.copytree(ROOT / name, source / name, symlinks=True)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation"]
    command += ["--wheel-dir", str(tmp_path), str(source)]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {
        "meshlab_lowrank"
    }
    assert "meshlab_lowrank/py.typed" in names
    chains = {path.name for path in (ROOT / "meshlab_lowrank/chains/ready").glob("*.mlx")}
    assert {f"meshlab_lowrank/chains/ready/{name}" for name in chains} <= set(names)
    modules = {path.name for path in (ROOT / "filters").glob("*.py")}
    assert {f"meshlab_lowrank/filters/{name}" for name in modules} <= set(names)


@pytest.fixture(scope="module")
def tracked():
    """Files and modes as git has them."""
    if not shutil.which("git") or not (ROOT / ".git").exists():
        pytest.skip("no checkout of git")
    listing = subprocess.run(
        ["git", "ls-files", "--stage", "-z"],  # noqa: S607
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    lines = (line.split("\t") for line in listing.stdout.split("\0") if line)
    return {path: facts.split()[0] for facts, path in lines}


def test_no_file_is_a_link(tracked):
    assert set(tracked.values()) <= {"100644", "100755"}


def test_a_copy_of_the_tree_finds_its_filters(tracked, tmp_path):
    wanted = ("meshlab_lowrank/", "filters/")
    for path in tracked:
        if path.startswith(wanted) and (ROOT / path).exists():
            target = tmp_path / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / path, target)
    code = (
        "import pathlib, pymeshlab, meshlab_lowrank, meshlab_lowrank.filters as filters; "
        "assert pymeshlab.MeshSet.get_hole_measures is filters.get_hole_measures; "
        "print(pathlib.Path(filters.__file__).parent)"
    )
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert Path(done.stdout.strip()).samefile(tmp_path / "filters")


def test_importing_is_light():
    code = (
        "import sys, meshlab_lowrank; "
        "heavy = {'rich', 'matplotlib', 'meshlab_lowrank.comparison', 'meshlab_lowrank.folders', "
        "'meshlab_lowrank.cli', 'fast_simplification'}; "
        "print(*(heavy & set(sys.modules)))"
    )
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "\n", "")


def test_filters_are_bound_to_the_meshset():
    for function in filters.FILTERS:
        assert getattr(pymeshlab.MeshSet, function.__name__) is function
        assert function.__doc__


def test_public_names_can_be_had():
    for name in meshlab_lowrank.__all__:
        assert getattr(meshlab_lowrank, name) is not None
    assert callable(meshlab_lowrank.batch)
    assert callable(meshlab_lowrank.compare)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = meshlab_lowrank.no_such_name


def test_the_version_stands_in_one_place(project):
    assert meshlab_lowrank.__version__ in (project["project"]["version"], "unknown")
