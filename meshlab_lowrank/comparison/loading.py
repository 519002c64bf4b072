"""Fillers by name, or from a user's own chain of filters."""

from __future__ import annotations

from pathlib import Path

from meshlab_lowrank.chains import load_chain, ready_chains
from meshlab_lowrank.comparison.fillers import FILLERS
from meshlab_lowrank.comparison.registry import Filler
from meshlab_lowrank.errors import InvalidParameterError


def find_filler(spec: str) -> Filler:
    """Look a filler up by its name, or make one of a chain of filters.

    Parameters
    ----------
    spec : str
        A name of the registry, the path of an ``.mlx`` filter script, the path of a Python file
        with a function ``chain(ms)``, or the name of a ready chain.

    Returns
    -------
    Filler
        Named after the file.

    Raises
    ------
    InvalidParameterError
        If there is no such name or file, or the file holds no chain.
    """
    if spec in FILLERS:
        return FILLERS[spec]
    if not Path(spec).suffix and spec not in ready_chains():
        msg = f"Filler {spec} is not known; choose from {', '.join(FILLERS)}, or give a .mlx or "
        msg += ".py file."
        raise InvalidParameterError(msg)
    chain = load_chain(spec)
    kind = "filter script" if chain.path.suffix.lower() == ".mlx" else "Python chain"
    return Filler(chain.path.name, f"{kind} {chain.path.name}", chain.run)
