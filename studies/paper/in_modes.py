"""Claims of VdR 2010 on complex modes: figures 5 to 10, and the reduction."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd
from found import (
    AGREES,
    ALONE,
    CLOSE,
    DAMPING,
    DIFFERS,
    GROUP,
    OPEN,
    PARTLY,
    SCALE,
    TAKES_PART,
    Answer,
    Found,
)

from squealstudy import Results
from squealstudy.tables.sensitivity_ranking import mode_sensitivities, rank_sensitivities

UNCHANGED = "no mode is unstable, or none is known, where nothing is changed"


def nominal_modes(results: Results) -> pd.DataFrame:
    """Modes at friction 0.5, which oscillate, the fastest growing first."""
    points = results.points
    here = points[np.isclose(points["friction"], 0.5) & (points["status"] == "ok")]
    modes = results.modes[results.modes["point_id"].isin(here["point_id"])]
    return modes[~modes["overdamped"]].sort_values("growth_rate", ascending=False)


def _mode(row: Mapping[str, float]) -> str:
    return f"{row['frequency_hz']:.0f} Hz ({row['growth_rate']:+.1f} 1/s)"


def several_unstable(found: Found) -> Answer:
    """VdR 2010, figure 5."""
    modes = nominal_modes(found.stability)
    unstable = modes[modes["unstable"]]
    if modes.empty:
        return OPEN, "the nominal point was not solved"
    error = modes["error_estimate"].max()
    text = f"{len(unstable)} of {len(modes)} modes are unstable"
    if len(unstable):
        text += ": " + ", ".join(_mode(row) for row in unstable.to_dict("records"))
    onsets = found.stability.onsets
    into = onsets[(onsets["direction"] == "in") & onsets["status"].isin(["refined", "cubic"])]
    known = int((onsets["status"] == "below_range").sum())
    if known:
        lowest = found.stability.points["friction"].min()
        text += f"; {known} {'is' if known == 1 else 'are'} so at a friction of {lowest:g} already"
    if len(into):
        which = "the next" if known else "the first"
        text += f"; {which} turns unstable at a friction of {into['onset'].min():.3f}"
    verdict = AGREES if len(unstable) > 1 else PARTLY if len(unstable) else DIFFERS
    return verdict, f"{text}. Estimated errors are at most {error:.2g} 1/s"


def parts_of_the_mode(found: Found) -> Answer:
    """VdR 2010, figure 6, left."""
    modes = nominal_modes(found.stability)
    if not modes["unstable"].any():
        return OPEN, "no mode is unstable"
    worst = modes.iloc[0]
    share = worst.filter(regex="^energy_").astype(float).rename(lambda c: c.removeprefix("energy_"))
    share = share.sort_values(ascending=False)
    text = ", ".join(f"{k.replace('_', ' ')} {100 * v:.0f} %" for k, v in share.items())
    pads = share[["inner_pad", "outer_pad"]]
    asked = [share["disc"], share["caliper"], pads.max()]
    verdict = AGREES if min(asked) >= TAKES_PART else PARTLY if asked[0] >= TAKES_PART else DIFFERS
    if verdict == AGREES and pads.idxmax() != "outer_pad":
        verdict = PARTLY  # with the other pad
    return verdict, f"elastic energy of the fastest, at {worst['frequency_hz']:.0f} Hz: {text}"


def most_sensitive(found: Found) -> Answer:
    """VdR 2010, figure 7."""
    table = found.sensitivity.sensitivities
    if not len(table):
        return OPEN, "no mode is unstable"
    ranked = rank_sensitivities(mode_sensitivities(table))
    by_component = ranked.groupby("component")["growth_per_percent"].agg(lambda v: v.abs().max())
    first = str(by_component.idxmax())
    top = ", ".join(
        f"{row['component'].replace('_', ' ')} {row['component_mode']} "
        f"({row['growth_per_percent']:+.1f})"
        for row in ranked.head(4).to_dict("records")
    )
    text = (
        f"growth by 1 % of a frequency, in 1/s, at {ranked['frequency_hz'].iloc[0]:.0f} Hz: {top}"
    )
    largest = by_component.get("caliper", 0.0) / by_component.max()
    if first != "caliper":
        text += f"; the largest of the caliper is {100 * largest:.0f} % of that"
    near = int(ranked["near_coalescence"].sum())
    text += f"; {near} of {len(ranked)} derivatives are near coalescence" if near else ""
    return (AGREES if first == "caliper" else PARTLY if largest > 0.5 else DIFFERS), text


def line(results: Results, what: str, together: bool) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Along the change of caliper mode 7, alone or with its neighbours: values and their modes.

    Returns
    -------
    points : DataFrame
        With a column ``x``, the value; only those that were solved.
    modes : DataFrame
        Of these points, with ``x``, and whether each is the mode that grows fastest without change
        (``target``).
    """
    points = results.points[results.points["status"] == "ok"]
    own, other = points[f"{ALONE}.{what}"], points[f"{GROUP}.{what}"]
    base = 1.0 if what == SCALE else 0.0
    here = np.isclose(other, own) if together else np.isclose(other, base)
    points = points[here].assign(x=own[here]).sort_values("x")
    modes = results.modes[~results.modes["overdamped"]]
    modes = modes.merge(points[["point_id", "x"]], on="point_id")
    unchanged = modes[np.isclose(modes["x"], base)]
    target = -1
    if unchanged["unstable"].any():
        target = int(unchanged.loc[unchanged["growth_rate"].idxmax(), "track"])
    return points, modes.assign(target=modes["track"] == target if target >= 0 else False)


