"""Rows of a work-precision study, one for each method, knob value and round; its two tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from squealstudy.engine.measurement import Measurement, Measuring
from squealstudy.engine.rows import HEAD, REAL, TEXT, WHOLE_NUMBER, head
from squealstudy.errors import ResultsError
from squealstudy.kinds.methods import Run
from squealstudy.kinds.work_precision.variants import Variant
from squealstudy.tables.method_quality import Miscount

Rows = Sequence[Mapping[str, Any]]
MEASURED = (  # attributes of a Measurement
    ("seconds", REAL),
    ("setup_seconds", REAL),
    ("reduction_seconds", REAL),
    ("memory_mb", REAL),
    ("iterations", REAL),
    ("n_coordinates", WHOLE_NUMBER),
    ("n_failed", WHOLE_NUMBER),
    ("onset_seconds", REAL),
    ("line_points", REAL),
)
# findings are JSON: number of a measured point -> its results
FIELDS = (("variant", TEXT), ("round", WHOLE_NUMBER), *MEASURED, ("findings", TEXT))
SCHEMA = pa.schema([pa.field(n, t, nullable=False) for n, t in (*HEAD, *FIELDS)])


def measurement_row(
    run: Run, wall_s: float, measurement: Measurement, failure: tuple[str, str] = ("ok", "")
) -> dict[str, Any]:
    """Chunk row of a measurement; `failure` is status and message of one without results."""
    variant, number = run.content
    outcomes = [(f["status"], f.get("message", "")) for f in measurement.findings.values()]
    status, message = next((outcome for outcome in outcomes if outcome[0] != "ok"), failure)
    measured = {name: getattr(measurement, name) for name, _ in MEASURED}
    identity = {
        "variant": variant.identity,
        "round": number,
        "findings": json.dumps(measurement.findings),
    }
    return head(run.point_id, wall_s, str(status), str(message)) | measured | identity


def measurement_tables(
    variants: Sequence[Variant],
    rows: Mapping[str, Rows],
    quantities: Sequence[str],
    over: int,
    measuring: Measuring,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make the tables of measurements and of their errors.

    Parameters
    ----------
    variants : sequence of Variant
        All variants, with the reference.
    rows : mapping of identity -> sequence of chunk rows
        Rows of all rounds of each variant.
    quantities : sequence of str
        Quantities for which measurements get columns of errors.
    over : int
        Number of design points that share a set-up.
    measuring : Measuring
        How findings are compared.

    Raises
    ------
    ResultsError
        Where a point of the reference failed: nothing can be measured against it.
    """
    reference = next(v for v in variants if v.reference)
    truth = _findings(rows[reference.identity])
    failed = [t for t in truth.values() if t["status"] != "ok"]
    if failed or not truth:
        why = failed[0]["message"] if failed else rows[reference.identity][0]["message"]
        raise ResultsError(f"the reference '{reference.method}' failed: {why}")
    measured, errors = [], []
    structures = {tuple(v.plan.structures) for v in variants}
    reduced = len(structures) > 1  # else the reduction is the same for all
    for variant in variants:
        findings = _findings(rows[variant.identity])
        variant_errors, count = _errors(findings, truth, measuring)
        errors += [{"label": variant.label, **row} for row in variant_errors]
        measured.append(
            _measurement(
                variant, rows[variant.identity], variant_errors, count, quantities, over, reduced
            )
        )
    return pd.DataFrame(measured), pd.DataFrame(errors)


def _findings(rows: Rows) -> dict[str, dict[str, Any]]:
    findings: dict[str, dict[str, Any]] = json.loads(rows[0]["findings"])
    return findings


def _errors(
    findings: Mapping[str, Mapping[str, Any]],
    truth: Mapping[str, Mapping[str, Any]],
    measuring: Measuring,
) -> tuple[list[dict[str, Any]], Miscount]:
    """Errors of all points against the reference, and numbers of missed and spurious modes."""
    rows, missed, spurious = [], 0, 0
    for point, finding in findings.items():
        if finding["status"] != "ok":
            continue
        for compare in measuring.comparisons:
            errors, count = compare(finding, truth[point])
            missed, spurious = missed + count.missed, spurious + count.spurious
            rows += [{"point": int(point), **e._asdict()} for e in errors]
    return rows, Miscount(missed, spurious)


def _measurement(
    variant: Variant,
    rows: Rows,
    errors: Sequence[Mapping[str, Any]],
    count: Miscount,
    quantities: Sequence[str],
    over: int,
    reduced: bool,
) -> dict[str, Any]:
    """One row of the table of measurements.

    The cost of a point has its share of the set-up, and of the reduction where methods differ in
    it; that of an onset has the shares of all points of its line.
    """
    seconds = np.array([r["seconds"] for r in rows], dtype=float)
    first = rows[0]
    setup = float(np.median([r["setup_seconds"] for r in rows]))
    reduction = float(first["reduction_seconds"])
    median = float(np.median(seconds))
    share = (setup + reduced * reduction) / max(over, 1)
    onset_s = float(np.median([r["onset_seconds"] for r in rows]))
    number = float(variant.value) if isinstance(variant.value, int | float) else np.nan
    return {
        "label": variant.label,
        "method": variant.method,
        "knob": variant.knob,
        "value": "" if variant.value is None else str(variant.value),
        "number": number,
        "default": variant.default,
        "reference": variant.reference,
        "status": first["status"],
        "message": first["message"],
        "seconds_median": median,
        "seconds_min": float(seconds.min()),
        "seconds_max": float(seconds.max()),
        "rounds": len(rows),
        "setup_seconds": setup,
        "reduction_seconds": reduction,
        "cost": median + share,
        "onset_seconds": onset_s,
        "cost_onset": onset_s + float(first["line_points"]) * share,
        "memory_mb": max(float(r["memory_mb"]) for r in rows),
        "iterations": float(first["iterations"]),
        "n_coordinates": int(first["n_coordinates"]),
        "n_failed": int(first["n_failed"]),
        "missed": count.missed,
        "spurious": count.spurious,
        **{k: v for q in quantities for k, v in _summary(q, errors).items()},
    }


def _summary(quantity: str, errors: Sequence[Mapping[str, Any]]) -> dict[str, float | bool]:
    """Largest error of a quantity over points and modes, its bounds, and the median error.

    `chance` is what the intervals of both results explain of the largest error; `within` says
    whether they explain every error.
    """
    of_quantity = [e for e in errors if e["quantity"] == quantity]
    if not of_quantity:
        names = ("error", "low", "high", "median", "chance")
        return {**{f"{name}_{quantity}": np.nan for name in names}, f"within_{quantity}": False}
    worst = max(of_quantity, key=lambda e: e["error"])
    return {
        f"error_{quantity}": worst["error"],
        f"low_{quantity}": worst["low"],
        f"high_{quantity}": worst["high"],
        f"median_{quantity}": float(np.median([e["error"] for e in of_quantity])),
        f"chance_{quantity}": worst["chance"],
        f"within_{quantity}": all(0 < e["chance"] >= e["error"] for e in of_quantity),
    }
