"""Motion at the end of runs in time: its deflection shape, and its parts along complex modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from squealstudy.engine.final_states import read_state, state_names
from squealstudy.engine.mode_shapes import PointShapes
from squealstudy.engine.result_names import STATES
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.motion.growing_modes import coordinates, mode_planes
from squealstudy.shapes.shape import Shape
from squealstudy.wording import CHANGING

END = "end of the run"
MODAL = "modal"  # representation whose states are in component-mode coordinates
LEVEL, FREQUENCY = "torque_rms", "torque_line_hz"  # columns of points


@dataclass(frozen=True)
class EndMotion:
    """The state in which a run ended, as a harmonic motion and by its complex modes.

    The final displacement u (from steady sliding) and velocity v are those of the harmonic motion
    Re(U exp(i omega t)) with U = u - i v / omega, where omega is the run's dominant frequency. This
    is exact where the vibration has that frequency alone. Energy is defined by THEORY.md eq. (86),
    about the design point's steady sliding.

    Attributes
    ----------
    shape : Shape
        U at all nodes.
    number : ndarray (m,) of int
        Numbers of the m oscillating complex modes in the band at this design point, as a study of
        complex modes numbers them.
    lam : ndarray (m,) complex
        Eigenvalues of these modes, rad/s.
    mac : ndarray (m,)
        Modal assurance criterion of each mode with U, 0 to 1; degrees of freedom are weighted by
        mass.
    share : ndarray (m,)
        Share of the energy in the plane of motion along each mode alone, 0 to 1. Planes are not
        orthogonal, so shares do not add up to 1.
    residual : float
        Share of the energy outside of all these planes together.
    """

    shape: Shape
    number: np.ndarray
    lam: np.ndarray
    mac: np.ndarray
    share: np.ndarray
    residual: float


def loudest(results: ResultTables) -> int:
    """Row of the run with the largest RMS of the torque.

    ResultsError where no run came to its end, or where speed or pressure changes in any of them.
    """
    _expect_runs(results)
    rms = results.points[LEVEL].where(results.points["status"] == "ok")
    if (results.points["class"] == CHANGING).any():
        raise ResultsError(
            f"{results.directory}: speed or pressure change during the runs, and no motion lasts "
            "that could be shown"
        )
    if rms.isna().all():
        raise ResultsError(f"{results.directory}: no run came to its end")
    return int(rms.to_numpy(float, na_value=-np.inf).argmax())


def _expect_runs(results: ResultTables) -> None:
    """Raise ResultsError unless the results are of runs in time, with levels."""
    if results.kind != "transient":
        raise ResultsError(
            f"{results.directory}: motion at the end is that of runs in time, these are results of "
            f"kind {results.kind}"
        )
    if missing := {LEVEL, FREQUENCY, "status"} - set(results.points):
        raise ResultsError(
            f"{results.directory}: its table points has no column {min(missing)}: it is not that "
            "of runs in time; run the study again"
        )


def end_motion(results: ResultTables, row: int) -> EndMotion:
    """The motion at the end of a run; `row` is that of its design point in a transient study.

    Raises
    ------
    ResultsError
        Where results are of another kind, the run has no final state or no dominant frequency, its
        states are not in component-mode coordinates, or this version cannot make its model again.
    """
    _expect_runs(results)
    point_row = results.points.iloc[row]
    hz = float(point_row[FREQUENCY])
    if point_row["status"] != "ok" or not hz > 0:
        reason = point_row["message"] or "it has no dominant frequency: nothing vibrates"
        if point_row["class"] == CHANGING:
            reason = "its speed or pressure changes, and no frequency lasts"
        raise ResultsError(
            f"design point {row} ({point_row['point_id']}) has no motion to show: {reason}"
        )
    shapes = PointShapes(results, row)
    q, v = _state(results, str(point_row["point_id"]), shapes)
    system, omega = shapes.system, 2 * np.pi * hz
    U = q - 1j * v / omega
    w2, phi = la.eigh(system.K_sym)
    oscillating_rows = np.flatnonzero(shapes.lam.imag > 0)
    lam, psi = shapes.lam[oscillating_rows], shapes.psi[:, oscillating_rows]
    scale = np.sqrt(np.maximum(w2, 0.0))
    rows, overlap = mode_planes(w2, lam, phi.T @ psi)
    planes = coordinates(rows @ (phi.T @ q), rows @ (phi.T @ v))
    total = float(((scale * (phi.T @ q)) ** 2).sum() + v @ v)
    b = planes.ravel()
    inside = float(b @ np.linalg.lstsq(overlap, b, rcond=1e-12)[0])
    size = (np.abs(psi) ** 2).sum(axis=0) * np.vdot(U, U).real
    return EndMotion(
        shape=shapes.motion(U, 1j * omega, END),
        number=oscillating_rows + 1,
        lam=lam,
        mac=np.abs(psi.conj().T @ U) ** 2 / size,
        share=(planes**2).sum(axis=1) / total,
        residual=max(0.0, 1.0 - inside / total),
    )


def _state(
    results: ResultTables, point_id: str, shapes: PointShapes
) -> tuple[np.ndarray, np.ndarray]:
    """Deviation from steady sliding and velocity (n,) in the coordinates of the shapes' model."""
    name = state_names(results.store).get(point_id)
    if name is None:
        raise ResultsError(f"{results.directory}: there is no final state {STATES}/{point_id}.npz")
    path = results.store.whole(name)
    try:
        q, v, key, representation = read_state(path, point_id)
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path} is no final state ({error})") from None
    if representation != MODAL:
        raise ResultsError(
            f"{results.directory}: states of the representation {representation} are not shown, "
            f"those of {MODAL} are"
        )
    if not shapes.has_model(key, len(q)):
        raise ResultsError(
            f"{results.directory}: the model of the run is not that of this version, or its "
            "coordinates are others: run the study again"
        )
    return q, v
