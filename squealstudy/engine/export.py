"""Exports models for other programs: the generated brake as files, and reduced matrices."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from squealstudy.engine.cache import load_prepared
from squealstudy.engine.model_kind import as_model_kind
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.engine.workers import Workers
from squealstudy.errors import SquealstudyError
from squealstudy.files import write_arrays, write_atomic, write_text
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.modes.point import state_working_point
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.toml_text import toml_text
from squealstudy.system.linearise import linearise
from squealstudy.wording import listed

GENERATED = "disc_brake"
MODEL_FILE = "brake.toml"
REDUCED = "reduced"  # .npz, .mat


def export_model(study: ResolvedStudy, folder: Path) -> list[Path]:
    """Write the generated brake of a study's [parameters] as a model file with its meshes.

    Raises
    ------
    SquealstudyError
        A study of another model.
    """
    from squealstudy.models.catalogue.disc_brake.as_files import brake_meshes, brake_tables
    from squealstudy.models.catalogue.disc_brake.parameters import HEAT, is_hot

    if study.model.name != GENERATED:
        raise SquealstudyError(
            f"{study.source.path}: only the model {GENERATED} can be written as a model file"
        )
    values = {name: float(study.values[name]) for name in study.model.defaults()}
    if is_hot(values):
        raise SquealstudyError(
            f"{study.source.path}: temperatures of disc and pads are not written to model files: "
            f"expected 0 K for {listed([p.name for p in HEAT])}"
        )
    written = []
    for name, mesh in brake_meshes(study.options, values).items():
        written.append(folder / f"{name}.inp")
        write_inp(mesh, written[-1])
    files = {path.stem: path.name for path in written}
    written.append(folder / MODEL_FILE)
    write_text(written[-1], toml_text(brake_tables(study.options, values, files)))
    return written


def export_reduced(
    plan: Plan, folder: Path, jobs: int = 1, warn: Callable[[str], None] = warnings.warn
) -> list[Path]:
    """Write the reduced model of the [parameters] for other tools, as .npz and .mat.

    Matrices ``M``, ``C``, ``K`` (n, n) of ``lambda^2 M + lambda C + K`` at steady sliding, the
    observation of the contact points ``N``, ``T``, ``T_perp`` (n_points, n), ``area`` [m2],
    ``gap`` [m] there, ``tangent`` [Pa/m], ``pressure`` [Pa], ``friction_coefficient`` (n_points,)
    at which C and K are linearised; ``springs`` (ns, 5): stiffness, third power, gap, side, cubic
    damping of the last ns points, which are springs; the parameter ``friction``, of fast sliding;
    the contact law by name with names and values of its parameters, and ``parameter_names`` and
    ``parameter_values`` of all of the study's, SI. The basis is that of a run: enriched where its
    tolerance demands it. `jobs` is the number of processes, `warn` gets each warning's text.

    Raises
    ------
    SquealstudyError
        A family of matrices, which has no reduction; no working point.
    """
    if isinstance(plan.study.model, FamilyDefinition):
        raise SquealstudyError(f"{plan.study.source.path}: its matrices are files already")
    plan, _ = as_model_kind(plan.kind).make_models(plan, Workers(jobs), warn)
    design = plan.design(plan.nominal_values)
    design = replace(design, structure=plan.structure_key(design))
    key, reason = build_structure(build_task(plan, design, jobs))
    if reason:
        raise SquealstudyError(f"{plan.study.source.path}: {reason}")
    prepared, state = load_prepared(key), design.state()
    point = state_working_point(prepared, state)
    pencil = linearise(prepared.model, point, state).pencil
    model, law = prepared.model, state.operating.law
    point_values = (point.contact_pressure, model.speed_factor, model.own_friction)
    friction = state.operating.friction_at(*point_values)
    content: dict[str, Any] = {
        "M": np.eye(len(pencil.K)),
        "C": pencil.C,
        "K": pencil.K,
        "N": model.N,
        "T": model.T,
        "T_perp": model.T_perp,
        "area": model.area,
        "gap": point.gap,
        "pressure": point.contact_pressure,
        "tangent": point.tangent,
        "friction": float(state.operating.friction),
        "friction_coefficient": model.frictional * np.abs(friction.mu),
        "springs": model.spring_points,
        "law": law.kind,
        "law_parameters": np.array(law.parameters),
        "law_parameter_names": [p.name for p in law.definition.parameters],
        "parameter_names": list(plan.study.values),
        "parameter_values": [plan.nominal_values[name] for name in plan.study.values],
    }
    content = {k: np.asarray(x) for k, x in content.items()}
    paths = [folder / f"{REDUCED}.npz", folder / f"{REDUCED}.mat"]
    write_arrays(paths[0], content, compressed=True)
    write_atomic(paths[1], partial(savemat, mdict=content, appendmat=False, do_compression=True))
    return paths
