"""Class of a run: that of its motion, unless a predicted instability may still change it."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.runs.behaviour import Verdict, classify
from squealstudy.analysis.runs.modal_run import ModalRun, level_shares, round_off
from squealstudy.analysis.runs.rising_modes import EXPRESSED, JUDGED_ROWS, grows_until, rises_until
from squealstudy.analysis.tables.run_classes import LIMIT_CYCLE, STABLE, UNDECIDED

NEARLY_ALL = 0.8  # share of the energy of a mode that is the whole motion, but for harmonics


def run_verdict(run: ModalRun, energy: np.ndarray) -> Verdict:
    """Class of what a run has done, from its `moving_energy`.

    A run that seems to decay is undecided while the motion does not show that all modes of which
    growth is predicted decay too: those that are followed may still be seen to, those that are not
    (above the band, or too many) and those of a run that nothing moved never. A limit cycle is
    undecided while a mode that is not part of it is seen to rise.
    """
    initial = 0.0 if run.continued else float(run.energy[0])
    found = classify(run.time, energy, initial, round_off(run), growth=_predicted_pace(run))
    modes = run.point.modes
    if found.name == LIMIT_CYCLE:
        until = rises_until(run)
        return Verdict(UNDECIDED, until) if np.isfinite(until) else found
    if found.name != STABLE:
        return found
    unseen = modes.n_above > 0 or modes.n_unstable > modes.n_followed
    if unseen or (modes.n_unstable and energy.max() <= round_off(run)):
        return Verdict(UNDECIDED, np.inf)
    until = max((grows_until(run, k) for k in range(modes.n_followed)), default=0.0)
    return Verdict(UNDECIDED, until) if until > 0 else found


def _predicted_pace(run: ModalRun) -> float:
    """Rate at which the level of the final motion would go by the complex modes alone, 1/s.

    Of instabilities, that of each followed one times its share of the energy, of those that are in
    it. Where there are none, the decay of the lightest mode if that has nearly all of the energy.
    """
    rows, modes = len(run.time), run.point.modes
    if rows < JUDGED_ROWS or not len(modes.lam):
        return 0.0
    shares = level_shares(run, slice(round(0.6 * rows), None))
    rates = np.asarray(modes.lam).real
    if modes.n_unstable or modes.n_above:
        unstable = np.arange(len(rates)) < modes.n_followed
        return float((shares * rates)[unstable & (shares >= EXPRESSED)].sum())
    return min(float(rates[0]), 0.0) if shares[0] >= NEARLY_ALL else 0.0
