"""The same numbers after a change of the code: small studies of every kind, by two states.

    python studies/benchmarks/same_tables.py [--then COMMIT] [--only NAME ...] [--keep FOLDER]

Each study of same_tables/ is run by the code of `--then` and by that of this tree, each with caches
of its own; every Parquet table of the results is compared, column by column, modes of a design
point paired by their roots. What was renamed in between stands in RENAMED; how far a column may
move, in TOLERANCES. Times and memory are left out, and identifiers must only map one to one. Exits
with 1 where anything differs. `--keep` holds the tables of `--then` for the next comparison.
"""

from __future__ import annotations

import argparse
import fnmatch
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io
import scipy.sparse as sp
from other_state import ROOT, commit_of, tree_of
from scipy.optimize import linear_sum_assignment

STUDIES = Path(__file__).with_suffix("")
THEN = "HEAD"
RUN = "from squealstudy.cli.app import main; main()"

# tables and columns that have another name now: old -> new
RENAMED: dict[str, str] = {}
# never compared: what a clock or the machine says
MEASURED = ("*_s", "*seconds*", "cost*", "memory*", "megabytes*", "wall*")
# compared as a mapping, one to one, not by value
IDENTIFIERS = (
    "*_id",
    "point_before",
    "point_after",
    "start_point",
    "worst_point",
    "threshold_cycle",
    "same_as",
    "continued_from",
    "curve_of",
    "parent",
    "structure",
    "key",
)
# largest difference, of the column's largest modulus in the study; the first pattern that fits
TOLERANCES = {
    "residual": np.inf,  # round-off, and so is what is estimated from it
    "*_residual": np.inf,
    "error_rung": 1e-2,
    "error_*": 1e-2,
    "*_error": 1e-2,
    "stick_number": 1e-6,  # pressures of working points, to their tolerance
    "*": 1e-7,
}
# differences that are round-off whatever a column holds: MAC of shapes in single precision, errors
# of roots in rad/s (1e-12 of the largest), relative errors
ROUND_OFF = {
    "track_mac": 2e-6,
    "error_rung": 1e-6,
    "error_reduction": 1e-7,
    "error_estimate": 1e-6,
    "energy_outside_share": 1e-12,
    "energy_balance": 1e-13,
    "power_imbalance": 1e-9,
    "biorthogonality": 1e-12,
    "error_*": 1e-13,
    "*_error": 1e-13,
}


