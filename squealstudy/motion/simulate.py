"""Time integration of modal systems with contact and friction by the kernels, and its outcomes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.integrator_state import BLOW_UP
from squealstudy.kernels.newmark_batch import newmark_batch
from squealstudy.kernels.newmark_layout import POINT_GAP
from squealstudy.kernels.schedule import newmark_scheduled
from squealstudy.laws.spring import evaluate_points
from squealstudy.motion.arrays import (
    kernel_settings,
    modal_arrays,
    observation,
    saved_arrays,
    schedule_arrays,
    work_arrays,
)
from squealstudy.motion.integrator import Integrator, KernelIntegrator
from squealstudy.motion.motion import EnergyBalance, Motion, outcome_of
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.wording import plural


@dataclass(frozen=True)
class Watch:
    """When runs are tested for whether they may stop, and the test.

    Attributes
    ----------
    steps : sequence of int
        Steps between tests of each design, rounded up to saved rows.
    judge : callable
        Called with the index of the design and its motion so far, whose histories are not copied.
        Returns why the run may stop, or an empty string.
    """

    steps: Sequence[int]
    judge: Callable[[int, Motion], str]


class OneByOne(Integrator):
    """An integrator that runs one design point after the other, each to its end."""

    @abstractmethod
    def run(self, system: ModalSystem, design: MotionPoint, settings: MotionSettings) -> Motion:
        """Integrate a design point; a failure is an outcome, no exception."""


def simulate(
    system: ModalSystem,
    designs: Sequence[MotionPoint],
    settings: MotionSettings,
    watch: Watch | None = None,
    *,
    passing: bool = False,
) -> list[Motion]:
    """Integrate design points; a failed one has an outcome and does not stop the others.

    Parameters
    ----------
    system : ModalSystem
    designs : sequence of MotionPoint
        Design points with their starts. With an integrator of the kernel they advance together;
        alone each would give the same result.
    settings : MotionSettings
    watch : Watch or None
        None lets all run to the end. A test by itself changes no bit of a run; but a design of a
        batch rounds differently once others have stopped.
    passing : bool
        Whether the motions are used only briefly: their histories are then views of arrays of all
        designs.

    Raises
    ------
    ParameterError
        A watch over runs that save no rows, with steps that are not positive, or of an integrator
        that runs design points one by one; a schedule with such an integrator.
    ModelError
        A design whose arrays do not fit the system, or an initial state that is not finite.
    """
    integrator = settings.integrator
    if isinstance(integrator, OneByOne):
        if watch is not None:
            raise ParameterError("integrator", f"runs of '{integrator.name}' go to their end")
        if any(design.schedule is not None for design in designs):
            raise ParameterError(
                "integrator", f"'{integrator.name}' runs at one speed and pressure alone"
            )
        return [integrator.run(system, design, settings) for design in designs]
    if not designs:
        return []
    run = KernelRun.of(system, designs, settings)
    counts = run.work.counts
    blocks = _block_steps(watch, len(designs), settings)
    stopped = [""] * len(designs)
    counts[:, layout.PAUSE] = blocks
    run.go_on()
    while watch is not None and (at_pause := _paused(counts)):
        for k in at_pause:
            stopped[k] = watch.judge(k, run.motion(k, np.asarray))
            if stopped[k]:
                run.stop(k)
            counts[k, layout.PAUSE] += blocks[k]
        run.go_on()
    take = np.asarray if passing else _copied
    return [_judged(system, run.motion(k, take, reason)) for k, reason in enumerate(stopped)]


def _copied(array: np.ndarray) -> np.ndarray:
    """A copy with contiguous columns, since each is read by itself, and often."""
    return np.array(array, order="F")


@dataclass(frozen=True)
class KernelRun:
    """Arrays of the kernel for some design points, and the run's results in them.

    Attributes
    ----------
    B : ndarray (nt, n, ROWS)
        Tiles of the observation matrix.
    modal, options, work, saved, schedule : newmark_layout tuples
    system : ModalSystem
    designs : sequence of MotionPoint
    settings : MotionSettings
        What the arrays were made for.
    """

    B: np.ndarray
    modal: layout.ModalArrays
    options: layout.StepSettings
    work: layout.WorkArrays
    saved: layout.SavedArrays
    schedule: layout.ScheduleArrays
    system: ModalSystem
    designs: Sequence[MotionPoint]
    settings: MotionSettings

    @staticmethod
    def of(
        system: ModalSystem, designs: Sequence[MotionPoint], settings: MotionSettings
    ) -> KernelRun:
        """The arrays at the start of a run, by an integrator of the kernel.

        Raises
        ------
        ModelError
            A design that does not fit the system.
        """
        integrator = settings.integrator
        assert isinstance(integrator, KernelIntegrator)
        starts = np.array([design.start(system.n) for design in designs])
        modal, dense = modal_arrays(system, designs, settings, integrator)
        options = kernel_settings(settings, integrator, dense, len(system.area))
        B = observation(system, integrator.single_storage)
        return KernelRun(
            B=B,
            modal=modal,
            options=options,
            work=work_arrays(modal, options, B, starts),
            saved=saved_arrays(modal, system, settings),
            schedule=schedule_arrays(designs, modal),
            system=system,
            designs=designs,
            settings=settings,
        )

    @property
    def arguments(
        self,
    ) -> tuple[
        np.ndarray, layout.ModalArrays, layout.StepSettings, layout.WorkArrays, layout.SavedArrays
    ]:
        """The first arguments of both kernels."""
        return self.B, self.modal, self.options, self.work, self.saved

    def go_on(self) -> None:
        """Integrate all designs to their pauses, ends or failures."""
        if len(self.schedule.times):
            newmark_scheduled(*self.arguments, self.schedule)
        else:
            newmark_batch(*self.arguments)

    def stop(self, k: int) -> None:
        """End design k where it is, its last step a saved row."""
        rows = self.work.counts[k, layout.SAVED]
        self.work.counts[k, layout.STATUS] = layout.DONE
        self.work.real[k, layout.STORED_END] = self.saved.history[k, rows - 1, layout.STORED]

    def motion(
        self, k: int, take: Callable[[np.ndarray], np.ndarray] = _copied, stopped: str = ""
    ) -> Motion:
        """Motion of design point k so far; `take` copies an array, or returns it as it is.

        `stopped` is the reason why the run was stopped, or empty.
        """
        system, settings, saved = self.system, self.settings, self.saved
        n, ns = system.n, len(system.sensed) + len(self.designs[k].growing.sensors)
        count, real = self.work.counts[k], self.work.real[k]
        steps = count[layout.STEP] + count[layout.POSITION] / 2**self.options.levels
        time = float(steps * settings.step)
        rows = int(count[layout.SAVED])
        columns = take(saved.history[k, :rows]).T
        outcome, message = outcome_of(int(count[layout.STATUS]), time)
        return Motion(
            point=self.designs[k],
            sensed=system.sensed,
            omega=system.frequencies[system.sensed - 1],
            outcome=outcome,
            message=message,
            time=time,
            q=take(self.work.x[k, layout.Q, :n]),
            v=take(self.work.x[k, layout.V, :n]),
            history=dict(zip(layout.HISTORY, columns, strict=True)),
            displacement=take(saved.sensed[k, :rows, 0, :ns]),
            velocity=take(saved.sensed[k, :rows, 1, :ns]),
            q_history=take(saved.q[k, :rows]),
            squares=take(saved.squares[k, :rows]),
            mean_iterations=float(count[layout.PASSES] / max(count[layout.STEP], 1)),
            max_iterations=int(max(count[layout.MAX_PASSES], count[layout.STEP_PASSES])),
            halvings=int(count[layout.HALVINGS]),
            newton_steps=int(count[layout.NEWTON_STEPS]),
            contraction=float(real[layout.CONTRACTION]),
            energy=EnergyBalance(*(float(x) for x in real[layout.W_LOAD : layout.N_REAL])),
            steps=int(count[layout.STEP]),
            stopped=stopped,
            cuts=int(count[layout.CUTS]),
        )


def _block_steps(watch: Watch | None, count: int, settings: MotionSettings) -> np.ndarray:
    """Steps between pauses of each design (count,): whole saved rows, or the whole run."""
    if watch is None:
        return np.full(count, settings.n_steps)
    if settings.save_every == 0:
        raise ParameterError("save_every", "a watch looks at saved rows, got 0")
    steps = np.asarray(watch.steps, dtype=np.int64)
    if steps.shape != (count,) or steps.min() < 1:
        raise ParameterError("steps", "a watch needs a positive number of steps for each design")
    return -(-steps // settings.save_every) * settings.save_every


def _paused(counts: np.ndarray) -> list[int]:
    """Designs that run and are at their pause."""
    at_pause = counts[:, layout.STEP] == counts[:, layout.PAUSE]
    return [int(k) for k in np.flatnonzero(at_pause & (counts[:, layout.STATUS] == layout.RUNNING))]


def _judged(system: ModalSystem, motion: Motion) -> Motion:
    """The motion, with its outcome and message where it blew up or failed."""
    if blown_up(motion, system):
        outcome, message = outcome_of(layout.BLOWN_UP, motion.time)
        motion = replace(motion, outcome=outcome, message=message, stopped="")
    if motion.outcome == "ok" or not (contact := failing_contact(system, motion)):
        return motion
    return replace(motion, message=f"{motion.message}; {contact}")


def failing_contact(system: ModalSystem, motion: Motion) -> str:
    """State of the contact at the end of a failed motion, in words; empty if that explains nothing.

    Where the tangent of a softening spring has become negative nothing holds the motion, and it
    runs away.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        gap = (motion.point.points(system)[POINT_GAP] + system.N @ motion.q)[system.touching]
        given_way = np.flatnonzero(motion.point.contact.evaluate(gap)[1] < 0.0)
    if len(given_way):
        points = plural(len(gap), "contact point")
        return f"a softening contact spring has given way at {len(given_way)} of {points}"
    open_ = not motion.point.contact.definition.pulls and bool((gap > 0.0).all())
    return "the whole contact was open" if open_ and len(gap) else ""


def blown_up(motion: Motion, system: ModalSystem) -> bool:
    """Whether a run has far more energy than was put in, as with a step too long for impacts.

    Energy is put in by the work of loads and belt, the initial motion and the contact's stored
    energy. The energy that came out is the stored energy at the end and all that was dissipated.
    """
    design, energy = motion.point, motion.energy
    worked = abs(energy.stored_start) + abs(energy.work_load) + abs(energy.work_belt)
    came_out = energy.stored_end + energy.friction + energy.damping
    # with the initial motion and the contact, which add to `worked`, the bound is only larger
    if motion.outcome != "ok" or (came_out <= BLOW_UP * worked and not (system.omega2 < 0.0).any()):
        return False
    q0, v0 = design.start(system.n)
    gaps = design.points(system)[POINT_GAP] + system.N @ q0
    p, kappa = evaluate_points(design.contact, system.spring_points, gaps)
    soft = np.divide(p, kappa, out=np.zeros_like(p), where=kappa > 0)
    put_in = worked + 0.5 * float(v0 @ v0 + system.omega2 @ (q0 * q0))
    return bool(came_out > BLOW_UP * (put_in + float(system.area @ (p * soft))))
