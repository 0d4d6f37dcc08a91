"""Speed and pressure over time, which a study file gives as points or as a text file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.errors import ModelError, ParameterError
from squealstudy.kinds.transient.section import STUCK, WORKING_POINT, ScheduleTable
from squealstudy.models.number_table import read_columns
from squealstudy.models.operating import PRESSURE, REGULARISATION_SPEED, SLIDING_SPEED
from squealstudy.motion.schedule import Schedule
from squealstudy.parameter import Parameter
from squealstudy.study.toml_text import KeyPath

SCHEDULED = (SLIDING_SPEED, PRESSURE)
BEGINS_STEADY = {  # values of `start` with which speed, or pressure, must begin at the point's own
    SLIDING_SPEED.name: (WORKING_POINT,),
    PRESSURE.name: (WORKING_POINT, STUCK),
}
TIME = "time"
SAME_SHARE = 1e-9  # largest difference of the first share from 1
PLAN_CACHE_SIZE = 4  # number of plans whose schedules stay in memory
Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class ParameterSchedule:
    """A parameter over time.

    Attributes
    ----------
    points : tuple of (time s, level)
        Times with levels in the unit of the parameter, or as shares of each design point's value.
    relative : bool
        Whether levels are such shares.
    """

    points: Points
    relative: bool

    def ratios(self, nominal: float, times: Sequence[float] | np.ndarray) -> np.ndarray:
        """Levels (n,) at times [s] over the value `nominal` of a design point."""
        knots, levels = np.array(self.points).T
        ratios: np.ndarray = np.interp(times, knots, levels if self.relative else levels / nominal)
        return ratios

    def highest(self, nominal: float) -> float:
        """The largest level over the value `nominal` of a design point."""
        return float(self.ratios(nominal, [time for time, _ in self.points]).max())


@dataclass(frozen=True)
class Schedules:
    """Parameters that a study changes over time; None for those that stay constant."""

    speed: ParameterSchedule | None
    pressure: ParameterSchedule | None

    def of(
        self, values: Mapping[str, float], load: np.ndarray, turning: np.ndarray | None = None
    ) -> Schedule:
        """The schedule of a design point.

        `load` (n,) is the modal load of a unit of pressure, `turning` (n, n) are gyroscopic terms.
        """
        knots = (t for s in (self.speed, self.pressure) if s for t, _ in s.points)
        times = np.unique([0.0, *knots])
        ratios = {
            parameter.name: np.ones(len(times))
            if schedule is None
            else schedule.ratios(values[parameter.name], times)
            for parameter, schedule in self._pairs
        }
        pressure = values[PRESSURE.name] if self.pressure else np.nan
        return Schedule(
            times=times,
            speeds=ratios[SLIDING_SPEED.name],
            pressures=ratios[PRESSURE.name],
            pressing=pressure * load if self.pressure else None,
            pressure=pressure,
            turning=turning,
        )

    @property
    def _pairs(self) -> list[tuple[Parameter, ParameterSchedule | None]]:
        return list(zip(SCHEDULED, (self.speed, self.pressure), strict=True))

    @property
    def text(self) -> str:
        """First, least, largest and last level of each parameter, and its last time, for people."""
        texts = []
        for parameter, schedule in self._pairs:
            if schedule is None:
                continue
            levels = [level for _, level in schedule.points]
            turns = dict.fromkeys((levels[0], min(levels), max(levels), levels[-1]))
            unit = "of each design point's own" if schedule.relative else parameter.unit
            numbers = ", ".join(f"{level:.4g}" for level in turns)
            texts.append(f"{parameter.name} {numbers} {unit} until {schedule.points[-1][0]:.4g} s")
        return "; ".join(texts)

    def with_slope(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of a design point with its regularisation speed lowered for a rising pressure.

        The slope of friction follows from the pressure of the working point. Under a higher
        pressure friction would then saturate at a higher speed than the one given.
        """
        if self.pressure is None:
            return dict(values)
        highest = max(1.0, self.pressure.highest(values[PRESSURE.name]))
        name = REGULARISATION_SPEED.name
        return {**values, name: values[name] / highest}

    def check(self, values: Mapping[str, float], start: str) -> None:
        """Raise ParameterError where a run would begin with a jump."""
        for parameter, schedule in self._pairs:
            if schedule is None or start not in BEGINS_STEADY[parameter.name]:
                continue
            name, unit, nominal = parameter.name, parameter.unit, values[parameter.name]
            first = float(schedule.ratios(nominal, [0.0])[0])
            if abs(first - 1.0) <= SAME_SHARE:
                continue
            hint = "1 as the first share" if schedule.relative else "the same, or relative = true"
            stuck = ', or start = "stuck"' if parameter is SLIDING_SPEED else ""
            raise ParameterError(
                f"transient.{name}",
                f"a run begins in steady sliding at {name} = {nominal:g} {unit}, this begins with "
                f"{first * nominal:g} {unit}: expected {hint}{stuck}",
            )


