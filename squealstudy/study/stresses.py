"""Effects of steady sliding on the model of a file: stresses that stiffen it, worn faces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from squealstudy.laws import ContactLaw, contact_law
from squealstudy.laws.own_friction import coefficients_alone
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import Brake, changed_mesh, own_numbers
from squealstudy.models.components.dimensions import STRESS
from squealstudy.models.components.model_file import WEAR, ModelFile, Numbers
from squealstudy.models.file_table import KeyPath
from squealstudy.models.linear_interfaces import StressStiffness
from squealstudy.models.operating import (
    FRICTION,
    PRESSURE,
    SLIDING_SPEED,
    OperatingPoint,
    contact_parameters,
)
from squealstudy.models.parameter import Assumption, Declared
from squealstudy.parameter import Parameter

# number of assemblies whose stresses a process keeps, because their working points take long
ASSEMBLY_CACHE_SIZE = 4
# largest relative difference of pressure, and difference of friction, at which stresses hold
MAX_OPERATING_DIFFERENCE = 0.2


def stressed_point(file: ModelFile) -> OperatingPoint | None:
    """The operating point of ``[stress_stiffening]`` in SI units, sliding forward, or None."""
    table = file.stress_stiffening
    if table is None:
        return None
    pressure = table.pressure * STRESS.factor(file.units)
    return OperatingPoint(table.friction, pressure, 1.0, contact_law())


def law_defaults(declared: Declared) -> dict[str, float]:
    """Default of every contact-law parameter: the file's, else the law's."""
    of_file = {p.name: p.default for p in declared if isinstance(p, Parameter)}
    return {p.name: of_file.get(p.name, p.default) for p in contact_parameters()}


_stored_stresses: dict[tuple[Any, ...], StressStiffness] = {}


def with_stresses(
    assembly: Assembly, brake: Brake, operating: OperatingPoint, overrides: Mapping[KeyPath, float]
) -> Assembly:
    """An assembly of a brake with the stiffness due to stresses in its meshed components.

    Parameters
    ----------
    assembly : Assembly
    brake : Brake
    operating : OperatingPoint
        Operating point whose steady sliding causes the stresses.
    overrides : mapping of key -> float
        Numbers of the file that have other values in the assembly.

    Raises
    ------
    ConvergenceError
        Where there is no steady sliding.
    """
    from squealstudy.reduction.stress_stiffening import stress_stiffness_of

    key = (brake, operating, tuple(sorted(overrides.items(), key=str)))
    if key not in _stored_stresses:
        from squealstudy.models.components.geometry import geometry_at  # of meshes alone

        meshes = {
            name: changed_mesh(body, own_numbers(name, overrides))
            for name, body in geometry_at(brake, overrides).bodies.items()
            if body.matrices is None
        }
        if len(_stored_stresses) >= ASSEMBLY_CACHE_SIZE:
            _stored_stresses.pop(next(iter(_stored_stresses)))
        _stored_stresses[key] = stress_stiffness_of(_without_laws(assembly), operating, meshes)
    return replace(assembly, springs=(*assembly.springs, _stored_stresses[key]))


def with_worn_gaps(
    assembly: Assembly, file: ModelFile, law: ContactLaw, overrides: Mapping[KeyPath, float]
) -> Assembly:
    """An assembly with contact worn as ``[wear]`` of its file says; the same without that table.

    Parameters
    ----------
    assembly : Assembly
    file : ModelFile
    law : ContactLaw
        Law of the contact while it wore.
    overrides : mapping of key -> float
        Numbers of the file that have other values, SI.

    Raises
    ------
    ConvergenceError
        Where there is no steady sliding at some stage of wear.
    """
    if file.wear is None:
        return assembly
    from squealstudy.reduction.wear import Wear, worn_depth

    numbers = Numbers(file, overrides)
    pressure = file.wear.pressure * STRESS.factor(file.units)
    operating = OperatingPoint(file.wear.friction, pressure, 1.0, law)
    wear = Wear(operating, numbers.at(WEAR, "distance"), numbers.at(WEAR, "rate"))
    gap0 = assembly.contact.gap0 + worn_depth(_without_laws(assembly), wear)
    return replace(assembly, contact=replace(assembly.contact, gap0=gap0))


def _without_laws(assembly: Assembly) -> Assembly:
    """The assembly without friction laws of contacts: a table's friction is at all speeds."""
    contact = assembly.contact
    own = coefficients_alone(contact.own_friction)
    return replace(assembly, contact=replace(contact, own_friction=own))


@dataclass(frozen=True)
class _Off:
    """How far design points are from where stresses were taken; sent to worker processes."""

    at: OperatingPoint
    of_pressure: bool

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Relative distance in pressure, or distance in friction, which is negative in reverse."""
        if self.of_pressure:
            return abs(values[PRESSURE.name] / self.at.brake_pressure - 1)
        way = np.copysign(1.0, values[SLIDING_SPEED.name])
        return abs(way * values[FRICTION.name] - self.at.friction)


def stress_assumptions(stressed: OperatingPoint | None) -> tuple[Assumption, ...]:
    """Assumptions that bound how far stresses of one operating point are used for others."""
    if stressed is None:
        return ()
    pressure = (
        f"stresses are those of {stressed.brake_pressure:g} Pa: pressures differ by at most 20 %"
    )
    friction = (
        f"stresses are those of friction {stressed.friction:g}: it differs by at most "
        f"{MAX_OPERATING_DIFFERENCE:g}"
    )
    return (
        Assumption(pressure, _Off(stressed, of_pressure=True), MAX_OPERATING_DIFFERENCE),
        Assumption(
            f"{friction} (reverse: -friction)",
            _Off(stressed, of_pressure=False),
            MAX_OPERATING_DIFFERENCE,
        ),
    )
