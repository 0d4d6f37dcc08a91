"""Energy of a run in modes of the assembly and in complex modes, and which mode leads in the end.

Mechanical energies are those of modes of unit mass (THEORY.md eq. (86)). Complex modes are not
orthogonal: their shares are those of projections on their planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.motion.growing_modes import DEGENERATE_AXIS_RATIO
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.intervals import mean_interval
from squealstudy.motion.outcome.levels import JUDGED_SHARE

ENERGY_ROUND_OFF = 3e-21  # energy of round-off over the work of friction
# least friction coefficient for that work, as there is round-off without friction, too
MIN_FRICTION_FOR_ROUND_OFF = 0.1
FIRST_WINDOW_SHARE = 0.1  # length of the first window over that of the record
OVERLAP_EIGENVALUE_CUTOFF = 1e-10  # below this, over the largest, an axis is spanned by the others
N_WINDOWS = 50  # windows of a record in which leading modes are compared
# a run begins with a growth phase if its first energy is below this share of the final energy
GROWTH_PHASE_ENERGY_RATIO = 0.01
LEADING_ENERGY_RATIO = 0.8  # a mode leads if its energy is at least this share of the largest
# a complex mode with this share of the energy at first and at the end leads throughout
LEADING_THROUGHOUT_SHARE = 0.7


@dataclass(frozen=True)
class ModalShares:
    """Shares of the mechanical energy over a window.

    Attributes
    ----------
    share, low, high : ndarray (ns,)
        Share of each sensed mode in the energy of all modes, with 95 % bounds within 0 and 1; zeros
        where nothing moves.
    mean : ndarray (ns,)
        Mean energy of each mode, J.
    outside : float
        Share outside the sensed modes.
    """

    share: np.ndarray
    low: np.ndarray
    high: np.ndarray
    mean: np.ndarray
    outside: float


def mode_energies(q: np.ndarray, v: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Mechanical energies (v^2 + omega^2 q^2) / 2 of modes of unit mass (THEORY.md eq. (86)).

    Parameters
    ----------
    q, v : ndarray (rows, ns)
        Modal amplitudes [m sqrt(kg)] and velocities.
    omega : ndarray (ns,)
        Angular frequencies, rad/s.

    Returns
    -------
    ndarray (rows, ns)
        Energies, J.
    """
    energies: np.ndarray = 0.5 * (v**2 + (omega * q) ** 2)
    return energies


def vibration_energy(v: np.ndarray) -> np.ndarray:
    """Twice the kinetic energy (rows,) of modal velocities (rows, ns), J.

    Its mean over a period is the mechanical energy of the vibration. Unlike `mode_energies` it does
    not include a static shift.
    """
    energy: np.ndarray = np.einsum("ij,ij->i", v, v)
    return energy


