"""What a run came to: at rest, a limit cycle, still growing or irregular; which mode took over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.runs.levels import LAST

WINDOWS = (10, 25)  # sub-windows of a record, fewest and most
WINDOW_PERIODS = 3.0  # of the dominant line in one, where the record has them
TREND = 0.05  # rise of the RMS over the judged part; less is none
DRIFT = 0.15  # of a limit cycle that drifts slowly: not settled, not irregular either
LEAST_TREND = 1e-3  # over the judged part: what is smaller is none
CHANCE = 3.0  # standard errors that a trend must exceed
SCATTER = 0.10  # of the RMS of sub-windows about their trend; more is irregular
BAND = 0.05  # least half-width of the band within which levels agree
STEADY = 0.25  # of the decay over the whole record: motion that still falls falls so fast
LOST = 0.9  # of the first energy: what never rose and has less at the end decays, however slowly
REST = 1e-2  # of the largest RMS: what is smaller is at rest
FADED = 0.3  # of the initial RMS: what is smaller and falls unevenly is dying away
PLATEAU = 0.8  # of the record: where a plateau begins at the latest
NOISE = 1e-18  # J: round-off of a run that nothing disturbs


@dataclass(frozen=True)
class Windows:
    """RMS levels of equal sub-windows of a record.

    Attributes
    ----------
    start : ndarray (m,)
        s.
    level : ndarray (m,)
        Square root of the mean of the energy in each.
    judged : int
        The first of those that are judged: the last 40 % of the record.
    """

    start: np.ndarray
    level: np.ndarray
    judged: int

    def trend(self, first: int | None = None) -> tuple[float, float, float]:
        """Relative rise over the windows from `first` on, its standard error, scatter about it."""
        y = self.level[self.judged if first is None else first :]
        y = y / (y.mean() or 1.0)
        x = np.arange(len(y)) - 0.5 * (len(y) - 1)
        slope = float(x @ y / (x @ x))
        rest = y - y.mean() - slope * x
        variance = float(rest @ rest) / (len(y) - 2)
        return slope * len(y), len(y) * float(np.sqrt(variance / (x @ x))), float(np.sqrt(variance))


def windows(time: np.ndarray, energy: np.ndarray, frequency_hz: float = np.nan) -> Windows:
    """Levels of 25 sub-windows, or of as few as 10 where those hold three periods each.

    Parameters
    ----------
    time : ndarray (rows,)
        Equally spaced, s; ten rows or more.
    energy : ndarray (rows,)
        Of the vibration (`modal_energies.vibration_energy`), or a squared torque fluctuation.
    frequency_hz : float
        Dominant line, where it is known.
    """
    few, most = WINDOWS
    periods = (time[-1] - time[0]) * frequency_hz
    count = most if np.isnan(periods) else int(np.clip(periods / WINDOW_PERIODS, few, most))
    count = min(count, len(time))
    edges = np.arange(count) * len(time) // count
    rows = np.diff(np.append(edges, len(time)))
    level = np.sqrt(np.add.reduceat(energy, edges) / rows)
    return Windows(time[edges], level, count - max(4, round(LAST * count)))


def settled(
    time: np.ndarray, energy: np.ndarray, frequency_hz: float = np.nan
) -> tuple[bool, float]:
    """Whether the levels of the last 40 % agree, and the earliest time from which all do.

    They agree where their RMS neither trends (5 %, beyond three standard errors) nor scatters (10 %
    about the trend) nor goes on growing or decaying, however slowly; or where all are at rest:
    below 1 % of the largest. The same part of the
    record gives the torque's levels (`levels.last_window`).

    Parameters
    ----------
    time, energy, frequency_hz
        As of `windows`.

    Returns
    -------
    settled : bool
    time : float
        Start of the first sub-window from which all levels stay near those judged, s; NaN where
        the run has not settled.
    """
    if len(time) < WINDOWS[0]:
        return False, np.nan
    found = windows(time, energy, frequency_hz)
    level, judged = found.level, found.level[found.judged :]
    rest = REST * level.max()
    if judged.max() <= rest:
        away = level > rest
    elif _stationary(found) and not (_steady(found, 1.0) or _steady(found, -1.0)):
        mean = float(judged.mean())
        band = max(BAND, 1.01 * float(np.abs(judged / mean - 1).max()))
        away = np.abs(level - mean) > band * mean
    else:
        return False, np.nan
    first = int(np.flatnonzero(away)[-1]) + 1 if away.any() else 0
    return True, float(found.start[first])


def classify(
    time: np.ndarray,
    energy: np.ndarray,
    initial: float = 0.0,
    frequency_hz: float = np.nan,
    noise: float = NOISE,
    driven: bool = True,
) -> str:
    """Class of a finished run.

    ``stable``: the energy at the end is not above the initial one and falls, or is gone (below
    1e-4 of the initial energy, or below `noise`), or never rose, lost a tenth and did not level
    off, or has fallen unevenly below 0.09 of it, the highest level that is judged below half of
    the highest before. ``growing``: levels still rise through the last 40 %. ``limit_cycle``: they
    are stationary there, drift by less than 15 % (such a run has not settled), or rose to a
    plateau within it and keep that over the last fifth. ``irregular``: neither.

    Parameters
    ----------
    time, energy, frequency_hz
        As of `windows`; fewer than ten rows are irregular.
    initial : float
        Energy that the perturbation put in, J, or zero for the continuation of a motion; for a
        steep fall, the first sub-window's where that is more.
    noise : float
        Energy of round-off, J.
    driven : bool
        Whether any mode is unstable: else what seems to level off from above decays on.
    """
    if len(time) < WINDOWS[0] or not np.isfinite(energy).all():
        return "irregular"
    found = windows(time, energy, frequency_hz)
    start = max(initial, float(found.level[0]) ** 2)
    end = float((found.level[found.judged :] ** 2)[-2:].mean())
    rise = _steady(found, 1.0)
    if end <= noise and not rise:
        return "stable"
    if rise:
        return "growing"
    if end <= start and (_steady(found, -1.0) or end <= REST**2 * start):
        return "stable"
    lost = _never_rose(found) and end <= LOST * found.level[0] ** 2
    if initial > 0 and lost and not (driven and _levelled_off(found)):
        return "stable"
    if _stationary(found, limit=DRIFT) or _reached(found):
        return "limit_cycle"
    return "stable" if end <= FADED**2 * start and _fades(found) else "irregular"


def _stationary(found: Windows, first: int | None = None, limit: float = TREND) -> bool:
    rise, error, scatter = found.trend(first)
    return scatter <= SCATTER and (abs(rise) <= limit or abs(rise) <= CHANCE * error)


def _reached(found: Windows) -> bool:
    """Whether the levels rose to a plateau that they keep in the last fifth, not above it before.

    Such a run saturated in the judged part: its levels are not settled, but it is no other class.
    """
    first = min(len(found.level) - 4, round(PLATEAU * len(found.level)))
    mean = float(found.level[first:].mean())
    below = bool((found.level[:first] <= (1 + SCATTER) * mean).all())
    return below and float(found.level[found.judged]) < mean and _stationary(found, first)


def _never_rose(found: Windows) -> bool:
    """Whether no level is above the first."""
    return bool(found.level.max() <= (1 + SCATTER) * found.level[0])


def _levelled_off(found: Windows) -> bool:
    """Whether the judged levels fall by chance at most, and more slowly than all did.

    So does a motion that began above its limit cycle.
    """
    pace, error = _pace(found, -1.0)
    level = np.maximum(found.level, 1e-300)
    whole = float(np.log(level[0]) - np.log(level[-1])) / (len(level) - 1)
    rests = pace * (len(level) - found.judged) < LEAST_TREND or pace <= CHANCE * error
    return rests and pace + error < STEADY * whole


def _pace(found: Windows, sign: float) -> tuple[float, float]:
    """Change of the logarithm of the judged levels a window, up (1) or down (-1); its error."""
    y = sign * np.log(np.maximum(found.level[found.judged :], 1e-300))
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    pace = float(x @ y / (x @ x))
    rest = y - y.mean() - pace * x
    return pace, float(np.sqrt(rest @ rest / (len(y) - 2) / (x @ x)))


def _fades(found: Windows) -> bool:
    """Whether the highest level that is judged is below half of the highest before."""
    before, judged = found.level[: found.judged], found.level[found.judged :]
    return bool(judged.max() <= 0.5 * before.max() and judged[-1] < judged[0])


def _steady(found: Windows, sign: float) -> bool:
    """Whether the judged levels go up (1) or down (-1) beyond chance and do not level off.

    Either the logarithm goes on to the end at `STEADY` of its mean pace over the whole record, or
    the level still rises by more than `TREND` in both halves of the judged part.
    """
    level = np.maximum(found.level, 1e-300)
    y = sign * np.log(level[found.judged :])
    pace, error = _pace(found, sign)
    if pace * len(y) < LEAST_TREND or pace < CHANCE * error:
        return False
    third = len(y) // 3
    steps = np.diff([y[:third].mean(), y[third:-third].mean(), y[-third:].mean()])
    whole = sign * float(np.log(level[-1]) - np.log(level[0])) / (len(level) - 1)
    last = float(steps[1]) * 2 / (len(y) - third)  # a window, as pace
    if whole * len(level) < TREND:
        return False
    if whole > 0 and min(pace, last) >= STEADY * whole:
        return True
    return sign > 0 and bool((steps > TREND).all())
