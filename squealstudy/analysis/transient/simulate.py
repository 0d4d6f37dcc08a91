"""Time integration of modal systems with contact and friction: run the kernels, name outcomes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.analysis.transient.arrays import (
    kernel_settings,
    modal_arrays,
    saved_arrays,
    work_arrays,
)
from squealstudy.analysis.transient.blow_up import blown_up
from squealstudy.analysis.transient.observation import observation
from squealstudy.analysis.transient.settings import (
    EnergyBalance,
    TransientResult,
    TransientSettings,
)
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.analysis.transient.watch import Watch, block_steps, paused, stop
from squealstudy.errors import ModelError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.newmark_batch import newmark_batch

OUTCOMES = {
    layout.RUNNING: "ok",  # so far
    layout.DONE: "ok",
    layout.NOT_CONVERGED: "not_converged",
    layout.NOT_FINITE: "not_finite",
    layout.SINGULAR: "singular_jacobian",
    layout.BLOWN_UP: "blown_up",
}
REASONS = {
    layout.DONE: "",
    layout.NOT_CONVERGED: "the contact iteration did not converge",
    layout.NOT_FINITE: "the forces are not finite",
    layout.SINGULAR: "the Jacobian is singular",
    layout.BLOWN_UP: "far more energy than was ever put in",
}


def simulate(
    system: ModalSystem,
    designs: Sequence[TransientDesign],
    settings: TransientSettings,
    q0: np.ndarray,
    v0: np.ndarray,
    watch: Watch | None = None,
) -> list[TransientResult]:
    """Integrate design points together; a failed one has an outcome and does not stop the others.

    Parameters
    ----------
    system : ModalSystem
    designs : sequence of TransientDesign
        Each comes to the same result alone.
    settings : TransientSettings
    q0, v0 : ndarray (n,) or (nb, n)
        Initial deviation and velocity.
    watch : Watch or None
        None lets all run to the end. Being looked at changes nothing, to the last bit; in a batch
        a design rounds otherwise once fewer go on beside it.

    Raises
    ------
    ParameterError
        A watch over runs that save no rows, or steps that are not positive.
    ModelError
        A design whose arrays do not fit the system, or an initial state that is not finite.
    """
    if not designs:
        return []
    modal, dense = modal_arrays(system, designs, settings)
    options = kernel_settings(settings, dense)
    B = observation(system, settings.single_storage)
    work = work_arrays(modal, options, B)
    _set_out(work, system.n, q0, v0)
    saved = saved_arrays(modal, system.n, settings)
    stopped = [""] * len(designs)
    seen = [(system.n, len(x.sensor_rows(system))) for x in designs]
    blocks = block_steps(watch, len(designs), settings)
    work.counts[:, layout.PAUSE] = blocks
    newmark_batch(B, modal, options, work, saved)
    while watch is not None and (at_pause := paused(work)):
        for k in at_pause:
            stopped[k] = watch.judge(k, result_of(work, saved, settings, k, seen[k], np.asarray))
            if stopped[k]:
                stop(work, saved, k)
            work.counts[k, layout.PAUSE] += blocks[k]
        newmark_batch(B, modal, options, work, saved)
    finished = [result_of(work, saved, settings, k, x) for k, x in enumerate(seen)]
    starts = zip(*(np.broadcast_to(x, (len(designs), system.n)) for x in (q0, v0)), strict=True)
    return [
        _judged(replace(r, stopped=why), blown_up(r, system, design, *start))
        for r, why, design, start in zip(finished, stopped, designs, starts, strict=True)
    ]


def _judged(result: TransientResult, blew_up: bool) -> TransientResult:
    """The result, with its outcome and message where it blew up."""
    if not blew_up:
        return result
    message = f"t = {result.time:.9g} s: {REASONS[layout.BLOWN_UP]}"
    return replace(result, outcome=OUTCOMES[layout.BLOWN_UP], message=message, stopped="")


def _set_out(work: layout.Work, n: int, q0: np.ndarray, v0: np.ndarray) -> None:
    """The initial state of all designs, also as their first trial state."""
    for row, trial, initial in ((layout.Q, layout.Q_TRIAL, q0), (layout.V, layout.V_TRIAL, v0)):
        shapes = ((n,), (len(work.x), n))
        if np.shape(initial) not in shapes or not np.isfinite(initial).all():
            raise ModelError(f"an initial state needs {n} finite values a design")
        work.x[:, row, :n] = initial
        work.x[:, trial, :n] = initial


def result_of(
    work: layout.Work,
    saved: layout.Saved,
    settings: TransientSettings,
    k: int,
    sizes: tuple[int, int],
    take: Callable[[np.ndarray], np.ndarray] = np.copy,
) -> TransientResult:
    """One design's part of the working arrays, `sizes` its modes and sensors.

    `take` copies it or leaves it where it is.
    """
    n, ns = sizes
    count, real = work.counts[k], work.real[k]
    status = int(count[layout.STATUS])
    done = status in (layout.DONE, layout.RUNNING)
    steps = count[layout.STEP] + count[layout.POSITION] / 2**settings.max_halvings
    time = float(steps * settings.step)
    message = "" if done else f"t = {time:.9g} s: {REASONS[status]}"
    rows = int(count[layout.SAVED])
    history = {name: take(saved.history[k, :rows, i]) for i, name in enumerate(layout.HISTORY)}
    energy = EnergyBalance(*(float(x) for x in real[layout.W_LOAD : layout.N_REAL]))
    return TransientResult(
        OUTCOMES[status],
        message,
        time,
        take(work.x[k, layout.Q, :n]),
        take(work.x[k, layout.V, :n]),
        history,
        take(saved.sensed[k, :rows, 0, :ns]),
        take(saved.sensed[k, :rows, 1, :ns]),
        take(saved.q[k, :rows]),
        float(count[layout.PASSES] / max(count[layout.STEP], 1)),
        int(max(count[layout.MAX_PASSES], count[layout.STEP_PASSES])),
        int(count[layout.HALVINGS]),
        int(count[layout.NEWTON_STEPS]),
        float(real[layout.CONTRACTION]),
        energy,
        int(count[layout.STEP]),
    )
