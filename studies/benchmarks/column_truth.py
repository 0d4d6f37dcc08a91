"""Random small designs against the independent judge: in which state is which column false?

Run:  python studies/benchmarks/column_truth.py [--seed 1] [--number 200] [--share 1.0]
          [--tables transient limit_cycles] [--out column_truth]

Each case is a study file of one design point (`column_cases.py`), run as a user runs it; its tables
are held against an integrator of its own (`tests/event_reference.py`), a column against its own
bounds (`column_compare.py`). Prints for each column how many numbers were compared, the share that
has the truth inside its bounds and how wide these are over the true error, then every violation;
study files of these go to the folder `--out`, beside a CSV of all numbers. Columns without bounds
are held against plain tolerances and told apart. 200 cases take about 10 CPU-minutes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import pandas as pd
from column_cases import Case, case_of_kind
from column_compare import COMPARERS, Told

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.study.definition import parse_study

SHARES = {"transient": 0.6, "limit_cycles": 0.4}  # of the cases


def compared(case: Case) -> list[Told]:
    """All numbers of a case; one word where the study or the judge could not be run."""
    try:
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run_study(Plan(parse_study(case.text, Path("case.toml"))), Path(folder), jobs=1)
            return list(COMPARERS[case.kind](case, Results.open(Path(folder))))
    except ArithmeticError as error:
        return [Told("judge", "judge", str(error), float("nan"), float("nan"), "a run")]
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        return [Told("study", "study", text[:200], float("nan"), float("nan"), "results")]


def cases(kinds: list[str], number: int, seed: int) -> Iterator[Case]:
    """Cases of the kinds in turn."""
    total = sum(SHARES.get(kind, 0.1) for kind in kinds)
    for kind in kinds:
        for k in range(round(number * SHARES.get(kind, 0.1) / total)):
            yield case_of_kind(kind, k, seed)


def table_of(found: Iterator[tuple[Case, list[Told]]]) -> pd.DataFrame:
    """A row a number."""
    rows = [
        {"kind": case.kind, "case": case.number, **asdict(t), "inside": t.inside, "width": t.width}
        for case, told in found
        for t in told
    ]
    return pd.DataFrame(rows)


def report(table: pd.DataFrame) -> str:
    """Coverage of each column, those with bounds first."""
    lines = []
    for bounded, own in sorted(table.groupby("bounded"), reverse=True):
        groups = own.groupby(["kind", "table", "column"])
        shown = groups.agg(
            numbers=("inside", "size"), inside=("inside", "mean"), width=("width", "median")
        )
        shown["inside"] = (100 * shown["inside"]).round(1)
        head = "with bounds or words" if bounded else "without bounds, against plain tolerances"
        lines.append(f"{head}\n{shown.round(2).to_string()}")
    told = table[table["bounded"]]
    undecided = (table["column"] == "class (decided)").sum()
    decided = (table["column"] == "class").sum() + undecided
    lines.append(
        f"{table.groupby(['kind', 'table', 'column']).ngroups} columns, "
        f"{table.groupby(['kind', 'case']).ngroups} cases, {len(table)} numbers; "
        f"{100 * told['inside'].mean():.1f} % inside their bounds, median width "
        f"{told['width'].median():.2f} true errors; {undecided} of {decided} runs undecided"
    )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=200, help="of cases")
    parser.add_argument("--share", type=float, default=1.0, help="of the cases that are run")
    parser.add_argument("--tables", nargs="+", choices=list(COMPARERS), default=list(COMPARERS))
    parser.add_argument("--out", type=Path, default=Path("column_truth"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    found, begun = [], time.process_time()
    for case in cases(options.tables, round(options.share * options.number), options.seed):
        told = compared(case)
        found.append((case, told))
        wrong = [t for t in told if not t.inside]
        if wrong:
            path = options.out / f"{case.kind}_{options.seed}_{case.number}.toml"
            path.write_text(case.text, encoding="utf-8")
            d = case.design
            print(f"{path.name}: {d.model}, {d.contact_law}{', smooth' * d.smooth}", flush=True)
        for t in wrong:
            bounds = "" if isinstance(t.truth, str) else f" [{t.low:.6g}, {t.high:.6g}]"
            told_, truth = (x if isinstance(x, str) else f"{x:.6g}" for x in (t.told, t.truth))
            print(f"    {t.table}.{t.column}: told {told_}{bounds}, true {truth}", flush=True)
    table = table_of(iter(found))
    table.to_csv(options.out / f"numbers_{options.seed}.csv", index=False)
    print(f"\n{report(table)}\n{time.process_time() - begun:.0f} CPU-seconds")


if __name__ == "__main__":
    main()
