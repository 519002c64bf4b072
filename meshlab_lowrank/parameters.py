"""All settings of the method in one frozen dataclass."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeAlias, get_args

from meshlab_lowrank.edge_length import EdgeLength, checked_length, length_on
from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.mesh.geometry import FloatArray
from meshlab_lowrank.parameter_checks import (
    check_bool,
    check_choice,
    check_int,
    check_length,
    check_optional_int,
    check_positive,
    check_range,
)

Preset: TypeAlias = Literal["auto", "paper"]
Base: TypeAlias = Literal["meshlab", "bspline"]
Detail: TypeAlias = Literal["calibrated", "full", "none"]
Continuation: TypeAlias = Literal["flat", "tangent", "smooth"]
Continuity: TypeAlias = Literal["auto", "crease", "flat", "tangent", "smooth"]

_PAPER_SIZES = {
    "patchsize": 100,  # section 4.2, like the next
    "ringnumber": 8,
    "similarpatches": 10,  # not given in the paper: 20 and 40 took longer and were no better
    "iterations": 1,
}
_ONLY_PAPER = (
    "base",
    "tau",
    "delta",
    "gamma",
    "truncation",
    "mu",
    "beta",
    "completioniterations",
    "completiontolerance",
    "refinementiterations",
    "refinementtolerance",
    "updateiterations",
)
HOLE_PARAMETERS = frozenset(
    {
        *("maxholesize", "minholesize", "maxholelength", "minholelength"),
        *("closerim", "continuity", "refineedgelen", "base"),
    }
)
_IGNORED: dict[Preset, tuple[str, ...]] = {"auto": _ONLY_PAPER, "paper": ("seed",)}
_STAGES = ("preset", "seed", *_PAPER_SIZES, *_ONLY_PAPER)  # what a pipeline decides


@dataclass(frozen=True, kw_only=True)
class InpaintParameters:
    """Settings of the inpainting; None means that the preset chooses.

    A value that the preset has no use for is refused, unless it is the default. With
    ``preset="paper"`` what is None takes the paper's value, so that ``InpaintParameters.paper()``
    and ``InpaintParameters(preset="paper")`` are equal.

    Parameters
    ----------
    preset : {"auto", "paper"}
        Which choice each stage makes. ``"paper"`` is Algorithm 1 of the paper as written, but for
        its stage 1: see ``base``.
    base : {"meshlab", "bspline"}
        Stage 1 of ``"paper"``: MeshLab's closing and our fairing, or a circular B-spline surface
        along the tangents at the rim, as the paper describes it (section 3.2).
    maxholesize : int
        Longest boundary loop that is filled, in edges, inclusive; 0 means no limit.
    minholesize : int
        Shortest boundary loop that is filled, in edges, inclusive.
    maxholelength, minholelength : float
        Longest and shortest, by their perimeter in the units of the mesh, inclusive; 0 means no
        limit.
    closerim : bool
        Fill the outer rims of open sheets too.
    detail : {"calibrated", "full", "none"} or None
        How much of the recovered detail is put on the base: scaled by how far it can be trusted,
        all of it, or none (the faired base). None: ``"calibrated"`` with ``"auto"``, ``"full"``
        with ``"paper"``, which has no calibration.
    continuity : {"auto", "crease", "flat", "tangent", "smooth"}
        How a fill goes on from the rim: not at all, as a flat cap without detail; with the tangents
        of the surroundings; or with their curvature too, where that predicts them better.
        ``"auto"`` joins creases, sharp edges of the surroundings, across the hole where the
        evidence for them is strong, caps cuts flat, whose rim is nearly planar and met steeply all
        round, and continues all else smoothly. ``"crease"`` joins shorter and blunter creases too,
        and caps nothing.
    refineedgelen : float, str, pymeshlab.PercentageValue, pymeshlab.PureValue or None
        Edge length of the new triangles: a number in the units of the mesh, or a part of the
        diagonal of its bounding box as ``"1%"``. None: that of the surroundings. It is kept as a
        number or as text.
    seed : int
        Seed of every random choice; ``"paper"`` makes none.
    patchsize : int or None
        Samples per patch (the paper's sp, section 4.2).
    ringnumber : int or None
        Rings around the hole in which patches are taken (the paper's r, section 4.2); with
        ``"auto"`` mean edge lengths.
    similarpatches : int or None
        Similar patches per group (the paper's k, section 3.3.3, which gives no number).
    iterations : int or None
        Passes over stages 2 to 6 (the paper's S_iter, Algorithm 1).
    tau, delta : float
        Threshold and step of the singular value thresholding (section 3.4.1); the paper's values.
    gamma : float
        Scalar of the truncated gamma norm (section 3.4.3); the paper's value.
    truncation : int
        Singular values that the truncated gamma norm leaves out (m, section 3.4.3); the paper's.
    mu : float
        Weight of the data term of Eq. 6, not given in the paper. Singular values below
        sqrt(2 / mu) are dropped: 14 at 0.01. Errors of size e in a matrix of 3 sp = 300 rows and
        w = 2000 columns have singular values up to e (sqrt(300) + sqrt(2000)) = 62 e, so errors up
        to e = 0.23 (13 degrees) go. Recovered normals next to the rim are about that far off; at
        0.1 the refinement no longer mends them, and far below 0.01 it takes the detail too.
    beta : float
        Weight of the augmented term of Eq. 13, not given in the paper. Equal to mu, it makes the
        first step for W drop just what Eq. 6 drops, and the iteration is then at its fixed point;
        a larger beta ends in local minima that keep more.
    completioniterations, completiontolerance : int, float
        Stop rule of Eq. 5, not given in the paper: residual on the observed entries relative to
        these. The tolerance is that of the method's authors; with the paper's step the residual
        falls by a tenth each iteration, 90 in all.
    refinementiterations, refinementtolerance : int, float
        Stop rule of Eq. 14 to 16, not given in the paper: last changes relative to the matrix.
    updateiterations : int
        Steps of the vertex update, not given in the paper. 20 is usual in mesh denoising. From
        recovered normals the error grows slowly with more, and from 100 on triangles flip.

    ``base``, ``tau`` and what follows that belong to ``"paper"`` only.

    Raises
    ------
    InvalidParameterError
        If a value has the wrong type, is out of range, or means nothing to the preset.

    See Also
    --------
    inpaint, restore_detail : Take them.

    Examples
    --------
    >>> from meshlab_lowrank import InpaintParameters
    >>> InpaintParameters(maxholesize=400).detail
    'calibrated'
    >>> InpaintParameters(tau=0.5)
    Traceback (most recent call last):
        ...
    meshlab_lowrank.errors.InvalidParameterError: Parameter tau is 0.5, but preset 'auto' has no \
use for it; leave it out or choose preset 'paper'.
    """

    preset: Preset = "auto"
    base: Base = "meshlab"
    maxholesize: int = 0
    minholesize: int = 0
    maxholelength: float = 0.0
    minholelength: float = 0.0
    closerim: bool = False
    detail: Detail | None = None
    continuity: Continuity = "auto"
    refineedgelen: EdgeLength | None = None
    seed: int = 0
    patchsize: int | None = None
    ringnumber: int | None = None
    similarpatches: int | None = None
    iterations: int | None = None
    tau: float = 0.9
    delta: float = 0.1
    gamma: float = 0.01
    truncation: int = 5
    mu: float = 0.01
    beta: float = 0.01
    completioniterations: int = 500
    completiontolerance: float = 1e-4
    refinementiterations: int = 500
    refinementtolerance: float = 1e-6
    updateiterations: int = 20

    def __post_init__(self) -> None:
        """Check every value."""
        check_choice("preset", self.preset, get_args(Preset))
        check_choice("base", self.base, get_args(Base))
        if self.detail is not None:
            check_choice("detail", self.detail, get_args(Detail))
        check_choice("continuity", self.continuity, get_args(Continuity))
        for end in ("size", "length"):
            least, most = f"minhole{end}", f"maxhole{end}"
            for name in (least, most):
                value = getattr(self, name)
                check_int(name, value, 0) if end == "size" else check_length(name, value)
            check_range(least, getattr(self, least), most, getattr(self, most))
        check_int("seed", self.seed, 0)
        check_bool("closerim", self.closerim)
        check_optional_int("patchsize", self.patchsize, 4)
        check_optional_int("ringnumber", self.ringnumber, 1)
        check_optional_int("similarpatches", self.similarpatches, 1)
        check_optional_int("iterations", self.iterations, 1)
        check_int("truncation", self.truncation, 0)
        for name in ("completioniterations", "refinementiterations", "updateiterations"):
            check_int(name, getattr(self, name), 1)
        for name in ("tau", "delta", "gamma", "mu", "beta"):
            check_positive(name, getattr(self, name))
        if self.delta >= 2.0:
            msg = f"Parameter delta is {self.delta!r}; give a step below 2, where Eq. 5 converges."
            raise InvalidParameterError(msg)
        for name in ("completiontolerance", "refinementtolerance"):
            check_positive(name, getattr(self, name))
        if self.refineedgelen is not None:
            length = checked_length("refineedgelen", self.refineedgelen)
            object.__setattr__(self, "refineedgelen", length)  # the dataclass is frozen
        self._refuse_ignored()
        self._choose()

    def _refuse_ignored(self) -> None:
        """Raise if a value is set that the preset has no use for."""
        other = "paper" if self.preset == "auto" else "auto"
        for name in self._set(_IGNORED[self.preset]):
            msg = (
                f"Parameter {name} is {getattr(self, name)!r}, but preset {self.preset!r} has no "
                f"use for it; leave it out or choose preset {other!r}."
            )
            raise InvalidParameterError(msg)
        if self.preset == "paper" and self.detail == "calibrated":
            msg = (
                "Parameter detail is 'calibrated', but preset 'paper' has no calibration; choose "
                "'full' or 'none', or preset 'auto'."
            )
            raise InvalidParameterError(msg)

    def _choose(self) -> None:
        """Put the preset's own values where None stands."""
        chosen: dict[str, object] = {"detail": "calibrated"}
        if self.preset == "paper":
            chosen = {"detail": "full", **_PAPER_SIZES}
        for name, value in chosen.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    def _set(self, names: tuple[str, ...]) -> list[str]:
        """Give those of some names that don't have their default value."""
        defaults = {field.name: field.default for field in fields(self)}
        return [name for name in names if getattr(self, name) != defaults[name]]

    def refuse_stages(self) -> None:
        """Raise if something is set that a pipeline decides.

        Raises
        ------
        InvalidParameterError
            Naming the parameter.
        """
        for name in self._set(_STAGES):
            msg = (
                f"Parameter {name} is {getattr(self, name)!r}, but a pipeline is given that "
                "decides it; set it in the stages of the pipeline."
            )
            raise InvalidParameterError(msg)

    @classmethod
    def of(cls, given: InpaintParameters | None, values: dict[str, Any]) -> InpaintParameters:
        """Take parameters as they are, or build them from values by name.

        Raises
        ------
        InvalidParameterError
            If both are given, or a name is unknown or a value wrong.
        """
        if given is None:
            return cls.from_dict(values)
        for name, value in values.items():
            msg = (
                f"Parameter {name} is {value!r}, but parameters are given too; put it into them, "
                "or give all by name."
            )
            raise InvalidParameterError(msg)
        return given

    def edge_length_on(self, vertices: FloatArray) -> float | None:
        """Give ``refineedgelen`` in the units of a mesh with these vertices (n, 3)."""
        length = self.refineedgelen
        return None if length is None else length_on(checked_length("", length), vertices)

    @classmethod
    def paper(cls, **changes: Any) -> InpaintParameters:
        """Give the paper's own setting (sections 3.4, 4.2), with changes by name.

        Raises
        ------
        InvalidParameterError
            If a change is wrong; another preset is.

        Examples
        --------
        >>> from meshlab_lowrank import InpaintParameters
        >>> parameters = InpaintParameters.paper(iterations=7)
        >>> parameters.patchsize, parameters.ringnumber, parameters.iterations
        (100, 8, 7)
        """
        preset = changes.pop("preset", "paper")
        if preset != "paper":
            msg = f"Parameter preset is {preset!r}; InpaintParameters.paper has none but 'paper'."
            raise InvalidParameterError(msg)
        return cls.from_dict({"preset": "paper", **changes})

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> InpaintParameters:
        """Build from names and values; an unknown name is an error that lists the known ones."""
        known = [field.name for field in fields(cls)]
        for name in values:
            if name not in known:
                msg = f"Parameter {name} is not known; choose from {', '.join(known)}."
                raise InvalidParameterError(msg)
        return cls(**values)

    def changed(self, **changes: Any) -> InpaintParameters:
        """Return a copy with some values changed; the preset stays.

        Raises
        ------
        InvalidParameterError
            If a change is wrong; another preset is, as values were chosen for this one.
        """
        if changes.get("preset", self.preset) != self.preset:
            msg = (
                f"Parameter preset is {changes['preset']!r}, but these are parameters of preset "
                f"{self.preset!r}; build new ones."
            )
            raise InvalidParameterError(msg)
        return replace(self, **changes)
