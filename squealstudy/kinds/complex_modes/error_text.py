"""Texts on methods and errors of complex modes, for screens."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from squealstudy.mechanics.defaults import STABILITY_TOLERANCE
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.models.operating import GYROSCOPIC
from squealstudy.modes.judged_roots import STABLE
from squealstudy.root_pairs import LIGHT_DAMPING
from squealstudy.screen import Rows
from squealstudy.wording import error_percent, in_digits, plural

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

JUDGED = "modes that grow or have little damping"
NEGLIGIBLE_METHOD_ERROR = 1e-9  # a method with a smaller relative error needs no check
# share of the largest estimate; checked points that err by less say little about the method
MIN_CHECK_ERROR_SHARE = 0.1
OTHER_MESH = "; the error of the mesh is not in it"
OF_MESH = "; the error of the mesh is not in it, `squealstudy check --mesh-error` tells it"


def method_rows(manifest: Mapping[str, Any]) -> Rows:
    """Rows on the rungs that solved the points, on what an audit found, and on estimated errors."""
    method = manifest.get("method")
    if not method:
        return []
    served = ", ".join(f"{rung} {count}" for rung, count in method["points"].items())
    rows = [("method", f"{method['chosen']} ({method['reason']}); points by rung: {served}")]
    if left_over := method.get("left_over"):
        points = plural(left_over["points"], "point")
        rows.append(("left over", f"{points}, solved exactly; the first was {left_over['first']}"))
    audit = manifest.get("audit")
    if audit and audit["modes"]:
        text = (
            f"{plural(audit['modes'], 'mode')} of {plural(audit['points'], 'point')} at full "
            f"order: eigenvalues err by {error_percent(audit['largest_true_error'])}, estimated "
            f"{error_percent(audit['largest_estimate'])}; {_missed(audit['missed_modes'])}"
        )
        rows.append(("audit", text))
    return [*rows, *_estimates(manifest)]


def _estimates(manifest: Mapping[str, Any]) -> Rows:
    """Row on the largest estimated errors of the rung and the reduction; neither has the mesh's."""
    errors = manifest.get("errors")
    if not errors or errors["largest_rung"] is None:
        return []
    largest = errors["largest_rung"]
    by_method = error_percent(largest) if largest < 1.0 else "more than the eigenvalue itself"
    text = f"eigenvalues of {JUDGED} err by {by_method} from the method"
    if unknown := errors.get("unknown_rung"):
        text += f" (not known of {plural(unknown, 'mode')})"
    if not errors["reduced"]:
        return [("estimates", f"{text}; the model is not reduced")]
    reduction, tolerance = errors["largest_reduction"], manifest["method"]["tolerance"]
    if reduction is None:
        return [("estimates", f"{text}; from the reduction not known: no sample point has modes")]
    points = plural(errors["reduction_sample_points"], "sample point")
    text += f" and {error_percent(reduction)} from the reduction, by a finer model at {points}"
    if rise := percent_or_times(errors["reduction_widened"]):
        text += f", already raised {rise}, as full order showed more"
    if manifest.get("basis_enriched"):
        text += "; the basis was enriched"
        if reduction > tolerance:
            text += (
                f" and still misses its tolerance of {100 * tolerance:g} %: a smaller tolerance "
                "in [reduction] enriches it more"
            )
    return [("estimates", text)]


def undamped_rows(results: ResultTables) -> Rows:
    """Row on points at which a mode neither grows nor decays; none where there is no such point."""
    columns = ["point_id", "damping_ratio", "stability"]
    if not set(columns) <= set(results.columns("modes")):  # tables of an earlier version
        return []
    neutral = results.rows("modes", columns, _is_neutral)
    count = neutral["point_id"].nunique()
    if not count:
        return []
    text = (
        f"at {plural(count, 'design point')} a mode that counts as stable neither grows nor "
        "decays, as without damping"
    )
    return [("undamped", text)]


def _is_neutral(modes: pd.DataFrame) -> np.ndarray:
    """Mask (n,) of the modes that are called stable and do not decay."""
    is_slow = modes["damping_ratio"].abs() <= STABILITY_TOLERANCE
    is_neutral: np.ndarray = (is_slow & (modes["stability"] == STABLE)).to_numpy(bool)
    return is_neutral


