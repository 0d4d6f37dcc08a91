"""Vermot des Roches et al. 2010, figures 5 to 16 on the coarse brake, and its claims beside ours.

Run:  python studies/paper/paper.py [--jobs 2]

From the top folder. The study files beside this script run without damping in the band, as in
the source, and once more with the damping that the brake is shipped with; their results are in
results/paper_*, and a second run goes on from them. Pictures go to results/paper/, small copies to
results/charts/, and the page of claims is studies/paper/README.md: page.txt with what the tables
say; nothing of that is written by hand but what VdR 2010 says.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.linalg as la
from claims import Claim, compared
from found import ALONE, DAMPING, GROUP, SCALE, VERDICTS, Answer, Found
from in_time import damped_runs
from matplotlib.figure import Figure

import squealstudy
from squealstudy import Results
from squealstudy.engine.mode_shapes import point_shapes
from squealstudy.engine.pictures import save_figure
from squealstudy.plots.style import COLOURS, finish, new_figure
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.shapes.picture import draw

HERE = Path(__file__).parent
FIGURES, CHARTS, PAGE = Path("results/paper"), Path("results/charts"), HERE / "README.md"
STUDIES = {
    "stability": "paper_stability",
    "sensitivity": "paper_sensitivity",
    "frequency": "paper_frequency",
    "damping": "paper_damping",
    "squeal": "paper_squeal",
    "damped": "paper_damped_squeal",
}
KICKED = 10.0  # times the start of `squeal`
SHIPPED = {
    f"parameters.{name}": None
    for name in ("damping_ratio", "modes[1-60].damping_ratio", "stiffness_damping")
}
SETTINGS = {"band": "none in the band, as in VdR 2010", "shipped": "as shipped"}
MODE = 7  # of the caliper: 13 of VdR 2010
TOPS = (8e3, 16e3, 24e3)  # Hz: bases of real modes of the assembly
WIDTH, KEPT = 640, 128  # of the small copies: pixels, colours


class Runs:
    """Studies of both settings, run once; what they took is kept in results/paper/cost.json.

    Parameters
    ----------
    jobs : int or None
        Worker processes.
    """

    def __init__(self, jobs: int | None) -> None:
        self.jobs, self.file = jobs, FIGURES / "cost.json"
        FIGURES.mkdir(parents=True, exist_ok=True)
        self.cost: dict[str, float] = (
            json.loads(self.file.read_text()) if self.file.exists() else {}
        )

    def __call__(self, study: squealstudy.face.Study) -> Results:
        """The results of a study; seconds of processor time of what is solved now are added."""
        name, before = str(study.tables["study"]["name"]), sum(os.times()[:4])
        print(name, flush=True)
        results = squealstudy.run(study, jobs=self.jobs, warn=print)
        if results.solved:
            self.cost[name] = self.cost.get(name, 0.0) + sum(os.times()[:4]) - before
            self.file.write_text(json.dumps(self.cost, indent=1))
        return results

    def found(self, setting: str) -> Found:
        """All results of a setting."""
        studies = {what: self.study(what, setting) for what in STUDIES}
        start = studies["squeal"].directory
        studies["damped"] = studies["damped"].with_({"transient.start": str(start)})
        again = studies["squeal"]
        again = again.with_(
            {
                "study.name": f"{again.tables['study']['name']}_kicked",
                "transient.perturbation": KICKED * again.tables["transient"]["perturbation"],
            }
        )
        results = {what: self(study) for what, study in studies.items()}
        kicked = self(again)
        return Found(**results, kicked=kicked, projection=projection(results["stability"])[0])

    @staticmethod
    def study(what: str, setting: str) -> squealstudy.face.Study:
        """A study file as it is, or with the shipped damping."""
        study = squealstudy.read_study(HERE / f"{STUDIES[what]}.toml")
        if setting == "band":
            return study
        return study.with_(SHIPPED | {"study.name": f"{STUDIES[what]}_{setting}"})


def nominal_row(results: Results) -> int:
    """Row of the design point at friction 0.5."""
    return int(np.flatnonzero(np.isclose(results.points["friction"], 0.5))[0])


def projection(results: Results) -> tuple[pd.DataFrame, list[tuple[str, np.ndarray]]]:
    """Caliper mode 7 on bases of real modes of the assembly about steady sliding at friction 0.5.

    Returns
    -------
    table : DataFrame
        A row a basis: MAC of the caliper's part with the mode, share of each component in the
        kinetic energy of the projection, and whether the basis leaves modes out (``truncated``).
    shapes : list of (basis, ndarray (n,))
        The mode and its projections, in component-mode coordinates, of unit mass.
    """
    source = point_shapes(results, nominal_row(results))
    model, (w2, phi) = source.model, la.eigh(source.system.K_sym)
    hz = np.sqrt(np.maximum(w2, 0.0)) / (2 * np.pi)
    mode = np.zeros(model.n)
    place = model.mode_coordinate("caliper", MODE)
    mode[place] = 1.0
    rows, shapes = [], [("the free caliper", mode)]
    for top in (*TOPS, np.inf):
        kept = phi[:, hz <= top]
        projected = kept @ (kept.T @ mode)
        shares = dict(
            zip(model.components, np.add.reduceat(projected**2, model.offsets[:-1]), strict=True)
        )
        total = sum(shares.values())
        name = f"modes below {top / 1e3:.0f} kHz" if np.isfinite(top) else "all coordinates"
        rows.append(
            {"basis": name, "truncated": kept.shape[1] < model.n}
            | {"mac": projected[place] ** 2 / shares["caliper"]}
            | {component: share / total for component, share in shares.items()}
        )
        shapes.append((name, projected))
    return pd.DataFrame(rows), shapes


def _free_hz(model: ReducedModel) -> float:
    return float(np.sqrt(model.k_el[model.mode_coordinate("caliper", MODE)]) / (2 * np.pi))


def figures(found: Found) -> Iterator[tuple[str, str, Figure]]:
    """Number, what it shows, and the picture of every figure."""
    stability, single = found.stability, {f"{GROUP}.{SCALE}": 1.0}
    row = nominal_row(stability)
    point = str(stability.points["point_id"].iloc[row])
    yield (
        "05",
        "Damping ratio over frequency at 12 bar.",
        stability.plot.stability_diagram(point_id=point),
    )
    own = stability.modes[stability.modes["point_id"] == point]
    own = own[~own["overdamped"]].nlargest(2, "growth_rate")
    for side, mode in zip("ab", own["mode"], strict=False):
        hz = own.loc[own["mode"] == mode, "frequency_hz"].iloc[0]
        yield f"06{side}", f"The mode at {hz:.0f} Hz.", draw(stability.shape(row, int(mode)))
    if len(found.sensitivity.sensitivities):
        yield "07", "Growth by component modes.", found.sensitivity.plot.sensitivity()
    along, both = f"{ALONE}.{SCALE}", (f"{ALONE}.{SCALE}", f"{GROUP}.{SCALE}")
    evolution = found.frequency.plot.evolution
    yield "08a", "Caliper mode 7 shifted alone.", evolution(along=along, fixed=single)
    yield "08b", "Caliper modes 7 to 9 shifted together.", evolution(along=both)
    along, both = f"{ALONE}.{DAMPING}", (f"{ALONE}.{DAMPING}", f"{GROUP}.{DAMPING}")
    evolution, single = found.damping.plot.evolution, {f"{GROUP}.{DAMPING}": 0.0}
    yield "09", "Caliper mode 7 damped alone.", evolution(along=along, fixed=single)
    yield "10", "Caliper modes 7 to 9 damped together.", evolution(along=both)
    yield "11", "Braking torque from the start to the cycle.", found.squeal.plot.torque_history()
    source = point_shapes(stability, row)
    table, shapes = projection(stability)
    lam = 2j * np.pi * _free_hz(source.model)
    for side, (name, u) in zip("ab", (shapes[0], shapes[1]), strict=True):
        # a projection is no mode and has no frequency: it moves as fast as the free caliper's
        fast = "" if side == "a" else ", at the frequency of the free caliper's mode"
        shape = source.motion(u.astype(complex), lam, f"caliper mode {MODE}, {name}{fast}")
        yield f"12{side}", f"Caliper mode {MODE}: {name}.", draw(shape)
    yield "13", "Shape kept, and what is left on other parts.", _projections(table)
    yield "14", "Torque with damping of 2, 5 and 10 %.", _torques(found)
    energies = found.damped.plot.modal_energies
    for number, group in (("15", False), ("16", True)):
        last = damped_runs(found, group)["point_id"].iloc[-1]
        which = "modes 7 to 9" if group else "mode 7 alone"
        yield (
            number,
            f"Energies of the assembly's modes, 10 % on {which}.",
            energies(point=str(last)),
        )


def _projections(table: pd.DataFrame) -> Figure:
    """MAC of the caliper's part, and kinetic energy of the others, by basis."""
    figure = new_figure(9.0, 3.4)
    left, right = figure.subplots(1, 2, sharey=True)
    place = np.arange(len(table))
    left.barh(place, table["mac"], color=COLOURS[1])
    left.set_yticks(place, table["basis"])
    finish(left, "MAC of the caliper's part with the free mode", "")
    for number, name in enumerate(("disc", "inner_pad", "outer_pad")):
        right.barh(
            place + 0.27 * (number - 1),
            100 * table[name],
            0.25,
            color=COLOURS[number + 2],
            label=name.replace("_", " "),
        )
    finish(right, "Share of the kinetic energy [%]", "")
    right.legend()
    return figure


