"""Runs that end with far more energy than was ever put in: a step that impacts do not forgive."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.transient.settings import TransientResult
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.kernels.contact_point import POINT_GAP
from squealstudy.kernels.integrator_state import BLOW_UP


def blown_up(
    result: TransientResult,
    system: ModalSystem,
    design: TransientDesign,
    q0: np.ndarray,
    v0: np.ndarray,
) -> bool:
    """Whether energy came from nowhere, from an initial state q0, v0 (n,) on.

    Put in are the work of loads and belt, the initial motion and what the contact had stored; what
    was dissipated came out as well, as the kernels balance their energies.
    """
    energy = result.energy
    p, kappa = design.contact.evaluate(system.points(design)[POINT_GAP] + system.N @ q0)
    soft = np.divide(p, kappa, out=np.zeros_like(p), where=kappa > 0)
    put_in = abs(energy.stored_start) + abs(energy.work_load) + abs(energy.work_belt)
    put_in += 0.5 * float(v0 @ v0 + system.omega2 @ (q0 * q0)) + float(system.area @ (p * soft))
    came_out = energy.stored_end + energy.friction + energy.damping
    return bool(result.outcome == "ok" and came_out > BLOW_UP * put_in)
