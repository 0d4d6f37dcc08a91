"""From the parts of a lumped model to an assembly, or to a stack of them."""

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
from squealstudy.models.lumped.parts import Coordinates, Interface, LumpedParts, parts_of
from squealstudy.models.lumped.tables import LumpedFile
from squealstudy.models.minimal_parts import LAW
from squealstudy.models.stacked_assembly import StackedAssembly


def dotted(keys: KeyPath) -> str:
    """Keys as users write them: lists count from 1."""
    text = "".join(f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in keys)
    return text.removeprefix(".")


@dataclass(frozen=True)
class LumpedBuild:
    """Builds the model: what `ModelDefinition.build` and `stack` are; goes to worker processes.

    Attributes
    ----------
    path : str
        Of the file, for messages.
    file : LumpedFile
    own : tuple of str
        Parameters that its numbers are made of.
    """

    path: str
    file: LumpedFile
    own: tuple[str, ...]

    def __call__(
        self,
        options: Mapping[str, str | int],
        values: Mapping[str, float],
    ) -> Assembly:
        """The assembly; ModelError where a number cannot be what it is."""
        return assembly_of(self.file, self._parts(values))

    def stack(
        self,
        options: Mapping[str, str | int],
        values: Mapping[str, Any],
    ) -> StackedAssembly:
        """As `__call__`, of values that are numbers or arrays (m,)."""
        return stack_of(self.file, self._parts(values))

    def _parts(self, values: Mapping[str, Any]) -> LumpedParts:
        try:
            return parts_of(self.file, {name: values[name] for name in self.own})
        except PlacedError as error:
            raise ModelError(f"{self.path}, {dotted(error.keys)}: {error.message}") from error


def assembly_of(file: LumpedFile, parts: LumpedParts) -> Assembly:
    """The assembly of parts at numbers."""
    space, c = Coordinates(file), parts.contact
    n = len(space.places)
    spans = zip(file.mass, space.offsets, space.offsets[1:], strict=False)
    return Assembly(
        components=tuple(
            Component(
                table.name,
                sp.csr_matrix(np.diag(parts.masses[0, a:b])),
                sp.csr_matrix((b - a, b - a)),
            )
            for table, a, b in spans
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
            ),
            spring_points=c.spring_points[0],
        ),
        springs=tuple(SpringInterface(s.name, sp.csr_matrix(s.row), s.size) for s in parts.springs),
        load=np.broadcast_to(parts.load, (1, n))[0],
        constant_load=np.broadcast_to(parts.constant_load, (1, n))[0],
        dampers=tuple(DamperInterface(d.name, sp.csr_matrix(d.row), d.size) for d in parts.dampers),
    )


def stack_of(file: LumpedFile, parts: LumpedParts) -> StackedAssembly:
    """Assemblies side by side, of parts at arrays."""
    space, c = Coordinates(file), parts.contact
    n = len(space.places)
    springs = _matrix(parts.springs, n)
    return StackedAssembly(
        components=tuple(table.name for table in file.mass),
        offsets=np.array(space.offsets),
        M=parts.masses[:, :, None] * np.eye(n),
        K=np.zeros((1, n, n)),
        springs=springs,
        static_springs=springs,
        C=_matrix(parts.dampers, n) if parts.dampers else None,
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
    )


def _matrix(interfaces: list[Interface], n: int) -> np.ndarray:
    """Sum of row^T size row (m or 1, n, n)."""
    total = np.zeros((1, n, n))
    for interface in interfaces:
        weighted = interface.size[:, None] * interface.row
        total = total + interface.row[:, :, None] * weighted[:, None, :]
    return total
