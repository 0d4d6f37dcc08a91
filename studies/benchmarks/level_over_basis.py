"""How the limit-cycle level depends on the basis: every modal basis against the hybrid model.

Run:  python studies/benchmarks/level_over_basis.py [--mesh coarse] [--duration 0.06] [--only ...]

The brake at 12 bar and friction 0.5 with 2 x 2 contact points a facet, step 2 us, structural
damping 0.5 % and a stiffness-proportional part of 1.5e-7 s (the same in every representation), from
one and the same perturbation into the limit cycle; levels are those of the last 40 %. Beside it two
other design points; POD vectors are trained at the first and the last of the three. Prints a table
and draws level_over_basis.png in the current directory. Results are kept in
results/level_over_basis/, so a second run only prints.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.machine.resources import cores
from squealstudy.study.definition import parse_study

REFERENCE = "hybrid, 1 layer"
VARIANTS = {
    REFERENCE: ("", 'representation = "hybrid"'),
    "all, enrichment to 3e-5": ("tolerance = 3e-5", ""),
    "all, enrichment to 1e-3": ("tolerance = 1e-3", ""),
    "all, no enrichment": ("enrichment = false", ""),
    "modes below 24 kHz": ("", "modes_below = 24e3"),
    "modes below 16 kHz": ("", "modes_below = 16e3"),
    "modes below 8 kHz": ("", "modes_below = 8e3"),
    "below 16 kHz, 50 POD": ("", "modes_below = 16e3\npod_vectors = 50"),
    "below 8 kHz, 50 POD": ("", "modes_below = 8e3\npod_vectors = 50"),
    "below 8 kHz, 80 POD": ("", "modes_below = 8e3\npod_vectors = 80"),
    "below 8 kHz, 120 POD": ("", "modes_below = 8e3\npod_vectors = 120"),
}
STUDY = """
[study]
name = "{name}"
kind = "transient"
[model]
name = "disc_brake"
mesh = "{mesh}"
contact_points = 2
[parameters]
damping_ratio = 0.005
stiffness_damping = 1.5e-7
[[sweep]]
parameter = "friction"
values = [0.5, 0.45, 0.4]
[[sweep]]
parameter = "pressure"
values = [12e5, 10e5, 8e5]
[design]
type = "zip"
[reduction]
{reduction}
[transient]
duration = {duration}
step = 2e-6
perturbation = 0.02
save_every = 0
{transient}
"""


@dataclass(frozen=True)
class Variant:
    """One basis as study text."""

    label: str
    text: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", default="coarse")
    parser.add_argument("--duration", type=float, default=0.06, help="s")
    parser.add_argument("--jobs", type=int, default=cores())
    parser.add_argument("--only", nargs="+", default=list(VARIANTS))
    options = parser.parse_args()
    rows = [row for v in variants(options) for row in solved(v, options.mesh, options.jobs)]
    table = with_deviations(pd.DataFrame(rows))
    print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
    chart(table, Path("level_over_basis.png"))


def variants(options: argparse.Namespace) -> list[Variant]:
    return [
        Variant(
            label,
            STUDY.format(
                name=label.translate(str.maketrans(" ,", "__")).replace("__", "_"),
                mesh=options.mesh,
                duration=options.duration,
                reduction=VARIANTS[label][0],
                transient=VARIANTS[label][1],
            ),
        )
        for label in options.only
    ]


def solved(variant: Variant, mesh: str, jobs: int) -> list[dict[str, object]]:
    plan = Plan(parse_study(variant.text, Path("level_over_basis.py")))
    directory = Path("results/level_over_basis") / mesh / plan.study.name
    run_study(plan, directory, jobs)
    points = Results.open(directory).points
    steps = plan.study.section.duration / plan.study.section.step
    return [
        {
            "basis": variant.label,
            "friction": p["friction"],
            "DOF": p["n_coordinates"],
            "growth": p["growth_rate"],
            "forecast": p["predicted_growth_rate"],
            "mean": p["torque_mean"],
            "RMS": p["torque_rms"],
            "low": p["torque_rms_low"],
            "high": p["torque_rms_high"],
            "Hz": p["torque_line_hz"],
            "class": p["class"] if p["status"] == "ok" else p["status"],
            "us a step": 1e6 * p["wall_s"] / steps,
        }
        for p in points.to_dict("records")
    ]


def with_deviations(table: pd.DataFrame) -> pd.DataFrame:
    """Deviation of RMS and growth from the hybrid model at the same design point, %."""
    truth = table[table["basis"] == REFERENCE].set_index("friction")
    for name in ("growth", "RMS"):
        if len(truth):
            reference = table["friction"].map(truth[name])
            table[f"{name} dev %"] = 100 * (table[name] / reference - 1)
    return table


def chart(table: pd.DataFrame, path: Path) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained", sharey=True)
    labels = list(dict.fromkeys(table["basis"]))
    for panel, name in zip(axes, ("RMS", "growth"), strict=True):
        for friction, marker in zip((0.5, 0.45, 0.4), "osv", strict=True):
            rows = table[table["friction"] == friction]
            column = f"{name} dev %"
            if column not in rows:
                continue
            place = [labels.index(b) for b in rows["basis"]]
            panel.plot(rows[column], place, marker, label=f"friction {friction}")
        panel.axvline(0.0, color="0.3", lw=1)
        limit = 10.0 if name == "RMS" else 1.0
        panel.axvspan(-limit, limit, color="0.93", zorder=0)
        panel.set_xlabel(f"{name}: deviation from the hybrid model [%]")
        panel.set_yticks(range(len(labels)), labels)
        panel.grid(True, color="0.9")
    axes[0].invert_yaxis()
    axes[0].legend()
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    main()
