"""The kernels' arrays of a modal system and its design points: aligned, padded, in tiles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.laws import side_by_side
from squealstudy.kernels.newmark_correct import NOT_FACTORED
from squealstudy.kernels.tile import LANES, POINTS, ROWS
from squealstudy.motion.integrator import FixedJacobian, KernelIntegrator
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.system import ModalSystem, MotionPoint

ALIGNMENT_BYTES = 64  # a cache line, and the widest vector register
SYMMETRY_TOLERANCE = 1e-12  # a smaller skew part, over the largest entry, is round-off
FEW_POINTS = 8  # steps are cut at corners for at most so many contact points: minimal models
PANEL_BYTES = 2**19  # tiles that are used twice stay in the second-level cache in between


def padded(n: int) -> int:
    """Number of modes, rounded up to whole vector registers."""
    return -(-n // LANES) * LANES


def coordinates(system: ModalSystem) -> int:
    """Number of modes in the kernels' arrays: rounded up, except for small models."""
    small = system.n < LANES and len(system.area) <= POINTS
    return system.n if small else padded(system.n)


def aligned_zeros(*shape: int, dtype: type[np.floating] = np.float64) -> np.ndarray:
    """Zeros; rows begin at cache lines if the last dimension fills whole cache lines."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = np.zeros(size + ALIGNMENT_BYTES, dtype=np.uint8)
    start = -raw.ctypes.data % ALIGNMENT_BYTES
    aligned: np.ndarray = raw[start : start + size].view(dtype).reshape(shape)
    return aligned


def observation(system: ModalSystem, single_storage: bool = False) -> np.ndarray:
    """Observation matrix B (nt, n, ROWS) of a system, in tiles of contact points.

    n is rounded up (`coordinates`). It is made once for each system and precision.
    """
    dtype = np.float32 if single_storage else np.float64
    if dtype not in system.tiles:
        nc, P = len(system.area), POINTS
        tiles = aligned_zeros(-(-nc // P), coordinates(system), ROWS, dtype=dtype)
        for k, part in enumerate((system.N, system.T1, system.T2)):
            for t in range(len(tiles)):
                block = part[t * P : (t + 1) * P]
                tiles[t, : system.n, k * P : k * P + len(block)] = block.T
        system.tiles[dtype] = tiles
    return system.tiles[dtype]


def modal_arrays(
    system: ModalSystem,
    designs: Sequence[MotionPoint],
    settings: MotionSettings,
    integrator: KernelIntegrator,
) -> tuple[layout.ModalArrays, bool]:
    """The kernels' arrays of design points, and whether the fixed Jacobian is dense."""
    n, m, h = coordinates(system), len(system.shapes), settings.step
    c = _stack([x.c for x in designs], system.n, "c")
    w2 = np.tile(system.omega2.astype(float), (len(designs), 1))
    w2, c = integrator.modes(w2, c, h)
    modes = aligned_zeros(len(designs), 3, n)
    modes[:, layout.W2, : system.n] = w2
    modes[:, layout.C, : system.n] = c
    modes[:, layout.LOAD, : system.n] = _stack([x.load for x in designs], system.n, "load")
    component_terms = [
        _stack([x.d for x in designs], m, "d"),
        _stack([x.s for x in designs], m, "s"),
    ]
    nc = len(system.area)
    points = np.zeros((len(designs), layout.N_POINT_ROWS, -(-nc // POINTS) * POINTS))
    points[:, :, :nc] = [x.points(system) for x in designs]
    points[:, layout.POINT_SPEED, nc:] = [[x.speed] for x in designs]  # no curve at rest there
    fixed = _fixed(system, designs, integrator)
    steps = step_tables(modes, integrator, h, _levels(integrator, nc))
    sticks_in_iteration = (
        isinstance(integrator, FixedJacobian) and integrator.tangential_damping == "auto"
    )
    tangential, compliance, self_compliance = _tangential(
        system, steps[0, 0, layout.LAST_V], sticks_in_iteration
    )
    modal = layout.ModalArrays(
        points=points,
        laws=side_by_side(x.laws(system)[0] for x in designs),
        modes=modes,
        steps=steps,
        shapes=_padded_rows(system.shapes, n),
        component_terms=np.stack(component_terms, axis=1),
        **_full_matrices(system, designs, n),
        fixed=fixed,
        sensors=_sensors(system, designs, n),
        tangential=tangential,
        compliance=compliance,
        self_compliance=self_compliance,
    )
    return modal, bool(fixed.any())


def schedule_arrays(
    designs: Sequence[MotionPoint], modal: layout.ModalArrays
) -> layout.ScheduleArrays:
    """Schedules of speed and pressure of the designs, and the loads that follow them.

    Raises
    ------
    ModelError
        Only some designs have a schedule, or their times differ.
    """
    staying, count = modal.modes[:, layout.LOAD], modal.fixed.shape[2]
    speeds, loads = (
        modal.points[:, layout.POINT_SPEED, :count].copy(),
        np.zeros((len(designs), 2, 0)),
    )
    schedules = [x.schedule for x in designs if x.schedule is not None]
    if not schedules:
        none = modal.turning[:0]
        return layout.ScheduleArrays(np.zeros(0), np.zeros((0, 2, 0)), speeds, loads, none, none)
    times = np.concatenate([[0.0], schedules[0].times[schedules[0].times > 0.0]])
    if len(schedules) < len(designs) or any(
        not np.array_equal(x.times, schedules[0].times) for x in schedules
    ):
        raise ModelError("design points that advance together need schedules at the same times")
    rows = np.array([[x.speed_at(times), x.pressure_at(times)] for x in schedules])
    pressing = [x.pressing for x in schedules]
    if any(x is not None for x in pressing):
        loads = np.zeros((len(designs), 2, staying.shape[1]))
        loads[:, layout.STAYING] = staying
        for load, x in zip(loads[:, layout.PRESSING], pressing, strict=True):
            if x is not None:
                load[: len(x)] = x
    terms_by_speed = np.zeros_like(modal.turning)
    for G, index in zip((x.turning for x in schedules), modal.turning_of, strict=True):
        if G is not None and index >= 0:
            terms_by_speed[index, : len(G), : len(G)] = G
    staying = modal.turning - terms_by_speed
    return layout.ScheduleArrays(times, rows, speeds, loads, staying, terms_by_speed)


def corner_halvings(integrator: KernelIntegrator, contact_points: int) -> int:
    """Halvings of a sub-step with a corner; 0 for many points, which meet one in every step."""
    return integrator.corner_halvings if contact_points <= FEW_POINTS else 0


def _levels(integrator: KernelIntegrator, contact_points: int) -> int:
    """Halvings of a step for which coefficients are computed."""
    return max(integrator.max_halvings, corner_halvings(integrator, contact_points))


def step_tables(
    modes: np.ndarray, integrator: KernelIntegrator, h: float, levels: int
) -> np.ndarray:
    """`ModalArrays.steps` (nb, levels + 1, N_STEP, n) of modes (nb, 3, n).

    Designs of the same stiffness and damping share the work.
    """
    nb, _, n = modes.shape
    steps = aligned_zeros(nb, levels + 1, layout.N_STEP, n)
    table_of: dict[bytes, np.ndarray] = {}
    for k, (w2, c, _) in enumerate(modes):
        key = w2.tobytes() + c.tobytes()
        if key not in table_of:
            table_of[key] = integrator.steps(w2, c, h, levels)
        steps[k] = table_of[key]
    return steps


def _padded_rows(rows: np.ndarray, n: int) -> np.ndarray:
    """`rows` (m, ..) with zeros up to n columns."""
    full = aligned_zeros(len(rows), n)
    full[:, : rows.shape[1]] = rows
    return full


def _full_matrices(
    system: ModalSystem, designs: Sequence[MotionPoint], n: int
) -> dict[str, np.ndarray]:
    """`ModalArrays.between` and `turning`, and which of their matrices each design uses.

    Designs with the same array share one matrix; -1 is none.

    Raises
    ------
    ModelError
        A matrix of another size, not finite, or with a diagonal.
    """
    matrices: dict[str, list[np.ndarray]] = {"between": [], "turning": []}
    row_of_matrix: dict[int, dict[str, int]] = {}
    row_of_design = {name: np.full(len(designs), -1) for name in matrices}
    for k, D in enumerate(x.damping_between for x in designs):
        if D is None:
            continue
        if id(D) not in row_of_matrix:
            if D.shape != (system.n,) * 2 or not np.isfinite(D).all():
                raise ModelError(
                    f"design point: 'damping_between' needs {system.n} x {system.n} finite values"
                )
            if np.diag(D).any():
                raise ModelError("design point: 'damping_between' has zeros on its diagonal")
            halves = {"between": (D + D.T) / 2, "turning": (D - D.T) / 2}
            round_off = SYMMETRY_TOLERANCE * np.abs(D).max()
            used = {name: half for name, half in halves.items() if np.abs(half).max() > round_off}
            row_of_matrix[id(D)] = {name: len(matrices[name]) for name in used}
            for name, half in used.items():
                matrices[name].append(half)
        for name, i in row_of_matrix[id(D)].items():
            row_of_design[name][k] = i
    arrays = {f"{name}_of": rows for name, rows in row_of_design.items()}
    for name, halves_of_all in matrices.items():
        arrays[name] = aligned_zeros(len(halves_of_all), n, n, dtype=np.float32)
        for full, half in zip(arrays[name], halves_of_all, strict=True):
            full[: system.n, : system.n] = half
    return arrays


def _sensors(system: ModalSystem, designs: Sequence[MotionPoint], n: int) -> np.ndarray:
    """Rows (nb, ns + 8 m, n) whose products with q and q' are saved.

    First those of the sensed modes, then the sensors of the growing modes.

    Raises
    ------
    ModelError
        Sensors of growing modes of another size, or not finite.
    """
    growing = [design.growing.sensors for design in designs]
    if any(len(x) and (x.shape[1] != system.n or not np.isfinite(x).all()) for x in growing):
        raise ModelError(f"design point: 'sensors' needs rows of {system.n} finite values")
    ns = len(system.sensed)
    full = aligned_zeros(len(designs), ns + max(len(x) for x in growing), n)
    full[:, range(ns), system.sensed - 1] = 1.0
    for rows, sensors_of_design in zip(full, growing, strict=True):
        rows[ns : ns + len(sensors_of_design), : system.n] = sensors_of_design.reshape(-1, system.n)
    return full


def _fixed(
    system: ModalSystem, designs: Sequence[MotionPoint], integrator: KernelIntegrator
) -> np.ndarray:
    """`ModalArrays.fixed` (nb, 2, nc): zeros where the Jacobian is not fixed."""
    fixed = np.zeros((len(designs), 2, len(system.area)))
    if not isinstance(integrator, FixedJacobian):
        return fixed
    uniform = integrator.contact_stiffness
    k_c = uniform * system.area if uniform else system.k_ref
    k_c = np.concatenate([k_c[system.touching], system.k_ref[system.touching.stop :]])
    fixed[:, 0] = integrator.contact_factor * k_c - system.k_ref
    if integrator.tangential_damping == "always":
        slopes = np.array([x.friction.k_t for x in designs])
        fixed[:, 1] = 0.5 * slopes[:, None] * system.area * (system.frictional > 0)
    return fixed


def _tangential(
    system: ModalSystem, velocity_change: np.ndarray, used: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`ModalArrays.tangential`, `compliance` and `self_compliance`; empty unless `used`.

    The compliance is that of the first design, whose velocities change by `velocity_change` (n,)
    for a unit pull. Dampings of other designs hardly change it, and the iteration has only to
    contract with it.
    """
    nc, n = (len(system.area) if used else 0), len(velocity_change)
    rows = aligned_zeros(2 * nc, n)
    rows[::2, : system.n] = system.T1[:nc]
    rows[1::2, : system.n] = system.T2[:nc]
    return rows, *point_compliance(rows, velocity_change)


def point_compliance(
    rows: np.ndarray, velocity_change: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`ModalArrays.compliance` and `self_compliance` of tangential rows (2 nc, n).

    Velocities change by `velocity_change` (n,) for a unit pull.
    """
    compliance = np.ascontiguousarray((rows * velocity_change) @ rows.T)
    return compliance, compliance.diagonal().reshape(-1, 2).max(axis=1)


def _stack(rows: Sequence[np.ndarray | None], n: int, name: str) -> np.ndarray:
    full = [np.zeros(n) if x is None else np.asarray(x, dtype=float) for x in rows]
    if any(x.shape != (n,) or not np.isfinite(x).all() for x in full):
        raise ModelError(f"design point: '{name}' needs {n} finite values")
    return np.array(full).reshape(len(full), n)


def kernel_settings(
    settings: MotionSettings, integrator: KernelIntegrator, dense: bool, contact_points: int
) -> layout.StepSettings:
    """The kernels' settings; Newton's method, which converges quadratically, squares tolerances."""
    fixed = isinstance(integrator, FixedJacobian)
    power = 1 if fixed else 2
    return layout.StepSettings(
        h=settings.step,
        n_steps=settings.n_steps,
        save_every=settings.save_every,
        tolerance=settings.tolerance**power,
        tolerance_t=settings.friction_tolerance**power,
        max_iterations=settings.max_iterations,
        max_halvings=integrator.max_halvings,
        corner_halvings=corner_halvings(integrator, contact_points),
        levels=_levels(integrator, contact_points),
        newton=not fixed,
        aitken=isinstance(integrator, FixedJacobian) and integrator.aitken,
        dense=dense,
        extrapolate=integrator.extrapolate,
        changes=integrator.work_of_changes,
    )


def work_arrays(
    modal: layout.ModalArrays, options: layout.StepSettings, B: np.ndarray, starts: np.ndarray
) -> layout.WorkArrays:
    """Working arrays; pages of matrices that are never factored are never touched.

    `starts` (nb, 2, n) are initial deviations and velocities, also the first trial states.
    """
    nb, _, n = modal.modes.shape
    n_matrices = 1 + (nb * (options.levels + 1) if options.dense else 0)
    panel = max(1, PANEL_BYTES // (8 * n * ROWS))
    x = aligned_zeros(nb, layout.N_ROWS, n)
    x[:, [layout.Q, layout.V], : starts.shape[2]] = starts
    x[:, [layout.Q_TRIAL, layout.V_TRIAL], : starts.shape[2]] = starts
    real = np.zeros((nb, layout.N_REAL))
    real[:, layout.STORED_END] = np.nan
    counts = np.zeros((nb, layout.N_COUNT), dtype=np.int64)
    counts[:, layout.PAUSE] = options.n_steps
    return layout.WorkArrays(
        x=x,
        point=np.zeros((nb, layout.N_POINT, modal.points.shape[2])),
        lu=np.empty((n_matrices, n, n)),
        pivots=np.full((n_matrices, n), NOT_FACTORED, dtype=np.int64),
        counts=counts,
        real=real,
        sums=np.zeros((nb, layout.N_SUM)),
        now=np.zeros((nb, len(layout.HISTORY))),
        tiles=aligned_zeros(panel, LANES, ROWS),
        lanes=aligned_zeros(3, n, LANES),
        wide=aligned_zeros(panel if B.dtype == np.float32 else 0, n, ROWS),
        row=aligned_zeros(3, n),
        running=np.zeros(nb, dtype=np.int64),
        listed=np.zeros(modal.points.shape[2], dtype=np.int64),
        stiff=np.zeros((modal.self_compliance.size, 4)),
        free=np.zeros(2 * modal.self_compliance.size),
        small=np.zeros(4 * modal.self_compliance.size**2),
    )


def saved_arrays(
    modal: layout.ModalArrays, system: ModalSystem, settings: MotionSettings
) -> layout.SavedArrays:
    """Room for the histories."""
    nb = len(modal.modes)
    rows = settings.n_steps // settings.save_every + 1 if settings.save_every else 0
    return layout.SavedArrays(
        history=np.empty((nb, rows, len(layout.HISTORY))),
        sensed=np.empty((nb, rows, 2, modal.sensors.shape[1])),
        squares=np.empty((nb, rows, 2, len(system.sensed))),
        q=np.empty((nb, rows if settings.save_q else 0, system.n)),
    )
