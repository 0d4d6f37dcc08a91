"""What a screen of mode families by their growth misses, where all of them were followed.

Run:  squealstudy run studies/benchmarks/brake_families.toml -o FOLDER --jobs 2 --yes
      python studies/benchmarks/cycle_screen.py FOLDER

Of each screen [1/s]: the share of families that are followed, and the families and designs with a
stable cycle that are missed. Then every stable mode whose curve has a cycle, slowest decay last.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

import squealstudy

SCREENS = (25.0, 50.0, 100.0, 150.0, 200.0, 250.0, 350.0, 500.0)
SHOWN = ["point_id", "mode", "frequency_hz", "growth_rate", "n_cycles", "verdict", "torque_rms"]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    results = squealstudy.open_results(parser.parse_args().folder)
    families, cycles = results.table("verdicts"), results.table("cycles")
    attracting = cycles[cycles["stable"].fillna(False)]
    keys = pd.MultiIndex.from_frame(families[["point_id", "mode"]])
    loud = families[keys.isin(pd.MultiIndex.from_frame(attracting[["point_id", "mode"]]))]
    designs = loud.groupby("point_id")["growth_rate"].max()  # its slowest is found last
    for screen in SCREENS:
        followed = (families["growth_rate"] > -screen).mean()
        missed = (loud["growth_rate"] <= -screen).sum()
        unseen = (designs <= -screen).sum()
        print(
            f"{screen:5.0f} 1/s: {100 * followed:3.0f} % of {len(families)} families followed; "
            f"missed {missed} of {len(loud)} with stable cycles, {unseen} of {len(designs)} designs"
        )
    kept = families[(families["n_cycles"] > 0) & ~families["unstable"]]
    print(kept.sort_values("growth_rate")[SHOWN].to_string(index=False))


if __name__ == "__main__":
    main()
