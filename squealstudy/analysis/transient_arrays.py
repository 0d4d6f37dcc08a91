"""The kernels' arrays of a modal system and its design points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.analysis.transient_settings import TransientSettings
from squealstudy.analysis.transient_system import ModalSystem, TransientDesign, stick_number
from squealstudy.errors import ModelError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.newmark_correct import NOT_FACTORED

AITKEN_REACH = 10.0  # stick number up to which Aitken's factor is cheaper than the mock-up
WARP_LIMIT = 2.0  # omega h up to which a mode is pre-warped


def modal_arrays(
    system: ModalSystem, designs: Sequence[TransientDesign], settings: TransientSettings
) -> tuple[layout.Modal, bool]:
    """The kernels' arrays, and whether the fixed Jacobian is dense."""
    n, m = system.n, len(system.shapes)
    c = _stack([x.c for x in designs], n, "c")
    w2 = np.tile(system.omega2.astype(float), (len(designs), 1))
    if settings.prewarp:
        w2, c = prewarped(w2, c, settings.step)
    uniform = settings.contact_stiffness
    k_c = system.k_ref if uniform is None else uniform * system.area
    beyond = settings.contact_factor * k_c - system.k_ref
    fixed = np.array([[beyond, _mockup(system, x, settings)] for x in designs])
    tuned = [_stack([x.d for x in designs], m, "d"), _stack([x.s for x in designs], m, "s")]
    modal = layout.Modal(
        system.points,
        np.array([x.law_row() for x in designs], dtype=float),
        np.stack([w2, c, _stack([x.load for x in designs], n, "load")], axis=1),
        np.ascontiguousarray(system.shapes, dtype=float),
        np.stack(tuned, axis=1),
        fixed,
        np.ascontiguousarray(system.sensors, dtype=float),
    )
    return modal, bool(fixed.any())


def _mockup(
    system: ModalSystem, design: TransientDesign, settings: TransientSettings
) -> np.ndarray:
    """Tangential damping of the fixed Jacobian (nc,), N s/m."""
    wanted = settings.mockup == "always" or (
        settings.mockup == "auto" and stick_number(system, design, settings.step) > AITKEN_REACH
    )
    half = 0.5 * design.friction.k_t * system.area * (system.frictional > 0)
    return half if wanted and settings.method == "newmark" else np.zeros(len(half))


def _stack(rows: Sequence[np.ndarray | None], n: int, name: str) -> np.ndarray:
    full = [np.zeros(n) if x is None else np.asarray(x, dtype=float) for x in rows]
    if any(x.shape != (n,) or not np.isfinite(x).all() for x in full):
        raise ModelError(f"transient design: '{name}' needs {n} finite values")
    return np.array(full).reshape(len(full), n)


def prewarped(w2: np.ndarray, c: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping with which Newmark's free modes keep their period and decay.

    s = (2/h) tanh(lambda h / 2) for both roots of lambda^2 + c lambda + w2; modes beyond
    omega h = 2 are left as they are.
    """
    root = np.sqrt((c * c / 4 - w2).astype(complex))
    s1 = 2 / h * np.tanh((-c / 2 + root) * h / 2)
    s2 = 2 / h * np.tanh((-c / 2 - root) * h / 2)
    slow = np.maximum(np.abs(-c / 2 + root), np.abs(-c / 2 - root)) * h <= WARP_LIMIT
    return np.where(slow, (s1 * s2).real, w2), np.where(slow, -(s1 + s2).real, c)


def work_arrays(modal: layout.Modal, options: layout.Settings) -> layout.Work:
    """Working arrays; pages of matrices that are never factored are never touched."""
    nb, _, n = modal.modes.shape
    n_matrices = 1 + (nb * (options.max_halvings + 1) if options.dense else 0)
    real = np.zeros((nb, layout.N_REAL))
    real[:, layout.STORED_END] = np.nan
    return layout.Work(
        np.zeros((nb, layout.N_ROWS, n)),
        np.zeros((nb, len(modal.points), layout.N_POINT)),
        np.empty((n_matrices, n, n)),
        np.full((n_matrices, n), NOT_FACTORED, dtype=np.int64),
        np.zeros((nb, layout.N_COUNT), dtype=np.int64),
        real,
    )


def saved_arrays(modal: layout.Modal, settings: TransientSettings) -> layout.Saved:
    """Room for the histories."""
    nb, _, n = modal.modes.shape
    rows = settings.n_steps // settings.save_every + 1 if settings.save_every else 0
    return layout.Saved(
        np.empty((nb, rows, len(layout.HISTORY))),
        np.empty((nb, rows, 2, len(modal.sensors))),
        np.empty((nb, rows if settings.save_q else 0, n)),
    )
