"""What a run of the judge came to: levels of windows, cycles, energies."""

from __future__ import annotations

from dataclasses import dataclass

import event_laws as laws
import numpy as np
from event_laws import Case

MOST_TURNS = 24  # passages of a section in a period, at most
SAME = 1e-4  # of the size of a cycle: passages that are the same over all periods looked at


@dataclass(frozen=True)
class Levels:
    """Of a window. Torque in N m; shares of time and contact area."""

    mean: float
    rms: float
    peak_to_peak: float
    normal_force: float
    stick_share: float
    slip_share: float
    open_share: float
    friction_power: float
    damping_power: float


@dataclass(frozen=True)
class Cycle:
    """A motion that repeats: `deviation` is how far it does not, of its size."""

    frequency_hz: float
    turns: int
    levels: Levels
    deviation: float

    @property
    def period(self) -> float:
        """s."""
        return 1.0 / self.frequency_hz


@dataclass(frozen=True)
class Record:
    """States (n + 1, ..) at equal times, least and largest torque from one to the next (n, 2)."""

    design: object
    case: Case
    sample: float
    rows: np.ndarray
    extremes: np.ndarray
    events: int

    @property
    def time(self) -> np.ndarray:
        """s."""
        return self.sample * np.arange(len(self.rows))

    @property
    def torque(self) -> np.ndarray:
        """N m at the samples."""
        return self.rows[:, laws.N_ROWS]

    @property
    def normal_force(self) -> np.ndarray:
        """N at the samples."""
        return self.rows[:, laws.N_ROWS + 1]

    @property
    def end(self) -> np.ndarray:
        """Displacements from steady sliding and velocities (4,)."""
        return self.rows[-1, :4]

    def levels(self, begin: float, end: float) -> Levels:
        """Of the samples nearest to a window [s]."""
        first, last = (round(t / self.sample) for t in (begin, end))
        return self._levels(first * self.sample, last * self.sample)

    def _integrals(self, t: float) -> np.ndarray:
        """Integrals up to a time between samples, by cubics whose slopes are differences."""
        k = min(max(int(t / self.sample), 1), len(self.rows) - 3)
        x = t / self.sample - k
        a, b, c, d = self.rows[k - 1 : k + 3, : laws.N_ROWS]
        return b + x * (
            -a / 3 - b / 2 + c - d / 6 + x * ((a + c) / 2 - b + x * ((d - a) / 6 + (b - c) / 2))
        )

    def _levels(self, begin: float, end: float) -> Levels:
        change = (self._integrals(end) - self._integrals(begin)) / (end - begin)
        first, last = int(begin / self.sample + 0.5), int(end / self.sample + 0.5)
        inside = self.extremes[first : max(last, first + 1)]
        mean = change[laws.TORQUE]
        return Levels(
            mean=float(mean),
            rms=float(np.sqrt(max(change[laws.SQUARE] - mean**2, 0.0))),
            peak_to_peak=float(inside[:, 1].max() - inside[:, 0].min()),
            normal_force=float(change[laws.NORMAL]),
            stick_share=float(change[laws.STICKS]),
            slip_share=float(change[laws.SLIPS]),
            open_share=float(change[laws.OPENS]),
            friction_power=float(change[laws.FRICTION]),
            damping_power=float(change[laws.DAMPING]),
        )

    def passages(self, share: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
        """Times of upward passages through the mean of the larger displacement, and states (4,).

        In the last `share` of the record.
        """
        first = max(1, int((1 - share) * len(self.rows)))
        x = self.rows[first:, :4]
        j = int(np.argmax(x[:, :2].std(axis=0)))
        z = x[:, j] - 0.5 * (x[:, j].max() + x[:, j].min())
        up = np.flatnonzero((z[:-1] < 0) & (z[1:] >= 0))
        up = up[(up >= 1) & (up < len(z) - 2)]
        times, states = [], []
        for k in up:
            four = z[k - 1 : k + 3]
            inner = np.polynomial.polynomial.polyfit([-1, 0, 1, 2], four, 3)
            r = np.roots(inner[::-1])
            r = r[np.abs(r.imag) < 1e-9].real
            s = float(np.clip(r[np.argmin(np.abs(r - z[k] / (z[k] - z[k + 1])))], 0, 1))
            times.append((first + k + s) * self.sample)
            states.append(self._integrals((first + k + s) * self.sample)[:4])
        return np.array(times), np.array(states).reshape(-1, 4)

    def cycle(self, share: float = 0.5, same: float = SAME) -> Cycle | None:
        """The cycle that the last part of the record repeats; None where it does not."""
        times, states = self.passages(share)
        part = self.rows[int((1 - share) * len(self.rows)) :, :4]
        size = np.maximum(part.max(axis=0) - part.min(axis=0), 1e-300)
        omega = size[2:].max() / size[:2].max()
        states = states * [omega, omega, 1, 1] / size[2:].max()
        for turns in range(1, min(MOST_TURNS, (len(times) - 1) // 2) + 1):
            apart = max(np.ptp(states[k::turns], axis=0).max() for k in range(turns))
            periods = times[turns:] - times[:-turns]
            if apart < same and np.ptp(periods) < same * periods.mean():
                count = (len(times) - 1) // turns * turns
                begin, end = times[-1 - count], times[-1]
                period = (end - begin) * turns / count
                return Cycle(1 / period, turns, self._levels(begin, end), float(apart))
        return None

    def energy(self) -> np.ndarray:
        """Kinetic, elastic and contact energy at the samples, J."""
        c, y = self.case, self.rows
        q = y[:, :2] + c.rest
        law = (c.contact, c.first, c.second)
        stored = [
            sum(a * laws.potential(*law, n @ x) for n, a in zip(c.N, c.area, strict=True))
            for x in q
        ]
        elastic = 0.5 * np.einsum("ij,jk,ik->i", q, c.K, q)
        return 0.5 * c.mass * (y[:, 2:4] ** 2).sum(axis=1) + elastic + np.array(stored)

    def imbalance(self) -> float:
        """Energy from nowhere at the end over the work of friction."""
        y, E = self.rows, self.energy()
        put_in = y[-1, :2] @ self.case.load - y[0, :2] @ self.case.load + y[-1, laws.BELT]
        lost = y[-1, laws.FRICTION] + y[-1, laws.DAMPING]
        return float((put_in - lost - (E[-1] - E[0])) / max(abs(y[-1, laws.FRICTION]), 1e-300))
