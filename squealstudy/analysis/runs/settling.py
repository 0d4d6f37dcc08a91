"""Whether a run has reached its levels, and from when on it has them."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.runs.behaviour import CHANCE, REST, SCATTER, TREND
from squealstudy.analysis.runs.envelope import WINDOWS, Windows, window_means, windows
from squealstudy.analysis.runs.levels import FLAT, LAST, last_window
from squealstudy.analysis.tables.run_classes import LEVELLED, STABLE

BAND = 0.05  # least half-width of the band within which levels agree


def settled(
    time: np.ndarray, energy: np.ndarray, torque: np.ndarray, name: str
) -> tuple[bool, float]:
    """Whether the levels of the last 40 % agree, and the earliest time from which all do.

    Those of a limit cycle or an irregular motion agree where the RMS of the vibration and that of
    the torque neither trend (5 %, beyond three standard errors) nor scatter (10 % about the trend);
    those of a stable run where both are at rest: below 1 % of the largest. Other runs have not
    settled, nor has one of so few periods that the torque's levels are those of a longer part of
    the record (`levels.last_window`) which was not settled from its start.

    Parameters
    ----------
    time, energy
        As of `envelope.windows`.
    torque : ndarray (rows,)
        N m.
    name : str
        Class of the run.

    Returns
    -------
    settled : bool
    time : float
        Start of the first window, s, from which energy, mean and RMS of the torque in each stay
        near those judged and no peak exceeds theirs; NaN where the run has not settled.
    """
    if len(time) < WINDOWS[0] or name not in (*LEVELLED, STABLE):
        return False, np.nan
    mean = float(torque[-round(LAST * len(torque)) :].mean())
    swing = torque - mean
    least = FLAT * float(np.abs(torque).max())
    motion, force = windows(time, energy), windows(time, swing**2)
    moves = _start(motion, _away(motion, name, 0.0))
    quiet = float(force.level[force.judged :].max()) <= least
    away = _away(force, STABLE if quiet else name, least)
    if away is not None:
        away = away | _shifted(torque, force, mean, least) | _exceeds(swing, force, least)
    since = max(moves, _start(force, away))  # infinite where either has not settled
    if not since <= time[last_window(time, torque)][0]:
        return False, np.nan
    return True, since


def _start(found: Windows, away: np.ndarray | None) -> float:
    """Start of the first window after the last that is away, s; infinite where none will do."""
    if away is None:
        return np.inf
    first = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    return float(found.start[first]) if first <= found.judged else np.inf


def _away(found: Windows, name: str, least: float) -> np.ndarray | None:
    """Which levels differ from those judged; None where these do not agree among themselves.

    What is below `least` is at rest.
    """
    level, judged = found.level, found.level[found.judged :]
    if name == STABLE:
        rest = max(REST * float(level.max()), least)
        return level > rest if judged.max() <= rest else None
    rise, error, scatter = found.trend()
    if scatter > SCATTER or abs(rise) > max(TREND, CHANCE * error):
        return None
    return _outside(level, found.judged, float(judged.mean()), 0.0)


def _outside(values: np.ndarray, judged: int, mean: float, least: float) -> np.ndarray:
    """Which values are off the mean by more than `BAND`, `least`, or any of those judged is."""
    off = np.abs(values - mean)
    found: np.ndarray = off > max(BAND * abs(mean), least, 1.01 * float(off[judged:].max()))
    return found


def _shifted(torque: np.ndarray, found: Windows, mean: float, least: float) -> np.ndarray:
    """Windows whose mean torque is not the one judged."""
    return _outside(window_means(torque, len(found.level)), found.judged, mean, least)


def _exceeds(swing: np.ndarray, found: Windows, least: float) -> np.ndarray:
    """Windows in which the torque swings wider than in those judged."""
    count = len(found.level)
    cut = np.abs(swing[len(swing) % count :]).reshape(count, -1)
    peak = cut.max(axis=1)
    top = float(peak[found.judged :].max())
    wider: np.ndarray = peak > max((1 + BAND) * top, REST * float(peak.max()), least)
    return wider
