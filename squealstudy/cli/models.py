"""What `squealstudy models` prints of a model: options, parameters, components, their modes."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.console import RenderableType

from squealstudy.face_model import Model
from squealstudy.laws.friction.map import SERIES
from squealstudy.models.matrices.expression import CONSTANTS, FUNCTIONS
from squealstudy.models.matrices.files import READERS
from squealstudy.screen import grid
from squealstudy.study.design_sections import ADDED_MASS
from squealstudy.wording import in_digits

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
drawn, but not integrated in time. Matrices with [[contact]]: squealstudy models lumped."""

LUMPED = """\
masses, springs, dampers, contact points and loads of a file, which a study names:

[model]
file = "groan.toml"            # a file with [[mass]] or [[term]] is a lumped model

[[mass]]     name, mass [kg] or inertia [kg m2], directions (of x, y, z, rx, ry, rz), place,
             spin [kg m2 rad/s] about spin_axis: gyroscopic terms
[[spring]]   between (two masses, or one and "ground"), direction, stiffness, cubic [N/m3], gap,
             side (tension, compression: of one side), at
[[damper]]   between, direction, damping, cubic, at
[[contact]]  between (a mass and "belt", "disc" or a mass), normal, sliding, stiffness or area,
             gap, friction (false: "ground" too; a number: its own), friction_law (own numbers:
             {static_ratio = 1.5}), speed_factor, radius, at; state (stuck, sliding: of a bracket
             or pin, "ground" too), tangential [N/m]
[[load]]     on, direction, force [N] or area [m2], on which the parameter pressure acts
[parameters] NAME = {default, unit, description, minimum, maximum}, or friction = 0.4 and others
             of the operating point with other defaults

In place of masses there may be matrices, symmetric, of 500 coordinates at most:

coordinates = ["pad_x", "pad_y"]  # names of the rows, if they have any
[[term]]     matrix (M, C, K; G: gyroscopic), file, variable, coefficient
[[contact]]  normal, sliding, across;  [[spring]], [[damper]], [[load]]  along: each a coordinate
             ("pad_y", or its number from 1; "-pad_y"), two (["pad_y", "disc_y"]: the first over the
             second), or a sum {pad_y = 1, disc_y = -0.5}; other keys as above

A direction is x, -x, ..., or components. Numbers are in SI units, or expressions of [parameters].
squealstudy new FILE --model lumped writes a study and such a file, squealstudy inspect MODEL tells
masses, springs and free frequencies, squealstudy models MODEL its parameters."""


def described(model: Model, modes: bool) -> Iterator[RenderableType]:
    """Tables of a model's options and parameters; with `modes` also of free-free modes."""
    yield f"{model.definition.name}: {model.definition.description}\n"
    options = model.options
    if len(options):
        rows = (
            [
                str(name),
                str(row["choices"][0]),
                ", ".join(map(str, row["choices"][1:])),
                row["description"],
            ]
            for name, row in options.iterrows()
        )
        yield grid("text:option of [model]", "text:default", "text:others", "text:", rows=rows)
        yield ""
    yield grid("text:parameter", "text:default", "text:unit", "text:", rows=_parameters(model))
    if modes:
        yield ""
        mesh = options["value"].get("mesh")
        of = "" if mesh is None else f" of the {mesh} mesh"
        titles = ("text:DOF", f"text:free-free modes{of}, Hz (number: frequency, rigid ones first)")
        yield grid("text:component", *titles, rows=_components(model.component_modes()))


def _parameters(model: Model) -> Iterator[list[str]]:
    """Rows of the table of parameters; of a series only the first parameter has a row."""
    named_by_first = {name for names in SERIES.values() for name in names}
    for name, row in model.parameters.iterrows():
        if name in named_by_first:
            continue
        series = SERIES.get(str(name), ("",))[-1].rpartition(".")[2]
        row["description"] += f"; and so on, to {series}" if series else ""
        note = " (new reduction)" if row["structural"] and model.definition.meshed else ""
        note += f"; with {row['laws']}" if row["laws"] else ""
        yield [str(name), f"{row['default']:g}", row["unit"] or "-", row["description"] + note]
    for name, default, text in MODE_PARAMETERS:
        yield [name, default, "-", text]
    if sets := model.definition.sets:
        text = f"in studies: a mass spread over a set, of {', '.join(sets)} (new reduction)"
        yield [f"{ADDED_MASS}<set>", "0", "kg", text]


def _components(modes: pd.DataFrame) -> Iterator[list[str]]:
    """Rows of the table of components, with their free frequencies."""
    for (name, n_dof), component_modes in modes.groupby(["component", "n_dof"], sort=False):
        rigid = int(component_modes["rigid"].sum())
        elastic = component_modes[~component_modes["rigid"]]
        pairs = zip(elastic["mode"], elastic["frequency_hz"], strict=True)
        listed = [f"1-{rigid}: rigid" if rigid > 1 else "1: rigid"] if rigid else []
        listed += [", ".join(f"{number}: {in_digits(hz)}" for number, hz in pairs)]
        yield [str(name), str(n_dof), "; ".join(text for text in listed if text)]
