"""One mode keeps one number from structure to structure, whatever their meshes."""

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from conftest import build_model

import squealstudy
from squealstudy.models import catalogue
from squealstudy.models.assembly import Assembly
from squealstudy.models.component import Component
from squealstudy.models.disc_brake.solids import MEDIUM_SIZES, BrakeMesher
from squealstudy.models.fem.correspondence import corresponding_rows
from squealstudy.models.minimal import bilateral_points
from squealstudy.models.operating import (
    DAMPING,
    FRICTION,
    FRICTION_LAW,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
)
from squealstudy.models.parameter import ModelDefinition, structural
from squealstudy.study.definition import parse_study
from squealstudy.study.plan import Plan
from squealstudy.study.runner import run_study

PLACES = (np.arange(30) + 0.5) / 30  # along a string, from end to end
STIFF = 1e9  # N/m, holds the ends of a string


def string(name, length, size, shift):
    """A string of unit density and tension 1e6 N in elements of about `size`, `shift` more."""
    n = int(np.ceil(length / size - 1e-9)) + shift
    h = length / n
    spread = np.array([[2.0, 1.0], [1.0, 2.0]]) * h / 6
    pull = np.array([[1.0, -1.0], [-1.0, 1.0]]) * 1e6 / h
    M, K = np.zeros((2, n + 1, n + 1))
    for e in range(n):
        M[e : e + 2, e : e + 2] += spread
        K[e : e + 2, e : e + 2] += pull
    K[0, 0] += STIFF
    K[-1, -1] += STIFF
    at = observe(n, PLACES) * np.sqrt(length / len(PLACES))
    return Component(name, sp.csr_matrix(M), sp.csr_matrix(K), correspondence=sp.csr_matrix(at))


def observe(n, places):
    """Linear shape functions of n elements at shares of the length."""
    nodes = np.arange(n + 1) / n
    return np.maximum(1 - np.abs(np.asarray(places)[:, None] - nodes) * n, 0.0)


def build_strings(options, values):
    """Two strings that touch: the frequencies of one fall through those of the other."""
    a = string("a", values["length"], values["size"], 0)
    b = string("b", 1.0, 0.02, int(values["length"] / 0.1))  # another mesh, the same string
    n = a.n_dof + b.n_dof
    N, T = np.zeros((2, 1, n))
    N[0, : a.n_dof] = observe(a.n_dof - 1, [0.37])[0]
    T[0, a.n_dof :] = observe(b.n_dof - 1, [0.41])[0]
    contact = bilateral_points(N - values["touch"] * T, T, np.array([values["stiffness"]]))
    load = np.zeros(n)
    load[: a.n_dof] = -1.0
    return Assembly((a, b), contact, (), np.zeros(n), load)


STRINGS = ModelDefinition(
    "strings",
    "two strings in contact",
    (),
    (
        FRICTION,
        SLIDING_SPEED,
        DAMPING,
        STIFFNESS_DAMPING,
        *FRICTION_LAW,
        *structural(
            (
                ("length", 1.0, "m", "first string"),
                ("size", 0.02, "m", "its elements"),
                ("touch", 0.1, "", "part of the second string in the gap"),
                ("stiffness", 2e4, "N/m", "contact"),
            )
        ),
    ),
    ("a", "b"),
    build_strings,
)
STUDY = """
[study]
name = "strings"
kind = "complex_modes"
[model]
name = "strings"
[parameters]
damping_ratio = 0.002
friction = 0.1
{sweeps}
[modes]
band = [300.0, 6000.0]
reference_points = 0
"""


@pytest.fixture
def strings(monkeypatch, tmp_path):
    """Runs a study of the strings over given sweeps; its modes with the values of its points."""
    monkeypatch.setitem(catalogue.MODELS, "strings", STRINGS)
    monkeypatch.setattr(catalogue, "MODEL_NAMES", (*catalogue.MODEL_NAMES, "strings"))

    def run(sweeps, more=""):
        plan = Plan(parse_study(STUDY.format(sweeps=sweeps) + more, Path("study.toml")))
        run_study(plan, tmp_path / "results", jobs=1)
        results = squealstudy.open_results(tmp_path / "results")
        assert (results.points["status"] == "ok").all()
        return results.modes.merge(results.points, on="point_id")

    return run


def identity(modes):
    """Which mode of which string each row is, as (string, number); none where they are mixed."""
    a = modes["energy_a"] / (modes["energy_a"] + modes["energy_b"])
    length = modes["length"].where(a > 0.5, 1.0)
    number = (modes["frequency_hz"] * 2 * length / 1e3).round().astype(int)
    return [
        (f"{'a' if share > 0.5 else 'b'}{k}" if abs(share - 0.5) > 0.3 else "")
        for share, k in zip(a, number, strict=True)
    ]


def names_of_tracks(modes):
    """The modes that each track has been, in rows that are not flagged."""
    sure = modes.assign(identity=identity(modes))[~modes["track_ambiguous"]]
    sure = sure[sure["identity"] != ""]
    return sure.groupby("track")["identity"].agg(lambda x: sorted(set(x)))


def test_modes_keep_their_numbers_over_a_length_though_every_mesh_is_another(strings):
    modes = strings('[[sweep]]\nparameter = "length"\nstart = 0.9\nstop = 1.3\nnum = 11\n')
    assert modes.groupby("point_id")["track"].nunique().eq(modes.groupby("point_id").size()).all()
    names = names_of_tracks(modes)
    assert names.map(len).eq(1).all(), names
    assert names.map(lambda x: x[0]).is_unique, names  # no mode has two numbers
    assert modes["track_ambiguous"].mean() < 0.05
