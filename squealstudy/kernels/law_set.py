"""The laws that kernels are compiled with: those of the package, each with a code of its own.

Laws from outside have one code in common, and kernels call their functions by address
(`kernels/outside.py`): nothing else is compiled for them.
"""

from __future__ import annotations

from collections.abc import Mapping

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


def _of_package(laws: Registry[D]) -> dict[int, D]:
    return dict(enumerate(law for law in laws if law.in_package))


CONTACT: dict[int, ContactLawDefinition] = _of_package(CONTACT_LAWS)
CURVES: dict[int, FrictionCurveDefinition] = _of_package(FRICTION_CURVES)
SLOPES: dict[int, Regularisation] = _of_package(REGULARISATIONS)
SOURCES = tuple(
    (law.name, law.source) for laws in (CONTACT, CURVES, SLOPES) for law in laws.values()
)


def code_of(law: LawDefinition, laws: Mapping[int, LawDefinition]) -> int:
    """Code of a law among those of its sort; OUTSIDE where it is not of the package."""
    codes = {(other.name, other.source): code for code, other in laws.items()}
    return codes.get((law.name, law.source), OUTSIDE)
