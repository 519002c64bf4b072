"""A filter script of MeshLab (.mlx) in which our filters may stand among MeshLab's own.

MeshLab's parser knows only its compiled filters, so each step goes to it as a script of its own,
and ours are called in between. MeshLab drops unknown parameters and malformed values with a warning
in its log at most; here they are errors that name the line.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn, TypeAlias
from xml.parsers import expat
from xml.sax import saxutils

import pymeshlab

from meshlab_lowrank.chains.chain_text import chain_text
from meshlab_lowrank.errors import InvalidParameterError, LowrankError
from meshlab_lowrank.filters.text_values import NUMBER, WHOLE, filter_value
from meshlab_lowrank.mesh_files import captured_output, meshlab_reason

StepCallback: TypeAlias = Callable[[int, str], object]

OUR_FILTERS = (
    "get_hole_measures",
    "meshing_inpaint_lowrank",
    "apply_coord_inpaint_lowrank",
    "compute_selection_inpainted_lowrank",
)
_ONLY_IN_PYTHON = ("ms", "progress", "pipeline")  # what they take can't be written as text

_UNKNOWN_PARAMETER = re.compile(r"parameter (.*?) not required by filter")
_UNKNOWN_FILTER = "Something really bad happened"  # all that MeshLab says about it
_VALUES = {
    "RichBool": re.compile("true|false", re.IGNORECASE),
    "RichInt": WHOLE,
    "RichEnum": WHOLE,
    "RichMesh": WHOLE,
    "RichFloat": NUMBER,
    "RichDynamicFloat": NUMBER,
    "RichAbsPerc": NUMBER,
}


@dataclass(frozen=True)
class Step:
    """One filter of a script.

    Attributes
    ----------
    name : str
    line : int
    parameters : dict
        Attributes of each ``<Param>`` by its name.
    lines : dict
        Line of each parameter by its name.
    """

    name: str
    line: int
    parameters: dict[str, dict[str, str]] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class ScriptChain:
    """A parsed filter script.

    Attributes
    ----------
    path : Path
    source : str
        Its text.
    steps : tuple of Step
    """

    path: Path
    source: str
    steps: tuple[Step, ...]

    @classmethod
    def read(cls, path: Path) -> ScriptChain:
        """Parse a script without running it.

        Raises
        ------
        InvalidParameterError
            If it is not well formed or holds something else than filters and their parameters.
        """
        source = chain_text(path)
        reader = _Reader(path.name)
        try:
            reader.parser.Parse(source, True)
        except expat.ExpatError as error:
            msg = f"{path.name}, line {error.lineno}: {expat.ErrorString(error.code)}."
            raise InvalidParameterError(msg) from error
        if not reader.steps:
            msg = f"{path.name} holds no filter; save it from MeshLab with at least one."
            raise InvalidParameterError(msg)
        return cls(path, source, tuple(reader.steps))

    @property
    def length(self) -> int:
        """Number of steps."""
        return len(self.steps)

    def check(self, number: int) -> None:
        """Try the name and the parameters of one step on a mesh that is too small for it.

        Some of MeshLab's filters crash on such a mesh: call it in an isolated process.

        Parameters
        ----------
        number : int
            Position of the step, from 0.

        Raises
        ------
        InvalidParameterError
            If there is no such filter or it has no such parameter; the message names the line.
        """
        step, meshset = self.steps[number], pymeshlab.MeshSet(verbose=False)
        if step.name in OUR_FILTERS:
            meshset.create_tetrahedron()
        else:
            meshset.add_mesh(pymeshlab.Mesh([[0.0, 0.0, 0.0]]))
        try:
            self._apply(step, meshset)
        except InvalidParameterError:
            raise
        except LowrankError:
            return  # it is a filter that needs a larger mesh

    def run(self, meshset: Any, on_step: StepCallback | None = None) -> list[dict[str, Any]]:
        """Run the steps on the current mesh.

        Parameters
        ----------
        meshset : pymeshlab.MeshSet
        on_step : callable or None
            Called with the number and the name of each step before it runs.

        Returns
        -------
        list of dict
            What our filters gave.

        Raises
        ------
        InvalidParameterError
            If a filter or parameter is unknown.
        LowrankError
            If a step fails; the message names the line.
        """
        results = []
        for number, step in enumerate(self.steps):
            if on_step:
                on_step(number, step.name)
            results.append(self._apply(step, meshset))
        return [result for result in results if result]

    def _apply(self, step: Step, meshset: Any) -> dict[str, Any]:
        if step.name in OUR_FILTERS:
            return self._apply_ours(step, meshset)
        error = None
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder, "step.mlx")
            script.write_text(_as_script(step), encoding="utf-8")
            with captured_output() as log:
                meshset.load_filter_script(str(script))
                try:
                    meshset.apply_filter_script()
                except pymeshlab.PyMeshLabException as raised:
                    error = raised
        if error and _UNKNOWN_FILTER in str(error):
            self._refuse(step.line, f"there is no filter {step.name!r}")
        for name in _UNKNOWN_PARAMETER.findall(log[0]):
            self._refuse(step.lines[name], f"{step.name} has no parameter {name!r}")
        if error:
            raise self._failure(step, error) from error
        return {}

    def _apply_ours(self, step: Step, meshset: Any) -> dict[str, Any]:
        for name in filter(_ONLY_IN_PYTHON.__contains__, step.parameters):
            self._refuse(step.lines[name], f"{step.name} has no parameter {name!r}")
        values = {n: filter_value(n, item["value"]) for n, item in step.parameters.items()}
        try:
            return dict(getattr(meshset, step.name)(**values) or {})
        except (LowrankError, pymeshlab.PyMeshLabException) as error:
            named = (n for n in step.parameters if f"Parameter {n} " in str(error))
            if name := next(named, ""):
                self._refuse(step.lines[name], meshlab_reason(error))
            raise self._failure(step, error) from error

    def _failure(self, step: Step, error: Exception) -> LowrankError:
        where = f"{self.path.name}, line {step.line}, {step.name}"
        return LowrankError(f"{where}: {meshlab_reason(error)}.")

    def _refuse(self, line: int, reason: str) -> NoReturn:
        msg = f"{self.path.name}, line {line}: {reason}."
        raise InvalidParameterError(msg)


class _Reader:
    """Collects the steps while expat walks through a script."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.steps: list[Step] = []
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        if tag == "filter" and attributes.get("name"):
            self.steps.append(Step(attributes["name"], line))
        elif tag == "Param" and self.steps and {"name", "value"} <= attributes.keys():
            self._check_value(line, attributes)
            self.steps[-1].parameters[attributes["name"]] = attributes
            self.steps[-1].lines[attributes["name"]] = line
        elif tag != "FilterScript":
            self._refuse(line, f"<{tag}> is not understood; see a script that MeshLab saved")

    def _check_value(self, line: int, attributes: dict[str, str]) -> None:
        if self.steps[-1].name in OUR_FILTERS:
            return
        kind, value = attributes.get("type"), attributes["value"]
        if kind is None:
            self._refuse(line, f"parameter {attributes['name']!r} has no type, as in RichInt")
        elif kind in _VALUES and not _VALUES[kind].fullmatch(value):
            self._refuse(line, f"{value!r} is no value of a parameter of type {kind}")

    def _refuse(self, line: int, reason: str) -> None:
        msg = f"{self.name}, line {line}: {reason}."
        raise InvalidParameterError(msg)


def _as_script(step: Step) -> str:
    """Write one step as a script that MeshLab reads."""
    parameters = "".join(
        "<Param {}/>".format(" ".join(f"{k}={saxutils.quoteattr(v)}" for k, v in item.items()))
        for item in step.parameters.values()
    )
    name = saxutils.quoteattr(step.name)
    return f"<FilterScript><filter name={name}>{parameters}</filter></FilterScript>"
