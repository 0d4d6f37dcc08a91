"""The one way to make a law known: a file of a law registers what it holds when it is read."""

from __future__ import annotations

from typing import TypeVar

from squealstudy.extensions import remember
from squealstudy.laws.contact_law import CONTACT_LAWS, ContactLawDefinition
from squealstudy.laws.friction_law import (
    FRICTION_CURVES,
    REGULARISATIONS,
    FrictionCurveDefinition,
    Regularisation,
)

L = TypeVar("L", ContactLawDefinition, FrictionCurveDefinition, Regularisation)


def register(law: L) -> L:
    """Make a contact law, a friction curve or a regularisation known by its name; returns it.

    Raises
    ------
    ModelError
        Another law of that name, a parameter that another law defines otherwise, or functions
        that were not written in a file.
    ExtensionError
        Functions of the program itself: workers could not execute them.
    """
    remember(law.functions[0])
    if isinstance(law, ContactLawDefinition):
        CONTACT_LAWS.add(law)
    elif isinstance(law, FrictionCurveDefinition):
        FRICTION_CURVES.add(law)
    else:
        REGULARISATIONS.add(law)
    return law
