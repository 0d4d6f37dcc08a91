"""Tables of component modes: frequencies, and damping ratios equivalent to loss factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.linalg.real_modes import real_modes, rigid_modes
from squealstudy.models.assembly import Assembly, Component
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.parameter_names import parse_parameter

if TYPE_CHECKING:
    import pandas as pd

LINEARITY_REL_TOLERANCE = 1e-9  # largest relative deviation of a stiffness from linear in moduli


def component_modes(point: ModelPoint, cutoff_hz: float) -> pd.DataFrame:
    """Free-free modes of the components (`Model.component_modes`)."""
    import pandas as pd

    rows = []
    for c in point.assembly().components:
        omega, _ = real_modes(c.M, c.K, cutoff_hz)
        rigid = rigid_modes(c.M, c.K, omega)
        rows += [
            (c.name, c.n_dof, j + 1, float(w / (2 * np.pi)), j < rigid) for j, w in enumerate(omega)
        ]
    names = ["component", "n_dof", "mode", "frequency_hz", "rigid"]
    table = pd.DataFrame(rows, columns=names)
    table.attrs["units"] = {"n_dof": "", "mode": "", "frequency_hz": "Hz"}
    return table


def loss_damping(
    point: ModelPoint, factors: Mapping[str | tuple[str, ...], float], cutoff_hz: float
) -> pd.DataFrame:
    """Damping ratios of component modes for loss factors (`Model.loss_damping`)."""
    import pandas as pd

    parts, rows = point.assembly().components, []
    materials = [name for m in factors for name in ((m,) if isinstance(m, str) else m)]
    if repeated := next((name for name in materials if materials.count(name) > 1), ""):
        raise ParameterError(repeated, "expected one loss factor of a material, got two")
    moduli = {(m,) if isinstance(m, str) else tuple(m): eta for m, eta in factors.items()}
    doubled = {names: _scaled(point, dict.fromkeys(names, 2.0)).components for names in moduli}
    for names, eta in moduli.items():
        thrice = _scaled(point, dict.fromkeys(names, 3.0)).components
        if not _scale_stiffness(parts, doubled[names], thrice):
            text = "expected moduli of a component, all of those that a material has"
            raise ParameterError(" and ".join(names), text)
        if not eta >= 0:
            raise ParameterError(" and ".join(names), f"expected a loss factor, got {eta}")
    if len(moduli) > 1:
        all_doubled = _scaled(point, dict.fromkeys(materials, 2.0)).components
        for k, c in enumerate(parts):
            change_of_all = all_doubled[k].K - c.K
            sum_of_changes = sum(scaled_parts[k].K - c.K for scaled_parts in doubled.values())
            if abs(change_of_all - sum_of_changes).max() > LINEARITY_REL_TOLERANCE * abs(c.K).max():
                raise ParameterError(
                    materials[-1], "expected one loss factor of a material, got two"
                )
    for k, c in enumerate(parts):
        K = {names: scaled_parts[k].K - c.K for names, scaled_parts in doubled.items()}
        if not any(abs(K_of_material).max() > 0 for K_of_material in K.values()):
            continue
        omega, phi = real_modes(c.M, c.K, cutoff_hz)
        for j in range(rigid_modes(c.M, c.K, omega), len(omega)):
            u = phi[:, j]
            share = {
                names: float(u @ (K_of_material @ u)) / omega[j] ** 2
                for names, K_of_material in K.items()
            }
            zeta = sum(0.5 * moduli[names] * e for names, e in share.items())
            name = f"{c.name}.modes[{j + 1}].damping_ratio"
            hz = float(omega[j] / (2 * np.pi))
            rows.append((name, c.name, j + 1, hz, sum(share.values()), zeta))
    columns = ["parameter", "component", "mode", "frequency_hz"]
    columns += ["energy_share", "damping_ratio"]
    table = pd.DataFrame(rows, columns=columns)
    table.attrs["units"] = dict.fromkeys(columns[2:], "") | {"frequency_hz": "Hz"}
    return table


def _scaled(point: ModelPoint, factors: Mapping[str, float]) -> Assembly:
    """The model as it is assembled, with factors on some of its parameters."""
    values = point.plain_values()
    for name, factor in factors.items():
        if name not in values:
            parse_parameter(name, point.model)
            raise ParameterError(name, "expected moduli of a component")
        values[name] *= factor
    return point.model.build(point.options, values)


def _scale_stiffness(
    once: Sequence[Component], twice: Sequence[Component], thrice: Sequence[Component]
) -> bool:
    """Whether stiffness changes with some values, linearly: at one, two and three times them."""
    largest_change = 0.0
    for a, b, c in zip(once, twice, thrice, strict=True):
        if not np.array_equal(a.coordinates, b.coordinates):
            return False
        change = abs(b.K - a.K).max()
        if abs(c.K - 2 * b.K + a.K).max() > LINEARITY_REL_TOLERANCE * max(
            change, abs(a.K).max() * LINEARITY_REL_TOLERANCE
        ):
            return False
        largest_change = max(largest_change, change)
    return largest_change > 0
