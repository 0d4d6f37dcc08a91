"""Sensitivities of small models against central differences of numpy's roots.

Run:  python studies/benchmarks/mode_slopes.py [--seed 1] [--number 40]

Each case is a study file of one of the models of `small_models.py`, run as a user runs it. Held
against numpy: the roots, derivatives of growth, frequency and damping ratio, what they are of a
percent, the finite changes (of the root that is followed there in small steps), and for friction,
in which the pencil is linear, the range of validity. `near_coalescence` flags a number.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
from mode_tables import Told
from small_models import FALL, HZ, MODELS, OWN_DAMPING, STATE, STRUCTURE, SmallModel, random_model

from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.face import read_study

STEP = 1e-4  # of a value: of central differences
SUBSTEPS = 200  # in which a root is followed over a finite change
CLOSE = 1e-4  # of a slope's size, beside what the two differences differ by
PATH_CLOSE = 1e-6  # of a modulus: two ways to one root
RANGE_CLOSE = 0.02  # of the range of validity: second differences
CHANGE = 0.01
TEXT = """\
[study]
name = "slopes"
kind = "sensitivity"
[model]
name = "{name}"
{parameters}[sensitivity]
modes = 2
change = {change}
parameters = [{asked}]
[modes]
band = [1.0, 1000.0]
"""
FIGURES = ("growth_rate", "frequency_hz", "damping_ratio")


def figures(lam: complex) -> np.ndarray:
    """Growth [1/s], frequency [Hz] and damping ratio of a root."""
    return np.array([lam.real, abs(lam) / HZ, -lam.real / abs(lam)])


def nearest(roots: np.ndarray, lam: complex) -> complex:
    """The root next to a value; NaN where there is none."""
    return complex(roots[np.argmin(np.abs(roots - lam))]) if len(roots) else complex(np.nan)


def slope_numbers(model: SmallModel, folder: Path) -> Iterator[Told]:
    """All numbers of the table of sensitivities of a model."""
    asked = [*STATE, *STRUCTURE[model.name], *OWN_DAMPING]
    if model.given[FALL[0]] > 1.0:
        asked += FALL
    text = TEXT.format(
        name=model.name,
        parameters=model.parameters(),
        change=CHANGE,
        asked=", ".join(f'"{n}"' for n in asked),
    )
    path = folder / "slopes.toml"
    path.write_text(text)
    run_study(read_study(path).plan(), folder / "slopes", jobs=1)
    results = Results.open(folder / "slopes")
    point = results.points.iloc[0]
    oscillating = len(model.roots())
    right = point["status"] == "ok" and point["n_modes"] >= oscillating
    yield Told("sensitivity points", "n_modes", point["n_modes"], oscillating, bool(right))
    for row in results.sensitivities.to_dict("records"):
        yield from _row_numbers(model, row)


def _row_numbers(model: SmallModel, row: dict) -> Iterator[Told]:
    """A mode's sensitivity to one parameter."""
    name, size = row["parameter"], row["change"]
    value = model.given[name] if name in model.given else model.given["damping_ratio"]
    lam = complex(-row["damping_ratio"], np.sqrt(max(0.0, 1.0 - row["damping_ratio"] ** 2)))
    lam *= HZ * row["frequency_hz"]
    own = nearest(model.roots(), lam)
    at, flagged = f"{model.name} {name}", bool(row["near_coalescence"])
    right = abs(own - lam) <= 1e-9 * abs(own)
    yield Told("sensitivities", "root", row["growth_rate"], own.real, right, flagged, at)
    right = abs(row["value"] - value) <= 1e-12 * abs(value)
    yield Told("sensitivities", "value", row["value"], value, right, False, at)
    expected = CHANGE * (1.0 if "damping_ratio" in name else value)
    if expected:  # of a stiffness damping of zero it is what adds as much at the band's top
        right = abs(size - expected) <= 1e-12 * expected
        yield Told("sensitivities", "change", size, expected, right, False, at)
    true, doubt = _slopes(model, name, value, own)
    scale = np.array([abs(own), abs(own) / HZ, 1.0]) / max(abs(value), STEP)
    for k, figure in enumerate(FIGURES):
        told = row[f"d_{figure}"]
        allowed = doubt[k] + CLOSE * abs(true[k]) + 1e-8 * scale[k]
        right = abs(told - true[k]) <= allowed
        yield Told("sensitivities", f"d_{figure}", told, true[k], right, flagged, at)
    hundredth = 0.01 * size / CHANGE  # of what counts as 100 %
    told, percent = row["growth_per_percent"], hundredth * true[0]
    right = abs(told - percent) <= hundredth * (doubt[0] + CLOSE * abs(true[0]) + 1e-8 * scale[0])
    yield Told("sensitivities", "growth_per_percent", told, percent, right, flagged, at)
    end = own
    for part in np.linspace(0.0, 1.0, SUBSTEPS + 1)[1:]:
        end = nearest(model.roots(**{name: value + part * size}), end)
    moved = figures(end) - figures(own)
    for figure, k in (("growth", 0), ("frequency", 1), ("damping", 2)):
        told = row[f"finite_{figure}_change"]
        allowed = PATH_CLOSE * (abs(own), abs(own) / HZ, 1.0)[k]
        right = abs(told - moved[k]) <= allowed + 1e-6 * abs(moved[k])
        yield Told("sensitivities", f"finite_{figure}", told, moved[k], right, flagged, at)
    if name == "friction" and model.given[FALL[0]] == 1.0:
        yield _validity(model, own, row, flagged, at)


def _slopes(
    model: SmallModel, name: str, value: float, own: complex
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the figures by central differences, extrapolated, and how far they differ."""
    found = []
    for h in (STEP * max(abs(value), STEP), 0.5 * STEP * max(abs(value), STEP)):
        up, down = (nearest(model.roots(**{name: value + s * h}), own) for s in (1, -1))
        found.append((figures(up) - figures(down)) / (2 * h))
    return (4.0 * found[1] - found[0]) / 3.0, np.abs(found[1] - found[0])


def _validity(model: SmallModel, own: complex, row: dict, flagged: bool, at: str) -> Told:
    """Where half the second derivative times the range is a quarter of the first."""
    value, h = model.given["friction"], 2e-4
    up, down = (nearest(model.roots(friction=value + s * h), own) for s in (1, -1))
    first, second = (up - down) / (2 * h), (up - 2 * own + down) / h**2
    truth = 0.25 * abs(first) / (0.5 * abs(second))
    told = row["validity_range"]
    right = abs(told - truth) <= RANGE_CLOSE * truth
    return Told("sensitivities", "validity_range", told, truth, right, flagged, at)


def random_numbers(seed: int, number: int) -> Iterator[Told]:
    """All numbers of case `number` of a seed."""
    rng = np.random.default_rng([seed, number])
    with tempfile.TemporaryDirectory() as folder:
        model = random_model(rng, MODELS[number % len(MODELS)])
        yield from slope_numbers(model, Path(folder))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=40, help="of cases")
    options = parser.parse_args()
    rows = []
    for k in range(options.number):
        for t in random_numbers(options.seed, k):
            rows.append({"case": k, **vars(t)})
            if not t.right:
                word = " (flagged)" if t.flagged else ""
                print(f"{k} {t.column} told {t.told:.9g}, true {t.truth:.9g} ({t.at}){word}")
    table = pd.DataFrame(rows)
    wrong = ~table["right"]
    table = table.assign(wrong=wrong & ~table["flagged"], doubted=wrong & table["flagged"])
    print(table.groupby("column")[["right", "wrong", "doubted"]].sum().to_string())


if __name__ == "__main__":
    main()
