"""Settings that a user may pick for a scene, for `fidelity_costs.py`."""

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


def hand_picks(scene: FidelityStudy, chosen: Changes) -> dict[str, Changes]:
    """Rungs beside the chosen ones, and what comes to mind without a ladder."""
    if scene.in_time:
        return _runs(scene, chosen)
    return _modes(scene, chosen)


def most_accurate(scene: FidelityStudy, chosen: Changes) -> Changes:
    """Full order, or all modes at the smallest step to the end of the run."""
    if not scene.in_time:
        return {**chosen, "modes.method": exact_method(scene.study)}
    steps = free_ladders(scene.study).get(STEP)
    smallest = steps[-1].changes if steps else {}
    contact = {k: v for k, v in chosen.items() if k.startswith("model.")}
    return {**QUIET, **(ALL_MODES if has_mesh(scene.study) else {}), **contact, **smallest}


def _modes(scene: FidelityStudy, chosen: Changes) -> dict[str, Changes]:
    tolerance = {"modes.tolerance": scene.tolerance}
    if not has_mesh(scene.study):
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
    ladder = free_ladders(scene.study).get(REDUCTION)
    for rung in ladder if ladder else ():
        found[f"rung: {rung.label}"] = {**chosen, **rung.changes}
    return found


def _runs(scene: FidelityStudy, chosen: Changes) -> dict[str, Changes]:
    found: dict[str, Changes] = {
        f"rung: {rung.label}": {**chosen, **rung.changes}
        for ladder in free_ladders(scene.study).values()
        for rung in ladder
        if {**chosen, **rung.changes} != dict(chosen)
    }
    contact = {k: v for k, v in chosen.items() if k.startswith("model.")}
    top = float(scene.study.definition.modes.band[1])
    bases: dict[str, Changes] = {"all modes": {}}
    if has_mesh(scene.study):
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
