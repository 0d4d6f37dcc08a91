"""What a hybrid run keeps: energies, rows of the histories, sensors, the motion itself."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels import hybrid_layout as layout
from squealstudy.kernels.hybrid_state import contact_energy, history_row
from squealstudy.kernels.newmark_layout import HISTORY
from squealstudy.motion.settings import MotionSettings
from squealstudy.reduction.hybrid import HybridModel


class Recorder:
    """Reads a run's state, whose motion is q = q_s + phi (alpha - alpha_s) (hybrid_layout).

    Parameters
    ----------
    model : HybridModel
    hybrid, state : hybrid_layout tuples
        Of the run.
    settings : MotionSettings
    sensed : ndarray (ns,) of int
        Modes of the model whose amplitudes are kept, from 1.
    watching : ndarray (8 m, n)
        Rows whose products with q and q' are kept beside them (GrowingModes.sensors).
    """

    def __init__(
        self,
        model: HybridModel,
        hybrid: layout.Hybrid,
        state: layout.State,
        settings: MotionSettings,
        sensed: np.ndarray,
        watching: np.ndarray,
    ) -> None:
        self._model, self._hybrid, self._state = model, hybrid, state
        self._settings, self._sensed_modes = settings, sensed - 1
        self._watching = watching.reshape(-1, model.n)
        self._watching_modes = self._watching @ model.phi
        self._rows: list[np.ndarray] = []
        self._sensed: list[np.ndarray] = []
        self._q: list[np.ndarray] = []

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Deviation and velocity (n,)."""
        x, lag = self._state.vectors, self._lag()
        moved = self._model.phi @ lag.T
        return x[layout.Q] + moved[:, 0], x[layout.V] + moved[:, 1]

    def stored(self) -> tuple[float, float]:
        """Mechanical energy of the linear part, and with the contact potential, J.

        Modes are orthogonal in M and K: theirs replaces that of the sparse part.
        """
        x, modes, w2 = self._state.vectors, self._state.modes, self._hybrid.omega2
        v = x[layout.V]
        a, a_s = modes[layout.ALPHA], modes[layout.ALPHA_S]
        rate, rate_s = modes[layout.RATE], modes[layout.RATE_S]
        twice = v @ (self._model.M @ v) + x[layout.Q] @ x[layout.KQ]
        twice += rate @ rate - rate_s @ rate_s + w2 @ (a * a - a_s * a_s)
        linear = 0.5 * float(twice)
        return linear, linear + float(contact_energy(self._hybrid, self._state))

    def save(self, step: int) -> None:
        """Append the accepted state, if the step is one of those kept."""
        every = self._settings.save_every
        if not every or step % every:
            return
        row = np.zeros(len(HISTORY))
        history_row(self._hybrid, self._state, row)
        row[0] = step * self._settings.step
        row[11], row[10] = self.stored()
        self._rows.append(row)
        amplitudes = self._state.modes[[layout.ALPHA, layout.RATE]][:, self._sensed_modes]
        motion = self._state.vectors[[layout.Q, layout.V]]
        watched = motion @ self._watching.T + self._lag() @ self._watching_modes.T
        self._sensed.append(np.hstack([amplitudes, watched]))
        if self._settings.save_q:
            self._q.append(self.motion()[0])

    def history(self) -> dict[str, np.ndarray]:
        """Columns newmark_layout.HISTORY (rows,)."""
        rows = np.array(self._rows).reshape(-1, len(HISTORY))
        return {name: rows[:, i].copy() for i, name in enumerate(HISTORY)}

    def sensed(self) -> np.ndarray:
        """Of q and q' (rows, 2, ns + 8 m): amplitudes, then what watches growing modes."""
        ns = len(self._sensed_modes) + len(self._watching)
        return np.array(self._sensed).reshape(-1, 2, ns)

    def coordinates(self) -> np.ndarray:
        """Deviations (rows, n), none unless they were asked for."""
        return np.array(self._q).reshape(-1, self._model.n)

    def _lag(self) -> np.ndarray:
        """What the modes differ from the sparse part, amplitude and velocity (2, m)."""
        modes = self._state.modes
        part = modes[[layout.ALPHA, layout.RATE]] - modes[[layout.ALPHA_S, layout.RATE_S]]
        return np.asarray(part)
