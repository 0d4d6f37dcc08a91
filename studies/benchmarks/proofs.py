"""Proofs of design studies put to the test: the chosen designs run in time at random points.

Run:  python studies/benchmarks/proofs.py --proofs 20 [--of little_damping] [--linear]
      python studies/benchmarks/proofs.py studies/kicked_design.toml [--linear]

Without a file small studies of a model are drawn (`proof_studies.py`) and run to their verdicts,
until so many are proven. A proven design then runs at points drawn inside its matrix:
from today's vibration there and at the values in [parameters], and from random modes in random
phases, up to the reach of limit cycles. A motion that lasts refutes the proof. Where a part is
another one, today's vibration is taken over mode by mode, by how modes move the contact.

`--linear` asks for proofs without runs in time and limit cycles. Kicks should refute some of these:
of a proof of `kicked_design` they must. A line a study, as it ends; what is known is kept in
FOLDER/proofs.json, and an interrupted run goes on there.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import one_thread  # noqa: F401

# isort: split

import numpy as np
from proof_studies import DRAWN, random_studies
from scipy.optimize import linear_sum_assignment

import squealstudy
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.trials import DECAYS, LASTS, OPEN, Ended, ended, run_on
from squealstudy.engine.cache import NewGaps
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.design.kind import request
from squealstudy.kinds.design.plan import first_plan
from squealstudy.kinds.design.state import PROVEN
from squealstudy.kinds.limit_cycles.designs import CyclesRequest
from squealstudy.motion.point import contact_speed, perturbed
from squealstudy.motion.system import ModalSystem
from squealstudy.study.definition import load_any

POINTS, KICKS, MOST_MODES = 3, 3, 6  # a proof, a point, a kick
SMALL = 1e-2  # m/s: where today's squeal begins


def taken_over(old: ModalSystem, new: ModalSystem) -> np.ndarray:
    """Matrix (n, m) from modes of one structure to those of another that move the contact alike."""
    rows = [np.vstack([s.N, s.T1, s.T2]) for s in (old, new)]
    shapes = [r / np.maximum(np.linalg.norm(r, axis=0), 1e-300) for r in rows]
    alike = shapes[1].T @ shapes[0]
    apart = np.abs(np.subtract.outer(*(np.log(s.omega2 + 1.0) for s in (new, old))))
    pairs = linear_sum_assignment(np.abs(alike) - 2.0 * apart, maximize=True)
    found = np.zeros_like(alike)
    found[pairs] = np.where(alike[pairs] < 0, -1.0, 1.0)
    return found


def kicks(
    contact: ContactOscillator, asked: CyclesRequest, rng: np.random.Generator
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Random real modes of the band in random phases: words, displacements, velocities (n,)."""
    omega = contact.system.frequencies
    inside = np.flatnonzero((omega >= asked.band[0]) & (omega <= asked.band[1]))
    for _ in range(KICKS):
        count = min(int(rng.integers(1, MOST_MODES + 1)), len(inside))
        modes, amplitude = rng.choice(inside, count, replace=False), np.zeros(len(omega), complex)
        phases = rng.uniform(0.0, 2 * np.pi, count)
        amplitude[modes] = rng.uniform(0.2, 1.0, count) * np.exp(1j * phases) / omega[modes]
        speed = rng.uniform(0.1, 1.0) * asked.section.reach * abs(contact.point.speed)
        factor = speed / contact_speed(contact.system, (1j * omega * amplitude).real)
        hz = ", ".join(f"{f:.0f}" for f in np.sort(omega[modes]) / (2 * np.pi))
        name = f"kick of {speed:.2g} m/s at {hz} Hz"
        yield name, factor * amplitude.real, factor * (1j * omega * amplitude).real


Squeal = tuple[ModalSystem, np.ndarray, np.ndarray]


def squeal(was: ContactOscillator, asked: CyclesRequest) -> list[Squeal]:
    """Today's design after a small start, with its modes; none where that decays or fails."""
    (motion,) = run_on(was, [perturbed(was.system, was.point, SMALL)], asked.band)
    lasts = motion.outcome == "ok" and ended("", motion).outcome != DECAYS
    return [(was.system, motion.q, motion.v)] if lasts else []


def runs(
    contact: ContactOscillator,
    squeals: list[Squeal],
    asked: CyclesRequest,
    rng: np.random.Generator,
) -> list[Ended]:
    """What a design comes to at one operating point, from every start."""
    if contact.point.growing.n_above:
        raise ConvergenceError("unstable_above_band", "a mode above the band grows")
    starts = [
        (f"today's vibration {k}", over @ q, over @ v)
        for k, (system, q, v) in enumerate(squeals)
        for over in [taken_over(system, contact.system)]
    ]
    starts += kicks(contact, asked, rng)
    made = [replace(contact.point, q0=q, v0=v) for _, q, v in starts]
    motions = run_on(contact, made, asked.band)
    for k, (_, q, v) in enumerate(starts):  # pressed more than can be integrated
        if motions[k].outcome != "ok":
            slower = replace(contact.point, q0=np.zeros_like(q), v0=v)
            (motions[k],) = run_on(contact, [slower], asked.band)
    return [ended(name, motion) for (name, _, _), motion in zip(starts, motions, strict=True)]


