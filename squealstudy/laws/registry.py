"""Registers of laws: what a study may name, and nothing else."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.extensions import PACKAGE
from squealstudy.parameter import Parameter

LENGTH = 16  # of a source's hash
STEP = 1e-6  # of central differences, relative


class Definition(Protocol):
    """What every law has, whatever it is a law of."""

    @property
    def name(self) -> str:
        """As in study files."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """In the order in which its functions take their values."""

    @property
    def source(self) -> str:
        """Hash of the file that holds it."""

    @property
    def in_package(self) -> bool:
        """Whether that file is one of the package."""


D = TypeVar("D", bound=Definition)


class Sourced:
    """A definition whose identity is the file of its functions."""

    @property
    def functions(self) -> tuple[Callable[..., Any], ...]:
        """Those that kernels compile."""
        raise NotImplementedError

    @cached_property
    def source(self) -> str:
        """Hash of the file that holds the functions; ModelError where they have none."""
        return source_of(self.functions[0])

    @cached_property
    def in_package(self) -> bool:
        """Whether that file is one of the package."""
        return Path(inspect.getfile(self.functions[0])).resolve().is_relative_to(PACKAGE)


def source_of(function: Callable[..., Any]) -> str:
    """Hash of the file of a function; ModelError where it was not written in a file."""
    path = Path(inspect.getfile(function))
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:LENGTH]
    except OSError:
        raise ModelError(
            f"function '{function.__name__}' of a law must be in a file of Python, which kernels "
            f"can be compiled from, not in {path}"
        ) from None


class Registry(Generic[D]):
    """The laws of one sort by name; codes for kernels are their places in it."""

    def __init__(self, sort: str, checked: Callable[[Parameter], None]) -> None:
        self.sort, self._checked = sort, checked
        self._known: dict[str, D] = {}

    def add(self, definition: D) -> None:
        """Add a law; one that is there already and is the same stays.

        Raises
        ------
        ModelError
            Another law of that name, or a parameter that another law defines otherwise.
        """
        known = self._known.get(definition.name)
        if known is not None and known.source != definition.source:
            raise ModelError(f"there is another {self.sort} '{definition.name}'")
        for parameter in definition.parameters:
            self._checked(parameter)
        self._known[definition.name] = definition

    def __getitem__(self, name: str) -> D:
        """The law of that name; ModelError where there is none."""
        if name not in self._known:
            raise ModelError(f"{self.sort} '{name}' is none of {', '.join(self._known)}")
        return self._known[name]

    def __iter__(self) -> Iterator[D]:
        return iter(self._known.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all laws, those of the package first."""
        return tuple(self._known)

    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of all laws, each name once."""
        return tuple({p.name: p for d in self for p in d.parameters}.values())

    def names_outside(self) -> set[str]:
        """Names of parameters that only laws from outside the package have."""
        within = {p.name for d in self if d.in_package for p in d.parameters}
        return {p.name for p in self.parameters()} - within


class SharedParameters:
    """Parameters of all laws: equal names are equal definitions."""

    def __init__(self) -> None:
        self._known: dict[str, Parameter] = {}

    def check(self, parameter: Parameter) -> None:
        """Remember a parameter; ModelError where its name means another one."""
        if self._known.setdefault(parameter.name, parameter) != parameter:
            raise ModelError(f"parameter '{parameter.name}' is defined otherwise by another law")


SHARED = SharedParameters()


def at_points(function: Callable[..., Any], n_out: int, *arguments: Any) -> np.ndarray:
    """A function of floats at every point of arrays, (n_out, ..); NaN where it overflows."""
    arrays = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in arguments))
    found = np.full((n_out, arrays[0].size), np.nan)
    for i, values in enumerate(zip(*(a.ravel().tolist() for a in arrays), strict=True)):
        try:
            found[:, i] = function(*values)
        except (OverflowError, ZeroDivisionError):
            continue
    return found.reshape(n_out, *arrays[0].shape)


def central_slope(
    function: Callable[[float], np.ndarray], value: float, size: float = 0.0
) -> np.ndarray:
    """Derivative of an array by a number, by central differences over STEP of its size."""
    h = STEP * (abs(value) or size or 1.0)
    slope: np.ndarray = (function(value + h) - function(value - h)) / (2.0 * h)
    return slope
