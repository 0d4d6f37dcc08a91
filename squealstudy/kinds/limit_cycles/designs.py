"""Oscillators in contact, from design points of a study and from designs between two of them.

Harmonic balance needs an oscillator; branches over a parameter need the designs between two points.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.oscillator import Oscillator
from squealstudy.engine.cache import NewGaps, prepared_model
from squealstudy.engine.plan import Plan
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.section import AUTO, LimitCyclesSection
from squealstudy.kinds.transient.batch import ALL_MODES, mode_keys, shared_reference
from squealstudy.kinds.transient.starts import steady_motion
from squealstudy.mechanics.motion_points import motion_at
from squealstudy.models.operating import ModeKey, OperatingPoint
from squealstudy.motion.shared_modes import SharedModes
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.root_pairs import angular_band
from squealstudy.study.design import DesignPoint

MAX_COORDINATES = 2000  # a matrix of this size is factorised for every harmonic
DESIGN_CACHE_SIZE = 8  # designs of a line whose oscillators are stored


@dataclass(frozen=True)
class CyclesRequest:
    """Settings of the search for cycles, the same for every design point.

    Attributes
    ----------
    section : LimitCyclesSection
        Keys of [limit_cycles] in the study file.
    operating : OperatingPoint
        Operating point of the study's [parameters], at which the shared modes are computed.
    component_modes : tuple of (component, mode)
        Component modes that design points may change.
    band_hz : (low, high)
        Band of the modes, Hz.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """

    section: LimitCyclesSection
    operating: OperatingPoint
    component_modes: tuple[ModeKey, ...]
    band_hz: tuple[float, float]
    tolerance: float

    @property
    def band(self) -> tuple[float, float]:
        """The band in rad/s."""
        return angular_band(self.band_hz)

    def search(self, contact: ContactOscillator) -> Search:
        """Settings of `cycles.cycle.Search` for a design point with this oscillator."""
        section = self.section
        return Search(
            None if section.harmonics == AUTO else int(section.harmonics),
            section.tolerance,
            section.reach * abs(contact.point.speed),
            self.band[1],
        )

    def shared_modes(self, structure: str) -> SharedModes:
        """Modes that all design points of a structure share; ConvergenceError for too many."""
        shared = shared_reference(structure, self.operating, self.component_modes, ALL_MODES)
        if shared.system.n > MAX_COORDINATES:
            raise ConvergenceError("too_large", too_large(shared.system.n))
        return shared

    def contact(self, point: DesignPoint, gaps: NewGaps) -> tuple[WorkingPoint, ContactOscillator]:
        """Working point and oscillator of a design point, with its unstable modes."""
        shared = self.shared_modes(point.structure)
        steady, motion_start = steady_motion(
            shared, point, self.section.friction, self.band_hz, self.tolerance, gaps
        )
        return steady, ContactOscillator(shared.system, motion_start)

    def contact_near(
        self, point: DesignPoint, gap: np.ndarray | None
    ) -> tuple[WorkingPoint, ContactOscillator]:
        """Working point and oscillator of a design on a curve, from a neighbour's gaps (nc,).

        They are not cached, and have no unstable modes.
        """
        shared, prepared = self.shared_modes(point.structure), prepared_model(point.structure)
        friction = self.section.friction
        steady, motion_start = motion_at(
            shared, prepared, point, friction, None, self.tolerance, start_gap=gap
        )
        return steady, ContactOscillator(shared.system, motion_start)


def request(plan: Plan) -> CyclesRequest:
    """Settings of the search, from the plan of a study."""
    return CyclesRequest(
        section=plan.study.section,
        operating=plan.nominal,
        component_modes=mode_keys(plan),
        band_hz=plan.band_hz,
        tolerance=plan.study.definition.modes.stability_tolerance,
    )


def too_large(n: int) -> str:
    """Message about a model of n coordinates."""
    return f"the model has {n} coordinates, limit cycles are for {MAX_COORDINATES} at most"


@dataclass(frozen=True, eq=False)
class DesignLine:
    """The designs on a straight line between two designs of one structure.

    Attributes
    ----------
    request : CyclesRequest
    first, last : DesignPoint
        Designs at the ends of the line.
    bounds : (low, high)
        Coordinates of the first and the last design: values of a parameter, or 0 and 1.
    """

    request: CyclesRequest
    first: DesignPoint
    last: DesignPoint
    bounds: tuple[float, float] = (0.0, 1.0)
    _oscillators: dict[float, ContactOscillator] = field(default_factory=dict, init=False)
    _last_gap: list[np.ndarray] = field(
        default_factory=list, init=False
    )  # gaps of the latest design

    def design(self, value: float) -> DesignPoint:
        """The design at a value, which may be a little beyond the ends."""
        low, high = self.bounds
        share = (value - low) / (high - low)
        a, b = self.first.values, self.last.values
        values = {k: a[k] if a[k] == b[k] else a[k] + share * (b[k] - a[k]) for k in a}
        return self.first.with_values(values)

    def contact(self, value: float) -> ContactOscillator:
        """The oscillator at a value; the latest ones are cached."""
        if value not in self._oscillators:
            while len(self._oscillators) >= DESIGN_CACHE_SIZE:
                del self._oscillators[next(iter(self._oscillators))]
            start_gap = self._last_gap[0] if self._last_gap else None
            steady, oscillator = self.request.contact_near(self.design(value), start_gap)
            self._last_gap[:] = [steady.gap]
            self._oscillators[value] = oscillator
        return self._oscillators[value]

    def oscillator(self, value: float) -> Oscillator:
        """Equation of motion at a value of the parameter."""
        return self.contact(value).oscillator
