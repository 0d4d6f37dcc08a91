"""Common parts of all laws: definitions, registries, and values of parameters.

A study can name registered laws only.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from squealstudy.errors import ExtensionError, ModelError, ParameterError
from squealstudy.extensions import PACKAGE, hash_of, note_registered, remember
from squealstudy.parameter import Parameter

DIFFERENCE_REL_STEP = 1e-6  # relative step of central differences


@dataclass(frozen=True, kw_only=True)
class LawDefinition:
    """A law as functions of one contact point; laws are the same if the files of these are.

    Attributes
    ----------
    name : str
        Name as in study files.
    description : str
    parameters : tuple of Parameter
        Parameters in the order in which the functions take them, behind their other arguments.
    plain : (..) -> str, or None
        For values of the parameters that switch the law off, what remains of it in words; else "".
    refuses : (sequence of values) -> str, or None
        Why values do not fit each other, though each is within its bounds; "" where they fit.
    by_address : bool
        Whether kernels call the functions by their addresses, as they do for laws from outside the
        package, and do not include them. Long functions would lengthen the compiling of each
        kernel.
    """

    registry: ClassVar[Registry[Any]]
    compiled: ClassVar[
        tuple[str, ...]
    ]  # fields with functions for kernels; the first is never None

    name: str
    description: str
    parameters: tuple[Parameter, ...] = ()
    plain: Callable[..., str] | None = None
    refuses: Callable[[Sequence[float]], str] | None = None
    by_address: bool = False

    @property
    def functions(self) -> dict[str, Callable[..., Any]]:
        """Functions that kernels compile, by their fields, without those that are None."""
        found = {name: getattr(self, name) for name in self.compiled}
        return {name: function for name, function in found.items() if function is not None}

    @cached_property
    def source(self) -> str:
        """Hash of the file of the main function; ModelError where it is in no file."""
        function = self.main_function
        path = Path(inspect.getfile(function))
        try:
            return hash_of(path)
        except ExtensionError:
            raise ModelError(
                f"function '{function.__name__}' of a law must be in a file of Python, which "
                f"kernels can be compiled from, not in {path}"
            ) from None

    @cached_property
    def in_package(self) -> bool:
        """Whether that file belongs to the package."""
        return Path(inspect.getfile(self.main_function)).resolve().is_relative_to(PACKAGE)

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """Short names of the parameters: the names of the main function's arguments.

        If it takes them as ``*values``, they are the parts of the names behind the last dot.
        """
        taken = tuple(inspect.signature(self.main_function).parameters.values())
        if taken[-1].kind is inspect.Parameter.VAR_POSITIONAL:
            return tuple(parameter.name.rpartition(".")[2] for parameter in self.parameters)
        return tuple(a.name for a in taken[len(taken) - len(self.parameters) :])

    @property
    def main_function(self) -> Callable[..., Any]:
        """The first of `functions`, which every law of this sort has."""
        return next(iter(self.functions.values()))

    def expect_consistent(self) -> None:
        """Try the functions with the parameters' defaults; ModelError where they contradict."""


D = TypeVar("D", bound=LawDefinition)


class Registry(Generic[D]):
    """The laws of one sort by name; a law's place is its code for kernels."""

    shared: ClassVar[dict[str, Parameter]] = {}  # parameters of all sorts of laws

    def __init__(self, sort: str) -> None:
        self.sort = sort
        self._known: dict[str, D] = {}

    def add(self, definition: D) -> None:
        """Add a law; one that is there already and is the same stays.

        Raises
        ------
        ModelError
            Another law has this name, another law defines a parameter otherwise, or functions of a
            law from outside the package contradict each other.
        """
        known = self._known.get(definition.name)
        if known is not None and known.source != definition.source:
            raise ModelError(f"there is another {self.sort} '{definition.name}'")
        for parameter in definition.parameters:
            if self.shared.setdefault(parameter.name, parameter) != parameter:
                raise ModelError(
                    f"parameter '{parameter.name}' is defined otherwise by another law"
                )
        if not definition.in_package:
            definition.expect_consistent()
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


def register(law: D) -> D:
    """Register a contact law, a friction curve or a regularisation; returns it.

    Parameters
    ----------
    law : ContactLawDefinition, FrictionCurveDefinition or Regularisation

    Raises
    ------
    ModelError
        Another law has this name, another law defines a parameter otherwise, or functions are not
        in a file or contradict each other.
    ExtensionError
        Functions are defined in the program itself, where workers cannot execute them.
    """
    remember(law.main_function)
    law.registry.add(law)
    note_registered(law.main_function.__module__, in_models=True)
    return law


@dataclass(frozen=True)
class Law(Generic[D]):
    """A law with values of its parameters.

    Parameters
    ----------
    kind : str
        Name of a registered law.
    parameters : tuple of float
        Values in the order of the law's definition.

    Raises
    ------
    ModelError
        Unknown law, a value outside its parameter's bounds, or values that do not fit each other.
    """

    registry: ClassVar[Registry[Any]]
    title: ClassVar[str]  # title in messages, with {} for the kind

    kind: str
    parameters: tuple[float, ...]

    def __post_init__(self) -> None:
        known, title = self.definition.parameters, self.title.format(self.kind)
        if len(known) != len(self.parameters):
            raise ModelError(f"{title} has {len(known)} parameters")
        try:
            checked = tuple(p.check(float(v)) for p, v in zip(known, self.parameters, strict=True))
        except ParameterError as e:
            raise ModelError(f"{title}: {e}") from None
        object.__setattr__(self, "parameters", checked)
        refuses = self.definition.refuses
        if refuses is not None and (why := refuses(checked)):
            raise ModelError(f"{title}: {why}")

    @classmethod
    def named(cls, kind: str, **parameters: float) -> Self:
        """A law with the named parameters (as its functions call them), the others at defaults.

        Raises
        ------
        ModelError
            As for the class, or a parameter that the law does not have.
        """
        law = cls.registry[kind]
        if unknown := parameters.keys() - set(law.arguments):
            has = ", ".join(law.arguments)
            raise ModelError(f"{cls.title.format(kind)} has {has}, not {unknown.pop()}")
        defaults = zip(law.arguments, law.parameters, strict=True)
        return cls(kind, tuple(parameters.get(name, p.default) for name, p in defaults))

    @classmethod
    def from_values(cls, kind: str, values: Mapping[str, float]) -> Self:
        """The law of that name with values of a study's parameters, and defaults of others."""
        known = cls.registry[kind].parameters
        return cls(kind, tuple(values.get(p.name, p.default) for p in known))

    @property
    def definition(self) -> D:
        """The registered definition of the law."""
        found: D = self.registry[self.kind]
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the law's parameters, as in study files."""
        return tuple(p.name for p in self.definition.parameters)

    def value(self, name: str) -> float:
        """Value of the parameter of that name, as in study files."""
        return self.parameters[self.names.index(name)]

    def with_value(self, name: str, value: float) -> Self:
        """The law with another value of a parameter."""
        index = self.names.index(name)
        return replace(
            self, parameters=(*self.parameters[:index], value, *self.parameters[index + 1 :])
        )


def at_points(function: Callable[..., Any], n_out: int, *arguments: Any) -> np.ndarray:
    """A function of floats at all entries of arrays (n_out, ..); NaN where it overflows."""
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
    """Derivative of an array by a number, by central differences.

    Where the number is 0, the step is relative to `size`, or to 1.
    """
    h = DIFFERENCE_REL_STEP * (abs(value) or size or 1.0)
    slope: np.ndarray = (function(value + h) - function(value - h)) / (2.0 * h)
    return slope
