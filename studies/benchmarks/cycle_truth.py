"""Which designs of the brake squeal, squeal if kicked, or stay silent: by time runs alone.

Run:  python studies/benchmarks/cycle_truth.py FOLDER [--mesh medium] [--draw 96] [--jobs 2]

The truth that verdicts on limit cycles are held against, made before any of them was tuned.
Designs are drawn at random in friction, pressure and two caliper modes (7 and 10, which carry the
squeals of this brake); complex modes say which are linearly stable, those of the runs' own basis
where both differ. One that is unstable begins with a small perturbation and with the vibration of
the nominal brake; one that is stable with that vibration and with kicks along two assembly modes
(`--kicks`). Where any start ends in a lasting vibration the design squeals, if only when kicked
where it is linearly stable; where all decay it is silent as far as these starts show; else it is
undecided. The results of all runs stay in FOLDER, which is gone on with where it stopped;
`truth.csv` in it has a row a design, taken in turn until there are as many of each class as
`WANTED` says.

The full basis of the studies in time is used, with a step of 2 microseconds; runs end where they
have settled or decayed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
from scipy.stats import qmc

import squealstudy
from squealstudy.wording import STABLE, SUSTAINED

RANGES = {
    "friction": (0.35, 0.6),
    "pressure": (6e5, 20e5),
    "caliper.modes[7].frequency_scale": (1.0, 2.0),
    "caliper.modes[10].frequency_scale": (0.9, 1.8),
}
KICKED = (3130.0, 4940.0)  # Hz: the assembly mode nearest is kicked
VELOCITIES = (1.0,)  # m/s at a contact point; sliding is 0.5 m/s
WANTED = {"squeals": 20, "squeals if kicked": 20, "silent": 20}
BRAKE = """
[model]
name = "disc_brake"
mesh = "{mesh}"
contact_points = 2
[parameters]
sliding_speed = 0.5
friction = 0.5
pressure = 12e5
"""
NOMINAL = {"friction": 0.5, "pressure": 12e5} | dict.fromkeys(list(RANGES)[2:], 1.0)
# designs of every study: the reduction is made for the range of pressure, and shall be one
ENDS = [{**NOMINAL, "pressure": pressure} for pressure in RANGES["pressure"]]
IN_TIME = """
[transient]
duration = {duration}
step = 2e-6
save_every = 10
stop = "settled"
sensors = [500.0, 8000.0]
slope_pilot = "never"
"""
ALONE = "track = false\nrefine_onsets = false\n"  # complex modes of single designs
KEPT = [
    "class",
    "n_unstable",
    "torque_rms",
    "torque_rms_low",
    "torque_rms_high",
    "torque_line_hz",
]


def drawn(count: int, seed: int) -> pd.DataFrame:
    """Designs, shape (count, 4), of low discrepancy."""
    unit = qmc.Sobol(len(RANGES), seed=seed).random(count)
    low, high = np.array(list(RANGES.values())).T
    return pd.DataFrame(np.round(low + unit * (high - low), 4), columns=list(RANGES))


def swept(designs: pd.DataFrame) -> str:
    """The sweeps of a study file over these designs, and the ends."""
    designs = pd.concat([designs, pd.DataFrame(ENDS)])
    sweeps = [
        f'[[sweep]]\nparameter = "{name}"\nvalues = {designs[name].tolist()}\n' for name in designs
    ]
    return '[design]\ntype = "zip"\n' + "".join(sweeps)


class Runs:
    """Studies in a folder, run once.

    Parameters
    ----------
    folder : Path
    jobs : int
        Worker processes.
    mesh : str
        Of the brake.
    duration : float
        Of a run at most, s.
    """

    def __init__(self, folder: Path, jobs: int, mesh: str, duration: float) -> None:
        self.folder, self.jobs, self.brake = folder, jobs, BRAKE.format(mesh=mesh)
        self.motion = IN_TIME.format(duration=duration)
        folder.mkdir(parents=True, exist_ok=True)

    def __call__(self, name: str, kind: str, text: str) -> squealstudy.Results:
        """Run a study, or read what it has found before."""
        path = self.folder / f"{name}.toml"
        path.write_text(f'[study]\nname = "{name}"\nkind = "{kind}"\n{text}')
        print(name, flush=True)
        return squealstudy.run(path, self.folder / name, jobs=self.jobs, yes=True)

    def in_time(self, name: str, designs: pd.DataFrame, start: str) -> pd.DataFrame:
        """One run a design: its class and level, in the order of the designs."""
        text = self.brake + swept(designs) + self.motion + start
        points = self(name, "transient", text).points.round(dict.fromkeys(designs, 4))
        rows = designs.reset_index().merge(points, on=list(designs), how="left", validate="1:1")
        return rows.set_index("index")[KEPT].assign(start=name.rpartition("-")[2])


def linearly_stable(designs: pd.DataFrame, runs: Runs) -> pd.Series:
    """Whether complex modes call each design stable."""
    text = runs.brake + swept(designs) + "[modes]\nband = [500.0, 8e3]\n" + ALONE
    points = runs("complex_modes", "complex_modes", text).points.round(dict.fromkeys(designs, 4))
    assert (points["status"] == "ok").all()
    rows = designs.reset_index().merge(points, on=list(designs), validate="1:1")
    return rows.set_index("index")["n_unstable"] == 0


def truth(
    designs: pd.DataFrame, stable: bool, runs: Runs, part: str, velocities: list[float]
) -> pd.DataFrame:
    """A row a design: its class, how each start ended, level and frequency of the loudest."""
    results = squealstudy.open_results(runs.folder / "nominal")
    point = results.points["point_id"].iloc[0]
    nominal = results.modes[results.modes["point_id"] == point]
    begin = f'start = "{runs.folder / "nominal"}"\nstart_point = "{point}"\n'
    ended = [runs.in_time(f"{part}-cycle", designs, begin)]
    if not stable:
        ended.append(runs.in_time(f"{part}-small", designs, ""))
    for frequency in KICKED if stable else ():
        nearest = (nominal["frequency_hz"] - frequency).abs().idxmin()
        for velocity in velocities:
            kick = f"perturbation = {velocity}\nperturb_modes = [{nominal['mode'][nearest]}]\n"
            ended.append(runs.in_time(f"{part}-{frequency:g}_Hz_{velocity * 100:g}", designs, kick))
    every, rows = pd.concat(ended), []
    for index, design in designs.iterrows():
        mine = every.loc[[index]]
        lasting = mine[mine["class"].isin(SUSTAINED)]
        if (mine["n_unstable"] > 0).any():  # in the basis of the runs, which may differ
            verdict = "squeals"
        elif len(lasting):
            verdict = "squeals if kicked"
        else:
            verdict = "silent" if (mine["class"] == STABLE).all() else "undecided"
        loudest = lasting.nlargest(1, "torque_rms")[KEPT]
        level = loudest.iloc[0].to_dict() if len(loudest) else {}
        starts = " ".join(
            f"{start}:{found}" for start, found in mine[["start", "class"]].to_numpy()
        )
        rows.append({**design, "truth": verdict, **level, "starts": starts})
    return pd.DataFrame(rows, index=designs.index)


def main() -> None:
    """Take designs in turn until there are enough of each class."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--mesh", default="coarse", help="of the brake")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draw", type=int, default=256, help="designs at most")
    parser.add_argument("--portion", type=int, default=20, help="designs of one study")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kicks", type=float, nargs="*", default=list(VELOCITIES), help="m/s")
    parser.add_argument("--duration", type=float, default=0.2, help="of a run at most, s")
    arguments = parser.parse_args()
    runs = Runs(arguments.folder.resolve(), arguments.jobs, arguments.mesh, arguments.duration)
    nominal = runs.brake + swept(pd.DataFrame([NOMINAL])) + runs.motion + "perturbation = 1e-2\n"
    runs("nominal", "transient", nominal)
    designs, tables = drawn(arguments.draw, arguments.seed), []
    stable = linearly_stable(designs, runs)
    print(f"{stable.sum()} of {len(designs)} designs are linearly stable", flush=True)
    kinds = {True: designs[stable], False: designs[~stable][: WANTED["squeals"]]}
    for sign, mine in sorted(kinds.items()):  # unstable ones first: they are few runs
        for begin in range(0, len(mine), arguments.portion):
            part = f"{'stable' if sign else 'unstable'}{begin:03}"
            portion = mine[begin : begin + arguments.portion]
            tables.append(truth(portion, sign, runs, part, arguments.kicks))
            table = pd.concat(tables)
            table.to_csv(arguments.folder / "truth.csv", index_label="design")
            counts = table["truth"].value_counts()
            print(counts.to_string(), flush=True)
            if sign and all(counts.get(n, 0) >= k for n, k in WANTED.items() if n != "squeals"):
                break


if __name__ == "__main__":
    main()
