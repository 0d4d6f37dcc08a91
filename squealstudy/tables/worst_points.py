"""Where unstable modes grow fastest."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
import pandas as pd

ANY = "any"  # in place of the value of a parameter over which growth is alike
ALIKE_REL_GROWTH = 1e-6  # relative difference of growth that is not told


def worst_settings(
    points: pd.DataFrame, unstable: pd.DataFrame, worst: pd.DataFrame, names: list[str]
) -> list[dict[Hashable, Any]]:
    """Values of the parameters `names` at the fastest growth of each track, or ANY.

    Parameters
    ----------
    points : DataFrame
    unstable : DataFrame
        Unstable modes with their `track`, row of the `point` and `growth_rate`.
    worst : DataFrame
        The fastest growing row of each track.
    names : list of str
        Parameters. One is ANY where growth is alike at all of its values.
    """
    largest = unstable["track"].map(worst.set_index("track")["growth_rate"]).to_numpy(float)
    growth = unstable["growth_rate"].to_numpy(float)
    nearly_worst = unstable[growth >= largest * (1.0 - ALIKE_REL_GROWTH * np.sign(largest))]
    n_values = points[names].nunique()
    settings = points[names].iloc[worst["point"]].to_dict("records")
    by_track = dict(list(nearly_worst.groupby("track")["point"]))
    for row, track in zip(settings, worst["track"], strict=True):
        if len(by_track[track]) < 2:
            continue
        n_alike = points[names].iloc[by_track[track].to_numpy()].nunique()
        row.update({n: ANY for n in names if 1 < n_alike[n] == n_values[n]})
    return settings
