"""Fillers by name, or from a user's own file."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from meshlab_lowrank.comparison.fillers import FILLERS
from meshlab_lowrank.comparison.registry import Filler, FillFunction
from meshlab_lowrank.errors import InvalidParameterError

FUNCTION_NAME = "fill"


def find_filler(spec: str) -> Filler:
    """Look a filler up by its name, or load one from a file.

    Parameters
    ----------
    spec : str
        A name of the registry; the path of an ``.mlx`` filter script; or the path of a Python
        file, whose function ``fill`` is taken, or another after a colon (``chains.py:soft``).

    Returns
    -------
    Filler

    Raises
    ------
    InvalidParameterError
        If there is no such name, file or function.
    """
    if spec in FILLERS:
        return FILLERS[spec]
    path, _, function = spec.rpartition(":") if ".py:" in spec else (spec, "", FUNCTION_NAME)
    file = Path(path)
    if file.suffix not in {".py", ".mlx"}:
        msg = f"Filler {spec!r} is not known; choose from {', '.join(FILLERS)} or give a .py or "
        msg += ".mlx file."
        raise InvalidParameterError(msg)
    if not file.is_file():
        msg = f"Filler {spec!r} can't be loaded: there is no file {path}."
        raise InvalidParameterError(msg)
    if file.suffix == ".mlx":
        return Filler(file.name, f"filter script {file.name}", _script(file))
    return Filler(spec if "/" not in spec else file.name, *_python_function(file, function))


def _script(file: Path) -> FillFunction:
    def run(ms: Any) -> None:
        ms.load_filter_script(str(file))
        ms.apply_filter_script()

    return run


def _python_function(file: Path, name: str) -> tuple[str, FillFunction]:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        msg = f"Filler {file} can't be loaded; give a Python file."
        raise InvalidParameterError(msg)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    function = getattr(module, name, None)
    if not callable(function):
        msg = f"Filler {file} has no function {name}; define {name}(ms) there."
        raise InvalidParameterError(msg)
    lines = (function.__doc__ or "").strip().splitlines()
    return (lines[0] if lines else f"function {name} of {file.name}"), function
