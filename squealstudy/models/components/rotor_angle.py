"""Checks of a rotor angle: it must not move joined parts apart, nor rotate fixed directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.models.components.model_file import GROUND, ROTOR_ANGLE, ModelFile
from squealstudy.models.file_table import PlacedError


def expect_rotor(file: ModelFile) -> None:
    """Raise PlacedError where nothing turns, or where the rotor is joined to what does not turn."""
    if not file.turning:
        raise PlacedError(
            ROTOR_ANGLE, "nothing turns: no contact is sliding, and there is no rotor"
        )
    joints = [("contact", t.slave, t.master) for t in file.contact if t.kind != "sliding"]
    joints += [("tie", t.slave, t.master) for t in file.tie]
    joints += [("coupling", t.node, t.face) for t in file.coupling]
    joints += [
        (kind, *t.between)
        for kind, tables in (("layer", file.layer), ("spring", file.spring))
        for t in tables
        if GROUND not in (n.casefold() for n in t.between)
    ]
    for kind, *sides in joints:
        component, other_component = (side.partition(".")[0] for side in sides)
        if (component in file.turning) != (other_component in file.turning):
            turns, stays = (
                (component, other_component)
                if component in file.turning
                else (other_component, component)
            )
            raise PlacedError(
                ROTOR_ANGLE,
                f"a {kind} joins {turns}, which turns, and {stays}, which does not: expected no "
                "angle, or one mesh of both",
            )


def turns_with(dofs: Sequence[int], turn: np.ndarray) -> bool:
    """Whether fixed directions, of 1 to 6, stay the same after a rotation `turn` (3, 3)."""
    for first in (1, 4):
        axes = np.array([first + axis in dofs for axis in range(3)], dtype=float)
        fixed = np.diag(axes)
        if np.abs(turn @ fixed @ turn.T - fixed).max() > 1e-12:
            return False
    return True
