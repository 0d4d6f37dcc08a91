"""Quality of methods: errors of their findings, least cost of an error, agreement with predictions.

Findings are plain data: for complex modes ``roots`` (m, 2) and perhaps an ``onset`` with bounds,
for a run in time ``values`` with bounds, ``energy_share`` by mode and ``class``. Every error has
bounds: if finding and truth have intervals, the smallest and largest distance between these.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from squealstudy.root_pairs import LIGHT_DAMPING, partners
from squealstudy.wording import SUSTAINED, UNDECIDED

if TYPE_CHECKING:
    import pandas as pd


MAX_PAIR_REL_DISTANCE = 0.05  # relative distance within which two roots are one mode
# damping ratio beyond which a mode is unstable, or stable, for certain
CERTAIN_DAMPING_RATIO = 1e-4
LEVEL_SCALE_OVER_STATIC = 1e-3  # scale of small levels over the static torque, for relative errors
GROWTH_SCALE_PER_S = 1.0  # 1/s: growth rates below are compared on this scale
ONSET_SCALE_OVER_RANGE = 1e-2  # scale of small onsets over the searched range, for relative errors
# of the mode's frequency, rad/s: the same of runs, whose growth is fitted
GROWTH_SCALE_OVER_OMEGA = 1e-3
COMPARED = (*SUSTAINED, UNDECIDED)  # classes whose levels over the same time say something


class FoundError(NamedTuple):
    """One quantity of one mode or run: the value found, the truth, and the error with bounds.

    Errors are relative, except those of damping ratios and energy shares. `chance` is the error
    that the 95 % intervals of both explain, the root of the sum of squares of their half-widths: a
    smaller error is within the bounds. It is 0 without intervals.
    """

    quantity: str
    mode: int
    value: float
    truth: float
    error: float
    low: float
    high: float
    chance: float = 0.0


def _plain(quantity: str, mode: int, value: float, truth: float, error: float) -> FoundError:
    """An error whose bounds are itself."""
    error = float(error)
    return FoundError(
        quantity=quantity,
        mode=mode,
        value=float(value),
        truth=float(truth),
        error=error,
        low=error,
        high=error,
    )


class Miscount(NamedTuple):
    """Unstable modes of the reference that were missed, and stable ones taken for unstable."""

    missed: int
    spurious: int


def root_errors(
    finding: Mapping[str, Any], truth: Mapping[str, Any]
) -> tuple[list[FoundError], Miscount]:
    """Errors of the light modes of a design point; unstable ones also under separate names.

    Modes are paired by their distance in the complex plane, one to one.
    """
    lam, ref = _roots(finding), _roots(truth)
    # the unstable ones too, however fast they grow
    light = ref[ref.real > -LIGHT_DAMPING * np.abs(ref)]
    partner = partners(np.abs(light[:, None] - lam) / np.abs(light)[:, None], MAX_PAIR_REL_DISTANCE)
    errors: list[FoundError] = []
    missed = 0
    for k, root in enumerate(light):
        zeta = -root.real / abs(root)
        partner_row = partner[k]
        if partner_row < 0 or (zeta < -CERTAIN_DAMPING_RATIO and lam[partner_row].real <= 0):
            missed += zeta < -CERTAIN_DAMPING_RATIO
        errors += (
            _mode_errors(k + 1, lam[partner_row], root) if partner_row >= 0 else _lost(k + 1, root)
        )
    taken = set(partner.tolist())
    clearly = lam.real > CERTAIN_DAMPING_RATIO * np.abs(lam)
    spurious = sum(j not in taken for j in np.flatnonzero(clearly))
    stable = [k for k, r in enumerate(light) if r.real <= 0 and partner[k] >= 0]
    spurious += sum(bool(clearly[partner[k]]) for k in stable)
    return errors, Miscount(int(missed), int(spurious))


def _roots(finding: Mapping[str, Any]) -> np.ndarray:
    """Roots (m,) complex, rad/s."""
    pairs = np.array(finding["roots"], dtype=float).reshape(-1, 2)
    lam: np.ndarray = pairs[:, 0] + 1j * pairs[:, 1]
    return lam


def _lost(mode: int, root: complex) -> Iterator[FoundError]:
    """Errors of a mode without partner: at least the largest difference that pairs may have."""
    values = {"frequency": abs(root) / (2 * np.pi), "damping_ratio": -root.real / abs(root)}
    for name, truth in values.items():
        yield _plain(name, mode, np.nan, truth, MAX_PAIR_REL_DISTANCE)


def _mode_errors(mode: int, lam: complex, root: complex) -> Iterator[FoundError]:
    """Errors of one mode: its frequency, damping ratio and growth rate."""
    f, f_ref = abs(lam) / (2 * np.pi), abs(root) / (2 * np.pi)
    zeta, zeta_ref = -lam.real / abs(lam), -root.real / abs(root)
    pairs = [
        ("frequency", f, f_ref, abs(f / f_ref - 1)),
        ("damping_ratio", zeta, zeta_ref, abs(zeta - zeta_ref)),
    ]
    if zeta_ref < -CERTAIN_DAMPING_RATIO:
        pairs += [(f"unstable_{name}", x, ref, error) for name, x, ref, error in pairs]
        scale = max(abs(root.real), GROWTH_SCALE_PER_S)
        pairs += [("growth_rate", lam.real, root.real, abs(lam.real - root.real) / scale)]
    for name, measured, truth, error in pairs:
        yield _plain(name, mode, measured, truth, error)


def onset_errors(
    finding: Mapping[str, Any], truth: Mapping[str, Any]
) -> tuple[list[FoundError], Miscount]:
    """Relative error of the onset of instability; nothing where none was sought.

    An onset that only the reference has is missed, one that it does not have is spurious.
    """
    if "onset" not in truth:
        return [], Miscount(0, 0)
    onset, ref = finding["onset"], truth["onset"]
    if onset[0] is None or ref[0] is None:
        return [], Miscount(int(ref[0] is not None), int(onset[0] is not None))
    error = _interval_error("onset", onset, ref, ONSET_SCALE_OVER_RANGE * truth["onset_range"])
    return [error] if error is not None else [], Miscount(0, 0)


def run_errors(
    finding: Mapping[str, Any], truth: Mapping[str, Any]
) -> tuple[list[FoundError], Miscount]:
    """Errors of a run; a run that squeals where the reference does not, or conversely, counts.

    Lines in the spectrum are compared where both vibrate, levels where the reference has one: a
    run that still grows has none.
    """
    level = LEVEL_SCALE_OVER_STATIC * abs(truth["torque_static"])
    slow = max(
        GROWTH_SCALE_PER_S, GROWTH_SCALE_OVER_OMEGA * 2 * np.pi * truth["predicted_frequency_hz"]
    )
    scales = {"growth_rate": slow, "torque_rms": level, "torque_mean": level}
    loud, loud_ref = (_upper(f, "torque_rms") > level for f in (finding, truth))
    left_out: tuple[str, ...] = () if loud and loud_ref else ("dominant_frequency",)
    left_out += () if truth["class"] in COMPARED else ("torque_rms",)
    errors = []
    for name, numbers in truth["values"].items():
        if name in left_out:
            continue
        error = _interval_error(name, finding["values"][name], numbers, scales.get(name, 0.0))
        errors += [error] if error is not None else []
    if loud and loud_ref and truth["class"] in COMPARED:
        errors += _share_errors(finding["energy_share"], truth["energy_share"])
    return errors, Miscount(int(loud_ref and not loud), int(loud and not loud_ref))


def _upper(finding: Mapping[str, Any], name: str) -> float:
    measured = finding["values"][name][0]
    return 0.0 if measured is None else abs(measured)


def _interval_error(
    name: str, interval: list[float | None], reference: list[float | None], scale: float
) -> FoundError | None:
    """Relative error of a value, all of it where only the truth is known; None without one."""
    if reference[0] is None:
        return None
    if interval[0] is None:
        return _plain(name, 0, np.nan, reference[0], 1.0)
    measured, ref = interval[0], reference[0]
    low, high = (measured if x is None else x for x in interval[1:])
    ref_low, ref_high = (ref if x is None else x for x in reference[1:])
    size = max(abs(ref), scale)
    size = size if size > 0 else 1.0
    nearest = max(0.0, low - ref_high, ref_low - high) / size
    farthest = max(high - ref_low, ref_high - low) / size
    chance = float(np.hypot(high - low, ref_high - ref_low)) / 2 / size
    return FoundError(
        quantity=name,
        mode=0,
        value=measured,
        truth=ref,
        error=abs(measured - ref) / size,
        low=nearest,
        high=farthest,
        chance=chance,
    )


def _share_errors(shares: Mapping[str, float], reference: Mapping[str, float]) -> list[FoundError]:
    """Differences of energy shares of all modes that one of both has."""
    pairs = [
        (k, shares.get(k, 0.0), reference.get(k, 0.0))
        for k in sorted({*shares, *reference}, key=int)
    ]
    return [_plain("energy_share", int(k), share, ref, abs(share - ref)) for k, share, ref in pairs]


FRONT_COLUMNS = {
    "quantity": "str",
    "tolerance": "f8",
    "cheapest": "str",
    "cost": "f8",
    "error": "f8",
    "default": "str",
    "default_cost": "f8",
    "default_error": "f8",
    "ratio": "f8",
}


def on_front(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Mask (n,) of measurements that no other one beats in cost and error; false for NaN."""
    is_finite = np.isfinite(cost) & np.isfinite(error)
    front = np.zeros(len(cost), dtype=bool)
    best = np.inf
    for i in np.lexsort((error, cost)):
        if is_finite[i] and error[i] < best:
            front[i] = True
            best = error[i]
    return front


