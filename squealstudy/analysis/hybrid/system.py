"""Design points on a hybrid model and their damping.

Damping has three parts::

    C = beta K + M phi (2 zeta omega - beta omega^2) phi^T M + shapes^T d shapes

(THEORY.md eq. (81)): every mode in `phi` has exactly its zeta, and the rest is damped by
beta K, a ratio beta omega / 2. The modal representation has the same damping where its coordinates
up to the same cutoff get 2 zeta omega and those beyond it beta omega^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.transient.system import FrictionLaw, law_row
from squealstudy.errors import ModelError
from squealstudy.models.law import ContactLaw
from squealstudy.reduction.hybrid import HybridModel


@dataclass(frozen=True)
class HybridDesign:
    """One design point on a hybrid model.

    Parameters
    ----------
    contact : ContactLaw
    friction : FrictionLaw
    speed : float
        Imposed sliding velocity along T, m/s.
    zeta : ndarray (m,)
        Damping ratio of each of the model's modes.
    beta : float
        Stiffness-proportional damping of everything beyond them, s.
    d : ndarray (k,) or None
        Damping of the model's shapes, 2 zeta_c omega_c of component modes, rad/s.
    gap : ndarray (nc,) or None
        At the design's own working point, m; None for the model's reference.
    force : ndarray (nc, 3) or None
        Normal and friction forces balanced there, N; None for the reference's.

    Raises
    ------
    ModelError
        Damping or speed that is negative or not finite.
    """

    contact: ContactLaw
    friction: FrictionLaw
    speed: float
    zeta: np.ndarray
    beta: float
    d: np.ndarray | None = None
    gap: np.ndarray | None = None
    force: np.ndarray | None = None

    def __post_init__(self) -> None:
        d = np.zeros(0) if self.d is None else self.d
        values = np.concatenate([np.ravel(self.zeta), [self.beta, self.speed], d])
        if not (np.isfinite(values).all() and (values >= 0).all()):
            raise ModelError("hybrid design: damping and speed must be finite, not negative")

    def law_row(self) -> np.ndarray:
        """(9,) for the kernels."""
        return law_row(self.contact, self.friction, self.speed)


def uniform_damping(
    model: HybridModel, zeta: float, beyond: float | None = None
) -> tuple[np.ndarray, float]:
    """Damping ratios `zeta` (m,) up to the model's damping cutoff, and `beta` [s] beyond it.

    Parameters
    ----------
    model : HybridModel
    zeta : float
        Of all modes up to the cutoff.
    beyond : float or None
        Ratio at the cutoff from where it rises in proportion to frequency; None for `zeta`. Finite
        elements squeal far above the band too (studies/benchmarks/hybrid.py --above).
    """
    start = zeta if beyond is None else beyond
    return np.full(len(model.omega), zeta), start / (np.pi * model.damping_cutoff)


def design_points(model: HybridModel, design: HybridDesign) -> np.ndarray:
    """Contact points of a design (nc, 8) for the kernels, at its own base state.

    Raises
    ------
    ModelError
        A base, or dampings, that do not fit the model or are not finite.
    """
    gap = model.gap if design.gap is None else np.asarray(design.gap, dtype=float)
    force = model.force if design.force is None else np.asarray(design.force, dtype=float)
    if gap.shape != model.gap.shape or force.shape != model.force.shape:
        raise ModelError(f"hybrid design: 'gap', 'force' need {len(model.gap)} points")
    if not (np.isfinite(gap).all() and np.isfinite(force).all()):
        raise ModelError("hybrid design: 'gap' or 'force' has values that are not finite")
    if np.shape(design.zeta) != model.omega.shape:
        raise ModelError(f"hybrid design: 'zeta' needs {len(model.omega)} values")
    if design.d is not None and np.shape(design.d) != (model.shapes.shape[0],):
        raise ModelError(f"hybrid design: 'd' needs {model.shapes.shape[0]} values")
    columns = (gap, model.area, model.frictional, model.radius, model.k_ref)
    return np.column_stack([*columns, force]).astype(float)
