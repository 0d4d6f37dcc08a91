"""Design points in time: set up about steady sliding on modes that they share, and run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.errors import ModelError, ParameterError
from squealstudy.faults import told
from squealstudy.mechanics.defaults import STABILITY_TOLERANCE
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.motion_points import motions_at, reference_modes
from squealstudy.mechanics.regularisation import with_speed
from squealstudy.mechanics.stacked_rows import messages, statuses
from squealstudy.mechanics.structures import Structures
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.operating import (
    SLIDING_SPEED,
)
from squealstudy.motion.integrator import Integrator, integrator
from squealstudy.motion.kept_rows import kept_rows
from squealstudy.motion.level_errors import doubts
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.level import ONE_STEP
from squealstudy.motion.outcome.summary import summarise
from squealstudy.motion.point import perturbed
from squealstudy.motion.settings import MotionSettings, steps_between_rows
from squealstudy.motion.shared_modes import SharedModes
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.reduction.working_point import WorkingPoint

if TYPE_CHECKING:
    import pandas as pd

METHOD = "exponential"  # moves free modes exactly, with contact forces by the trapezoidal rule


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs in time; arrays of a batch have a leading axis (m, ...).

    Attributes
    ----------
    motions : tuple of (Motion or None)
        Run of each design point, with rows enough for a summary; None where it was not set up.
    status, message : str or ndarray (m,) of str
        ``ok``, or what ended the run, or why there was none.
    systems : tuple of (ModalSystem or None)
        Modal system of each design point that was integrated.
    settings : MotionSettings
        Settings of the integration.
    single : bool
        Whether this is one design point and no batch.
    every : int
        Number of rows of `motions` for each row of `history`; 0: there is no history.

    Examples
    --------
    >>> import squealstudy as sq
    >>> model = sq.model("belt", friction=0.4, sliding_speed=1.0)
    >>> runs = model.at().simulate(duration=0.02, step=1e-5, save_every=20)
    >>> runs.status, runs.time.shape, float(runs.time[-1].round(6))
    ('ok', (101,), 0.02)
    >>> runs.history("stick").shape
    (101,)
    """

    motions: tuple[Motion | None, ...] = field(repr=False)
    status: str | np.ndarray
    message: str | np.ndarray
    systems: tuple[ModalSystem | None, ...] = field(repr=False)
    settings: MotionSettings
    single: bool
    every: int = 1

    def history(self, name: str) -> np.ndarray:
        """A column (rows,) of the saved rows, such as ``torque``; NaN after a shorter run's end.

        Parameters
        ----------
        name : str
            ``time``, ``torque``, ``stick``, ``modal_energy``, ...

        Raises
        ------
        KeyError
            Where there is no such column; the message lists the columns.
        """
        rows = [None if m is None else kept_rows(m.history, self.every) for m in self.motions]
        columns = next((h for h in rows if h is not None), {})
        if name not in columns:
            raise KeyError(f"'{name}': expected one of {', '.join(columns)}")
        longest = max((len(h[name]) for h in rows if h is not None), default=0)
        padded = np.full((len(rows), longest), np.nan)
        for row, history in zip(padded, rows, strict=True):
            if history is not None:
                row[: len(history[name])] = history[name]
        return padded[0] if self.single else padded

    @property
    def time(self) -> np.ndarray:
        """Times of the saved rows (rows,), s."""
        return self.history("time")

    @property
    def torque(self) -> np.ndarray:
        """Friction torque (rows,) at the saved rows, N m (belt: N), positive where it brakes."""
        return self.history("torque")

    def summary(self) -> pd.DataFrame:
        """Outcome of each run in a row for each design point: class, levels, growth.

        ``invalid_reason`` says which assumptions of its numbers a run breaks, such as a step too
        long for friction that sticks, and which step to take; it is empty for a sound run. Bounds
        of levels here do not include the error of the step (see ``bounds_reason``); in a study they
        do.
        """
        import pandas as pd

        status = np.atleast_1d(np.array(self.status, dtype=object))
        runs = zip(self.motions, self.systems, strict=True)
        rows = [
            {"status": point_status, **self._row(motion, system)}
            for point_status, (motion, system) in zip(status, runs, strict=True)
        ]
        return pd.DataFrame(rows)

    def _row(self, motion: Motion | None, system: ModalSystem | None) -> dict[str, Any]:
        if motion is None or system is None:
            return {}
        columns = summarise(motion, lambda _: ONE_STEP).point
        broken = doubts(motion, system, self.settings, columns) if motion.outcome == "ok" else {}
        reason = "; ".join(f"{rule}: {text}" for rule, text in broken.items())
        return {**columns, "invalid_reason": reason}


