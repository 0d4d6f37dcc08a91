"""Builds the assembly of a lumped model from its parts, or many assemblies side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.linear_interfaces import DamperInterface, SpringInterface
from squealstudy.models.lumped.masses import MassSpace
from squealstudy.models.lumped.matrices import MatrixSpace
from squealstudy.models.lumped.number_types import Number
from squealstudy.models.lumped.numbers import value_of
from squealstudy.models.lumped.parts import Interface, LumpedParts, parts_of
from squealstudy.models.minimal_parts import LAW
from squealstudy.models.operating import FRICTION_RANGE
from squealstudy.models.own_law import curve_of
from squealstudy.models.stacked_assembly import StackedAssembly


def dotted(keys: KeyPath) -> str:
    """A key path as users write it; list positions count from 1."""
    text = "".join(f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in keys)
    return text.removeprefix(".")


@dataclass(frozen=True)
class LumpedBuild:
    """`ModelDefinition.build` and `stack` of a lumped model; can be sent to worker processes.

    Attributes
    ----------
    path : str
        Path of the file, for messages.
    space : MassSpace or MatrixSpace
        The coordinates of the model.
    own : tuple of str
        Parameters of the file, which its expressions use.
    """

    path: str
    space: MassSpace | MatrixSpace
    own: tuple[str, ...]

    def __call__(
        self,
        options: Mapping[str, str | int],
        values: Mapping[str, float],
    ) -> Assembly:
        """The assembly; ModelError where a number is not possible."""
        return assembly_of(self.space, self._parts(options, values))

    def stack(
        self,
        options: Mapping[str, str | int],
        values: Mapping[str, Any],
    ) -> StackedAssembly:
        """`__call__` for values that are numbers or arrays (m,)."""
        return stack_of(self.space, self._parts(options, values))

    def _parts(self, options: Mapping[str, str | int], values: Mapping[str, Any]) -> LumpedParts:
        try:
            return parts_of(self.space, values, curve_of(options))
        except PlacedError as error:
            raise ModelError(f"{self.path}, {dotted(error.keys)}: {error.message}") from error


@dataclass(frozen=True)
class LargestFriction:
    """Largest static friction coefficient of all contacts: the group of `FRICTION_RANGE`.

    Attributes
    ----------
    factors : tuple of float or str
        `friction_factor` of each contact with the study's friction.
    own : tuple of (float or str, mapping of parameter -> float or str)
        For each contact with its own friction: its coefficient (an expression of "friction" where
        it has the study's), and its values of friction-law parameters.
    """

    factors: tuple[Number, ...]
    own: tuple[tuple[Number, Mapping[str, Number]], ...] = ()

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """The coefficient at values of all parameters, numbers or arrays (m,).

        Where a factor has no value, factors count as 1; own friction without a value is left out.
        Such a design point fails when its model is built.
        """
        try:
            factors = [value_of(factor, values, ()) for factor in self.factors]
        except PlacedError:
            factors = []
        largest = np.maximum.reduce(np.broadcast_arrays(*factors)) if factors else 1.0
        groups = [] if not factors and self.own else [FRICTION_RANGE.group(values) * largest]
        for coefficient, law in self.own:
            try:
                numbers = {name: value_of(number, values, ()) for name, number in law.items()}
                numbers["friction"] = value_of(coefficient, values, ())
            except PlacedError:
                continue
            groups.append(FRICTION_RANGE.group({**values, **numbers}))
        return np.maximum.reduce(np.broadcast_arrays(*groups)) if groups else 0.0


def assembly_of(space: MassSpace | MatrixSpace, parts: LumpedParts) -> Assembly:
    """The assembly of parts whose values are numbers."""
    file, c, own = space.file, parts.contact, parts.structure
    spans = zip(own.components, own.offsets, own.offsets[1:], strict=False)
    return Assembly(
        components=tuple(
            Component(
                name,
                sp.csr_matrix(own.M[0, a:b, a:b]),
                sp.csr_matrix(own.K[0, a:b, a:b]),
                C=None if own.C is None else sp.csr_matrix(own.C[0, a:b, a:b]),
                G=None if own.G is None else sp.csr_matrix(own.G[0, a:b, a:b]),
            )
            for name, a, b in spans
        ),
        contact=ContactInterface(
            N=sp.csr_matrix(c.N[0]),
            T=sp.csr_matrix(c.T[0]),
            T_perp=sp.csr_matrix(c.T_perp[0]),
            area=c.area[0],
            gap0=c.gap[0],
            radius=c.radius[0],
            law=LAW,
            frictional=c.frictional[0],
            speed_factor=c.speed_factor[0],
            pairs=(
                *(file.name_of("contact", i) for i in range(len(file.contact))),
                *(file.name_of("spring", i) for i, s in enumerate(file.spring) if not s.linear),
                *(file.name_of("damper", i) for i, d in enumerate(file.damper) if not d.linear),
            ),
            spring_points=c.spring_points[0],
            own_friction=c.own_friction[0],
        ),
        springs=(
            *(SpringInterface(s.name, sp.csr_matrix(s.row), s.size) for s in parts.springs),
            *(
                SpringInterface(s.name, sp.csr_matrix(s.row), s.size, False)
                for s in parts.stuck_springs
            ),
        ),
        load=parts.load[0],
        constant_load=parts.constant_load[0],
        dampers=tuple(DamperInterface(d.name, sp.csr_matrix(d.row), d.size) for d in parts.dampers),
    )


def stack_of(space: MassSpace | MatrixSpace, parts: LumpedParts) -> StackedAssembly:
    """Assemblies side by side, of parts whose values are arrays."""
    c, own = parts.contact, parts.structure
    static_springs = _matrix(parts.springs, space.n)
    springs = (
        static_springs + _matrix(parts.stuck_springs, space.n)
        if parts.stuck_springs
        else static_springs
    )
    dampers = _matrix(parts.dampers, space.n) if parts.dampers else None
    rates = [A for A in (own.C, own.G, dampers) if A is not None]
    return StackedAssembly(
        components=own.components,
        offsets=np.array(own.offsets),
        M=own.M,
        K=own.K,
        springs=springs,
        static_springs=static_springs,
        C=sum(rates[1:], rates[0]) if rates else None,
        N=c.N,
        T=c.T,
        T_perp=c.T_perp,
        area=c.area,
        gap0=c.gap,
        frictional=c.frictional,
        speed_factor=c.speed_factor,
        load=parts.load,
        constant_load=parts.constant_load,
        spring_points=c.spring_points,
        own_friction=c.own_friction,
    )


def _matrix(interfaces: list[Interface], n: int) -> np.ndarray:
    """Matrix (m or 1, n, n) of interfaces: the sum of row^T size row."""
    total = np.zeros((1, n, n))
    for interface in interfaces:
        weighted = interface.size[:, None] * interface.row
        total = total + interface.row[:, :, None] * weighted[:, None, :]
    return total
