"""What single-precision storage of the observation matrix may do to contact forces."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.transient.system import ModalSystem, TransientDesign

STORAGE_LIMIT = 1e-3  # relative change of contact forces: what a step's imbalance may be


def storage_number(system: ModalSystem, design: TransientDesign, energy: float) -> float:
    """Largest relative change of a contact pressure by storage in single precision; a bound.

    The entries of N change by dN, known exactly, and a motion of energy E has no larger change of
    gap than |dN / omega| sqrt(2 E) (Cauchy and Schwarz). Modes without stiffness are left out:
    their displacement has no bound.

    Parameters
    ----------
    system : ModalSystem
    design : TransientDesign
    energy : float
        Largest modal energy of the motion, J.
    """
    elastic = system.omega2 > 0
    rounded = system.N.astype(np.float32).astype(float) - system.N
    share = rounded[:, elastic] / np.sqrt(system.omega2[elastic])
    change = np.linalg.norm(share, axis=1) * np.sqrt(2 * max(energy, 0.0))
    gap = system.gap if design.gap is None else np.asarray(design.gap, dtype=float)
    pressure, _ = design.contact.evaluate(gap)
    scale = np.array([design.contact.gap_scale(max(float(p), 0.0)) for p in pressure])
    closed = pressure > 0
    with np.errstate(over="ignore"):
        return float(np.expm1((change / scale)[closed]).max(initial=0.0))
