"""Time integration of modal systems with contact and friction: run the kernels, name outcomes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.analysis.transient.arrays import (
    kernel_settings,
    modal_arrays,
    saved_arrays,
    work_arrays,
)
from squealstudy.analysis.transient.observation import observation
from squealstudy.analysis.transient.settings import (
    EnergyBalance,
    TransientResult,
    TransientSettings,
)
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.errors import ModelError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.newmark import newmark
from squealstudy.kernels.newmark_batch import newmark_batch

OUTCOMES = {
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
    layout.BLOWN_UP: "far more kinetic energy than was ever put in",
}


def simulate(
    system: ModalSystem,
    designs: Sequence[TransientDesign],
    settings: TransientSettings,
    q0: np.ndarray,
    v0: np.ndarray,
) -> list[TransientResult]:
    """Integrate design points together; a failed one has an outcome and does not stop the others.

    Parameters
    ----------
    system : ModalSystem
    designs : sequence of TransientDesign
        One runs in the single kernel, several in the batched one, to the same result.
    settings : TransientSettings
    q0, v0 : ndarray (n,) or (nb, n)
        Initial deviation and velocity.

    Raises
    ------
    ModelError
        A design whose arrays do not fit the system, or an initial state that is not finite.
    """
    if not designs:
        return []
    modal, dense = modal_arrays(system, designs, settings)
    options = kernel_settings(settings, dense)
    B = observation(system, settings.single_storage)
    work = work_arrays(modal, options, B)
    rows = ((layout.Q, layout.Q_TRIAL, q0), (layout.V, layout.V_TRIAL, v0))
    for row, trial, initial in rows:
        shapes = ((system.n,), (len(designs), system.n))
        if np.shape(initial) not in shapes or not np.isfinite(initial).all():
            raise ModelError(f"an initial state needs {system.n} finite values a design")
        work.x[:, row, : system.n] = initial
        work.x[:, trial, : system.n] = initial
    saved = saved_arrays(modal, system.n, settings)
    kernel = newmark if len(designs) == 1 else newmark_batch
    kernel(B, modal, options, work, saved)
    return [result_of(work, saved, settings, k, system.n) for k in range(len(designs))]


def result_of(
    work: layout.Work, saved: layout.Saved, settings: TransientSettings, k: int, n: int
) -> TransientResult:
    """One design's part of the working arrays of a kernel that came to an end."""
    count, real = work.counts[k], work.real[k]
    status = int(count[layout.STATUS])
    steps = count[layout.STEP] + count[layout.POSITION] / 2**settings.max_halvings
    time = float(steps * settings.step)
    message = "" if status == layout.DONE else f"t = {time:.9g} s: {REASONS[status]}"
    rows = int(count[layout.SAVED])
    history = {name: saved.history[k, :rows, i].copy() for i, name in enumerate(layout.HISTORY)}
    energy = EnergyBalance(*(float(x) for x in real[layout.W_LOAD : layout.N_REAL]))
    return TransientResult(
        OUTCOMES[status],
        message,
        time,
        work.x[k, layout.Q, :n].copy(),
        work.x[k, layout.V, :n].copy(),
        history,
        saved.sensed[k, :rows, 0].copy(),
        saved.sensed[k, :rows, 1].copy(),
        saved.q[k, :rows].copy(),
        float(count[layout.PASSES] / max(count[layout.STEP], 1)),
        int(max(count[layout.MAX_PASSES], count[layout.STEP_PASSES])),
        int(count[layout.HALVINGS]),
        int(count[layout.NEWTON_STEPS]),
        float(real[layout.CONTRACTION]),
        energy,
        int(count[layout.STEP]),
    )