def usable(measurements: pd.DataFrame) -> np.ndarray:
    """Mask (n,) of measurements with every point solved, nothing missed and nothing spurious."""
    counts = measurements[["n_failed", "missed", "spurious"]].sum(axis=1)
    return ((measurements["status"] == "ok") & (counts == 0)).to_numpy(bool)


def cost_of(measurements: pd.DataFrame, quantity: str) -> np.ndarray:
    """Cost (n,) of a quantity in seconds: its own, as an onset has, else that of a design point."""
    own_column = f"cost_{quantity}"
    column = own_column if own_column in measurements else "cost"
    return measurements[column].to_numpy(float)


def at_tolerances(
    measurements: pd.DataFrame, quantities: Sequence[str], tolerances: Sequence[float]
) -> pd.DataFrame:
    """The cheapest measurement within each tolerance, and the cheapest of the default methods.

    Parameters
    ----------
    measurements : DataFrame
        Columns ``label``, ``default``, ``reference``, ``cost``, ``status``, ``n_failed``,
        ``missed``, ``spurious``, ``error_<quantity>`` and, where it has a cost of its own,
        ``cost_<quantity>``.
    quantities : sequence of str
        Quantities; several are also judged together, under the name ``all``, at the cost of the
        dearest. Quantities that no measurement has are left out of these.
    tolerances : sequence of float

    Returns
    -------
    DataFrame
        FRONT_COLUMNS; `ratio` is the default's cost over the cheapest's, NaN where there is none.
    """
    import pandas as pd  # not wanted by a check of a study

    good = measurements[usable(measurements) & ~measurements["reference"].to_numpy(bool)]
    rows = []
    measured_quantities = [q for q in quantities if good[f"error_{q}"].notna().any()]
    for name in [*quantities, *(["all"] if len(quantities) > 1 else [])]:
        judged = measured_quantities if name == "all" else [name]
        error = good[[f"error_{q}" for q in judged]].max(axis=1, skipna=False).to_numpy(float)
        cost = np.max([cost_of(good, q) for q in judged or quantities], axis=0)
        rows += [
            {"quantity": name, "tolerance": tolerance} | _at(good, error <= tolerance, error, cost)
            for tolerance in tolerances
        ]
    return pd.DataFrame(rows, columns=list(FRONT_COLUMNS)).astype(FRONT_COLUMNS)