@lru_cache(maxsize=PLAN_CACHE_SIZE)
def schedules_of(plan: Plan) -> Schedules | None:
    """Schedules of a study; None where nothing changes over time.

    Raises
    ------
    StudyFileError
        Where a file cannot be read, times do not rise, pressure is below zero or the model has
        none, a run would begin with a jump, there is a [fidelity] section, or a parameter follows
        speed or pressure by a table.
    """
    study, section = plan.study, plan.study.section
    if not section.changes:
        return None
    if study.definition.fidelity is not None:
        text = "it needs levels that settle, but speed or pressure change over time"
        raise study.error(("fidelity",), text)
    if section.pressure is not None and PRESSURE.name not in study.values:
        text = f"model '{study.model.name}' has no pressure"
        raise study.error(("transient", PRESSURE.name), text)
    for name in (p.name for p in SCHEDULED if getattr(section, p.name) is not None):
        for table in study.model.tables:
            if name in table.over:
                text = (
                    f"'{table.name}' follows '{name}' by a table, which a run does not: expected "
                )
                text += 'friction_law = "table" or "map", or one value'
                raise study.error(("transient", name), text)
    schedules = Schedules(*(_read(plan, p, getattr(section, p.name)) for p in SCHEDULED))
    swept = {s.name: plan.swept[:, k] for k, s in enumerate(study.sweeps)}
    names = [p.name for p in SCHEDULED if p.name in study.values]
    columns = np.broadcast_arrays(*(swept.get(name, study.values[name]) for name in names))
    for row in np.unique(np.column_stack([np.ravel(c) for c in columns]), axis=0):
        try:
            schedules.check(dict(zip(names, row.tolist(), strict=True)), section.start)
        except ParameterError as error:
            raise study.error(tuple(error.key.split(".")), error.message) from None
    return schedules


def _read(
    plan: Plan, parameter: Parameter, table: ScheduleTable | None
) -> ParameterSchedule | None:
    """One parameter's schedule; None where the study has none."""
    if table is None:
        return None
    key: KeyPath = ("transient", parameter.name)
    if table.file is None:
        points, key = table.points, (*key, "points")
        labels = [f"point {k}" for k in range(1, len(points) + 1)]
    else:
        key, path = (*key, "file"), plan.study.source.path.parent / table.file
        try:
            lines, rows = read_columns(path, (TIME, parameter.name))
        except ModelError as error:
            raise plan.study.error(key, str(error)) from None
        points = tuple((time, level) for time, level in rows)
        labels = [f"{path.name}, line {line}" for line in lines]
    if refusal := _refusal(parameter, points, labels):
        raise plan.study.error(key, refusal)
    return ParameterSchedule(points, table.relative)


def _refusal(parameter: Parameter, points: Points, labels: Sequence[str]) -> str:
    """The fault of points over time, which messages call `labels`; empty where there is none."""
    if len(points) < 2:
        return f"expected two points or more, got {len(points)}"
    before = -np.inf
    for label, (time, level) in zip(labels, points, strict=True):
        if time < 0:
            return f"{label}: the time {time:g} s is before the run, which begins at 0 s"
        if time <= before:
            return f"{label}: the time {time:g} s follows {before:g} s: expected times that rise"
        if parameter is PRESSURE and level < 0:
            return f"{label}: the pressure {level:g} is below zero"
        before = time
    return ""