def tested(study: Path, place: Path, rng: np.random.Generator) -> dict[str, Any]:
    """A study run to its verdict, and where it is proven what runs in time say of it."""
    began = time.process_time()
    facts = squealstudy.run(study, place, jobs=1, yes=True).manifest["design_study"]
    found: dict[str, Any] = {name: facts[name] for name in ("outcome", "cost", "change", "rounds")}
    found["proof_s"] = round(time.process_time() - began)
    if facts["outcome"] not in PROVEN:
        return found
    began, resolved = time.process_time(), load_any(study)
    plan = first_plan(resolved)
    asked, first = request(plan).cycles, plan.tasks[0]

    def at(values: dict[str, float]) -> ContactOscillator:
        point = first.with_values({**first.values, **values})
        point = replace(point, structure=plan.structure_key(point))
        if lost := build_structure(build_task(plan, point, 1))[1]:
            raise ConvergenceError("structure", lost)
        return asked.contact(point, NewGaps())[1]

    change = {c["parameter"]: c["to"] for c in facts["changes"]}
    swept = resolved.sweeps[: resolved.n_operating]
    nominal = squeal(at({s.name: resolved.value_of(s.parameter) for s in swept}), asked)
    found |= {"runs": 0, "lasts": [], "open": []}
    for _ in range(POINTS):
        where = {s.name: float(f"{rng.uniform(s.low, s.high):.6g}") for s in swept}
        text = ", ".join(f"{name} {value:g}" for name, value in where.items())
        try:
            some = runs(at({**where, **change}), squeal(at(where), asked) + nominal, asked, rng)
        except ConvergenceError as error:
            found["open"].append(f"{text}: {error}")
            continue
        found["runs"] += len(some)
        for outcome, kept in ((LASTS, found["lasts"]), (OPEN, found["open"])):
            kept += [f"{text}: {run.text}" for run in some if run.outcome == outcome]
    return found | {"test_s": round(time.process_time() - began)}


def line(name: str, found: dict[str, Any]) -> str:
    """A line of the table."""
    cells = [name, found["outcome"], f"{found['cost']:.4g}", found["rounds"], found["proof_s"]]
    if "runs" in found:
        refuted = "REFUTED" if found["lasts"] else "no"
        cells += [found["test_s"], found["runs"], refuted, len(found["open"])]
    more = [*found.get("lasts", []), *found.get("open", [])]
    return "\n    ".join([" | ".join(map(str, [*cells, found["change"]])), *more])


def main() -> None:
    """A line a study, and how many proofs were refuted."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path, nargs="*", help="design studies, instead of random ones")
    parser.add_argument("--proofs", type=int, default=20, help="random designs that are tested")
    parser.add_argument("--of", choices=list(DRAWN), default="brake")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--linear", action="store_true", help="no large motions in the proofs")
    parser.add_argument("--folder", type=Path, default=Path("results/proofs"))
    parser.add_argument("--skip", nargs="*", default=[], help="names of studies that are not run")
    given = parser.parse_args()
    kept = given.folder / "proofs.json"
    given.folder.mkdir(parents=True, exist_ok=True)
    known = json.loads(kept.read_text()) if kept.exists() else {}
    print("study | outcome | cost | rounds | CPU-s | in time | runs | refuted | open | change")
    texts = [(path.stem, path.read_text()) for path in given.file]
    shown: list[dict[str, Any]] = []
    for number, (name, text) in enumerate(texts or random_studies(given.seed, given.of)):
        if name in given.skip:
            continue
        if given.linear:
            name, less = f"{name}_linear", "[goal]\nin_time = 0\ncycles = 0\n"
            text = text.replace("in_time = 2\n", "").replace("[goal]\n", less)
        if name not in known:
            study = given.folder / f"{name}.toml"
            study.write_text(text)
            rng = np.random.default_rng([given.seed, number, 1])
            known[name] = tested(study, given.folder / name, rng)
            kept.write_text(json.dumps(known, indent=1) + "\n")
        shown.append(known[name])
        print(line(name, known[name]), flush=True)
        proofs = [found for found in shown if "runs" in found]
        if not given.file and len(proofs) == given.proofs:
            break
    refuted, count = sum(bool(f["lasts"]) for f in proofs), sum(f["runs"] for f in proofs)
    undecided = sum(len(f["open"]) for f in proofs)
    print(f"{refuted} of {len(proofs)} proofs refuted; {count} runs, {undecided} undecided")


if __name__ == "__main__":
    main()
