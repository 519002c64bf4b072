"""A dask cluster as the engine of a batch run."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Iterator
from concurrent.futures import Executor
from typing import Any

from meshlab_lowrank.errors import InvalidParameterError, MissingExtraError

_PATIENCE = 10.0  # seconds to wait for a scheduler's answer


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Connect to a dask cluster.

    A file whose worker dies is given to another by the scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://host:8786`` say.

    Yields
    ------
    concurrent.futures.Executor

    Raises
    ------
    MissingExtraError
        If dask.distributed is not installed.
    InvalidParameterError
        If nothing answers at the address.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        msg = "Dask is not installed; install meshlab-lowrank[dask]."
        raise MissingExtraError(msg) from error
    try:
        client = distributed.Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        msg = f"No dask scheduler answers at {address}; check the address."
        raise InvalidParameterError(msg) from error
    with client:
        yield client.get_executor(pure=False)
