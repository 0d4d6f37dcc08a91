"""Sweep bases in files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.engine.files import write_atomic
from squealstudy.modes.reanalysis.polynomials import CollocatedSystem, Expansion
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis
from squealstudy.system.parametric import DAMPING, MASS, STIFFNESS


def save_basis(path: Path, basis: SweepBasis) -> None:
    """Keep a basis in a file that appears whole or not at all."""
    arrays: dict[str, Any] = {
        "V": basis.V,
        "flexibility": basis.flexibility,
        "trained": basis.trained,
        "facts": np.array(
            [basis.error, basis.seconds, basis.interpolated, float(basis.small.unit_mass)]
        ),
        "orders": np.array([e.order for e in basis.small.expansions]),
    }
    arrays |= {f"shapes.{i}": e.shapes for i, e in enumerate(basis.small.expansions)}
    arrays |= {f"stack.{order}": stack for order, stack in enumerate(basis.small.stacks)}

    def write(temporary: Path) -> None:
        with temporary.open("wb") as handle:
            np.savez(handle, **arrays)

    write_atomic(path, write)


def load_basis(path: Path) -> SweepBasis:
    """Read a basis that `save_basis` kept."""
    with np.load(path) as data:
        expansions = tuple(
            Expansion(int(order), data[f"shapes.{i}"]) for i, order in enumerate(data["orders"])
        )
        stacks = tuple(data[f"stack.{order}"] for order in (STIFFNESS, DAMPING, MASS))
        V, flexibility, trained = data["V"], data["flexibility"], data["trained"]
        error, seconds, interpolated, unit_mass = (float(x) for x in data["facts"])
        small = CollocatedSystem(V.shape[1], expansions, stacks, bool(unit_mass))
        return SweepBasis(
            V=V,
            flexibility=flexibility,
            small=small,
            error=error,
            trained=trained,
            seconds=seconds,
            interpolated=interpolated,
        )