def _values(x: pd.Series | np.ndarray, what: str) -> str:
    """Values as percent: their range, or their list where there are gaps."""
    shown = [f"{100 * (v - (what == SCALE)):+.0f}" for v in np.sort(np.asarray(x, float))]
    shown = shown if what == SCALE else [text.lstrip("+") for text in shown]
    return ", ".join(shown) + " %"


def target_stabilised(what: str, together: bool, claimed: bool) -> Callable[[Found], Answer]:
    """VdR 2010, figures 8 to 10: is the mode stable at some change, and was it said to be?"""

    def answer(found: Found) -> Answer:
        results = found.frequency if what == SCALE else found.damping
        points, modes = line(results, what, together)
        target = modes[modes["target"]]
        if target.empty:
            return OPEN, UNCHANGED
        stable = target.loc[~target["unstable"], "x"]
        text = f"stable at {len(stable)} of {len(points)} values"
        text += f" ({_values(stable, what)})" if len(stable) else ""
        lost = points.loc[~points["x"].isin(target["x"]), "x"]
        text += f"; not followed to {_values(lost, what)}" if len(lost) else ""
        if not len(stable) and len(lost):
            return OPEN, text
        return (AGREES if bool(len(stable)) == claimed else DIFFERS), text

    return answer


def handed_on(what: str, together: bool, claimed: bool) -> Callable[[Found], Answer]:
    """VdR 2010, figure 8 and 9: does another mode, stable before, turn unstable?"""

    def answer(found: Found) -> Answer:
        results = found.frequency if what == SCALE else found.damping
        _, modes = line(results, what, together)
        base = 1.0 if what == SCALE else 0.0
        before = set(modes.loc[np.isclose(modes["x"], base) & modes["unstable"], "track"])
        if not before:
            return OPEN, UNCHANGED
        new = modes[modes["unstable"] & ~modes["track"].isin(before) & (modes["track"] >= 0)]
        if new.empty:
            lost = modes["unstable"] & (modes["track"] < 0)
            if lost.any():
                return OPEN, f"unstable modes without a track at {_values(modes.x[lost], what)}"
            return (DIFFERS if claimed else AGREES), "no mode that was stable turns unstable"
        worst = new.loc[new["growth_rate"].idxmax()]
        n = new["track"].nunique()
        text = "1 mode that was stable turns" if n == 1 else f"{n} modes that were stable turn"
        text += " unstable, at "
        text += f"{_values(new['x'].unique(), what)}; fastest {_mode(worst)} at "
        text += _values([worst["x"]], what)
        doubt = int(new["track_ambiguous"].sum())
        text += f"; {doubt} of these {len(new)} modes are ambiguously tracked" if doubt else ""
        return (AGREES if claimed else DIFFERS), text

    return answer


def silent_by_group_damping(found: Found) -> Answer:
    """VdR 2010, figure 10."""
    points, modes = line(found.damping, DAMPING, True)
    if points.empty:
        return OPEN, "no point was solved"
    unstable = set(modes.loc[modes["unstable"], "x"])
    silent = points.loc[~points["x"].isin(unstable), "x"]
    if 0.0 in set(silent):
        return OPEN, "nothing is unstable without it"
    if len(silent):
        lasts = not unstable or max(unstable) < silent.min()
        text = f"no mode is unstable at {_values(silent, DAMPING)}"
        return (AGREES if lasts else PARTLY), text
    last = modes[np.isclose(modes["x"], points["x"].max())].nlargest(1, "growth_rate").iloc[0]
    return DIFFERS, f"at {_values([last['x']], DAMPING)} {_mode(last)} still grows"


def small_and_exact(found: Found) -> Answer:
    """VdR 2010, section 1.2."""
    points = found.stability.points
    checked = points.dropna(subset="reference_frequency_error")
    if checked.empty:
        return OPEN, "no point was solved at full order"
    checks = found.stability.manifest.get("reference", [])
    missed = sum(check.get("missed_modes", 0) for check in checks)
    f, z = (checked[f"reference_{n}_error"].max() for n in ("frequency", "damping"))
    text = (
        f"at {len(checked)} points against full order: frequencies err by {f:.1g} of their value, "
    )
    text += f"damping ratios by {z:.1g}, after the basis is enriched by responses to friction; "
    text += f"{found.squeal.points['n_coordinates'].iloc[0]:.0f} coordinates in time"
    text += f"; of the full order, {missed} of its modes missed" if missed else ""
    return (DIFFERS if f >= CLOSE else PARTLY if missed else AGREES), text
