"""One mode keeps one number from structure to structure, whatever their meshes."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from conftest import TOP
from study_runs import plan_of, solved
from study_texts import study_text
from tracks import Known, track

from squealstudy.linalg.real_modes import real_modes
from squealstudy.models import catalogue
from squealstudy.models.assembly import Assembly, Component
from squealstudy.models.catalogue.disc_brake.solids import COARSE, MEDIUM, BrakeMesher
from squealstudy.models.fem.sampling import corresponding_rows
from squealstudy.models.minimal_parts import bilateral_points
from squealstudy.models.operating import (
    DAMPING,
    FRICTION,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    friction_parameters,
)
from squealstudy.models.parameter import ModelDefinition, structural
from squealstudy.modes.tracking.labels import TrackTree, join_tracks
from squealstudy.modes.tracking.pairing import pair_modes
from squealstudy.modes.tracking.ragged import Ragged
from squealstudy.modes.tracking.tree import cross_edges, tracking_tree

HZ = 2 * np.pi
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
        friction_parameters,
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
STUDY = (
    study_text("strings", "complex_modes", "strings")
    + """\
[parameters]
damping_ratio = 0.002
friction = 0.1
{sweeps}
[modes]
band = [300.0, 6000.0]
reference_points = 0
"""
)


@pytest.fixture
def strings(monkeypatch, tmp_path):
    """Runs a study of the strings over given sweeps; its modes with the values of its points."""
    monkeypatch.setitem(catalogue.MODELS, "strings", STRINGS)

    def run(sweeps, more=""):
        plan = plan_of(STUDY.format(sweeps=sweeps) + more)
        results = solved(plan, tmp_path / "results")
        assert (results.points["status"] == "ok").all()
        return results.modes.merge(results.points, on="point_id")

    return run


def identity(modes):
    """Which mode of which string each row is, as a1, b3 and so on; empty where they are mixed."""
    a = modes["energy_a"] / (modes["energy_a"] + modes["energy_b"])
    length = modes["length"].where(a > 0.5, 1.0)
    number = (modes["frequency_hz"] * 2 * length / 1e3).round().astype(int)
    return [
        f"{'a' if share > 0.5 else 'b'}{k}" if abs(share - 0.5) > 0.3 else ""
        for share, k in zip(a, number, strict=True)
    ]


def check_one_number_a_mode(modes):
    """Each track is one mode, each mode one track; rows that are flagged or mixed aside."""
    sure = modes.assign(identity=identity(modes))[~modes["track_ambiguous"]]
    sure = sure[sure["identity"] != ""]
    assert sure.groupby("track")["identity"].nunique().eq(1).all()
    assert sure.groupby("identity")["track"].nunique().eq(1).all()
    assert modes["track_ambiguous"].mean() < 0.05


LENGTH = '[[sweep]]\nparameter = "length"\nstart = 0.9\nstop = 1.3\n'
FRICTION_SWEEP = '[[sweep]]\nparameter = "friction"\nstart = 0.0\nstop = 0.5\n'
SOBOL = '[design]\ntype = "sobol"\nsamples = 16\nseed = 1\n'


@pytest.mark.parametrize(  # steps of 20 and of 4 %
    "num", [pytest.param(3, marks=pytest.mark.full_size), 11]
)
def test_a_mode_keeps_its_number_over_structures_of_different_meshes(strings, num):
    modes = strings(LENGTH + f"num = {num}\n")
    check_one_number_a_mode(modes)
    assert modes["track"].max() == 26  # 11 of the second string, 15 of the first in the end
    assert modes["track_mac"].min() > 0.95


def test_a_mode_keeps_its_number_over_a_grid_of_structures_and_friction(strings):
    modes = strings(LENGTH + "num = 5\n" + FRICTION_SWEEP + "num = 3\n")
    check_one_number_a_mode(modes)


def test_a_mode_keeps_its_number_in_a_random_design_of_structures(strings):
    modes = strings(LENGTH + FRICTION_SWEEP, SOBOL)
    check_one_number_a_mode(modes)


def test_without_refinement_no_number_is_wrong_but_flagged(strings):
    modes = strings(LENGTH + "num = 5\n", "refine_tracking = false\n")
    sure = modes.assign(identity=identity(modes))[~modes["track_ambiguous"]]
    sure = sure[sure["identity"] != ""]
    assert modes["track_ambiguous"].any()
    assert sure.groupby("track")["identity"].nunique().eq(1).all()
    numbers = sure.groupby("identity")["track"].nunique()
    flagged = modes.groupby("track")["track_ambiguous"].any()
    for name in numbers[numbers > 1].index:  # each of its numbers ends or begins with a flag
        assert flagged[sure.loc[sure["identity"] == name, "track"].unique()].all()


# -- tracks that break


def test_a_track_that_breaks_is_flagged_where_it_ends_and_where_the_next_begins():
    lam = HZ * 1j * np.array([1000.0, 2000.0])
    shapes = np.eye(3, dtype=complex)
    tracks = track([-1, 0], [lam, lam * 1.02], [shapes[[0, 1]], shapes[[0, 2]]])
    assert [list(labels) for labels in tracks.labels] == [[1, 2], [1, 3]]
    assert [list(flags) for flags in tracks.ambiguous] == [[False, True], [False, True]]


def test_modes_that_leave_the_band_and_come_into_it_are_no_break():
    lams = Ragged.of(HZ * 1j * np.array(f) for f in ((1000.0, 1990), (1050.0, 1995)))

    def tracks(top):
        tree = TrackTree(np.array([-1, 0]), lams, band=(HZ * 500, HZ * top))
        return tree.label(tree.stepper(Known([np.eye(3)[[0, 1]], np.eye(3)[[0, 2]]])).pair_all())

    assert not tracks(2000).ambiguous.flat.any()
    inside = tracks(4000)
    assert inside.ambiguous.flat.tolist() == [False, True, False, True]


# -- joining


def branches():
    """Two modes at the root of a tree, a third that comes in on two branches."""
    lam, shapes = HZ * 1j * np.array([1000.0, 2000.0, 3000.0]), np.eye(3, dtype=complex)
    lams, seen = [lam[:2], lam, lam * 1.01], [shapes[:2], shapes, shapes]
    tracks = track([-1, 0, 0], lams, seen)
    assert [list(labels) for labels in tracks.labels] == [[1, 2], [1, 2, 3], [1, 2, 4]]
    return tracks, lams, seen


def joined(tracks, lams, shapes):
    return join_tracks(tracks, Ragged.of(lams), np.array([[1, 2]]), Known(shapes))


def test_a_mode_that_comes_in_on_two_branches_gets_one_number():
    tracks, lams, seen = branches()
    found = joined(tracks, lams, seen)
    assert [list(labels) for labels in found.labels] == [[1, 2], [1, 2, 3], [1, 2, 3]]


def test_tracks_are_not_joined_without_likeness_or_where_a_point_has_both():
    tracks, lams, seen = branches()
    unlike = [seen[0], seen[1], seen[2] @ np.diag([1.0, 1.0, 0.0])]
    assert joined(tracks, lams, unlike) is tracks
    labels = Ragged.of([tracks.labels[0], tracks.labels[1], np.array([1, 2, 4]), np.array([3, 4])])
    both = replace(tracks, labels=labels)
    lams.append(lams[1][1:])
    assert joined(both, lams, seen).labels.flat.tolist() == labels.flat.tolist()


def test_lines_of_a_grid_run_along_what_does_not_change_the_structure():
    parents = tracking_tree(np.zeros((6, 2)), (2, 3), (True, False))
    assert list(parents) == [-1, 0, 0, 1, 2, 3]
    assert cross_edges(np.zeros((6, 2)), parents, (2, 3)).tolist() == [[2, 3], [4, 5]]


# -- the brake


@pytest.mark.parametrize("solid", ["pad", "caliper"])
def test_corresponding_places_do_not_depend_on_the_mesh(solid):
    values = catalogue.MODELS["disc_brake"].defaults()
    found = []
    for density in (MEDIUM, COARSE):
        mesher = BrakeMesher(values, density)
        made = mesher.pad(-1) if solid == "pad" else mesher.caliper()
        rows = corresponding_rows(made)
        weight = rows @ np.ones(rows.shape[1])
        assert (weight[::3] ** 2).sum() == pytest.approx(made.M[::3, ::3].sum(), rel=1e-12)
        found.append((rows @ made.coordinates.ravel()) / weight)
    assert found[0] == pytest.approx(found[1], abs=1e-9)


def test_modes_of_a_pad_are_recognised_though_its_mesh_changes():
    values = catalogue.MODELS["disc_brake"].defaults()
    lams, seen, sizes = [], [], []
    for angle, density in ((32.0, COARSE), (33.0, MEDIUM)):
        values["pad.half_angle"] = angle
        pad = BrakeMesher(values, density).pad(-1)
        omega, phi = real_modes(pad.M, pad.K, TOP)
        lams.append(1j * omega[6:])
        seen.append((corresponding_rows(pad) @ phi[:, 6:]).T)
        sizes.append(pad.M.shape[0])
    assert sizes[0] != sizes[1]
    pairs = pair_modes(lams[0], seen[0], lams[1], seen[1])
    assert len(lams[0]) >= 3
    assert list(pairs.partner) == list(range(len(lams[0])))
    assert (pairs.mac > 0.98).all()
    assert not pairs.ambiguous.any()
