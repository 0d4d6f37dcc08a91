"""All cases of method-stability studies, by name."""

from __future__ import annotations

from collections.abc import Mapping

from squealstudy.laboratory.method_stability.coalescence import COALESCENCE
from squealstudy.laboratory.method_stability.contract import Case
from squealstudy.laboratory.method_stability.default_chain import DEFAULT_CHAIN
from squealstudy.laboratory.method_stability.equilibrium import WORKING_POINT
from squealstudy.laboratory.method_stability.explicit import EXPLICIT
from squealstudy.laboratory.method_stability.fixed_jacobian import (
    FIXED_JACOBIAN,
    FIXED_JACOBIAN_POINT,
)
from squealstudy.laboratory.method_stability.impact_energy import IMPACT_ENERGY
from squealstudy.laboratory.method_stability.linearisation import LINEARISATION
from squealstudy.laboratory.method_stability.orthonormalisation import ORTHONORMALISATION
from squealstudy.laboratory.method_stability.storage import STORAGE
from squealstudy.laboratory.method_stability.tracking import TRACKING
from squealstudy.laboratory.method_stability.windows_rung import WINDOWS_RUNG

CASES: Mapping[str, Case] = {
    case.name: case
    for case in (
        FIXED_JACOBIAN,
        FIXED_JACOBIAN_POINT,
        DEFAULT_CHAIN,
        IMPACT_ENERGY,
        EXPLICIT,
        COALESCENCE,
        TRACKING,
        LINEARISATION,
        ORTHONORMALISATION,
        WORKING_POINT,
        STORAGE,
        WINDOWS_RUNG,
    )
}