def full_order_error_text(manifest: Mapping[str, Any]) -> str:
    """One line on the error against the full-order model."""
    reference = manifest.get("reference", [])
    checks = [c for c in reference if c.get("status") == "ok"]
    other = "a second factorisation" if manifest["model"] == MATRICES else "the full-order model"
    meshed = manifest["model"] == OF_FILE or "mesh" in manifest.get("options", {})
    other += " of the same mesh" if meshed else ""
    if not reference:
        audit = (manifest.get("fidelity") or {}).get("audit") or {}
        if audit.get("error") is not None:
            return (
                f"held against {audit['against']} by the audit alone ([modes] reference_points = 0)"
            )
        failed = ", or those points failed" if manifest.get("n_failed") else ""
        return f"not checked against {other} ([modes] reference_points = 0{failed})"
    if not checks:
        failed = plural(len(reference), "point")
        return f"not known, {other} failed at {failed}: {reference[0]['message']}"
    points = plural(len(checks), "point")
    if not any(c["full_order_modes"] for c in checks):
        return f"{other} has no mode in the band either, at {points}"
    compared = [c for c in checks if "frequency_error" in c]
    if not compared:
        return f"not known: {other} has no mode of damping < 5 % to compare with, at {points}"
    points = plural(len(compared), "point")
    of_mesh = OF_MESH if "mesh" in manifest.get("options", {}) else OTHER_MESH if meshed else ""
    frequency = max(c["frequency_error"] for c in compared)
    damping = max(c["damping_error"] for c in compared)
    missed = sum(c["missed_modes"] for c in compared)
    return (
        f"{other} gives frequencies that differ by {error_percent(frequency)} and damping by "
        f"{error_percent(damping)} of critical, for modes of damping < 5 % at {points}; "
        f"{_missed(missed)}{of_mesh}"
    )


def turning_rows(manifest: Mapping[str, Any]) -> Rows:
    """Row on gyroscopic terms that are left out; none where they decide on no mode's growth."""
    facts = manifest.get("turning")
    if not facts or not facts["decided_points"]:
        return []
    growth = in_digits(facts["decided_growth"], 1)
    decided = f"{facts['decided_points']} of {plural(facts['looked'], 'design point')}"
    text = (
        f"terms of the turning disc are left out: at {decided} near an onset they decide whether a "
        f"mode grows, and change its growth rate by up to {growth} 1/s ({GYROSCOPIC.name} = 1 has "
        "them)"
    )
    return [("gyroscopic", text)]


def _missed(modes: int) -> str:
    return (
        f"{plural(modes, 'mode')} {'is' if modes == 1 else 'are'} missed"
        if modes
        else "none is missed"
    )


def unseen_text(results: ResultTables) -> str:
    """Text where the method errs much less at the checked points than elsewhere; else empty.

    They may be nodes of its interpolation.
    """
    checked = [c["point_id"] for c in results.manifest.get("reference", []) if "roots" in c]
    if not checked or "error_rung" not in results.columns("modes"):
        return ""
    highest_there = highest = -np.inf
    columns = ["point_id", "error_rung", "frequency_hz", "damping_ratio"]
    for modes in results.batches("modes", columns):
        light = modes["damping_ratio"].abs() < LIGHT_DAMPING
        estimate = (modes["error_rung"] / (2 * np.pi * modes["frequency_hz"])).where(light)
        highest = np.fmax(highest, estimate.max())
        highest_there = np.fmax(highest_there, estimate[modes["point_id"].isin(checked)].max())
    if not (
        np.isfinite(highest_there)
        and highest > NEGLIGIBLE_METHOD_ERROR
        and highest_there < MIN_CHECK_ERROR_SHARE * highest
    ):
        return ""  # estimates are alike, negligible, or missing at the checked points
    at_checks, elsewhere = error_percent(highest_there), error_percent(highest)
    if at_checks == elsewhere:  # as both are rounded
        return ""
    return (
        f"; by its own estimate the method errs by {at_checks} there, but by {elsewhere} "
        "elsewhere: audit checks points drawn at random"
    )


def percent_or_times(factor: float) -> str:
    """How much a factor raises a number, in words; empty for less than 1 %."""
    if factor < 1.01:
        return ""
    return (
        f"by {100 * (factor - 1):.0f} %" if factor < 2 else f"to {factor:.2g} times what that told"
    )
