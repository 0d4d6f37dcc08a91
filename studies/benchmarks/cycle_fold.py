"""A fold of a brake's limit cycles over friction, and runs in time on both sides of it.

Run:  python studies/benchmarks/cycle_fold.py FOLDER [--design 79] [--mode 23] [--lowest 0.26]

The stable cycle of a design of `cycle_truth.csv` is followed as friction falls, by a study of limit
cycles, to its fold. Runs begin on the cycle of the design itself, at friction beside the fold by
shares of it: those above it shall last, those below decay.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import pandas as pd
from cycle_truth import BRAKE, RANGES

import squealstudy

SHARES = (0.98, 0.99, 1.01, 1.02)
CYCLES = """
[modes]
band = [500.0, 8e3]
[limit_cycles]
families = [{mode}]
follow = "friction"
undecided_in_time = false
neighbours = false
"""
RUN = """
[transient]
duration = 1.6
step = 2e-6
save_every = 10
stop = "settled"
slope_pilot = "never"
start = "cycle:{cycle}"
"""


def main() -> None:
    """Print the fold, and what each run came to."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--design", type=int, default=79)
    parser.add_argument("--mode", type=int, default=23)
    parser.add_argument("--lowest", type=float, default=0.26, help="friction")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    truth = pd.read_csv(Path(__file__).with_name("cycle_truth.csv")).set_index("design")
    design = truth.loc[arguments.design, list(RANGES)].astype(float).to_dict()
    friction = design.pop("friction")
    brake = BRAKE.format(mesh="coarse").partition("friction = ")[0]
    brake += "".join(f'"{name}" = {value}\n' for name, value in design.items())

    def study(name: str, kind: str, values: list[float], more: str) -> squealstudy.Results:
        path = folder / f"{name}.toml"
        sweep = f'[[sweep]]\nparameter = "friction"\nvalues = {values}\n'
        path.write_text(f'[study]\nname = "{name}"\nkind = "{kind}"\n{brake}{sweep}{more}')
        return squealstudy.run(path, folder / name, jobs=arguments.jobs, yes=True)

    more = CYCLES.format(mode=arguments.mode)
    found = study("cycles", "limit_cycles", [arguments.lowest, friction], more)
    branches = found.table("branches")
    folds = branches[(branches["event"] == "F").to_numpy(bool)]
    if not len(folds):
        raise SystemExit(f"no fold between friction {arguments.lowest} and {friction}")
    fold = folds.iloc[0]
    cycle = found.table("cycles").nlargest(1, "torque_rms").iloc[0]
    print(f"fold at friction {fold['value']:.5f}, {fold['torque_rms']:.4g} N m")
    values = [round(share * float(fold["value"]), 6) for share in SHARES]
    start = RUN.format(cycle=folder / "cycles" / cycle["cycle_id"])
    points = study("runs", "transient", values, start).points
    print(points[["friction", "class", "torque_rms", "torque_line_hz"]].to_string())


if __name__ == "__main__":
    main()
