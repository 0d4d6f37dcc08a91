"""Cost of a study with a mesh before its first reduction: by its size, and by past reductions.

The first reduction says more than any table, but takes a while; before it only the degrees of
freedom are known. What reductions of like size took, on this machine where some are in the cache,
bounds what this one takes.
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
# how far times of another machine, under another load and of other meshes may be from those, and
# from each other on one machine: bounds on factors
ELSEWHERE, HERE = (0.25, 4.0), (0.6, 1.7)
# largest memory of a reduction up to 12 kHz: Python, matrices and shapes, and the entries of a
# triangular factor, whose fill grows faster than the size; measured are 1.1 to 1.2 GB of 28,875 (by
# SuperLU) and 2.7 GB of 95,217 degrees of freedom (by CHOLMOD). SuperLU holds both triangles, with
# an index for each entry. Bounds on its factor: of other bands and contacts
BASE_GB, GB_PER_DOF = 0.25, 2.3e-5
FACTOR_ENTRIES, FACTOR_DOF, FILL_POWER = 11e6, 28_875, 1.4
BYTES_PER_ENTRY = {"superlu": 24, "cholmod": 8, "pardiso": 8}
MEMORY_ELSEWHERE = (0.6, 1.6)
LIKE_SIZE = 2.0  # factor of degrees of freedom within which a past reduction is of like size


@dataclass(frozen=True)
class SizeForecast:
    """Bounds of what reductions and points take, where none of the study is in the cache.

    Attributes
    ----------
    n_dof : int
        Degrees of freedom of the first structure, as it is assembled.
    reduction_s, point_s : (float, float)
        Of one reduction, and of one exact design point of complex modes.
    by : str
        What they are told by, in words.
    memory_gb : (float, float)
        The most that one reduction needs.
    factors : str
        The library that makes its sparse factors.
    """

    n_dof: int
    reduction_s: tuple[float, float]
    point_s: tuple[float, float]
    by: str
    memory_gb: tuple[float, float]
    factors: str

    def memory_text(self, free_gb: float) -> str:
        """Memory that a reduction needs, and whether it fits into what is left [GB]."""
        low, high = self.memory_gb
        text = f"a reduction needs about {np.sqrt(low * high):.1f} GB, {low:.1f} to {high:.1f} GB"
        if high <= free_gb:
            return text
        if low <= free_gb:
            return f"{text}: it may not fit into the {free_gb:.1f} GB that are left here"
        advice = "take coarser meshes, a lower band or a machine with more"
        return f"{text}: more than the {free_gb:.1f} GB that are left here; {advice}"


def forecast_by_size(plan: Plan) -> SizeForecast | None:
    """By the size of the first structure, which is assembled; None where it cannot be."""
    try:
        n_dof = int(plan.first.assembly().n_dof)
    except FAILURES:  # a run tells of it
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
    """Bounds of the largest memory of a reduction, GB."""
    entries = FACTOR_ENTRIES * (n_dof / FACTOR_DOF) ** FILL_POWER
    factor_gb = 1e-9 * BYTES_PER_ENTRY[automatic_backend(n_dof, definite=True)] * entries
    middle = BASE_GB + GB_PER_DOF * n_dof + factor_gb
    return MEMORY_ELSEWHERE[0] * middle, MEMORY_ELSEWHERE[1] * middle


def _measured(seconds: tuple[float, ...], n_dof: int) -> float:
    """Seconds between the sizes that were measured, a power of the size beyond them."""
    x, y = np.log(MEASURED_DOF), np.log(seconds)
    at = np.log(max(n_dof, 1))
    i = int(np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2))
    return float(np.exp(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i])))
