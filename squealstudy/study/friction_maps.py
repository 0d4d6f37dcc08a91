"""Friction over speed and pressure in a study file, as lists or as a file of points.

[parameters.friction_law.map]
speed = ["2 cm/s", "50 cm/s", 2.0]     # m/s
pressure = ["2 bar", "20 bar"]         # of the contact, Pa
ratio = [[1.5, 1.1, 1.0], [1.3, 1.0, 0.9]]   # over the parameter friction: a row for each pressure

or file = "mu.csv" with the columns speed, pressure and ratio and a line for each point.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from squealstudy.errors import ModelError
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import KeyPath
from squealstudy.wording import listed, shown

SECTION, LAW, MAP, FILE = "parameters", "friction_law", "map", "file"
COLUMNS = ("speed", "pressure", "ratio")
LIMITS = {"speed": 6, "pressure": 4}  # most values, for which the law has parameters
KEYS: KeyPath = (SECTION, LAW, MAP)


def with_map(tables: Mapping[str, Any], source: SourceText) -> Mapping[str, Any]:
    """A study file's tables with parameters of the friction law in place of a friction map.

    Raises
    ------
    StudyFileError
        The map has wrong keys or sizes; its file cannot be read or lacks points.
    """
    written = _map_of(tables)
    if written is None:
        return tables
    if not isinstance(written, Mapping):
        raise source.error(KEYS, f"expected a table of {listed(COLUMNS)}, got {shown(written)}")
    if FILE in written:
        if len(written) > 1:
            raise source.error(KEYS, f"expected file alone, or {listed(COLUMNS)}")
        return _with_values(tables, _of_file(written[FILE], source), source)
    if set(written) != set(COLUMNS):
        raise source.error(KEYS, f"expected {listed(COLUMNS)}, or file; got {listed([*written])}")
    speeds, pressures, rows = (written[key] for key in COLUMNS)
    for key in LIMITS:
        if not isinstance(written[key], list) or not 1 <= len(written[key]) <= LIMITS[key]:
            text = f"expected a list of 1 to {LIMITS[key]} values, got {shown(written[key])}"
            raise source.error((*KEYS, key), text)
    if not isinstance(rows, list) or len(rows) != len(pressures):
        text = f"expected {len(pressures)} lists of {len(speeds)} ratios, one for each pressure"
        raise source.error((*KEYS, "ratio"), text)
    for number, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != len(speeds):
            text = f"expected {len(speeds)} ratios, one for each speed, got {shown(row)}"
            raise source.error((*KEYS, "ratio", number), text)
    return _with_values(tables, _law_values(speeds, pressures, rows), source)


def recorded_map(tables: Mapping[str, Any], nominal: Mapping[str, float]) -> Mapping[str, Any]:
    """The study tables of results, with the values that the file of a map had in that run."""
    written = _map_of(tables)
    if not isinstance(written, Mapping) or FILE not in written:
        return tables
    first = f"{LAW}.{MAP}_"
    values = {k.removeprefix(f"{LAW}."): v for k, v in nominal.items() if k.startswith(first)}
    return _replaced(tables, values)


def _map_of(tables: Mapping[str, Any]) -> Any:
    """What a study file writes as friction map; None without one."""
    parameters = tables.get(SECTION)
    laws = parameters.get(LAW) if isinstance(parameters, Mapping) else None
    return laws.get(MAP) if isinstance(laws, Mapping) else None


def _law_values(speeds: list[Any], pressures: list[Any], rows: list[Any]) -> dict[str, Any]:
    """Values of the parameters of the friction law, by their names after friction_law."""
    return {
        **{f"{MAP}_speed_{k}": speed for k, speed in enumerate(speeds, 1)},
        **{f"{MAP}_pressure_{j}": pressure for j, pressure in enumerate(pressures, 1)},
        **{
            f"{MAP}_ratio_{k}_{j}": ratio
            for j, row in enumerate(rows, 1)
            for k, ratio in enumerate(row, 1)
        },
    }


def _of_file(name: Any, source: SourceText) -> dict[str, Any]:
    """Values of the law's parameters from a file of points."""
    from squealstudy.models.number_table import read_columns

    keys = (*KEYS, FILE)
    if not isinstance(name, str):
        raise source.error(keys, f"expected the name of a file, got {shown(name)}")
    try:
        _, rows = read_columns(source.path.parent / name, COLUMNS)
    except ModelError as error:
        raise source.error(keys, str(error)) from None
    ratios = {(speed, pressure): ratio for speed, pressure, ratio in rows}
    speeds, pressures = (sorted({row[column] for row in rows}) for column in (0, 1))
    if len(ratios) < len(rows) or len(ratios) != len(speeds) * len(pressures):
        text = f"{len(rows)} points, of {len(speeds)} speeds and {len(pressures)} pressures"
        raise source.error(keys, f"{name}: {text}: expected each speed once at each pressure")
    for key, knots in (("speed", speeds), ("pressure", pressures)):
        if len(knots) > LIMITS[key]:
            text = f"{len(knots)} values of {key}, expected at most {LIMITS[key]}"
            raise source.error(keys, f"{name}: {text}")
    return _law_values(speeds, pressures, [[ratios[s, p] for s in speeds] for p in pressures])


def _with_values(
    tables: Mapping[str, Any], values: Mapping[str, Any], source: SourceText
) -> Mapping[str, Any]:
    twice = [name for name in tables[SECTION][LAW] if name in values]
    if twice:
        raise source.error((SECTION, LAW, twice[0]), "it is given in friction_law.map already")
    return _replaced(tables, values)


def _replaced(tables: Mapping[str, Any], values: Mapping[str, Any]) -> Mapping[str, Any]:
    others = {k: v for k, v in tables[SECTION][LAW].items() if k != MAP}
    return {**tables, SECTION: {**tables[SECTION], LAW: {**others, **values}}}
