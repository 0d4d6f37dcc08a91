"""The kernels' arrays of a modal system and its design points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.analysis.transient.observation import aligned_zeros, padded
from squealstudy.analysis.transient.propagators import step_table
from squealstudy.analysis.transient.settings import TransientSettings
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.errors import ModelError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.newmark_correct import NOT_FACTORED
from squealstudy.kernels.tile import LANES, POINTS, ROWS

PANEL_BYTES = 2**19  # of the tiles that wait in the second cache for their second use
WARP_LIMIT = 2.0  # omega h up to which a mode is pre-warped


def modal_arrays(
    system: ModalSystem, designs: Sequence[TransientDesign], settings: TransientSettings
) -> tuple[layout.Modal, bool]:
    """The kernels' arrays, and whether the fixed Jacobian is dense."""
    n, m = padded(system.n), len(system.shapes)
    c = _stack([x.c for x in designs], system.n, "c")
    w2 = np.tile(system.omega2.astype(float), (len(designs), 1))
    if settings.prewarp:
        w2, c = prewarped(w2, c, settings.step)
    modes = aligned_zeros(len(designs), 3, n)
    modes[:, layout.W2, : system.n] = w2
    modes[:, layout.C, : system.n] = c
    modes[:, layout.LOAD, : system.n] = _stack([x.load for x in designs], system.n, "load")
    uniform = settings.contact_stiffness
    k_c = system.k_ref if uniform is None else uniform * system.area
    beyond = settings.contact_factor * k_c - system.k_ref
    fixed = np.array([[beyond, _mockup(system, x, settings)] for x in designs])
    tuned = [_stack([x.d for x in designs], m, "d"), _stack([x.s for x in designs], m, "s")]
    nc = len(system.area)
    points = np.zeros((len(designs), 8, -(-nc // POINTS) * POINTS))
    points[:, :, :nc] = [system.points(x) for x in designs]
    steps = step_tables(modes, settings)
    modal = layout.Modal(
        points,
        np.array([x.law_row() for x in designs], dtype=float),
        modes,
        steps,
        _padded_rows(system.shapes, n),
        np.stack(tuned, axis=1),
        fixed,
        _sensors(system, designs, n),
        *_tangential(system, steps[0, 0, layout.LAST_V], settings),
    )
    return modal, bool(fixed.any())


def step_tables(modes: np.ndarray, settings: TransientSettings) -> np.ndarray:
    """Modal.steps for modes (nb, 3, n); designs of the same damping share the work."""
    nb, _, n = modes.shape
    steps = aligned_zeros(nb, settings.max_halvings + 1, layout.N_STEP, n)
    limit = settings.exact_limit if settings.method == "exponential" else None
    made: dict[bytes, np.ndarray] = {}
    for k, (w2, c, _) in enumerate(modes):
        key = w2.tobytes() + c.tobytes()
        if key not in made:
            made[key] = step_table(w2, c, settings.step, settings.max_halvings, limit)
        steps[k] = made[key]
    return steps


def _padded_rows(rows: np.ndarray, n: int) -> np.ndarray:
    """`rows` (m, ..) with zeros up to n columns."""
    full = aligned_zeros(len(rows), n)
    full[:, : rows.shape[1]] = rows
    return full


def _sensors(system: ModalSystem, designs: Sequence[TransientDesign], n: int) -> np.ndarray:
    """The system's rows and each design's own (nb, ns, n)."""
    rows = [design.sensor_rows(system) for design in designs]
    full = aligned_zeros(len(rows), max(len(r) for r in rows), n)
    for k, own in enumerate(rows):
        full[k, : len(own), : system.n] = own
    return full


def _tangential(
    system: ModalSystem, answer: np.ndarray, settings: TransientSettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Modal.tangential, compliance and own of the points; empty if unused.

    The compliance is that of the first design, whose velocities answer to the pull with `answer`
    (n,): dampings of the others hardly change it, and it only has to make the iteration contract.
    """
    wanted = settings.mockup == "auto" and settings.method != "newmark_newton"
    nc, n = (len(system.area) if wanted else 0), len(answer)
    rows = aligned_zeros(2 * nc, n)
    rows[::2, : system.n] = system.T1[:nc]
    rows[1::2, : system.n] = system.T2[:nc]
    compliance = np.ascontiguousarray((rows * answer) @ rows.T)
    return rows, compliance, compliance.diagonal().reshape(nc, 2).max(axis=1)


def _mockup(
    system: ModalSystem, design: TransientDesign, settings: TransientSettings
) -> np.ndarray:
    """Tangential damping of the fixed Jacobian (nc,), N s/m."""
    wanted = settings.mockup == "always" and settings.method != "newmark_newton"
    return 0.5 * wanted * design.friction.k_t * system.area * (system.frictional > 0)


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


def kernel_settings(settings: TransientSettings, dense: bool) -> layout.Settings:
    """The kernels' settings; Newton converges quadratically and takes squares of tolerances."""
    newton = settings.method == "newmark_newton"
    power = 2 if newton else 1
    return layout.Settings(
        settings.step,
        settings.n_steps,
        settings.save_every,
        settings.tolerance**power,
        settings.tolerance_t**power,
        settings.max_iterations,
        settings.max_halvings,
        newton,
        settings.aitken,
        dense,
        settings.extrapolate,
        1.0 if settings.method == "exponential" else 0.0,
    )


def work_arrays(modal: layout.Modal, options: layout.Settings, B: np.ndarray) -> layout.Work:
    """Working arrays; pages of matrices that are never factored are never touched."""
    nb, _, n = modal.modes.shape
    n_matrices = 1 + (nb * (options.max_halvings + 1) if options.dense else 0)
    panel = max(1, PANEL_BYTES // (8 * n * ROWS))
    real = np.zeros((nb, layout.N_REAL))
    real[:, layout.STORED_END] = np.nan
    counts = np.zeros((nb, layout.N_COUNT), dtype=np.int64)
    counts[:, layout.PAUSE] = options.n_steps
    return layout.Work(
        aligned_zeros(nb, layout.N_ROWS, n),
        np.zeros((nb, layout.N_POINT, modal.points.shape[2])),
        np.empty((n_matrices, n, n)),
        np.full((n_matrices, n), NOT_FACTORED, dtype=np.int64),
        counts,
        real,
        aligned_zeros(panel, LANES, ROWS),
        aligned_zeros(3, n, LANES),
        aligned_zeros(panel if B.dtype == np.float32 else 0, n, ROWS),
        aligned_zeros(3, n),
        np.zeros(modal.points.shape[2], dtype=np.int64),
        np.zeros((modal.own.size, 4)),
        np.zeros(2 * modal.own.size),
        np.zeros(4 * modal.own.size**2),
    )


def saved_arrays(modal: layout.Modal, n: int, settings: TransientSettings) -> layout.Saved:
    """Room for the histories of n modes."""
    nb = len(modal.modes)
    rows = settings.n_steps // settings.save_every + 1 if settings.save_every else 0
    return layout.Saved(
        np.empty((nb, rows, len(layout.HISTORY))),
        np.empty((nb, rows, 2, modal.sensors.shape[1])),
        np.empty((nb, rows if settings.save_q else 0, n)),
    )
