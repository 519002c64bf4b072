"""Chains of filters, MeshLab's own and ours, run on one mesh after the other."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from meshlab_lowrank.chains.python_chain import PythonChain
from meshlab_lowrank.chains.script_chain import ScriptChain
from meshlab_lowrank.errors import InvalidParameterError

Chain: TypeAlias = ScriptChain | PythonChain

__all__ = ["Chain", "PythonChain", "ScriptChain", "chain_path", "load_chain", "ready_chains"]


def ready_chains() -> dict[str, Path]:
    """Names and files of the chains that come with the package."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "ready").glob("*.mlx"))}


def chain_path(chain: str | Path) -> Path:
    """Find a chain by its file or by the name of a ready one.

    Raises
    ------
    InvalidParameterError
        If there is neither.
    """
    path = Path(chain)
    if path.is_file():
        return path
    ready = ready_chains()
    if str(chain) not in ready:
        msg = f"There is no chain {chain}; give a .mlx or .py file, or one of {', '.join(ready)}."
        raise InvalidParameterError(msg)
    return ready[str(chain)]


def load_chain(chain: str | Path) -> Chain:
    """Read a chain without running it.

    Parameters
    ----------
    chain : str or Path
        A filter script of MeshLab (.mlx), a Python file, or the name of a ready chain.

    Returns
    -------
    ScriptChain or PythonChain

    Raises
    ------
    InvalidParameterError
        If there is no such chain or it can't be parsed; the message names the line.
    """
    path = chain_path(chain)
    if path.suffix.lower() == ".mlx":
        return ScriptChain.read(path)
    if path.suffix.lower() == ".py":
        return PythonChain.read(path)
    msg = f"{path} is no chain; give a .mlx filter script or a .py file."
    raise InvalidParameterError(msg)