def set_up(
    structures: Structures,
    regularisation: str,
    single: bool,
    run_settings: MotionSettings | None = None,
) -> list[tuple[SharedModes, MotionPoint, ModelPoint, WorkingPoint] | Exception]:
    """Set up each design point on the modes of its structure; the error where that fails.

    A `single` design point raises its error.
    """
    values = structures.values  # noqa: PD011 - no frame
    slowest = float(np.min(np.abs(values.columns[SLIDING_SPEED.name])))
    resolved = replace(values, columns=with_speed(values.columns, slowest))
    first = values.point(0)
    keys = sorted({(p.component, m) for p in first.mode_parameters() for m in p.modes})
    band = structures.basis.band_hz
    starts: dict[int, Any] = {}
    for start, numbers in values.of_structures():
        try:
            prepared = structures.reduction(start, numbers).prepared
            operating = structures.sliding.operating_point()
            reference = reference_modes(prepared, operating, keys)
        except FAILURES as error:
            if single:
                raise
            starts |= dict.fromkeys(numbers.tolist(), error)
            continue
        points = [resolved.point(number) for number in numbers.tolist()]
        steady_motions = motions_at(
            reference,
            prepared,
            points,
            regularisation,
            band,
            STABILITY_TOLERANCE,
            [None] * len(points),
            run_settings,
        )
        for number, point, steady_motion in zip(
            numbers.tolist(), points, steady_motions, strict=True
        ):
            if isinstance(steady_motion, Exception):
                if single:
                    raise steady_motion
                starts[number] = steady_motion
                continue
            steady, motion_start = steady_motion
            starts[number] = reference, motion_start, point, steady
    return [starts[number] for number in range(values.count)]


def simulated(
    structures: Structures,
    duration: float,
    step: float,
    save_every: int,
    method: str | Integrator | None,
    perturbation: float,
    regularisation: str,
    single: bool,
) -> Runs:
    """Run the design points (`System.simulate`); those of one structure advance together."""
    chosen = method if isinstance(method, Integrator) else integrator(method or METHOD)
    tolerance = {"tolerance": chosen.tolerance} if hasattr(chosen, "tolerance") else {}
    settings = MotionSettings(duration, step, save_every, integrator=chosen, **tolerance)
    try:
        rows_every = steps_between_rows(save_every, step, structures.basis.band_hz[1])
    except ValueError as error:
        raise ParameterError("save_every", str(error)) from None
    settings = replace(settings, save_every=rows_every)
    ready = set_up(structures, regularisation, single, settings)
    results: list[Motion | Exception] = [
        x if isinstance(x, Exception) else ModelError("not run") for x in ready
    ]
    systems: list[ModalSystem | None] = [None] * len(ready)
    together: dict[int, list[int]] = {}
    for number, motion_point in enumerate(ready):
        if not isinstance(motion_point, Exception):
            together.setdefault(id(motion_point[0]), []).append(number)
    for numbers in together.values():
        points, reference = [], None
        for number in numbers:
            motion_point = ready[number]
            assert not isinstance(motion_point, Exception)
            reference, motion_start, _, _ = motion_point
            points.append(perturbed(reference.system, motion_start, perturbation))
        assert reference is not None
        system = replace(reference.system, sensed=_sensed(reference, structures.basis.band_hz))
        with told():
            motions = simulate(system, points, settings)
        for number, motion in zip(numbers, motions, strict=True):
            results[number], systems[number] = motion, system
    status, message = statuses(results), messages(results)
    for number, run in enumerate(results):
        if not isinstance(run, Exception):
            status[number], message[number] = run.outcome, run.message
    return Runs(
        motions=tuple(None if isinstance(x, Exception) else x for x in results),
        status=status[0] if single else status,
        message=message[0] if single else message,
        systems=tuple(systems),
        settings=settings,
        single=single,
        every=save_every // rows_every,
    )


def _sensed(reference: SharedModes, band_hz: tuple[float, float]) -> np.ndarray:
    """Numbers, from 1, of the assembly modes in the band, whose motion is recorded."""
    hz = reference.system.frequencies[: reference.n_exact] / (2 * np.pi)
    return np.flatnonzero((hz >= band_hz[0]) & (hz <= band_hz[1])) + 1
