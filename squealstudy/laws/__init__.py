"""Contact laws, friction curves and regularisations: all of one in one file.

The files of the folders `contact`, `friction` and `regularisation` are read here; a file outside
the package registers what it holds in the same way (`squealstudy.extensions`).
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType

from squealstudy.laws import contact, friction, regularisation
from squealstudy.laws.contact_law import (
    CONTACT_LAWS,
    ContactLaw,
    ContactLawDefinition,
    contact_law,
)
from squealstudy.laws.friction_law import (
    DEFAULT_CURVE,
    FRICTION_CURVES,
    REGULARISATIONS,
    Friction,
    FrictionCurve,
    FrictionCurveDefinition,
    FrictionLaw,
    Number,
    Regularisation,
    friction_curve,
)
from squealstudy.laws.registry import register

__all__ = [
    "CONTACT_LAWS",
    "DEFAULT_CURVE",
    "FRICTION_CURVES",
    "REGULARISATIONS",
    "ContactLaw",
    "ContactLawDefinition",
    "Friction",
    "FrictionCurve",
    "FrictionCurveDefinition",
    "FrictionLaw",
    "Number",
    "Regularisation",
    "contact_law",
    "friction_curve",
    "register",
]


def _read(folder: ModuleType, first: str) -> None:
    """Import the files of a folder, that of its default law first."""
    names = [module.name for module in iter_modules(folder.__path__)]
    for name in sorted(names, key=lambda name: (name != first, name)):
        import_module(f"{folder.__name__}.{name}")


_read(contact, "exponential")
_read(friction, DEFAULT_CURVE)
_read(regularisation, "regularised")
