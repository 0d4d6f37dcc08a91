"""`squealstudy models`."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from squealstudy.analysis.tables.digits import in_digits
from squealstudy.cli import screen
from squealstudy.errors import SquealstudyError
from squealstudy.linalg.real_modes import real_modes, rigid_modes
from squealstudy.models.catalogue import MODEL_NAMES, MODELS
from squealstudy.models.expression import CONSTANTS
from squealstudy.models.expression_tree import FUNCTIONS
from squealstudy.models.matrix_family import DESCRIPTION
from squealstudy.models.matrix_family import NAME as MATRICES
from squealstudy.models.matrix_files import READERS
from squealstudy.models.parameter import ModelDefinition

MODE_PARAMETERS = (
    ("<component>.modes[N].frequency_scale", "1", "factor on a free-free frequency; N, N-M or N,M"),
    ("<component>.modes[N].damping_ratio", "0", "damping ratio of a free-free mode"),
    ("modes[N].damping_ratio", "damping_ratio", "the same of a real mode of the assembly"),
)

CONTRACT = f"""\
lambda^2 M(p) + lambda C(p) + K(p), each a sum of the terms that the study lists:

[model]
name = "matrices"
folder = "..."                 # of the files, beside the study without it; or $SQUEALSTUDY_DATA

[[model.term]]
matrix = "C"                   # M | C | K
file = "gyroscopic.mat"        # {" ".join(e for endings in READERS for e in endings)}
variable = "G"                 # where the file holds several
coefficient = "omega/(2*pi)"   # number or expression, default 1

[parameters]
omega = 12.6                   # every name in a coefficient is a parameter and has its value here

Expressions: + - * / ** and brackets; {", ".join(CONSTANTS)}; {", ".join(FUNCTIONS)}.
Such a model has no contact, components or energies: it is solved at full order, tracked, ranked and
drawn, but not integrated in time."""


def models_command(name: str | None, modes: bool, cutoff: float) -> None:
    """List the models, or describe one."""
    if name is None:
        rows = [(m.name, m.description) for m in MODELS.values()]
        screen.facts([*rows, (MATRICES, DESCRIPTION)])
        screen.console.print("\nsquealstudy models NAME lists parameters, components and modes.")
        return
    if name == MATRICES:
        screen.console.print(f"{MATRICES}: {DESCRIPTION}\n\n{CONTRACT}")
        return
    if name not in MODELS:
        raise SquealstudyError(f"unknown model '{name}', expected {', '.join(MODEL_NAMES)}")
    model = MODELS[name]
    screen.console.print(f"{model.name}: {model.description}\n")
    _options(model)
    _parameters(model)
    if modes:
        _components(model, cutoff)


def _grid(*titles: str) -> Table:
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in titles:
        grid.add_column(title, overflow="fold")
    return grid


def _options(model: ModelDefinition) -> None:
    if not model.options:
        return
    grid = _grid("option of [model]", "default", "others", "")
    for option in model.options:
        first, *others = (str(c) for c in option.choices)
        grid.add_row(option.name, first, ", ".join(others), option.description)
    screen.console.print(grid, "")


def _parameters(model: ModelDefinition) -> None:
    grid = _grid("parameter", "default", "unit", "")
    for p in model.parameters:
        note = (
            " (new reduction)" if p.structural and "mesh" in {o.name for o in model.options} else ""
        )
        grid.add_row(p.name, f"{p.default:g}", p.unit or "-", p.description + note)
    for row in MODE_PARAMETERS:
        grid.add_row(row[0], row[1], "-", row[2])
    screen.console.print(grid, "")


def _components(model: ModelDefinition, cutoff: float) -> None:
    """Build the default model and list its components' free-free modes."""
    options = {o.name: o.choices[0] for o in model.options}
    assembly = model.build(options, model.defaults())
    grid = _grid("component", "DOF", "free-free modes, Hz (number: frequency, rigid ones first)")
    for c in assembly.components:
        omega, _ = real_modes(c.M, c.K, cutoff)
        f = omega / (2 * np.pi)
        rigid = rigid_modes(c.M, c.K, omega)
        elastic = ", ".join(f"{j + 1}: {in_digits(f[j])}" for j in range(rigid, len(f)))
        listed = f"1-{rigid}: rigid" if rigid > 1 else "1: rigid" if rigid else ""
        grid.add_row(c.name, str(c.n_dof), "; ".join(t for t in (listed, elastic) if t))
    screen.console.print(grid)
