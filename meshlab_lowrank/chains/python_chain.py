"""A chain written in Python: a file with a function that works on a MeshSet."""

from __future__ import annotations

import ast
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshlab_lowrank.chains.chain_text import chain_text
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.mesh_files import meshlab_reason
from meshlab_lowrank.records import RecordError, checked_report

FUNCTION = "chain"


@dataclass(frozen=True)
class PythonChain:
    """A Python file that defines ``chain(ms)``.

    Attributes
    ----------
    path : Path
    source : str
        Its text.
    """

    path: Path
    source: str

    @classmethod
    def read(cls, path: Path) -> PythonChain:
        """Read and compile the file without running it.

        Raises
        ------
        InvalidParameterError
            If it is no Python or has no such function.
        """
        source = chain_text(path)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                tree = ast.parse(source, str(path))
        except SyntaxError as error:
            msg = f"{path.name}, line {error.lineno}: {error.msg}."
            raise InvalidParameterError(msg) from error
        except (ValueError, MemoryError, RecursionError) as error:  # null bytes, too many brackets
            msg = f"{path.name} is no Python: {str(error) or 'it is nested too deeply'}."
            raise InvalidParameterError(msg) from error
        functions = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
        if FUNCTION not in functions:
            msg = f"{path.name} defines no function {FUNCTION}(ms); add one that takes a MeshSet."
            raise InvalidParameterError(msg)
        return cls(path, source)

    @property
    def length(self) -> int:
        """Number of steps: one, since the function is not looked into."""
        return 1

    def run(self, meshset: Any, on_step: Any = None) -> list[dict[str, Any]]:
        """Run the function on a MeshSet.

        Parameters
        ----------
        meshset : pymeshlab.MeshSet
        on_step : callable or None
            Called with the number and the name of each step before it runs.

        Returns
        -------
        list of dict
            What is read of what the function returned: a dict, or a list of them, as the filters
            give.

        Raises
        ------
        LowrankError
            If the function raises, the message names the line, or if it returns anything else.
        """
        if on_step:
            on_step(0, self.path.name)
        names: dict[str, Any] = {"__name__": self.path.stem, "__file__": str(self.path)}
        try:
            exec(compile(self.source, str(self.path), "exec"), names)  # noqa: S102  the user's own
            result = names[FUNCTION](meshset)
        except (Exception, SystemExit) as error:
            frames = traceback.extract_tb(error.__traceback__)
            lines = [frame.lineno for frame in frames if frame.filename == str(self.path)]
            where = f"{self.path.name}, line {lines[-1] if lines else 1}"
            msg = f"{where}: {meshlab_reason(error)}."
            raise LowrankError(msg) from error
        results = result if isinstance(result, list | tuple) else [result]
        try:
            return [checked_report(item) for item in results if item is not None]
        except RecordError as error:
            msg = (
                f"{self.path.name}: {FUNCTION}(ms) returned no report of a filter ({error}); "
                "return what the filters gave, or nothing."
            )
            raise LowrankError(msg) from error
