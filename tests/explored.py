"""Results as pages to explore take them, made of numbers that are known."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
from made_results import made

STUDY = """[study]
name = "map"
kind = "complex_modes"
description = "growth over two parameters"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
start = 0.1
stop = 0.7
num = 7
"""
NO_ONSETS = {
    **dict.fromkeys(("track", "evaluations"), "int64"),
    **dict.fromkeys(("onset", "bracket_low", "bracket_high"), "f8"),
    **dict.fromkeys(("frequency_hz", "error_estimate"), "f8"),
    **dict.fromkeys(("direction", "status", "point_before", "point_after"), "str"),
}


def brake_map(across=7, up=5, n_modes=6, second="pressure", **facts):
    """Complex modes over friction and a second parameter: some grow beyond a friction."""
    rng = np.random.default_rng(1)
    friction, pressure = np.meshgrid(
        np.linspace(0.1, 0.7, across), np.geomspace(2e5, 3e6, up), indexing="ij"
    )
    mu, p, n = friction.ravel()[:, None], pressure.ravel()[:, None], friction.size
    ids = [f"{row:016x}" for row in range(n)]
    start, damping = np.sort(rng.uniform(500, 8000, n_modes)), rng.uniform(0.002, 0.03, n_modes)
    hertz = start * (1 + 0.02 * (mu - 0.4) + 0.003 * np.log(p / 1e6))
    onset = rng.uniform(0.25, 2.2, n_modes)
    onset[n_modes // 2] = 0.3
    growth = 2 * np.pi * hertz * (0.08 * np.clip(mu - onset, 0, None) - damping)
    numbers = np.tile(np.arange(1, n_modes + 1), n)
    modes = pd.DataFrame(
        {
            "point_id": np.repeat(ids, n_modes),
            "mode": numbers,
            "track": numbers,
            "track_ambiguous": False,
            "frequency_hz": hertz.ravel(),
            "growth_rate": growth.ravel(),
            "damping_ratio": (-growth / (2 * np.pi * hertz)).ravel(),
            "error_estimate": np.abs(growth.ravel()) * 1e-3,
            "unstable": (growth > 0).ravel(),
            "overdamped": False,
            "stability": np.where(growth.ravel() > 0, "unstable", "stable"),
        }
    )
    shares = rng.dirichlet([1.0, 1.0, 2.0], len(modes))
    for name, share in zip(("disc", "inner_pad", "interfaces"), shares.T, strict=True):
        modes[f"energy_{name}"] = share
    points = pd.DataFrame(
        {
            **{"point_id": ids, "status": "ok", "message": "", "wall_s": 0.1},
            **{"friction": mu.ravel(), second: p.ravel()},
            "n_modes": n_modes,  # the first that is no parameter
            **dict.fromkeys(
                ("n_unstable", "n_unstable_low", "n_unstable_high"), (growth > 0).sum(axis=1)
            ),
        }
    )
    names = ["friction", second]
    known = {
        "nominal": {"friction": 0.4, second: 2e5},
        "name": "map",
        "parameters": names,
        "sweeps": names,
        "n_points": n,
        "study": STUDY,
    }
    return made(
        units={"friction": "", second: "Pa"},
        points=points,
        modes=modes,
        onsets=pd.DataFrame({name: pd.Series(dtype=d) for name, d in NO_ONSETS.items()}),
        facts=known | facts,
    )


def content_of(page):
    """What a page's script reads."""
    (text,) = re.findall(r'<script id="data" type="application/json">([^<]*)</script>', page)
    return json.loads(text)
