"""Cycles on the whole model: velocities of named points, and power that surfaces radiate.

The expansion to all nodes is made once for each structure, if the study asks for one of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.cycles.harmonics import orders, series_at
from squealstudy.engine.cache import load_prepared
from squealstudy.engine.cycle_states import CycleSeries
from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import REAL, TEXT, WHOLE_NUMBER
from squealstudy.kinds.limit_cycles.section import NamedPoint
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import Expansion
from squealstudy.shapes.radiation import AIR_IMPEDANCE_PA_S_PER_M, Place, mean_square_form, place
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint

SAMPLES_PER_PERIOD = 512
VELOCITY_FIELDS = (
    ("cycle_id", TEXT),
    ("mode", WHOLE_NUMBER),
    ("point", TEXT),
    ("velocity_rms", REAL),
    ("velocity_peak", REAL),
    ("distance", REAL),
)


@dataclass(frozen=True, eq=False)
class Observer:
    """Computes velocities and radiated power from the motions of a structure.

    Attributes
    ----------
    form : ndarray (n, n) or None
        Matrix of the mean square velocity of all radiating surfaces (`mean_square_form`); None
        without any.
    places : mapping of name -> Place
        The named points.
    """

    form: np.ndarray | None
    places: Mapping[str, Place]

    @classmethod
    def of(
        cls,
        assembly: Assembly,
        expansion: Expansion,
        radiating: Sequence[str],
        points: Sequence[NamedPoint],
    ) -> Observer:
        """Observer of an assembly, by the expansion of its reduced model to all nodes."""
        model = expansion.model
        components = {c.name: (k, c) for k, c in enumerate(assembly.components)}
        form = np.zeros((model.n, model.n)) if radiating else None
        for name in radiating:
            k, component = components[name]
            component_columns = slice(int(model.offsets[k]), int(model.offsets[k + 1]))
            assert form is not None
            form[component_columns, component_columns] = mean_square_form(
                component, np.asarray(expansion.blocks[k])
            )
        places = {}
        for point in points:
            k, component = components[point.component]
            observed = place(component, np.asarray(expansion.blocks[k]), point.at)
            rows = np.zeros((len(observed.rows), model.n))
            rows[:, int(model.offsets[k]) : int(model.offsets[k + 1])] = observed.rows
            places[point.name] = Place(rows, observed.distance)
        return cls(form, places)

    def power(self, Q: np.ndarray, omega: float) -> float:
        """Equivalent radiated power [W] of a series Q (2 H + 1, n), in the mean over the period."""
        if self.form is None:
            return np.nan
        v = orders((len(Q) - 1) // 2)[:, None] * omega * Q
        return float(AIR_IMPEDANCE_PA_S_PER_M * 0.5 * np.einsum("hi,ij,hj->", v, self.form, v))

    def velocities(self, Q: np.ndarray, omega: float) -> dict[str, tuple[float, float]]:
        """RMS and largest speed [m/s] of each named point over the period."""
        theta = 2 * np.pi * np.arange(SAMPLES_PER_PERIOD) / SAMPLES_PER_PERIOD
        slope = series_at(theta, (len(Q) - 1) // 2)[1]
        speeds = {}
        for name, named_place in self.places.items():
            squared = ((omega * slope @ (Q @ named_place.rows.T)) ** 2).sum(axis=1)
            speeds[name] = float(np.sqrt(squared.mean())), float(np.sqrt(squared.max()))
        return speeds


class Observers:
    """Observers of a study's structures, each made when it is first asked for.

    Attributes
    ----------
    changed_bases : set of str
        Keys of structures whose basis has other coordinates when it is made again. Their cycles are
        not observed.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan, self._observers = plan, dict[str, Observer | None]()
        self.changed_bases: set[str] = set()

    @property
    def has_requests(self) -> bool:
        """Whether the study names points or radiating components."""
        section = self._plan.study.section
        return bool(section.radiating or section.points)

    def observe(self, series: CycleSeries) -> tuple[float, list[dict[str, Any]]]:
        """Radiated power [W] of a cycle, NaN where it is not known; rows of its points."""
        key = series.prepared_key
        if key not in self._observers:
            self._observers[key] = self._observer_of(key)
        observer = self._observers[key]
        if observer is None:
            return np.nan, []
        rows = [
            {
                "cycle_id": series.cycle_id,
                "point": name,
                "velocity_rms": rms,
                "velocity_peak": peak,
                "distance": observer.places[name].distance,
            }
            for name, (rms, peak) in observer.velocities(series.Q, series.omega).items()
        ]
        return observer.power(series.Q, series.omega), rows

    def _observer_of(self, key: str) -> Observer | None:
        """Observer of surface velocities for a structure; None if its basis has changed."""
        from squealstudy.engine.mode_shapes import expansion, same_coordinates  # needs pandas

        plan, section = self._plan, self._plan.study.section
        row = next(
            int(rows[0]) for key_there, rows in plan.tasks.of_structures() if key_there == key
        )
        way = expansion(plan, row, lambda *_: None)
        if not same_coordinates(way.model, load_prepared(key).model):
            self.changed_bases.add(key)
            return None
        return Observer.of(plan.tasks[row].assembly(), way, section.radiating, section.points)


def not_observed(study: ResolvedStudy) -> tuple[tuple[str | int, ...], str]:
    """Key and reason of a request that cannot be observed in a study; empty if there is none."""
    section, names = study.section, study.model.components
    listed_names = ", ".join(f"'{name}'" for name in names) or "none"
    for name in section.radiating:
        if name not in names:
            return ("radiating",), f"expected components ({listed_names}), got '{name}'"
        if not study.model.meshed:
            return ("radiating",), f"the model {study.model.name} has no mesh, and so no surface"
    for k, point in enumerate(section.points):
        if point.component not in names:
            where = ("points", k, "component")
            return where, f"expected a component ({listed_names}), got '{point.component}'"
        if study.model.meshed != isinstance(point.at, tuple):
            expected = "[x, y, z] in m" if study.model.meshed else "a degree of freedom from 1"
            return ("points", k, "at"), f"expected {expected} of the model {study.model.name}"
    if section.points and not study.model.meshed:
        assembly = DesignPoint(study.model, study.options, study.values).assembly()
        sizes = {c.name: c.n_dof for c in assembly.components}
        for k, point in enumerate(section.points):
            if point.at > sizes[point.component]:
                freedoms_text = (
                    f"'{point.component}' has degrees of freedom 1 to {sizes[point.component]}"
                )
                return ("points", k, "at"), f"{freedoms_text}, got {point.at}"
    return (), ""
