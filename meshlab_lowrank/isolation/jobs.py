"""What an isolated process does with a job: find its function, call it, tell how it went.

A job is a dictionary that is ready for JSON. Its entry ``function`` names what does it, as
``package.module:function``; that function takes the job and a callable for progress events, and
returns a report: ``status``, "failed" or a word of its own, and whatever else it found.
"""

from __future__ import annotations

import importlib
import traceback
from collections.abc import Callable
from typing import Any, TypeAlias

import pymeshlab

from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.mesh_files import meshlab_reason
from meshlab_lowrank.plain_text import plain

Emit: TypeAlias = Callable[[dict[str, Any]], object]
Report: TypeAlias = dict[str, Any]
JobFunction: TypeAlias = Callable[[dict[str, Any], Emit], Report]

_PACKAGE = __name__.partition(".")[0]


def load_function(job: dict[str, Any]) -> JobFunction:
    """Import what does a job.

    Parameters
    ----------
    job : dict

    Returns
    -------
    callable

    Raises
    ------
    InvalidParameterError
        If the name is not that of a function of this package: a job may come from another machine.
    """
    module, _, name = str(job.get("function", "")).partition(":")
    if module.partition(".")[0] != _PACKAGE or not name.isidentifier() or name.startswith("_"):
        msg = f"The job names {job.get('function')!r}; it must be a function of {_PACKAGE}."
        raise InvalidParameterError(msg)
    try:
        function: JobFunction = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        msg = f"The job names {module}:{name}, which can't be imported ({error})."
        raise InvalidParameterError(msg) from error
    return function


def perform(job: dict[str, Any], emit: Emit) -> Report:
    """Do one job; whatever goes wrong is told in the report.

    Parameters
    ----------
    job : dict
    emit : callable
        Called with progress events.

    Returns
    -------
    dict
        The report of the job's function, with ``reason``: one sentence, empty if all is well, and
        ``wrong_call``: whether the call is to blame rather than the mesh.
    """
    try:
        return {"reason": "", "wrong_call": False, **load_function(job)(job, emit)}
    except InvalidParameterError as error:
        return _failed(error, wrong_call=True)
    except (LowrankError, pymeshlab.PyMeshLabException) as error:
        return _failed(error)
    except MemoryError:
        return {"status": "failed", "reason": "The memory ran out.", "wrong_call": False}
    except OSError as error:
        reason = f"{error.strerror or error}: {error.filename or job.get('target')}."
        return {"status": "failed", "reason": reason, "wrong_call": False}
    except Exception as error:  # noqa: BLE001  a bug must cost one job, not the run
        reason = (
            f"{type(error).__name__}: {meshlab_reason(error)}; this is a bug, please report it."
        )
        return {**_failed(error), "reason": reason, "traceback": traceback.format_exc()}


def tell(emit: Emit, stage: str, fraction: float) -> None:
    """Tell which stage of a job begins, and the part of the job that is done."""
    emit({"event": "progress", "stage": stage, "fraction": fraction})


def _failed(error: Exception, *, wrong_call: bool = False) -> Report:
    own = isinstance(error, LowrankError)
    reason = plain(str(error)) if own else f"{plain(meshlab_reason(error))}."
    return {"status": "failed", "reason": reason, "wrong_call": wrong_call}
