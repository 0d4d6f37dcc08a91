"""Draw results of turning_disc.toml: onsets over speed, growth of the mode near 3.1 kHz.

squealstudy run studies/turning_disc.toml
python studies/turning_disc.py results/turning_disc turning_disc.png
"""

from __future__ import annotations

import sys

import matplotlib as mpl

mpl.use("agg")

import matplotlib.pyplot as plt

import squealstudy as sq
from squealstudy.colours import COLOURS, GREY

CASES = ["friction_law.static_ratio", "gyroscopic_factor"]
FRICTION = 0.24
BAND = (3000.0, 3250.0)  # Hz


def label(ratio: float, factor: float) -> str:
    """What a line has, in words."""
    friction = "falling friction" if ratio > 1 else "constant friction"
    return f"{friction}, {'gyroscopic terms' if factor else 'without'}"


def main(directory: str, picture: str) -> None:
    """Two panels, a line a case."""
    results = sq.open_results(directory)
    joined = results.modes.merge(results.points, on="point_id", suffixes=("", "_of_point"))
    mode = joined[
        joined["frequency_hz"].between(*BAND) & joined["friction"].sub(FRICTION).abs().lt(1e-9)
    ]
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    for (ratio, factor), onsets in results.onsets.groupby(CASES):
        style = {"color": COLOURS[int(ratio > 1)], "ls": "-" if factor else "--"}
        least = onsets.groupby("sliding_speed")["onset"].min()
        left.semilogx(least, marker=".", label=label(ratio, factor), **style)
        of_case = mode[(mode[CASES[0]] == ratio) & (mode[CASES[1]] == factor)]
        right.semilogx(of_case.groupby("sliding_speed")["growth_rate"].max(), marker=".", **style)
    left.set(xlabel="sliding speed [m/s]", ylabel="least friction at which a mode grows")
    right.set(
        xlabel="sliding speed [m/s]", ylabel=f"growth near 3.1 kHz at friction {FRICTION:g} [1/s]"
    )
    right.axhline(0.0, color=GREY, lw=0.8)
    left.legend(frameon=False, fontsize=8)
    figure.savefig(picture, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
