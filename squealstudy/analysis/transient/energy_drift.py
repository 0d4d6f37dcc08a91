"""Whether a run gained or lost energy that its vibration lives on.

The energy balance of a run says so at its end and against the work of friction, which steady
sliding does as well: energies from nowhere cancel by chance, and as much as the whole vibration
may be a thousandth of that work. Here the imbalance is followed over the run, and the measure is
the vibration itself.
"""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.transient.settings import TransientResult

DRIFT_LIMIT = 1e-3  # the level of a coarse brake is 3 % low at 1.6e-3, right to 0.1 % at 4e-4
# exact free motion: work is summed by the trapezoidal rule, and levels are right to 0.1 % at 3.9e-3
# (coarse brake, 4 us), to 1.4 % at 2.2e-2
EXACT_LIMIT = 4e-3
BLOCKS = 10  # parts of a run; inside an impact the balance is off and comes back
EXPLODED = 0.5  # of the energy of the vibration, from nowhere in the last row: no impact does so
ROUND_OFF = 1e-9  # of the work of friction and of the energy that is stored


def energy_drift(result: TransientResult) -> float:
    """Largest imbalance of energy over a run, relative to the energy of its vibration.

    The medians of ten parts of the history are compared with the start, and the last row where it
    is most of the energy: a run that explodes at its end. The vibration's energy is its largest
    modal energy and what damping took from it. NaN for a history shorter than that.
    """
    h = result.history
    if len(h["time"]) < BLOCKS:
        return float("nan")
    work = h["work_load"] + h["work_belt"] - h["dissipated_friction"] - h["dissipated_damping"]
    imbalance = work - (h["stored"] - h["stored"][0])
    medians = [float(np.median(part)) for part in np.array_split(imbalance, BLOCKS)]
    size = h["modal_energy"].max() + h["dissipated_damping"][-1]
    size += ROUND_OFF * (abs(h["dissipated_friction"][-1]) + float(np.abs(h["stored"]).max()))
    if not size > 0.0:
        return 0.0
    last = abs(float(imbalance[-1])) / float(size)
    drift = max(abs(m) for m in medians) / float(size)
    return max(drift, last) if last > EXPLODED else drift
