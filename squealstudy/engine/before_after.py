"""Compares two studies of complex modes, before and after a change."""

from __future__ import annotations

import tomllib
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from squealstudy.engine.comparison import PARAMETERS, model_files, value_elsewhere
from squealstudy.engine.manifest import MATRICES_FOLDER, MATRIX_FILES
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.study.sweeps import RANDOM_DESIGNS
from squealstudy.tables.before_after import SIDES, UnstableModes, paired, unstable_modes
from squealstudy.tables.comparison import join_points
from squealstudy.tables.mode_ranking import line_codes
from squealstudy.wording import amount, shown, units_of

NAMES_ALONE = {("study", "name"), ("study", "description")}  # settings that change no result


def compare_modes(before: ResultTables, after: ResultTables) -> pd.DataFrame:
    """Effect of a change on the unstable modes (`tables.before_after.paired`).

    The table's `attrs` have ``points`` and ``failed``, the numbers of common design points that are
    compared and that failed in a study; ``along``, the parameter of the onsets, or None;
    ``changes``, texts on what differs between the study files; ``parameters`` and ``units``; and
    under each of SIDES a mapping with the numbers of ``unstable`` and ``uncertain`` points, of
    ``failed`` points on the lines of onsets, whether tables have ``knots`` between values of
    `along`, and its largest value ``top``.

    Raises
    ------
    ResultsError
        A study has a boundary design; bands or models differ; no design point is common, or none
        was solved in both studies.
    """
    both = (before, after)
    for results in both:
        if results.boundary is not None:
            raise ResultsError(f"{results.directory} is of a boundary design, expected a grid")
    _expect_alike("models", [r.manifest["model"] for r in both], both)
    _expect_alike(
        "bands, so that modes of one would seem silenced",
        ["{:g} to {:g} Hz".format(*r.fact("band_hz")) for r in both],
        both,
    )
    first, second = before.swept, after.swept
    nominal = {n: value_elsewhere(after, n) for n in first if n not in second}
    nominal |= {n: value_elsewhere(before, n) for n in second if n not in first}
    pairs = join_points(before.points, after.points, first, second, nominal, SIDES)
    status = [r.points["status"].to_numpy() for r in both]
    solved = [(i, k) for i, k in pairs if status[0][i] == status[1][k] == "ok"]
    if not solved:
        raise ResultsError("every common design point failed in one of the two studies")
    same = before.along == after.along
    drawn = {before.design, after.design} & set(RANDOM_DESIGNS)
    along = before.along if same and not drawn else None
    sides: list[UnstableModes] = []
    facts: dict[Hashable, Any] = {}
    for results, side, of in zip(both, SIDES, (0, 1), strict=True):
        points = results.points
        common = np.array([pair[of] for pair in solved])
        lines = _marked(common, len(points))
        if along is not None:
            joined = _marked(np.array([pair[of] for pair in pairs]), len(points))
            line, x = line_codes(points, along), points[along].to_numpy(float)
            within = (x >= x[joined].min()) & (x <= x[joined].max())
            lines = np.isin(line, line[joined]) & within
        sides.append(unstable_modes(points, results.modes, results.onsets, along, lines, common))
        facts[side] = {
            "unstable": sides[-1].unstable,
            "uncertain": sides[-1].uncertain,
            "failed": sides[-1].failed,
            "knots": along in results.manifest.get("knots_between", {}),
            "top": float(points[along][lines].max()) if along else np.nan,
        }
    table = paired(*sides)
    units = before.units | after.units
    of_onset = dict.fromkeys((n for n in table.columns if n.startswith("onset_")), "")
    of_onset |= dict.fromkeys((n for n in of_onset if "kind" not in n), units.get(along or "", ""))
    table.attrs |= facts | {
        "points": len(solved),
        "failed": len(pairs) - len(solved),
        "along": along,
        "changes": _changes(before, after),
        "parameters": list(first),
        "units": units_of(table.columns, units) | of_onset,
    }
    return table


def _marked(rows: np.ndarray, count: int) -> np.ndarray:
    is_named = np.zeros(count, dtype=bool)
    is_named[rows] = True
    return is_named


def _expect_alike(noun: str, texts: list[str], both: tuple[ResultTables, ResultTables]) -> None:
    if texts[0] != texts[1]:
        each = ", ".join(f"{r.directory}: {text}" for r, text in zip(both, texts, strict=True))
        raise ResultsError(f"the two studies have different {noun} ({each})")


def _changes(before: ResultTables, after: ResultTables) -> list[str]:
    """Texts on the differences of the study files, of the model's files and of versions."""
    both = (before, after)
    settings = [dict(_settings(tomllib.loads(str(r.fact("study"))))) for r in both]
    names = [n for n in dict.fromkeys([*settings[0], *settings[1]]) if n not in NAMES_ALONE]
    units = before.units | after.units
    texts = []
    for name in names:
        first, second = (of.get(name) for of in settings)
        if first != second and name == ("sweep",):
            texts.append("the sweeps")
        elif first != second:
            ends = (
                _setting_text(r, of, name, other.get(name), units)
                for r, of, other in zip(both, settings, settings[::-1], strict=True)
            )
            texts.append(f"{'.'.join(name)} {' -> '.join(ends)}")
    files = [model_files(r) for r in both]
    texts += ["the files of the model"] if files[0] != files[1] else []
    if all(MATRICES_FOLDER in r.manifest for r in both):
        matrices = [r.manifest.get(MATRIX_FILES, []) for r in both]
        if not all(matrices):  # results of an earlier version
            texts.append("perhaps the files of the matrices, which results of old do not tell")
        elif matrices[0] != matrices[1]:
            texts.append("the files of the matrices")
    versions = [str(r.manifest.get("versions", {}).get("squealstudy", "")) for r in both]
    return texts + ([f"squealstudy {' -> '.join(versions)}"] if versions[0] != versions[1] else [])


def _settings(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> list[tuple[Any, Any]]:
    """Key paths and values of a TOML table, with those of tables within it.

    A table that a parameter follows, `{table = ..}`, is one value.
    """
    settings: list[tuple[Any, Any]] = []
    for name, setting in table.items():
        key = (*path, name)
        is_followed = key[0] == PARAMETERS and isinstance(setting, dict) and "table" in setting
        of_keys = isinstance(setting, dict) and not is_followed
        settings += _settings(setting, key) if of_keys else [(key, setting)]
    return settings


def _setting_text(
    results: ResultTables,
    settings: Mapping[Any, Any],
    name: tuple[str, ...],
    other: object,
    units: Mapping[str, str],
) -> str:
    """Text of a setting of a study; for a parameter that it leaves out, the default.

    The default is in the unit of the other study, `other`, if that writes one.
    """
    if name in settings:
        return shown(settings[name])
    if name[0] != PARAMETERS:
        return "(left out)"
    parameter = ".".join(name[1:])
    default = value_elsewhere(results, parameter)
    if isinstance(other, str):
        return shown(amount(default, units.get(parameter, "")))
    return f"{default:g}"
