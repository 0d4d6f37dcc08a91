"""Compares predictions (complex modes or limit cycles) with runs in time."""

from __future__ import annotations

from typing import Any, TypeVar

import pandas as pd

from squealstudy.engine.manifest import model_of
from squealstudy.engine.manifest_file import version_of
from squealstudy.engine.result_names import MANIFEST
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.models.operating import IN_TIME_ONLY
from squealstudy.models.parameter_names import (
    ADDED,
    DAMPING_RATIO,
    ModeParameter,
    parse_parameter,
)
from squealstudy.study.added_parts import named_mass
from squealstudy.study.design_sections import ADDED_MASS
from squealstudy.study.source import SourceText
from squealstudy.study.tabled import take_tables
from squealstudy.tables.comparison import compare
from squealstudy.tables.cycle_comparison import compare_cycles
from squealstudy.wording import units_of

AnyTables = TypeVar("AnyTables", bound=ResultTables)
PARAMETERS = "parameters"  # table of study files
LIMIT_CYCLES = "cycles"  # table that only results of limit cycles have
BOUNDS = {"low": "1/s", "high": "1/s"}  # of the fitted growth rate


def compare_results(first: ResultTables, second: ResultTables) -> pd.DataFrame:
    """Compare a study in time with one of complex modes or limit cycles, in either order.

    Raises ResultsError unless there is one of each, of the same model, with common design points.
    """
    frequency, transient = in_order(first, second)
    models = [r.manifest["model"] for r in (frequency, transient)]
    if models[0] != models[1]:
        raise ResultsError(
            f"{frequency.directory} is of model '{models[0]}', {transient.directory} of "
            f"'{models[1]}': expected two studies of one model"
        )
    files = [model_files(r) for r in (frequency, transient)]
    if files[0] != files[1]:
        raise ResultsError(
            f"{frequency.directory} and {transient.directory} have different model files or "
            "meshes: expected two studies of one model"
        )
    frequency_options, time_options = (
        r.manifest.get("options", {}) for r in (frequency, transient)
    )
    odd = sorted(
        k
        for k in frequency_options.keys() | time_options.keys()
        if frequency_options.get(k) != time_options.get(k)
    )
    if odd:
        differences = ", ".join(
            f"{k} {frequency_options.get(k)} and {time_options.get(k)}" for k in odd
        )
        raise ResultsError(f"the two studies differ in the options of their model: {differences}")
    tables = [_followed(r) for r in (frequency, transient)]
    if odd := sorted(
        k for k in tables[0].keys() | tables[1].keys() if tables[0].get(k) != tables[1].get(k)
    ):
        raise ResultsError(
            f"the two studies differ in the table that {odd[0]} follows, or one has none: expected "
            "the same values at each design point"
        )
    ours, theirs = (
        [n for n in r.parameters if n not in IN_TIME_ONLY] for r in (frequency, transient)
    )
    nominal = {n: value_elsewhere(transient, n) for n in ours if n not in theirs}
    nominal |= {n: value_elsewhere(frequency, n) for n in theirs if n not in ours}
    if LIMIT_CYCLES in frequency.tables:
        table = compare_cycles(
            frequency.points,
            frequency.table(LIMIT_CYCLES),
            transient.points,
            ours,
            theirs,
            nominal,
        )
    else:
        table = compare(
            frequency.points,
            frequency.modes,
            transient.points,
            transient.growth,
            ours,
            theirs,
            nominal,
        )
    table.attrs["parameters"] = list(dict.fromkeys([*theirs, *ours]))
    table.attrs["units"] = units_of(table.columns, frequency.units | transient.units | BOUNDS)
    return table


def in_order(first: AnyTables, second: AnyTables) -> tuple[AnyTables, AnyTables]:
    """The study of complex modes or limit cycles, then the one in time; ResultsError for others."""
    for frequency, transient in ((first, second), (second, first)):
        predicts = {"onsets", LIMIT_CYCLES} & set(frequency.tables)
        if predicts and "growth" in transient.tables:
            return frequency, transient
    kinds = ", ".join(f"{r.directory} is {r.kind}" for r in (first, second))
    raise ResultsError(
        "expected results of kind complex_modes or limit_cycles and of kind transient, or two of "
        f"complex_modes, but {kinds}"
    )


def _followed(results: ResultTables) -> dict[str, Any]:
    """The tables in [parameters] of a study, by the name of what follows them."""
    text = str(results.manifest.get("study", "")) if results.manifest.get("tables") else ""
    source = SourceText(results.directory / MANIFEST, text)
    return {name: table for _, name, table in take_tables(source.tables)[1]}


def model_files(results: ResultTables) -> list[str]:
    """Hashes of a model's files; empty for a model without files.

    Masses that the study adds by name are left out: they are parameters, not files.
    """
    named = [n for n in results.fact("nominal") if n.startswith(ADDED_MASS)]
    source = SourceText(results.directory / MANIFEST, "")
    masses = {named_mass(n, source, (PARAMETERS, n)).identity for n in named}
    files = (results.manifest.get("model_file") or {}).get("files", [])
    return [file_hash for file_hash in files if file_hash not in masses]


def value_elsewhere(results: ResultTables, name: str) -> float:
    """The value of a parameter in a study that does not sweep it.

    An added mass that the study does not name is 0.
    """
    model = model_of(results.manifest)
    declared = {parameter.name for parameter in model.parameters}
    if name.split(".")[0] in ADDED and name not in declared:
        return float(results.fact("nominal").get(name, 0.0))
    parameter = parse_parameter(name, model)
    values = model.defaults(version_of(results.manifest)) | results.fact("nominal")
    if isinstance(parameter, ModeParameter) and not parameter.component:  # instead of the uniform
        return float(values.get(DAMPING_RATIO, parameter.default))
    return float(values.get(name, parameter.default))
