"""What a run does to each file: parameters of the filter or a chain, as text and as a hash."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from meshlab_lowrank.chains import chain_path, load_chain
from meshlab_lowrank.chains.script_chain import ScriptChain
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.filters.text_values import filter_value, value_text
from meshlab_lowrank.filters.trust_showing import checked_show_trust
from meshlab_lowrank.isolation.pool import WorkerPool
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.picking import checked_ids, checked_point

_CHECK = "meshlab_lowrank.folders.tasks:check"


def parameter_texts(
    parameters: InpaintParameters | Mapping[str, object] | None,
) -> dict[str, str]:
    """Check the parameters of ``meshing_inpaint_lowrank`` and write them as text.

    Parameters
    ----------
    parameters : InpaintParameters, mapping or None
        ``refineedgelen`` may be a number, a PureValue, a PercentageValue or text like ``"2%"``.
        Those that pick holes count, ``selected``, ``holes`` and ``near``, and ``showtrust``.

    Returns
    -------
    dict of str to str
        As `filter_value` reads them; those that are None are left out.

    Raises
    ------
    InvalidParameterError
        If a name is unknown or a value is wrong.
    """
    if isinstance(parameters, InpaintParameters):
        parameters = asdict(parameters)
    texts = {n: value_text(v) for n, v in (parameters or {}).items() if v is not None}
    values = {name: filter_value(name, text) for name, text in texts.items()}
    selected = values.pop("selected", False)
    if not isinstance(selected, bool):
        msg = f"Parameter selected is {selected!r}; give True or False."
        raise InvalidParameterError(msg)
    checks: dict[str, Callable[[object], object]] = {
        "holes": checked_ids,
        "near": checked_point,
        "showtrust": checked_show_trust,
    }
    for name, check in checks.items():
        if name in values:
            check(values.pop(name))
    InpaintParameters.from_dict(values)
    return texts


def refuse_places(texts: Mapping[str, str]) -> None:
    """Refuse parameters that pick holes of one mesh.

    Raises
    ------
    InvalidParameterError
    """
    for name in ("holes", "near"):
        if name in texts:
            msg = (
                f"Parameter {name} is {texts[name]}, which picks holes of one mesh and not of a "
                "folder; fill that mesh by itself."
            )
            raise InvalidParameterError(msg)


def check_chain(chain: str | Path, pool: WorkerPool) -> str:
    """Parse a chain and, of a filter script, try the steps.

    Parameters
    ----------
    chain : str or Path
    pool : WorkerPool
        Lends the process in which MeshLab may crash.

    Returns
    -------
    str
        Absolute path of the chain.

    Raises
    ------
    InvalidParameterError
        If the chain, a filter or a parameter is wrong; the message names the line.
    """
    path = str(chain_path(chain).absolute())
    parsed = load_chain(path)
    for step in range(parsed.length if isinstance(parsed, ScriptChain) else 0):
        with pool.borrowed() as worker:
            ending = worker.run({"function": _CHECK, "chain": path, "step": step})
        if ending.report and ending.report["wrong_call"]:
            raise InvalidParameterError(ending.report["reason"])
    return path


def digest(
    parameters: Mapping[str, str], chain: str, suffix: str | None, *, repair: bool = False
) -> str:
    """Hash everything but the input that decides an output."""
    source: Any = Path(chain).read_text(encoding="utf-8") if chain else ""
    text = json.dumps([dict(sorted(parameters.items())), source, suffix, *(["repair"] * repair)])
    return hashlib.sha256(text.encode()).hexdigest()