def _torques(found: Found) -> Figure:
    """Torque over time: a row a ratio, mode 7 alone on the left, modes 7 to 9 on the right."""
    figure = new_figure(10.5, 6.4)
    both = [damped_runs(found, group).iloc[1:] for group in (False, True)]
    axes = figure.subplots(len(both[0]), 2, sharex=True, sharey=True, squeeze=False)
    for column, rows in enumerate(both):
        for place, row in enumerate(rows.to_dict("records")):
            history = found.damped.history(row["point_id"])
            axis = axes[place, column]
            axis.plot(1e3 * history["time"], history["torque"], color=COLOURS[1], linewidth=0.3)
            which = ("mode 7", "modes 7 to 9")[column]
            told = str(row["class"]).replace("_", " ")
            axis.set_title(f"{100 * row['x']:.0f} % on {which}: {told}", fontsize=9)
            finish(axis, "Time [ms]" if place == len(rows) - 1 else "", "Torque [N m]")
    return figure


def save(setting: str, number: str, figure: Figure) -> Path:
    """The picture in full, and the path of its small copy for the page."""
    from PIL import Image

    path, small = FIGURES / f"fig{number}_{setting}.png", CHARTS / f"paper_{number}_{setting}.png"
    save_figure(figure, path)
    with Image.open(path) as image:
        size = WIDTH, round(image.height * WIDTH / image.width)
        copied = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
        copied.quantize(KEPT, Image.Quantize.FASTOCTREE).save(small, optimize=True)
    return small


