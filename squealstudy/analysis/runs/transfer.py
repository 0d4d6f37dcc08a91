"""Which mode leads the growth of a run, and which has taken over at its end."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.runs.levels import LAST

WINDOWS = 50  # of a record
GROWN = 0.01  # of the final energy: what lies below, at the beginning, is the growth phase
LEADS = 0.8  # of the largest energy: a mode that has as much still leads
HOLDS = 0.7  # of the energy: one complex mode with as much at first and at the end leads throughout


def transfer(
    time: np.ndarray,
    energies: np.ndarray,
    modes: np.ndarray,
    held: np.ndarray | None = None,
) -> tuple[int, int, float]:
    """The mode that led at first, the one that leads at the end, and when it took over for good.

    Energies are averaged over 50 windows. The first leader has the largest mean share of the
    sensed energy in the growth phase (leading windows below 1 % of the final energy; the first
    window where there is none); the last one the largest energy over the last 40 %. The time is
    the start of the window from which the latter has 80 % of the largest energy or more, to the
    end or, where the lead still changes, in the last time that it took it.

    A complex mode that has parts of several real ones lends the lead to one and another of them:
    where the motion stays in the subspace of one, at first and at the end, nothing took over.

    Parameters
    ----------
    time : ndarray (rows,)
        s.
    energies : ndarray (rows, ns)
        J.
    modes : ndarray (ns,)
        Mode numbers.
    held : ndarray (rows, m) or None
        Part of their sum that lies in the subspace of each of m complex modes, J.

    Returns
    -------
    first, last : int
        Mode numbers; 0 where one mode leads throughout or nothing moves.
    time : float
        s; NaN likewise.
    """
    if not energies.size or not energies.any():
        return 0, 0, np.nan
    count = min(WINDOWS, len(time))
    edges = np.arange(count) * len(time) // count
    rows = np.diff(np.append(edges, len(time)))
    level = np.add.reduceat(energies, edges, axis=0) / rows[:, None]
    total = level.sum(axis=1)
    end = slice(-max(1, round(LAST * count)), None)
    final = level[end].mean(axis=0)
    grown = np.flatnonzero(total >= GROWN * final.sum())
    early = max(1, int(grown[0])) if len(grown) else count
    whole = np.where(total > 0, total, 1.0)[:, None]
    first, last = int(np.argmax((level / whole)[:early].mean(axis=0))), int(np.argmax(final))
    if first == last:
        return 0, 0, np.nan
    if held is not None:
        within = np.add.reduceat(held, edges, axis=0) / rows[:, None]
        at_first = (within / whole)[:early].mean(axis=0)
        at_last = within[end].mean(axis=0) / (final.sum() or 1.0)
        if (np.minimum(at_first, at_last) >= HOLDS).any():
            return 0, 0, np.nan
    leads = level[:, last] >= LEADS * level.max(axis=1)
    holds = np.flatnonzero(leads)
    not_yet = np.flatnonzero(~leads[: holds[-1]])
    taken = int(not_yet[-1]) + 1 if len(not_yet) else 0
    return int(modes[first]), int(modes[last]), float(time[edges[taken]])
