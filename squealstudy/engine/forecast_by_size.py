"""Forecasts the cost of a study with a mesh before its first reduction, by size.

The first reduction would say more, but takes a while. Before it only the degrees of freedom are
known. Bounds on the cost follow from the times of other reductions of like size: those in the cache
of this machine, else those measured on another one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.engine.cache import past_reductions
from squealstudy.engine.plan import Plan
from squealstudy.linalg.factor import LABELS, automatic_backend
from squealstudy.mechanics.failures import FAILURES
from squealstudy.wording import plural

# seconds of a reduction and of an exact design point of complex modes, one core, by degrees of
# freedom (docs/explanation/cost-and-size.md)
MEASURED_DOF = (14_769, 48_588, 115_959)
MEASURED_REDUCTION_S, MEASURED_POINT_S = (21.0, 77.0, 253.0), (0.29, 0.36, 0.70)
# bounds on the factor between times: of another machine, load and mesh to those measured; and of
# two reductions on one machine
ELSEWHERE, HERE = (0.25, 4.0), (0.6, 1.7)
# largest memory of a reduction up to 12 kHz: Python, matrices and shapes, and the entries of a
# triangular factor, whose fill grows faster than the size; measured are 1.1 to 1.2 GB of 28,875 (by
# SuperLU) and 2.7 GB of 95,217 degrees of freedom (by CHOLMOD). SuperLU holds both triangles, with
# an index for each entry. Bounds on its factor: of other bands and contacts
BASE_GB, GB_PER_DOF = 0.25, 2.3e-5
FACTOR_ENTRIES, FACTOR_DOF, FILL_POWER = 11e6, 28_875, 1.4
BYTES_PER_ENTRY = {"superlu": 24, "cholmod": 8, "pardiso": 8}
MEMORY_ELSEWHERE = (0.6, 1.6)
LIKE_SIZE = 2.0  # largest factor between degrees of freedom of reductions of like size


@dataclass(frozen=True)
class SizeForecast:
    """Bounds on time and memory of a study that has no reduction in the cache.

    Attributes
    ----------
    n_dof : int
        Degrees of freedom of the first structure, as it is assembled.
    reduction_s, point_s : (float, float)
        Bounds on the seconds of one reduction, and of one exact design point of complex modes.
    by : str
        Where these bounds come from, in words.
    memory_gb : (float, float)
        Bounds on the largest memory of one reduction, GB.
    factors : str
        Name of the library that makes its sparse factors.
    """

    n_dof: int
    reduction_s: tuple[float, float]
    point_s: tuple[float, float]
    by: str
    memory_gb: tuple[float, float]
    factors: str

    def memory_text(self, free_gb: float) -> str:
        """Text on the memory of a reduction, and on whether it fits into `free_gb` [GB]."""
        low, high = self.memory_gb
        text = f"a reduction needs about {np.sqrt(low * high):.1f} GB, {low:.1f} to {high:.1f} GB"
        if high <= free_gb:
            return text
        if low <= free_gb:
            return f"{text}: it may not fit into the {free_gb:.1f} GB that are left here"
        advice = "take coarser meshes, a lower band or a machine with more"
        return f"{text}: more than the {free_gb:.1f} GB that are left here; {advice}"


def forecast_by_size(plan: Plan) -> SizeForecast | None:
    """Forecast by the size of the first structure, which is assembled; None where that fails."""
    try:
        n_dof = int(plan.first.assembly().n_dof)
    except FAILURES:  # a run reports it
        return None
    reduction_s, point_s = (
        _measured(MEASURED_REDUCTION_S, n_dof),
        _measured(MEASURED_POINT_S, n_dof),
    )
    like = [
        seconds / _measured(MEASURED_REDUCTION_S, n)
        for n, seconds in past_reductions()
        if n_dof / LIKE_SIZE <= n <= n_dof * LIKE_SIZE
    ]
    if like:
        low, high = np.quantile(like, (0.25, 0.75)) * HERE
        by = f"by {plural(len(like), 'reduction')} of like size in the cache"
    else:
        low, high = ELSEWHERE
        by = "by reductions of like size on another machine"
    ends = float(low), float(high)
    return SizeForecast(
        n_dof,
        (ends[0] * reduction_s, ends[1] * reduction_s),
        (ends[0] * point_s, ends[1] * point_s),
        by,
        _memory_gb(n_dof),
        LABELS[automatic_backend(n_dof, definite=True)],
    )


def _memory_gb(n_dof: int) -> tuple[float, float]:
    """Bounds on the largest memory of a reduction, GB."""
    entries = FACTOR_ENTRIES * (n_dof / FACTOR_DOF) ** FILL_POWER
    factor_gb = 1e-9 * BYTES_PER_ENTRY[automatic_backend(n_dof, definite=True)] * entries
    middle = BASE_GB + GB_PER_DOF * n_dof + factor_gb
    return MEMORY_ELSEWHERE[0] * middle, MEMORY_ELSEWHERE[1] * middle


def _measured(seconds: tuple[float, ...], n_dof: int) -> float:
    """Measured seconds, interpolated and continued as powers of the degrees of freedom."""
    x, y = np.log(MEASURED_DOF), np.log(seconds)
    at = np.log(max(n_dof, 1))
    i = int(np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2))
    return float(np.exp(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i])))
