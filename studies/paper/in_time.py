"""Claims of VdR 2010 on vibration in time: figures 11 to 16."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from found import (
    AGREES,
    ALONE,
    DAMPING,
    DIFFERS,
    GONE,
    GROUP,
    NOTHING,
    OPEN,
    PARTLY,
    SAME_LEVEL,
    SAME_SHAPE,
    SEEN,
    Answer,
    Found,
)

from squealstudy.wording import LASTING, STABLE, SUSTAINED


def _level(row: pd.Series) -> str:
    low, high = row["torque_rms_low"], row["torque_rms_high"]
    return f"{row['torque_rms']:.1f} N m ({low:.1f} to {high:.1f})"


def _class(row: Mapping[str, object]) -> str:
    return str(row["class"]).replace("_", " ")


def grows_and_saturates(found: Found) -> Answer:
    """VdR 2010, figure 11."""
    row = found.squeal.points.iloc[0]
    if row["status"] != "ok":
        return OPEN, f"the run failed: {row['message']}"
    text = f"growth {row['growth_rate']:.1f} 1/s as fitted, {row['predicted_growth_rate']:.1f} as "
    text += f"predicted; {_class(row)} of a torque's RMS of {_level(row)}"
    if row["settled"]:
        text += f", settled from {1e3 * row['settled_time']:.0f} ms on"
    text += f"; energy balance {abs(row['energy_balance']):.1g}"
    lasts = row["class"] in SUSTAINED
    return (AGREES if lasts and row["growth_rate"] > 0 else OPEN if not lasts else PARTLY), text


def robust_to_the_start(found: Found) -> Answer:
    """VdR 2010, section 3.2."""
    rows = [results.points.iloc[0] for results in (found.squeal, found.kicked)]
    text = " and ".join(f"{_class(row)}, {_level(row)}" for row in rows)
    text += f", from starts of {rows[0]['perturbation']:g} and {rows[1]['perturbation']:g} m/s"
    if any(row["status"] != "ok" or row["class"] not in SUSTAINED for row in rows):
        return OPEN, text
    far = abs(rows[1]["torque_rms"] / rows[0]["torque_rms"] - 1)
    return (AGREES if far <= SAME_LEVEL else DIFFERS), text


def not_linear(found: Found) -> Answer:
    """VdR 2010, section 3.2."""
    row = found.squeal.points.iloc[0]
    if row["status"] != "ok" or row["class"] not in SUSTAINED:
        return OPEN, "the run has no cycle that lasts"
    moved = row["torque_line_hz"] / row["predicted_frequency_hz"] - 1
    harmonics = [row[f"harmonic_{n}_level"] / row["dominant_level"] for n in (2, 3)]
    text = f"its line is at {row['torque_line_hz']:.0f} Hz, {100 * moved:+.1f} % from the "
    text += f"fastest complex mode; harmonics {100 * harmonics[0]:.1f} and "
    text += f"{100 * harmonics[1]:.1f} % of it; {100 * row['open_share']:.1f} % of the contact is "
    text += "open on average"
    return (AGREES if max(harmonics) >= SEEN else DIFFERS), text


def more_than_there_are(found: Found) -> Answer:
    """Introduction, after Lorang 2007."""
    row, growth = found.squeal.points.iloc[0], found.squeal.growth
    if row["status"] != "ok" or row["class"] not in SUSTAINED:
        return OPEN, "the run has no cycle that lasts"
    predicted = growth[growth["unstable"].astype(bool)]
    seen = int(predicted["expressed"].fillna(False).astype(bool).sum())
    text = f"{len(predicted)} modes are predicted to grow, {seen} of them have 5 % or more of the "
    text += "energy of the cycle"
    return (AGREES if seen < len(predicted) else DIFFERS if len(predicted) > 1 else OPEN), text


def same_shape(found: Found) -> Answer:
    """VdR 2010, figure 12 and 13."""
    table = found.projection
    rows = [
        f"{row['basis']}: MAC {row['mac']:.4f}, "
        f"{100 * row['outer_pad'] * (row['outer_pad'] > NOTHING):.2g} % of the kinetic energy on "
        "the outer pad"
        for row in table.to_dict("records")
    ]
    kept = table[table["truncated"] & (table["mac"] >= SAME_SHAPE)]
    residual = (kept["outer_pad"] > NOTHING).any()
    return (AGREES if residual else PARTLY if len(kept) else DIFFERS), "; ".join(rows)


def damped_runs(found: Found, group: bool) -> pd.DataFrame:
    """Rows of the damped runs, from no damping on, with ``x`` and energies of the first's mode."""
    points = found.damped.points
    own, other = points[f"{ALONE}.{DAMPING}"], points[f"{GROUP}.{DAMPING}"]
    here = (own == other) if group else (other == 0.0)
    rows = points[here].assign(x=own[here]).sort_values("x")
    modes = found.damped.modes.set_index(["point_id", "mode"])["energy_mean"]
    first = rows["dominant_mode"].iloc[0]
    keys = [(point, first) for point in rows["point_id"]]
    return rows.assign(first_energy=modes.reindex(keys).to_numpy())