def main() -> None:
    """Run the studies by both states and compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--then", default=THEN, help="commit, or a folder with the code")
    parser.add_argument("--only", nargs="+", help="names of studies, with * as in file names")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder that keeps the tables of --then")
    arguments = parser.parse_args()
    names = [path.stem for path in sorted(STUDIES.glob("*.toml"))]
    if arguments.only:
        names = [n for n in names if any(fnmatch.fnmatch(n, only) for only in arguments.only)]
    if not names:
        raise SystemExit(f"{STUDIES}: no study of that name")
    with tempfile.TemporaryDirectory() as folder, tree_of(arguments.then) as tree:
        kept = arguments.keep and arguments.keep / commit_of(tree)
        different = _compared(names, tree, Path(folder), arguments.jobs, kept)
    print(f"{len(names)} studies, {different} with differences")
    sys.exit(different > 0)


def _compared(names: list[str], tree: Path, folder: Path, jobs: int, kept: Path | None) -> int:
    """Number of studies whose tables differ."""
    different = 0
    for name in names:
        try:
            then = _kept_tables(kept and kept / name) or run(name, tree, folder / "then", jobs)
            _keep_tables(kept and kept / name, then)
            now = run(name, ROOT, folder / "now", jobs)
        except RuntimeError as error:
            then, now, found = {}, {}, [str(error)]
        else:
            found = list(study_differences(then, now))
        rows = sum(len(table) for table in now.values())
        print(f"{name:<24}{len(now):>3} tables {rows:>6} rows  {'differs' if found else 'same'}")
        for text in found:
            print(f"    {text}")
        sys.stdout.flush()
        different += bool(found)
    return different


def run(name: str, tree: Path, folder: Path, jobs: int) -> dict[str, pd.DataFrame]:
    """Tables of a study by the package in `tree`, by their names; RuntimeError where it fails."""
    folder.mkdir(exist_ok=True)
    copy_studies(folder)
    environment = os.environ | {
        "PYTHONPATH": str(tree),
        "SQUEALSTUDY_CACHE": str(folder / "cache"),
        "NUMBA_CACHE_DIR": str(folder / "kernels"),
    }
    output = folder / "results" / name
    command = [sys.executable, "-c", RUN, "run", f"{name}.toml", "--no-pictures"]
    command += ["--jobs", str(jobs), "--yes", "--output", str(output)]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"failed in {tree}:\n{done.stdout}{done.stderr}")
    return {path.stem: pd.read_parquet(path) for path in sorted(output.glob("*.parquet"))}


def _kept_tables(folder: Path | None) -> dict[str, pd.DataFrame]:
    """Tables that an earlier comparison kept; none where it did not."""
    files = sorted(folder.glob("*.parquet")) if folder else []
    return {path.stem: pd.read_parquet(path) for path in files}


def _keep_tables(folder: Path | None, tables: dict[str, pd.DataFrame]) -> None:
    if folder and not folder.is_dir():
        folder.mkdir(parents=True)
        for name, table in tables.items():
            table.to_parquet(folder / f"{name}.parquet")


def copy_studies(folder: Path) -> None:
    """Study files, the files of a model, and matrices: a chain of six masses with friction."""
    shutil.copytree(STUDIES, folder, dirs_exist_ok=True)
    n, stiffness = 6, 1e6
    K = sp.diags([2.0 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]) * stiffness
    coupling = sp.coo_array(([stiffness, -stiffness], ([1, 2], [2, 1])), shape=(n, n))
    for name, matrix in {
        "mass": sp.eye(n),
        "damping": K,
        "stiffness": K,
        "coupling": coupling,
    }.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", matrix)


# -- comparison ----------------------------------------------------------------------------------
def study_differences(then: dict[str, pd.DataFrame], now: dict[str, pd.DataFrame]) -> Iterator[str]:
    """Of all tables of a study, what differs, in words."""
    old = {RENAMED.get(name, name): table for name, table in then.items()}
    for name in sorted(set(old) ^ set(now)):
        yield f"{name}: only {'then' if name in old else 'now'}"
    for name in sorted(set(old) & set(now)):
        for text in table_differences(old[name].rename(columns=RENAMED), now[name]):
            yield f"{name}.{text}"


def table_differences(then: pd.DataFrame, now: pd.DataFrame) -> Iterator[str]:
    """Of two tables of one name, what differs, in words."""
    for column in sorted(set(then.columns) ^ set(now.columns)):
        yield f"{column}: only {'then' if column in then.columns else 'now'}"
    if len(then) != len(now):
        yield f"rows: {len(then)} then, {len(now)} now"
        return
    order = _partners(then, now)
    moved = (order != np.arange(len(now))).any()
    now = now.iloc[order]
    for column in [c for c in now.columns if c in then.columns]:
        if not fits(column, MEASURED) and not (moved and column == "mode"):
            text = column_difference(column, then[column], now[column])
            if text:
                yield f"{column}: {text}"


def _partners(then: pd.DataFrame, now: pd.DataFrame) -> np.ndarray:
    """Rows of `now` in the order of `then`: modes of a design point by their nearest roots.

    Two modes of a locked pair have one |lambda|, and round-off tells which comes first. Each
    design point must have its modes in one block; other tables stay as they are.
    """
    order = np.arange(len(now))
    if not {"point_id", "frequency_hz", "growth_rate"} <= {*then.columns, *now.columns}:
        return order
    if "parameter" in now.columns:  # a row a mode and parameter
        return order
    roots = [
        2 * np.pi * t["frequency_hz"].to_numpy() * 1j + t["growth_rate"].to_numpy()
        for t in (then, now)
    ]
    for rows in then.groupby("point_id", sort=False).indices.values():
        known = np.isfinite(roots[0][rows]) & np.isfinite(roots[1][rows])
        if known.all():
            distance = np.abs(roots[0][rows][:, None] - roots[1][rows][None, :])
            order[rows] = rows[linear_sum_assignment(distance)[1]]
    return order


def column_difference(name: str, then: pd.Series, now: pd.Series) -> str:
    """What differs in a column; empty where nothing does."""
    a, b = (_flat(column) for column in (then, now))
    if len(a) != len(b):
        return f"{len(a)} values then, {len(b)} now"
    if fits(name, IDENTIFIERS):
        pairs = set(zip(a, b, strict=True))
        one_to_one = len(pairs) == len({x for x, _ in pairs}) == len({y for _, y in pairs})
        return "" if one_to_one else "identifiers do not map one to one"
    if any(isinstance(x, str | bytes) for x in [*a, *b]):
        differing = [k for k, (x, y) in enumerate(zip(a, b, strict=True)) if x != y]
        k = differing[0] if differing else 0
        return f"{len(differing)} differ, first {a[k]!r} then, {b[k]!r} now" if differing else ""
    return _number_difference(name, np.array(a, dtype=float), np.array(b, dtype=float))


def _number_difference(name: str, a: np.ndarray, b: np.ndarray) -> str:
    known = np.isfinite(a) & np.isfinite(b)
    if not np.array_equal(a[~known], b[~known], equal_nan=True):
        return "not finite in other rows"
    scale = np.abs(a[known]).max(initial=0.0)
    off = np.abs(a[known] - b[known]).max(initial=0.0)
    tolerance = next(t for pattern, t in TOLERANCES.items() if fnmatch.fnmatch(name, pattern))
    least = next((t for pattern, t in ROUND_OFF.items() if fnmatch.fnmatch(name, pattern)), 0.0)
    if off == 0.0 or off <= max(tolerance * scale, least):
        return ""
    return f"off by {off:.2e} of {scale:.2e}, allowed {tolerance:g} of it"


def fits(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatch.fnmatch(name, pattern) for pattern in patterns)


def _flat(column: pd.Series) -> list[object]:
    """Values of a column one after the other, those of lists too; None becomes NaN."""
    values: list[object] = []
    for x in column:
        values += list(np.ravel(x)) if isinstance(x, np.ndarray | list) else [x]
    return [np.nan if x is None or x is pd.NA else x for x in values]


if __name__ == "__main__":
    main()
