"""Growth of a run: the fitted and the predicted rate of each followed complex mode."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.energies import (
    energy_round_off,
    level_shares,
    moving_energy,
    slowest_period,
)
from squealstudy.motion.outcome.growth import ENERGY, LEFT_VECTOR, GrowthFit, bend_time, fit_growth
from squealstudy.motion.outcome.verdict import MIN_ENERGY_SHARE
from squealstudy.wording import STABLE, SUSTAINED

# a mode that saturates ends the fits of the others if it has this share of the largest energy
MIN_BENDING_SHARE = 0.01
NOT_LINEAR = "not_linear"  # status of motion along a left vector at another frequency than its mode
# relative difference of the fitted frequency from that of the mode at the step (in 300 runs at most
# 1e-3), and from that of the mode where its root at the step is not known
SAME_HZ, SAME_HZ_UNKNOWN = 5e-3, 0.05


def has_moved(run: Motion) -> bool:
    """Whether the run ever moved, beyond round-off."""
    return bool(run.modal_energy.max() > energy_round_off(run))


def mode_fits(run: Motion) -> list[GrowthFit]:
    """Fitted growth of each followed mode, until another one of much energy nears its limit."""
    count = len(run.point.growing.lam)
    if not count or not has_moved(run):
        return [GrowthFit()] * count
    xi = [run.xi(k) for k in range(count)]
    energy = run.point.growing.energy * np.array([np.abs(x).max() ** 2 for x in xi])
    ends = np.array([bend_time(run.times, x) for x in xi]) if count > 1 else np.full(1, np.inf)
    ends[energy < MIN_BENDING_SHARE * energy.max()] = np.inf
    fits = []
    for k in range(count):
        others = xi[:k] + xi[k + 1 :]
        until = float(np.delete(ends, k).min(initial=np.inf))
        fits.append(_as_integrated(run, k, fit_growth(run.times, xi[k], until, others=others)))
    return fits


def growth_rows(
    run: Motion, fits: list[GrowthFit], kind: str, window: slice
) -> list[dict[str, Any]]:
    """Rows with fitted and predicted growth of each followed complex mode, and its final share.

    Parameters
    ----------
    run : Motion
    fits : list of GrowthFit
        `mode_fits` of the run.
    kind : str
        Class of the run.
    window : slice
        The rows whose levels are judged.
    """
    modes, moving = run.point.growing, has_moved(run)
    sustained = kind in SUSTAINED and moving
    shares = level_shares(run, window) if sustained else np.full(len(fits), np.nan)
    return [
        {
            "mode": k + 1,
            "frequency_hz": float(abs(lam)) / (2 * np.pi),
            "growth_rate": float(lam.real),
            "damping_ratio": float(-lam.real / abs(lam)),
            "unstable": k < modes.n_unstable,
            "fitted_growth_rate": fit.growth_rate,
            "fitted_low": fit.low,
            "fitted_high": fit.high,
            "fit_start": fit.start,
            "fit_stop": fit.stop,
            "fit_status": fit.status,
            "step_error": step_error(run, k),
            "level_share": float(share),
            "expressed": _expressed(float(share), kind, moving) if k < modes.n_unstable else None,
        }
        for k, (lam, fit, share) in enumerate(zip(modes.lam, fits, shares, strict=True))
    ]


def _expressed(share: float, kind: str, moving: bool) -> bool | None:
    """Whether a predicted instability is part of the final vibration; None where that is open.

    It is if the vibration is sustained and the mode has a twentieth of its energy. It is not if the
    vibration dies away. It is open in a run that still grows, is undecided, has failed or was never
    disturbed.
    """
    if not moving or kind not in (*SUSTAINED, STABLE):
        return None
    return kind in SUSTAINED and share >= MIN_ENERGY_SHARE


def growth_columns(run: Motion, fits: list[GrowthFit]) -> dict[str, Any]:
    """Columns on the growth of the fastest complex mode, or of the energy if no mode is followed.

    Where a followed mode has no exponential stretch the motion is not linear for long enough. The
    energy is not fitted then: its rate would be that of a flank of its ripple, or of a vibration
    that fills up.
    """
    if not has_moved(run):
        return {}
    if fits:
        fit, method = fits[0], LEFT_VECTOR
    else:
        amplitude, period = np.sqrt(moving_energy(run)), slowest_period(run)
        fit, method = fit_growth(run.times, amplitude, period=period), ENERGY
    return {
        "growth_rate": fit.growth_rate,
        "growth_rate_low": fit.low,
        "growth_rate_high": fit.high,
        "growth_rate_step_error": step_error(run, 0) if fits else np.nan,
        "growth_method": method if fit.status == "ok" else fit.status,
        "onset_time": fit.onset_time,
    }


def step_error(run: Motion, k: int) -> float:
    """Growth rate of followed mode `k` at the run's step less the exact one, 1/s, or NaN."""
    balanced = run.point.growing.integrated[0]
    return float(balanced[k].real - run.point.growing.lam[k].real) if len(balanced) else np.nan


def _as_integrated(run: Motion, k: int, fit: GrowthFit) -> GrowthFit:
    """The fit with wider bounds by the step; `NOT_LINEAR` where it is not of the mode's motion.

    Any motion has an amplitude along a left vector, also a limit cycle; but linear motion has the
    frequency of the mode, at the run's step. The bounds are widened by the error of the step, and
    by the change of growth in steps with one evaluation of the forces.
    """
    if fit.status != "ok":
        return fit
    modes = run.point.growing
    balanced, once = modes.integrated[:, k] if modes.integrated.shape[1] else (np.nan, np.nan)
    is_known = np.isfinite(balanced)
    hz, allowed = (balanced.imag, SAME_HZ) if is_known else (modes.lam[k].imag, SAME_HZ_UNKNOWN)
    if abs(fit.frequency - hz) > allowed * hz:
        return GrowthFit(status=NOT_LINEAR)
    more = abs(once.real - balanced.real) if np.isfinite(once - balanced) else 0.0
    more += abs(step_error(run, k)) if is_known else 0.0
    return replace(fit, low=fit.low - more, high=fit.high + more)