def energy_outside(energies: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Energy (rows,) outside the sensed modes, J.

    Parameters
    ----------
    energies : ndarray (rows, ns)
        Energies of the sensed modes.
    total : ndarray (rows,)
        Energy of all modes (history column `modal_energy`).
    """
    outside: np.ndarray = np.maximum(total - energies.sum(axis=1), 0.0)
    return outside


def first_window(rows: int) -> slice:
    """The first tenth of a record, one row at least."""
    return slice(0, max(1, round(FIRST_WINDOW_SHARE * rows)))


def mean_shares(energies: np.ndarray, total: np.ndarray) -> np.ndarray:
    """The shares (ns,) of `modal_shares`, without bounds."""
    mean, mean_total = energies.mean(axis=0), float(total.mean())
    return mean / mean_total if mean_total > 0 else np.zeros(energies.shape[1])


def modal_shares(energies: np.ndarray, total: np.ndarray) -> ModalShares:
    """Ratio of mean energies over a window, with bounds from its sub-windows.

    The bounds are those of the linearised ratio: of the mean of energy - share * total.

    Parameters
    ----------
    energies : ndarray (rows, ns)
        Energies of the sensed modes in the window, J.
    total : ndarray (rows,)
        Energy of all modes, J.
    """
    mean, mean_total = energies.mean(axis=0), float(total.mean())
    share = mean_shares(energies, total)
    if not mean_total > 0:
        return ModalShares(share=share, low=share, high=share, mean=mean, outside=0.0)
    _, low, high = mean_interval((energies - share * total[:, None]) / mean_total)
    return ModalShares(
        share=share,
        low=np.minimum(np.maximum(share + low, 0.0), share),
        high=np.minimum(np.maximum(share + high, share), np.maximum(share, 1.0)),
        mean=mean,
        outside=float(max(0.0, 1.0 - share.sum())),
    )


def complex_shares(states: np.ndarray, overlap: np.ndarray, energy: float) -> np.ndarray:
    """Share of each complex mode in the vibration's energy over a window; their sum is at most 1.

    If a motion is along one mode only, the energy of its projection on that mode's plane
    (`growing_modes.mode_planes`) is all of its energy. Planes of several modes overlap, so that the
    energies of projections may add up to more than there is. Each mode is therefore given the
    energy that its plane adds to that on the planes of the modes before it, where the mode of the
    largest projection is first. Together they have the energy of the projection on all planes.

    Parameters
    ----------
    states : ndarray (rows, 2 m)
        Coordinates on the planes of m modes, side by side, sqrt(J). Their means over the window,
        which are a static shift, are subtracted.
    overlap : ndarray (2 m, 2 m)
        Scalar products of the axes.
    energy : float
        Mean energy of the vibration, without that of a static shift, J.

    Returns
    -------
    ndarray (m,)
        Shares from 0 to 1; NaN where nothing vibrates.
    """
    m = len(overlap) // 2
    deviations = states - states.mean(axis=0)
    product = deviations.T @ deviations / len(deviations)
    single_energies = [_projected(product, overlap, [k]) for k in range(m)]
    order = np.argsort([-energy for energy in single_energies], kind="stable")
    share, energy_so_far = np.zeros(m), 0.0
    for position, k in enumerate(order):
        modes = list(order[: position + 1])
        energy_with_mode = _projected(product, overlap, modes) if position else single_energies[k]
        share[k], energy_so_far = (
            max(energy_with_mode - energy_so_far, 0.0),
            max(energy_with_mode, energy_so_far),
        )
    largest_energy = max(energy, energy_so_far)
    return share / largest_energy if largest_energy > 0 else np.full(m, np.nan)


def _projected(product: np.ndarray, overlap: np.ndarray, modes: list[int]) -> float:
    """Mean energy of the projection on the planes of some modes together, J."""
    axes = [2 * k + i for k in modes for i in (0, 1)]
    part = np.ix_(axes, axes)
    size, vectors = np.linalg.eigh(overlap[part])
    spans = size > OVERLAP_EIGENVALUE_CUTOFF * size.max()
    along = ((product[part] @ vectors) * vectors).sum(axis=0)
    return 0.5 * float((along[spans] / size[spans]).sum())


def level_shares(run: Motion, window: slice) -> np.ndarray:
    """Share (m,) of each followed complex mode in the energy of the vibration over a window.

    Empty where no mode is followed.
    """
    if not len(run.point.growing.lam):
        return np.zeros(0)
    states = [run.plane(k)[window] for k in range(len(run.point.growing.lam))]
    shift = run.sensed_q[window].mean(axis=0)  # a static shift is no vibration
    energy = float(run.modal_energy[window].mean() - 0.5 * ((run.omega * shift) ** 2).sum())
    return complex_shares(np.hstack(states), run.point.growing.overlap, energy)


def moving_energy(run: Motion) -> np.ndarray:
    """Energy of the vibration (rows,), J: twice the kinetic energy of the sensed modes.

    It does not include a static shift. Where the sensed modes have less than half of the energy in
    the last 40 %, it is the mechanical energy of all modes instead.
    """
    last = slice(round(0.6 * len(run.times)), None)
    sensed = mode_energies(run.sensed_q, run.sensed_v, run.omega)[last].sum()
    if sensed < 0.5 * run.modal_energy[last].sum():
        return run.modal_energy
    return vibration_energy(run.sensed_v)


def slowest_period(run: Motion) -> float:
    """Period of the slowest change of the energy, s.

    It is the period of the slowest mode, or of the slowest beat of two modes, of all sensed modes
    that have 1 % of the energy at some time. Infinite where a rigid mode is among them.
    """
    energies = mode_energies(run.sensed_q, run.sensed_v, run.omega)
    total = energies.sum(axis=1, keepdims=True)
    shares = energies / np.where(total > 0, total, 1.0)
    omega = np.sort(run.omega[(shares >= GROWTH_PHASE_ENERGY_RATIO).any(axis=0)])
    slowest = min(np.append(omega, np.diff(omega)), default=0.0)
    return float(2 * np.pi / slowest) if slowest > 0 else np.inf


def energy_round_off(run: Motion) -> float:
    """Energy below which nothing moves, J, in proportion to the work of friction.

    0 where that work is not known, as with integrators that solve no balance in each step.
    """
    work = abs(run.energy.friction)
    if not np.isfinite(work):
        return 0.0
    force = run.history["normal_force"]
    pressed = float(np.abs(force).mean()) if len(force) else 0.0
    return ENERGY_ROUND_OFF * max(
        work, MIN_FRICTION_FOR_ROUND_OFF * pressed * abs(run.point.speed) * run.time
    )


def transfer(
    time: np.ndarray,
    energies: np.ndarray,
    modes: np.ndarray,
    held_energy: np.ndarray | None = None,
) -> tuple[int, int, float]:
    """The mode that led at first, the one that leads at the end, and when it took over for good.

    Energies are averaged over 50 windows. The first leader has the largest mean share of the
    sensed energy in the growth phase (the windows before the energy first reaches 1 % of the final
    one; the first window at least). The last leader has the largest energy over the last 40 %. The
    time is the start of the window from which on the last leader has 80 % of the largest energy or
    more, to the end; where the lead still changes, it is the last time that it took the lead.

    A complex mode consists of several real ones, of which now one and now another may lead. Where
    the motion is along the same complex mode at first and at the end, nothing took over.

    Parameters
    ----------
    time : ndarray (rows,)
        Times of the rows, s.
    energies : ndarray (rows, ns)
        Energies of the sensed modes, J.
    modes : ndarray (ns,)
        Numbers of the sensed modes.
    held_energy : ndarray (rows, m) or None
        Part of their sum that is along each of m complex modes (`held_energies`), J.

    Returns
    -------
    first, last : int
        Mode numbers; 0 where one mode leads throughout, where the last leader leads from the start
        on, or where nothing moves.
    time : float
        Time of the transfer, s; NaN where the numbers are 0.
    """
    if not energies.size or not energies.any():
        return 0, 0, np.nan
    count = min(N_WINDOWS, len(time))
    edges = np.arange(count) * len(time) // count
    rows = np.diff(np.append(edges, len(time)))
    level = np.add.reduceat(energies, edges, axis=0) / rows[:, None]
    total = level.sum(axis=1)
    end = slice(-max(1, round(JUDGED_SHARE * count)), None)
    final = level[end].mean(axis=0)
    grown = np.flatnonzero(total >= GROWTH_PHASE_ENERGY_RATIO * final.sum())
    early = max(1, int(grown[0])) if len(grown) else count
    total_energy = np.where(total > 0, total, 1.0)[:, None]
    first, last = int(np.argmax((level / total_energy)[:early].mean(axis=0))), int(np.argmax(final))
    if first == last:
        return 0, 0, np.nan
    if held_energy is not None:
        within = np.add.reduceat(held_energy, edges, axis=0) / rows[:, None]
        at_first = (within / total_energy)[:early].mean(axis=0)
        at_last = within[end].mean(axis=0) / (final.sum() or 1.0)
        if (np.minimum(at_first, at_last) >= LEADING_THROUGHOUT_SHARE).any():
            return 0, 0, np.nan
    leads = level[:, last] >= LEADING_ENERGY_RATIO * level.max(axis=1)
    holds = np.flatnonzero(leads)
    not_yet = np.flatnonzero(~leads[: holds[-1]])
    if not len(not_yet):
        return 0, 0, np.nan
    takeover = int(not_yet[-1]) + 1
    return int(modes[first]), int(modes[last]), float(time[edges[takeover]])


def held_energies(run: Motion) -> np.ndarray:
    """Part (rows, m) of the sensed energy v^2 that is along each followed complex mode, J.

    It is that of the projection of the velocities on the mode's real and imaginary parts, whatever
    their phases. It is 0 for a mode of which the sensors see less than half.
    """
    right_vectors = run.point.growing.right
    sensed_modes = right_vectors[run.sensed - 1]
    energies = np.zeros((len(run.times), right_vectors.shape[1]))
    for k, x in enumerate(sensed_modes.T):
        if np.linalg.norm(x) ** 2 < 0.5 * np.linalg.norm(right_vectors[:, k]) ** 2:
            continue
        axes, size, _ = np.linalg.svd(np.column_stack([x.real, x.imag]), full_matrices=False)
        axes = axes[:, size > DEGENERATE_AXIS_RATIO * size[0]]
        energies[:, k] = ((run.sensed_v @ axes) ** 2).sum(axis=1)
    return energies
