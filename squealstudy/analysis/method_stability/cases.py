"""All cases of method-stability studies, by name."""

from __future__ import annotations

from collections.abc import Mapping

from squealstudy.analysis.method_stability.contract import Case
from squealstudy.analysis.method_stability.default_chain import DEFAULT_CHAIN
from squealstudy.analysis.method_stability.fixed_jacobian import (
    FIXED_JACOBIAN,
    FIXED_JACOBIAN_POINT,
)
from squealstudy.analysis.method_stability.impact_energy import IMPACT_ENERGY

CASES: Mapping[str, Case] = {
    case.name: case for case in (FIXED_JACOBIAN, FIXED_JACOBIAN_POINT, DEFAULT_CHAIN, IMPACT_ENERGY)
}
