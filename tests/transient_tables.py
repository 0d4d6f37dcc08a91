"""Hand-made tables of a transient study, for tests of pictures, ranking and comparison."""

import numpy as np
import pandas as pd

TEXT = ("point_id", "status", "message", "class", "growth_method")
WHOLE = {"n_unstable": 0, "dominant_mode": 0, "transfer_from": 0, "transfer_to": 0}
REAL = ("predicted_frequency_hz", "predicted_growth_rate", "growth_rate", "growth_rate_low")
REAL += ("growth_rate_high", "onset_time", "settled_time", "torque_static", "torque_mean")
REAL += ("torque_rms", "torque_rms_low", "torque_rms_high", "torque_line_hz")
REAL += ("dominant_share", "transfer_time", "energy_outside_share")
ENERGIES = ("energy_disc", "energy_caliper", "energy_interfaces")
FREQUENCIES = {44: 3180.0, 45: 3260.0, 51: 4950.0}


def points_table(parameters, kinds, **columns):
    """A row a design point; `kinds` are classes, "failed" ones without any figure."""
    n = len(kinds)
    failed = np.array([kind == "failed" for kind in kinds])
    status = np.where(failed, "not_converged", "ok")
    message = np.where(failed, "t = 0.0123 s", "")
    head = {"point_id": [f"p{i}" for i in range(n)], "status": status, "message": message}
    table = pd.DataFrame(head | {"wall_s": 1.0} | parameters | {"class": list(kinds)})
    given = {"n_unstable": 1, "predicted_frequency_hz": 3250.0, "predicted_growth_rate": 300.0}
    given |= {"growth_rate": 303.0, "growth_rate_low": 297.0, "growth_rate_high": 309.0}
    given |= {"settled_time": 0.03, "torque_static": 360.0, "torque_mean": 348.0}
    given |= {"torque_rms": 60.0, "torque_rms_low": 57.0, "torque_rms_high": 63.0}
    given |= {"torque_line_hz": 3175.0, "dominant_mode": 44, "dominant_share": 0.6}
    given |= {"energy_outside_share": 0.05} | columns
    for name in REAL:
        values = pd.Series(given.get(name, np.nan), index=table.index, dtype=float)
        table[name] = values.mask(failed)
    for name, value in WHOLE.items():
        values = pd.Series(given.get(name, value), index=table.index)
        table[name] = values.mask(failed, 0)
    table["settled"] = given.get("settled", True) & ~failed
    return table


def modes_table(shares):
    """Rows of point -> {mode: share of the last window}."""
    rows = [
        {"point_id": point, "mode": mode, "frequency_hz": FREQUENCIES[mode], "energy_share": share}
        | {"energy_share_low": 0.9 * share, "energy_share_high": 1.1 * share, "energy_mean": share}
        | {"first_share": 0.1}
        | dict(zip(ENERGIES, (0.2, 0.7, 0.1) if mode == 44 else (0.5, 0.3, 0.2), strict=True))
        for point, own in shares.items()
        for mode, share in own.items()
    ]
    columns = ["point_id", "mode", "frequency_hz", "energy_share", "energy_share_low"]
    columns += ["energy_share_high", "energy_mean", "first_share", *ENERGIES]
    return pd.DataFrame(rows, columns=columns)


def growth_table(rows):
    """Rows of (point, mode, frequency, growth, fitted or None, level share)."""
    names = ["point_id", "mode", "frequency_hz", "growth_rate", "fitted_growth_rate", "level_share"]
    table = pd.DataFrame(rows, columns=names)
    table = table.astype(dict.fromkeys(names[2:], float))
    table["fitted_low"] = table["fitted_growth_rate"] - 3.0
    table["fitted_high"] = table["fitted_growth_rate"] + 3.0
    table["fit_start"], table["fit_stop"] = 0.005, 0.015
    table["fit_status"] = np.where(table["fitted_growth_rate"].notna(), "ok", "too_short")
    table["damping_ratio"] = -0.01
    table["unstable"] = table["growth_rate"] > 0
    lasting = table["level_share"].notna()
    table["expressed"] = (table["level_share"] >= 0.05).astype("boolean").where(lasting)
    return table


def history_table(n=4000, duration=0.1, frequency=3175.0):
    """Growth of a vibration that saturates at 40 ms; mode 51 takes over from mode 44 late."""
    t = np.linspace(0.0, duration, n)
    level = np.minimum(np.exp(300 * (t - 0.04)), 1.0)
    wave = level * np.sin(2 * np.pi * frequency * t)
    energy = 0.02 * level**2 + 1e-12
    late = 1 / (1 + np.exp(-(t - 0.07) / 0.004))
    return pd.DataFrame(
        {"time": t, "torque": 348 + 90 * wave, "normal_force": 6000 + 500 * wave}
        | {"stick": 0.01 * level, "slip": 1 - 0.11 * level, "open": 0.1 * level}
        | {"energy": energy, "energy_outside": 0.05 * energy}
        | {"energy_mode_44": 0.8 * energy * (1 - late), "energy_mode_45": 0.1 * energy}
        | {"energy_mode_51": 0.8 * energy * late + 1e-3 * energy, "amplitude_mode_44": level}
    )
