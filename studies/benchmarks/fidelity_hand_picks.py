"""Settings that a user may pick for a study, for `fidelity_costs.py`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from squealstudy.engine.plan import has_mesh
from squealstudy.fidelity.frequency_search import exact_method
from squealstudy.fidelity.ladders import REDUCTION, STEP, free_ladders
from squealstudy.fidelity.pilots import FidelityStudy
from squealstudy.fidelity.time_search import ALL_MODES, QUIET

Changes = Mapping[str, Any]
FACTORS = (1.1, 1.3, 1.5, 2.0)  # cut-offs over the band
METHODS = ("windows", "dense")
STEPS = (16e-6, 8e-6, 4e-6, 2e-6)  # s
BASES = ((1.0, 20), (1.0, 50), (2.0, 20), (2.0, 50))  # modes up to, over the band; POD vectors


def hand_picks(fidelity: FidelityStudy, chosen: Changes) -> dict[str, Changes]:
    """Rungs beside the chosen ones, and what comes to mind without a ladder."""
    if fidelity.in_time:
        return _runs(fidelity, chosen)
    return _modes(fidelity, chosen)


def most_accurate(fidelity: FidelityStudy, chosen: Changes) -> Changes:
    """Full order, or all modes at the smallest step to the end of the run."""
    if not fidelity.in_time:
        return {**chosen, "modes.method": exact_method(fidelity.study)}
    steps = free_ladders(fidelity.study).get(STEP)
    smallest = steps[-1].changes if steps else {}
    contact = {k: v for k, v in chosen.items() if k.startswith("model.")}
    return {**QUIET, **(ALL_MODES if has_mesh(fidelity.study) else {}), **contact, **smallest}


def _modes(fidelity: FidelityStudy, chosen: Changes) -> dict[str, Changes]:
    tolerance = {"modes.tolerance": fidelity.tolerance}
    if not has_mesh(fidelity.study):
        return {m: {"modes.method": m, **tolerance} for m in METHODS}
    found: dict[str, Changes] = {}
    for factor in FACTORS:
        cutoffs = {
            "reduction.component_cutoff_factor": factor,
            "reduction.assembly_cutoff_factor": factor,
        }
        for method in METHODS if factor != FACTORS[-1] else METHODS[:1]:
            method_of = {"modes.method": method, **(tolerance if method == "windows" else {})}
            found[f"modes to {factor:g} x band, {method}"] = {**cutoffs, **method_of}
            if factor < 1.5 and method == "windows":
                coarse = {"reduction.tolerance": 1e-3}
                found[f"modes to {factor:g} x band, enrichment to 1e-3, {method}"] = {
                    **cutoffs,
                    **coarse,
                    **method_of,
                }
    found["modes to 1.5 x band, sweep_basis"] = {"modes.method": "sweep_basis", **tolerance}
    ladder = free_ladders(fidelity.study).get(REDUCTION)
    for rung in ladder if ladder else ():
        found[f"rung: {rung.label}"] = {**chosen, **rung.changes}
    return found


def _runs(fidelity: FidelityStudy, chosen: Changes) -> dict[str, Changes]:
    found: dict[str, Changes] = {
        f"rung: {rung.label}": {**chosen, **rung.changes}
        for ladder in free_ladders(fidelity.study).values()
        for rung in ladder
        if {**chosen, **rung.changes} != dict(chosen)
    }
    contact = {k: v for k, v in chosen.items() if k.startswith("model.")}
    top = float(fidelity.study.definition.modes.band[1])
    bases: dict[str, Changes] = {"all modes": {}}
    if has_mesh(fidelity.study):
        bases |= {
            f"modes below {factor * top:g} Hz, {vectors} POD": {
                "transient.modes_below": factor * top,
                "transient.pod_vectors": vectors,
            }
            for factor, vectors in BASES
        }
    settled = {"transient.stop": "settled"}
    for label, basis in bases.items():
        for step in STEPS:
            key = f"{label}, step {1e6 * step:g} us, until settled"
            found[key] = {**QUIET, **contact, **settled, **basis, "transient.step": step}
    return found
