"""The laws that kernels are compiled with: those of the package, each with a code of its own.

Laws from outside, and the few of the package that are `by_address`, have one code in common:
kernels call their functions by address (`kernels/outside.py`) and hold none of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from squealstudy.kernels.newmark_layout import OUTSIDE
from squealstudy.laws import (
    CONTACT_LAWS,
    FRICTION_CURVES,
    REGULARISATIONS,
    ContactLawDefinition,
    FrictionCurveDefinition,
    Regularisation,
)
from squealstudy.laws.registry import D, LawDefinition, Registry


def _within_kernels(laws: Registry[D]) -> dict[int, D]:
    return dict(enumerate(law for law in laws if law.in_package and not law.by_address))


CONTACT: dict[int, ContactLawDefinition] = _within_kernels(CONTACT_LAWS)
CURVES: dict[int, FrictionCurveDefinition] = _within_kernels(FRICTION_CURVES)
SLOPES: dict[int, Regularisation] = _within_kernels(REGULARISATIONS)
_REGISTRIES: tuple[Iterable[LawDefinition], ...] = (CONTACT_LAWS, FRICTION_CURVES, REGULARISATIONS)
SOURCES = tuple((law.name, law.source) for laws in _REGISTRIES for law in laws if law.in_package)


def code_of(law: LawDefinition, laws: Mapping[int, LawDefinition]) -> int:
    """Code of a law among those of its sort; OUTSIDE where kernels do not hold it."""
    codes = {(other.name, other.source): code for code, other in laws.items()}
    return codes.get((law.name, law.source), OUTSIDE)