def page(
    found: Mapping[str, Found],
    pictures: Mapping[str, Sequence[tuple[str, str, Path]]],
    cost: Mapping[str, float],
) -> str:
    """The page of claims and pictures."""
    rows = compared(found)
    counts = [
        f"| {verdict} | {' | '.join(str(_count(rows, name, verdict)) for name in found)} |"
        for verdict in VERDICTS
    ]
    costs = (
        sum(v for name, v in cost.items() if ("_shipped" in name) == (setting == "shipped"))
        for setting in found
    )
    first = next(iter(found.values()))
    points = sum(len(r.points) for r in (first.stability, first.frequency, first.damping))
    text = (
        (HERE / "page.txt")
        .read_text(encoding="utf-8")
        .format(
            files=", ".join(f"[{name}]({name}.toml)" for name in STUDIES.values()),
            points=points,
            counts="\n".join(counts),
            costs=" | ".join(f"{seconds:.0f} s" for seconds in costs),
            claims="\n".join(_told(claim, told) for claim, told in rows),
            figures="\n".join(_shown(setting, shown) for setting, shown in pictures.items()),
        )
    )
    return text


def _told(claim: Claim, told: Mapping[str, Answer]) -> str:
    lines = [
        f"- {SETTINGS[name]}: **{verdict}**. {said[:1].upper()}{said[1:]}.\n"
        for name, (verdict, said) in told.items()
    ]
    return f"**{claim.figure}** {claim.text}\n\n{''.join(lines)}"


def _shown(setting: str, pictures: Sequence[tuple[str, str, Path]]) -> str:
    told = f"### Damping: {SETTINGS[setting]}\n"
    for number, what, path in pictures:
        named = f"VdR 2010, figure {number.lstrip('0')}: {what}"
        told += f"\n![{named}]({os.path.relpath(path, HERE)})\n\n{named}\n"
    return told


def _count(rows: Sequence[tuple[Claim, Mapping[str, Answer]]], setting: str, verdict: str) -> int:
    return sum(told[setting][0] == verdict for _, told in rows)


def main() -> None:
    """Run what is not there yet, draw, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--jobs", type=int, help="worker processes; as many as cores by default")
    arguments = parser.parse_args()
    runs = Runs(arguments.jobs)
    found = {setting: runs.found(setting) for setting in SETTINGS}
    pictures: dict[str, list[tuple[str, str, Path]]] = {}
    for setting, one in found.items():
        pictures[setting] = []
        for number, what, figure in figures(one):
            pictures[setting].append((number, what, save(setting, number, figure)))
    PAGE.write_text(page(found, pictures, runs.cost), encoding="utf-8")
    print(f"written: {PAGE}, pictures in {FIGURES} and {CHARTS}")


if __name__ == "__main__":
    main()
