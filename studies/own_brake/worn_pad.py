"""Draw results of worn_pad.toml: modes of the new and of the worn brake at one friction.

squealstudy run studies/own_brake/worn_pad.toml
python studies/own_brake/worn_pad.py results/worn_pad worn_pad.png
"""

from __future__ import annotations

import sys

import matplotlib as mpl

mpl.use("agg")

import matplotlib.pyplot as plt

import squealstudy as sq
from squealstudy.colours import COLOURS, GREY

FRICTION = 0.5
LEAST_GROWTH = -300.0  # 1/s


def main(directory: str, picture: str) -> None:
    """Growth over frequency, a colour a distance."""
    results = sq.open_results(directory)
    modes = results.modes.merge(results.points[["point_id", "friction", "worn"]], on="point_id")
    modes = modes[modes["friction"].sub(FRICTION).abs().lt(1e-9)]
    figure, ax = plt.subplots(figsize=(7.5, 3.8), layout="constrained")
    for i, (worn, of_it) in enumerate(modes.groupby("worn")):
        ax.plot(
            of_it["frequency_hz"] / 1e3,
            of_it["growth_rate"],
            "os"[i],
            color=COLOURS[i],
            mfc="none" if worn == 0 else COLOURS[i],
            label="new" if worn == 0 else f"worn by {worn / 1e3:g} km",
        )
        for row in of_it[of_it["growth_rate"] > 0].itertuples():
            place = (row.frequency_hz / 1e3, row.growth_rate)
            text = f" {row.frequency_hz:.0f} Hz"
            side = ("bottom", "top")[i]
            ax.annotate(text, place, va=side, fontsize=8, color=COLOURS[i])
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.set(
        xlabel="frequency [kHz]",
        ylabel=f"growth at friction {FRICTION:g} [1/s]",
        ylim=(LEAST_GROWTH, None),
    )
    ax.legend(frameon=False, fontsize=8)
    figure.savefig(picture, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