def _at(
    good: pd.DataFrame, within: np.ndarray, error: np.ndarray, cost: np.ndarray
) -> dict[str, object]:
    """The cheapest of the measurements `within` a tolerance, and of the default ones."""
    default = within & good["default"].to_numpy(bool)
    best = _cheapest(good, within, error, cost)
    best_default = _cheapest(good, default, error, cost)
    names = "cheapest", "cost", "error", "default", "default_cost", "default_error"
    return dict(zip(names, best + best_default, strict=True)) | {"ratio": best_default[1] / best[1]}


def _cheapest(
    good: pd.DataFrame, among: np.ndarray, error: np.ndarray, cost: np.ndarray
) -> tuple[str, float, float]:
    """Label, cost and error of the cheapest measurement among some; "" and NaN without one."""
    rows = np.flatnonzero(among)
    if not len(rows):
        return "", np.nan, np.nan
    best = rows[np.argmin(cost[rows])]
    return str(good["label"].iloc[best]), float(cost[best]), float(error[best])


WORKS = ("converged", "slow", "recovered")
# relative distance from the predicted boundary below which cells are not judged
BOUNDARY_REL_MARGIN = 0.02


def agreement(cells: pd.DataFrame) -> dict[str, Any]:
    """Counts of outcomes, the share of judged cells that are as predicted, unflagged wrong ones.

    Parameters
    ----------
    cells : DataFrame
        Columns ``outcome``, ``flagged``, ``predicted`` (works below 1).

    Returns
    -------
    dict
        ``counts`` by outcome; ``agreement`` (None without a judged cell), ``judged``,
        ``unflagged_wrong``, ``unpredicted_failures``: judged cells within the predicted region
        where the method does not work.
    """
    works = cells["outcome"].isin(WORKS).to_numpy()
    predicted = cells["predicted"].to_numpy(float)
    judged = np.isfinite(predicted) & (np.abs(predicted - 1.0) > BOUNDARY_REL_MARGIN)
    judged |= np.isinf(predicted)
    recovered = (cells["outcome"] == "recovered").to_numpy()  # the plain method failed, as it may
    same = recovered | (works == (predicted < 1.0))
    wrong = (cells["outcome"] == "wrong").to_numpy() & ~cells["flagged"].to_numpy(bool)
    return {
        "counts": {str(k): int(v) for k, v in cells["outcome"].value_counts().items()},
        "agreement": float(same[judged].mean()) if judged.any() else None,
        "judged": int(judged.sum()),
        "unflagged_wrong": int(wrong.sum()),
        "unpredicted_failures": int((judged & (predicted < 1.0) & ~works).sum()),
    }
