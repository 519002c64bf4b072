"""All settings of the method in one frozen dataclass."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeAlias, get_args

from meshlab_lowrank.errors import InvalidParameterError

Preset: TypeAlias = Literal["auto", "paper"]
Detail: TypeAlias = Literal["calibrated", "full", "none"]


@dataclass(frozen=True, kw_only=True)
class InpaintParameters:
    """Settings of the inpainting; None means that the method chooses for itself.

    Parameters
    ----------
    preset : {"auto", "paper"}
        Which choice each stage makes. ``"paper"`` is Algorithm 1 of the paper as written.
    maxholesize : int
        Longest boundary loop that is filled, in edges, inclusive; 0 means no limit.
    closerim : bool
        Fill the outer rims of open sheets too.
    detail : {"calibrated", "full", "none"}
        How much of the recovered detail is put on the base: scaled by how far it can be trusted,
        all of it, or none (the faired base).
    refineedgelen : float or None
        Edge length of the new triangles in the units of the mesh. None: that of the surroundings.
    seed : int
        Seed of every random choice.
    patchsize : int or None
        Samples per patch (the paper's sp, section 4.2).
    ringnumber : int or None
        Rings around the hole in which patches are taken (the paper's r, section 4.2).
    similarpatches : int or None
        Similar patches per group (the paper's k, section 3.3.3).
    iterations : int or None
        Passes over stages 2 to 6 (the paper's S_iter, Algorithm 1).

    Raises
    ------
    InvalidParameterError
        If a value has the wrong type or is out of range.
    """

    preset: Preset = "auto"
    maxholesize: int = 0
    closerim: bool = False
    detail: Detail = "calibrated"
    refineedgelen: float | None = None
    seed: int = 0
    patchsize: int | None = None
    ringnumber: int | None = None
    similarpatches: int | None = None
    iterations: int | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        _check_choice("preset", self.preset, get_args(Preset))
        _check_choice("detail", self.detail, get_args(Detail))
        _check_int("maxholesize", self.maxholesize, 0)
        _check_int("seed", self.seed, 0)
        _check_bool("closerim", self.closerim)
        _check_optional_int("patchsize", self.patchsize, 4)
        _check_optional_int("ringnumber", self.ringnumber, 1)
        _check_optional_int("similarpatches", self.similarpatches, 1)
        _check_optional_int("iterations", self.iterations, 1)
        if self.refineedgelen is not None:
            _check_positive("refineedgelen", self.refineedgelen)

    @classmethod
    def paper(cls, **changes: Any) -> InpaintParameters:
        """Give the paper's own setting (sections 3.4, 4.2), with changes by name."""
        defaults: dict[str, Any] = {
            "preset": "paper",
            "detail": "full",
            "patchsize": 100,
            "ringnumber": 8,
            "iterations": 1,
        }
        return cls.from_dict({**defaults, **changes})

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
        """Return a copy with some values changed."""
        return replace(self, **changes)


def _check_choice(name: str, value: object, choices: tuple[str, ...]) -> None:
    if value not in choices:
        msg = f"Parameter {name} is {value!r}; choose one of {', '.join(map(repr, choices))}."
        raise InvalidParameterError(msg)


def _check_bool(name: str, value: object) -> None:
    if not isinstance(value, bool):
        msg = f"Parameter {name} is {value!r}; give True or False."
        raise InvalidParameterError(msg)


def _check_int(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        msg = f"Parameter {name} is {value!r}; give a whole number of at least {least}."
        raise InvalidParameterError(msg)


def _check_optional_int(name: str, value: object, least: int) -> None:
    if value is not None:
        _check_int(name, value, least)


def _check_positive(name: str, value: object) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or value <= 0:  # type: ignore[arg-type, operator]
        msg = f"Parameter {name} is {value!r}; give a number greater than 0."
        raise InvalidParameterError(msg)
