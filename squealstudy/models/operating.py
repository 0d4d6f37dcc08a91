"""Parameters of the working point: they enter through the contact points, never the components."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from squealstudy.models.law import ContactLaw
from squealstudy.models.parameter import Parameter

FRICTION = Parameter("friction", 0.5, "", "friction coefficient mu", minimum=0.0, maximum=5.0)
PRESSURE = Parameter("pressure", 12e5, "Pa", "brake pressure", positive=True)
SLIDING_SPEED = Parameter(
    "sliding_speed", 0.5, "m/s", "imposed sliding of the disc under the pads", positive=True
)
DAMPING = Parameter(
    "damping_ratio", 0.0, "", "modal damping of the assembly's real modes", minimum=0.0, maximum=1.0
)
CONTACT_LAW = (
    Parameter("contact.p0", 1e5, "Pa", "exponential law: pressure at zero gap", positive=True),
    Parameter("contact.lambda", 5e5, "1/m", "exponential law: exponent", positive=True),
    Parameter(
        "contact.stiffness",
        5e11,
        "Pa/m^n",
        "unilateral, power (n its exponent) and bilateral laws: stiffness",
        positive=True,
    ),
    Parameter("contact.exponent", 1.5, "", "power law: exponent", minimum=1.0, maximum=10.0),
)


@dataclass(frozen=True)
class OperatingPoint:
    """Where the linearisation is done.

    Attributes
    ----------
    friction : float
        mu.
    pressure : float
        Pa; factor on the assembly's `load`.
    sliding_speed : float
        |w0|, m/s.
    law : ContactLaw
    """

    friction: float
    pressure: float
    sliding_speed: float
    law: ContactLaw


def law_from_values(kind: str, values: Mapping[str, float]) -> ContactLaw:
    """Contact law of the given kind from the values of the ``contact.*`` parameters."""
    return ContactLaw(
        kind,
        values.get("contact.p0", 1e5),
        values.get("contact.lambda", 5e5),
        values.get("contact.stiffness", 5e11),
        values.get("contact.exponent", 1.5),
    )
