"""Parameters of the working point: they enter through the contact points, never the components."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from squealstudy.kernels.friction_laws import mu_at
from squealstudy.models.law import ContactLaw
from squealstudy.models.parameter import Parameter

FRICTION = Parameter(
    "friction", 0.5, "", "friction coefficient mu, the dynamic one", minimum=0.0, maximum=5.0
)
PRESSURE = Parameter("pressure", 12e5, "Pa", "brake pressure", positive=True)
SLIDING_SPEED = Parameter(
    "sliding_speed", 0.5, "m/s", "imposed sliding of the disc under the pads", positive=True
)
DAMPING = Parameter(
    "damping_ratio", 0.0, "", "modal damping of the assembly's real modes", minimum=0.0, maximum=1.0
)
STIFFNESS_DAMPING = Parameter(
    "stiffness_damping",
    0.0,
    "s",
    "damping proportional to stiffness (Rayleigh's beta): beta omega / 2 on top of damping_ratio",
    minimum=0.0,
)
STATIC_RATIO = Parameter(
    "friction_law.static_ratio",
    1.0,
    "",
    "static over dynamic friction; 1: friction does not fall with speed",
    minimum=1.0,
    maximum=10.0,
)
DECAY_SPEED = Parameter(
    "friction_law.decay_speed",
    0.5,
    "m/s",
    "sliding speed over which the excess of static friction falls by e",
    positive=True,
)
SLOPE = Parameter(
    "contact.kt",
    0.0,
    "N s/m3",
    "slope of friction at zero sliding, per area, in time only; 0: automatic, friction saturates "
    "at 2 % of the sliding speed where the working point presses hardest",
    minimum=0.0,
)
FRICTION_LAW = (STATIC_RATIO, DECAY_SPEED, SLOPE)
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
        mu_d, the coefficient of fast sliding.
    pressure : float
        Pa; factor on the assembly's `load`.
    sliding_speed : float
        |w0|, m/s.
    law : ContactLaw
    static_ratio : float
        mu_s/mu_d of mu(s) = mu_d + (mu_s - mu_d) exp(-s / decay_speed), s the sliding speed.
    decay_speed : float
        m/s.
    """

    friction: float
    pressure: float
    sliding_speed: float
    law: ContactLaw
    static_ratio: float = 1.0
    decay_speed: float = 0.5

    @property
    def mu_steady(self) -> float:
        """Friction coefficient at the imposed sliding speed."""
        return self._mu()[0]

    @property
    def friction_slope(self) -> float:
        """The slope dmu/ds [s/m] there, zero or negative."""
        return self._mu()[1]

    def _mu(self) -> tuple[float, float]:
        mu_s = float(self.static_ratio * self.friction)
        return mu_at(mu_s, float(self.friction), float(self.decay_speed), float(self.sliding_speed))


def law_from_values(kind: str, values: Mapping[str, float]) -> ContactLaw:
    """Contact law of the given kind from the values of the ``contact.*`` parameters."""
    return ContactLaw(
        kind,
        values.get("contact.p0", 1e5),
        values.get("contact.lambda", 5e5),
        values.get("contact.stiffness", 5e11),
        values.get("contact.exponent", 1.5),
    )