def _runs(rows: pd.DataFrame) -> str:
    told = []
    for row in rows.to_dict("records"):
        text = f"{100 * row['x']:.0f} %: {_class(row)}"
        if row["status"] == "ok":
            text += f", {_level(row)}, {_largest(row)}"
        told.append(text)
    return "; ".join(told)


def _largest(row: Mapping[str, float]) -> str:
    return f"R{row['dominant_mode']:.0f} with {100 * row['dominant_share']:.0f} % of the energy"


def _open(found: Found, rows: pd.DataFrame) -> str:
    """Why damped runs answer nothing; empty where they do.

    All must be solved, and the undamped one be a cycle: as it is called, or as the run is that it
    goes on from, at the same level.
    """
    if not (rows["status"] == "ok").all():
        return f"a run failed; {_runs(rows)}"
    before, first = found.squeal.points.iloc[0], rows.iloc[0]
    goes_on = before["status"] == "ok" and before["class"] in SUSTAINED
    far = abs(first["torque_rms"] - before["torque_rms"])
    goes_on &= bool(far <= SAME_LEVEL * before["torque_rms"])
    if first["class"] in SUSTAINED or goes_on:
        return ""
    return f"there is no cycle to damp; {_runs(rows)}"


def _last(rows: pd.DataFrame) -> tuple[bool, str]:
    """Whether another mode has the largest energy with most damping than without, and in words."""
    last, first = rows.iloc[-1], rows.iloc[0]
    text = f"at {100 * last['x']:.0f} % it is {_largest(last)}, without {_largest(first)}; the "
    text += f"run is called {_class(last)}"
    return bool(last["dominant_mode"] != first["dominant_mode"]), text


def quieter_not_silent(found: Found) -> Answer:
    """VdR 2010, figure 14, above: little damping of mode 7."""
    rows = damped_runs(found, False)
    if why := _open(found, rows):
        return OPEN, why
    text = _runs(rows)
    little = rows.iloc[1:3]
    if (little["class"] == STABLE).any():
        return DIFFERS, text
    quieter = (little["torque_rms"] < rows["torque_rms"].iloc[0]).all()
    lasting = little["class"].isin(LASTING).all()
    return (AGREES if quieter and lasting else PARTLY if quieter else DIFFERS), text


def handed_on_in_time(found: Found) -> Answer:
    """VdR 2010, figure 15: more damping of mode 7 alone."""
    rows = damped_runs(found, False)
    if why := _open(found, rows):
        return OPEN, why
    other, text = _last(rows)
    rises = rows["torque_rms"].iloc[-1] > rows["torque_rms"].iloc[1:-1].min()
    text += "; the torque rises again" if rises else "; the torque does not rise again"
    return (AGREES if other and rises else PARTLY if other or rises else DIFFERS), text


def group_threshold(found: Found) -> Answer:
    """VdR 2010, figure 14, below, and 16: the energy of the first mode is dissipated."""
    rows = damped_runs(found, True)
    if why := _open(found, rows):
        return OPEN, why
    text = _runs(rows)
    share = (rows["first_energy"] / rows["first_energy"].iloc[0]).to_numpy()
    gone = np.flatnonzero(share < GONE)
    text += "; energy of the first's mode, of that without: "
    text += ", ".join(f"{100 * s:.2g} %" for s in share[1:])
    return (AGREES if len(gone) and gone[0] > 1 else PARTLY if len(gone) else DIFFERS), text


def another_takes_over(found: Found) -> Answer:
    """VdR 2010, figure 16: another unstable mode expresses itself."""
    rows = damped_runs(found, True)
    if why := _open(found, rows):
        return OPEN, why
    other, text = _last(rows)
    if other and rows["class"].iloc[-1] in LASTING:
        return AGREES, text
    return (PARTLY if other else DIFFERS), text
