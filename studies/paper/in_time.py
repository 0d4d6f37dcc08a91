"""Claims of VdR 2010 on vibration in time: figures 11 to 16."""

from __future__ import annotations

import numpy as np
import pandas as pd
from found import (
    AGREES,
    ALONE,
    DAMPING,
    DIFFERS,
    GONE,
    GROUP,
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


def grows_and_saturates(found: Found) -> Answer:
    """VdR 2010, figure 11."""
    row = found.squeal.points.iloc[0]
    if row["status"] != "ok":
        return OPEN, f"the run failed: {row['message']}"
    text = f"growth {row['growth_rate']:.1f} 1/s as fitted, {row['predicted_growth_rate']:.1f} as "
    text += f"predicted; {str(row['class']).replace('_', ' ')} of a torque's RMS of {_level(row)}"
    if row["settled"]:
        text += f", settled from {1e3 * row['settled_time']:.0f} ms on"
    text += f"; energy balance {abs(row['energy_balance']):.1g}"
    lasts = row["class"] in SUSTAINED
    return (AGREES if lasts and row["growth_rate"] > 0 else OPEN if not lasts else PARTLY), text


def robust_to_the_start(found: Found) -> Answer:
    """VdR 2010, section 3.2."""
    rows = [results.points.iloc[0] for results in (found.squeal, found.kicked)]
    text = " and ".join(f"{row['class'].replace('_', ' ')}, {_level(row)}" for row in rows)
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
    moved = row["dominant_frequency_hz"] / row["predicted_frequency_hz"] - 1
    harmonics = [row[f"harmonic_{n}_level"] / row["dominant_level"] for n in (2, 3)]
    text = f"its line is at {row['dominant_frequency_hz']:.0f} Hz, {100 * moved:+.1f} % from the "
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
        f"{row['basis']}: MAC {row['mac']:.4f}, {100 * row['outer_pad']:.2g} % of the kinetic "
        f"energy on the outer pad"
        for row in table.to_dict("records")
    ]
    best = table[table["truncated"]]["mac"].max()
    return (AGREES if best >= SAME_SHAPE else DIFFERS), "; ".join(rows)


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
        text = f"{100 * row['x']:.0f} %: {str(row['class']).replace('_', ' ')}"
        if row["status"] == "ok":
            text += f", {row['torque_rms']:.1f} N m, mostly R{row['dominant_mode']:.0f}"
        told.append(text)
    return "; ".join(told)


def _begins(rows: pd.DataFrame) -> bool:
    """Whether all runs were solved and the undamped one goes on as a cycle."""
    return bool((rows["status"] == "ok").all() and rows["class"].iloc[0] in SUSTAINED)


def quieter_not_silent(found: Found) -> Answer:
    """VdR 2010, figure 14, above: little damping of mode 7."""
    rows = damped_runs(found, False)
    text = _runs(rows)
    if not _begins(rows):
        return OPEN, text
    little = rows.iloc[1:3]
    if (little["class"] == STABLE).any():
        return DIFFERS, text
    quieter = (little["torque_rms"] < rows["torque_rms"].iloc[0]).all()
    lasting = little["class"].isin(LASTING).all()
    return (AGREES if quieter and lasting else PARTLY if quieter else DIFFERS), text


def handed_on_in_time(found: Found) -> Answer:
    """VdR 2010, figure 15: more damping of mode 7 alone."""
    rows = damped_runs(found, False)
    if not _begins(rows):
        return OPEN, _runs(rows)
    last, first = rows.iloc[-1], rows.iloc[0]
    other = last["dominant_mode"] != first["dominant_mode"]
    text = f"at {100 * last['x']:.0f} % R{last['dominant_mode']:.0f} has most of the energy, "
    text += f"R{first['dominant_mode']:.0f} without; the run is called "
    text += str(last["class"]).replace("_", " ")
    rises = last["torque_rms"] > rows["torque_rms"].iloc[1:-1].min()
    return (AGREES if other and rises else PARTLY if other or rises else DIFFERS), text


def group_threshold(found: Found) -> Answer:
    """VdR 2010, figure 14, below, and 16: the energy of the first mode is dissipated."""
    rows = damped_runs(found, True)
    text = _runs(rows)
    if not _begins(rows):
        return OPEN, text
    share = (rows["first_energy"] / rows["first_energy"].iloc[0]).to_numpy()
    gone = np.flatnonzero(share < GONE)
    text += "; energy of the first's mode, of that without: "
    text += ", ".join(f"{100 * s:.2g} %" for s in share[1:])
    return (AGREES if len(gone) and gone[0] > 1 else PARTLY if len(gone) else DIFFERS), text


def another_takes_over(found: Found) -> Answer:
    """VdR 2010, figure 16: another unstable mode expresses itself."""
    rows = damped_runs(found, True)
    if not _begins(rows):
        return OPEN, _runs(rows)
    last, first = rows.iloc[-1], rows.iloc[0]
    other = last["dominant_mode"] != first["dominant_mode"]
    text = f"at {100 * last['x']:.0f} % R{last['dominant_mode']:.0f} has "
    text += f"{100 * last['dominant_share']:.0f} % of the energy, "
    text += f"R{first['dominant_mode']:.0f} without; the run is called "
    text += str(last["class"]).replace("_", " ")
    if other and last["class"] in LASTING:
        return AGREES, text
    return (PARTLY if other else DIFFERS), text
