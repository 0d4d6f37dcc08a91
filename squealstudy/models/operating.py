"""Operating point and design state of a design point, and the parameters of the working point.

Parameters have their names in study files. Those of the working point act at the contact points,
never in the components.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.laws import (
    CONTACT_LAWS,
    FRICTION_CURVES,
    ContactLaw,
    Friction,
    FrictionCurve,
    friction_curve,
)
from squealstudy.laws.friction.exponential_fall import STATIC_RATIO
from squealstudy.laws.friction.map import MAP_RATIOS
from squealstudy.laws.friction.table import RATIOS
from squealstudy.laws.own_friction import NO_OWN_FRICTION, has_own, own_mu, own_slopes
from squealstudy.models.parameter import Assumption, ModelOption
from squealstudy.parameter import Parameter

FRICTION = Parameter(
    "friction", 0.5, "", "friction coefficient mu, the dynamic one", minimum=0.0, maximum=5.0
)
PRESSURE = Parameter("pressure", 12e5, "Pa", "brake pressure", positive=True, usual=(1e3, 1e8))
SLIDING_SPEED = Parameter(
    "sliding_speed",
    0.5,
    "m/s",
    "imposed sliding of the disc under the pads; negative: in reverse",
    nonzero=True,
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
SLOPE = Parameter(
    "contact.kt",
    0.0,
    "N s/m3",
    "slope of friction at zero sliding, per area, in time only; 0: automatic, friction saturates "
    "at contact.regularisation_speed where the working point has most of it",
    minimum=0.0,
)
GYROSCOPIC = Parameter(
    "gyroscopic_factor",
    0.0,
    "",
    "factor on the gyroscopic terms of the disc as it turns at sliding_speed over its radius, seen "
    "from the pads; 0: none, 1: as they are. Of a disc symmetric about its axis",
    minimum=0.0,
    maximum=1.0,
)
REGULARISATION_SHARE = 0.002  # regularisation speed over the slowest sliding speed of a study
REGULARISATION_SPEED = Parameter(
    "contact.regularisation_speed",
    0.0,
    "m/s",
    "sliding speed below which a point sticks, of the automatic contact.kt, in time only. 0: "
    f"{100 * REGULARISATION_SHARE:g} % of the slowest sliding_speed of all design points of the "
    "study, so that a slower one changes every row",
    minimum=0.0,
)
IN_TIME_ONLY = (SLOPE.name, REGULARISATION_SPEED.name)  # complex modes do not see them


def contact_parameters() -> tuple[Parameter, ...]:
    """Parameters of all registered contact laws."""
    return CONTACT_LAWS.parameters()


def friction_parameters() -> tuple[Parameter, ...]:
    """Parameters of friction: those of all registered curves, and those of its slope in time."""
    return *FRICTION_CURVES.parameters(), SLOPE, REGULARISATION_SPEED


def contact_laws() -> tuple[str, ...]:
    """Names of all registered contact laws."""
    return CONTACT_LAWS.names


def pulling_laws() -> tuple[str, ...]:
    """Names of the contact laws for contact that stays closed, the linear one first."""
    return tuple(law.name for law in CONTACT_LAWS if law.pulls)


def pulling_parameters() -> tuple[Parameter, ...]:
    """Parameters of the contact laws that pull where they are open, each once."""
    return tuple({p.name: p for law in CONTACT_LAWS if law.pulls for p in law.parameters}.values())


def friction_laws() -> tuple[str, ...]:
    """Names of all registered friction curves."""
    return FRICTION_CURVES.names


CONTACT_OPTION = ModelOption("contact_law", contact_laws, "pressure over the gap")
FRICTION_OPTION = ModelOption(
    "friction_law", friction_laws, "friction over sliding speed and pressure"
)

LARGEST_FRICTION = 2.0  # friction of dry contacts; brakes are below 1
LARGEST_MODAL_DAMPING = 0.2  # with more damping, damping each mode alone is no approximation


def _static_friction(values: Mapping[str, Any]) -> Any:
    ratios = [values[name] for name in (STATIC_RATIO.name, *RATIOS, *MAP_RATIOS) if name in values]
    return values["friction"] * np.maximum.reduce(np.broadcast_arrays(*ratios))


def _damping_ratio(values: Mapping[str, Any]) -> Any:
    return values["damping_ratio"]


FRICTION_RANGE = Assumption(
    f"static friction of dry contacts is at most {LARGEST_FRICTION:g}",
    _static_friction,
    LARGEST_FRICTION,
)
LIGHTLY_DAMPED = Assumption(
    f"modal damping is light, a ratio of at most {LARGEST_MODAL_DAMPING:g}",
    _damping_ratio,
    LARGEST_MODAL_DAMPING,
)
ASSUMPTIONS = (FRICTION_RANGE, LIGHTLY_DAMPED)  # assumptions of every model with contact


# fields of OperatingPoint that are parameters, by their names in study files
_FIELD_OF_PARAMETER = {
    FRICTION.name: "friction",
    PRESSURE.name: "brake_pressure",
    SLIDING_SPEED.name: "sliding_speed",
    GYROSCOPIC.name: "gyroscopic",
}


@dataclass(frozen=True)
class OperatingPoint:
    """Friction, loads, sliding and contact laws, at which a model is linearised.

    Attributes
    ----------
    friction : float
        The coefficient of fast sliding, which scales `curve`.
    brake_pressure : float
        Brake pressure, Pa: factor on the assembly's `load`.
    sliding_speed : float
        Imposed sliding speed, m/s: a contact point slides at this times its `speed_factor`, along T
        where positive, against T where negative.
    law : ContactLaw
    curve : FrictionCurve
        Friction over sliding speed and contact pressure.
    gyroscopic : float
        Factor on the gyroscopic terms of rotors.
    """

    friction: float
    brake_pressure: float
    sliding_speed: float
    law: ContactLaw
    curve: FrictionCurve = field(default_factory=friction_curve)
    gyroscopic: float = 0.0

    @property
    def turning(self) -> float:
        """Weight of `Assembly.turning`, m/s; negative for sliding against T."""
        return self.gyroscopic * self.sliding_speed

    def expect_turning(self, turning: object, unturned: str) -> None:
        """ParameterError, with the reason, where gyroscopic terms are asked for in vain."""
        if self.gyroscopic and turning is None:
            raise ParameterError(GYROSCOPIC.name, unturned or "nothing turns in this model")

    @property
    def direction(self) -> float:
        """1 for sliding along T, -1 for sliding against it."""
        return float(np.copysign(1.0, self.sliding_speed))

    def speed_at(self, speed_factor: np.ndarray) -> float | np.ndarray:
        """Sliding speeds [m/s], positive, of points with these factors (nc,).

        One number where all are the same.
        """
        speeds: np.ndarray = abs(self.sliding_speed) * speed_factor
        return float(speeds[0]) if len(speeds) and (speeds == speeds[0]).all() else speeds

    def friction_at(
        self, p: np.ndarray, speed_factor: np.ndarray, own_friction: np.ndarray = NO_OWN_FRICTION
    ) -> Friction:
        """Friction at contact pressures p (nc,) [Pa] of points with these factors (nc,).

        `own_friction` (nc, k) is that of points which do not follow the study's friction
        (laws/own_friction.py). Where no sliding is imposed, the sign is that of slip along T.

        Where sliding is against T, the coefficient and dmu/dp are negative: traction opposes
        sliding. dmu/ds is the slope by the velocity along T in both cases. Contact that pulls
        (p < 0) has no friction, as in time. The result has floats where friction is computed for
        all points together, else arrays (nc,).
        """
        if has_own(own_friction):
            speeds = abs(self.sliding_speed) * speed_factor
            friction = Friction(
                *own_mu(self.curve.definition, self._values, own_friction, speeds, p)
            )
        else:
            friction = self.curve.at(self.friction, self.speed_at(speed_factor), p)
        if (p < 0.0).any():
            friction = Friction(*(np.where(p < 0.0, 0.0, part) for part in friction))
        if self.direction > 0:
            return friction
        sign = np.where(speed_factor == 0.0, 1.0, -1.0) if has_own(own_friction) else -1.0
        return friction._replace(mu=sign * friction.mu, by_pressure=sign * friction.by_pressure)

    @property
    def _values(self) -> tuple[float, tuple[float, ...]]:
        """Friction and the parameters of its curve."""
        return self.friction, self.curve.parameters

    def friction_slopes(
        self, p: np.ndarray, speed_factor: np.ndarray, own_friction: np.ndarray = NO_OWN_FRICTION
    ) -> np.ndarray:
        """Derivatives of `friction_at` (k, 3, 1 or nc), in the order of `FrictionCurve.slopes`.

        The first row is by the imposed sliding speed.
        """
        speeds = self.speed_at(speed_factor)
        if has_own(own_friction):
            speeds = abs(self.sliding_speed) * speed_factor
            rows = own_slopes(self.curve.definition, self._values, own_friction, speeds, p)
        else:
            rows = self.curve.slopes(self.friction, speeds, p)
        rows[0] = rows[0] * (speeds / abs(self.sliding_speed))
        if (p < 0.0).any():
            rows = np.where(p < 0.0, 0.0, rows)
        if self.direction < 0:
            sign = np.where(speed_factor == 0.0, 1.0, -1.0) if has_own(own_friction) else -1.0
            rows[1:, [0, 2]] *= sign
            rows[0, 1] *= -1.0
        return rows

    def traction(
        self, p: np.ndarray, speed_factor: np.ndarray, own_friction: np.ndarray = NO_OWN_FRICTION
    ) -> np.ndarray:
        """Friction traction mu p [Pa] of steady sliding, against T; arguments of `friction_at`."""
        drag: np.ndarray = self.friction_at(p, speed_factor, own_friction).mu * p
        return drag

    @property
    def sliding_friction(self) -> tuple[float | str, ...]:
        """Everything in friction on which steady sliding depends, to compare working points."""
        if self.curve.constant:
            return (self.direction * self.friction,)
        return (self.curve.kind, *self.curve.parameters, self.friction, self.sliding_speed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters as in study files, each once."""
        return tuple(dict.fromkeys([*_FIELD_OF_PARAMETER, *self.curve.names, *self.law.names]))

    def value(self, name: str) -> float:
        """Value of one of the parameters."""
        if name in _FIELD_OF_PARAMETER:
            return float(getattr(self, _FIELD_OF_PARAMETER[name]))
        return self.curve.value(name) if name in self.curve.names else self.law.value(name)

    def with_value(self, name: str, value: float) -> OperatingPoint:
        """The point with another value of a parameter, in both laws if both have it."""
        changed: dict[str, Any] = (
            {_FIELD_OF_PARAMETER[name]: value} if name in _FIELD_OF_PARAMETER else {}
        )
        if name in self.curve.names:
            changed["curve"] = self.curve.with_value(name, value)
        if name in self.law.names:
            changed["law"] = self.law.with_value(name, value)
        return replace(self, **changed)


ModeKey = tuple[str, int]  # component, free-free mode numbered from 1


@dataclass(frozen=True)
class DesignState:
    """Operating point, changes of component modes, and modal damping of the assembly.

    Attributes
    ----------
    operating : OperatingPoint
    frequency_scale : mapping of (component, mode) -> float
        Factor on the free-free frequency of each component mode that is changed.
    mode_damping : mapping of (component, mode) -> float
        Damping ratio of each damped component mode at its scaled frequency.
    damping_ratio : float
        Damping ratio of every real mode of the assembly at its working point.
    assembly_damping : mapping of int -> float
        Damping ratios of single real modes of the assembly, numbered from 1 as they ascend in
        frequency at the working point without friction; each replaces `damping_ratio`.
    stiffness_damping : float
        Rayleigh's beta, s: C has beta times the symmetric stiffness of the working point.
    """

    operating: OperatingPoint
    frequency_scale: Mapping[ModeKey, float] = field(default_factory=dict)
    mode_damping: Mapping[ModeKey, float] = field(default_factory=dict)
    damping_ratio: float = 0.0
    assembly_damping: Mapping[int, float] = field(default_factory=dict)
    stiffness_damping: float = 0.0

    def stiffness_changes(self, omega: Mapping[ModeKey, float]) -> dict[ModeKey, float]:
        """Change of the modal stiffness (scale^2 - 1) omega^2 of each scaled mode, (rad/s)^2."""
        return {
            key: (scale**2 - 1.0) * omega[key] ** 2 for key, scale in self.frequency_scale.items()
        }

    def modal_dampers(self, omega: Mapping[ModeKey, float]) -> dict[ModeKey, float]:
        """Damping 2 zeta omega of each damped component mode at its scaled frequency, rad/s."""
        return {
            key: 2.0 * zeta * self.frequency_scale.get(key, 1.0) * omega[key]
            for key, zeta in self.mode_damping.items()
        }

    def assembly_damping_ratios(self, n: int) -> np.ndarray:
        """Damping ratio of each of the `n` real modes of the assembly (n,).

        Raises
        ------
        ParameterError
            A damped mode has a number beyond `n`.
        """
        zeta = np.full(n, self.damping_ratio)
        for mode, ratio in self.assembly_damping.items():
            if not 1 <= mode <= n:
                raise ParameterError(
                    f"modes[{mode}].damping_ratio", f"the assembly has modes 1 to {n} here"
                )
            zeta[mode - 1] = ratio
        return zeta
