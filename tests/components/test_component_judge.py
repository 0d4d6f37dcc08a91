"""CalculiX as the outside judge: K and M of every element that is called verified.

The judge is a program of its own (Debian and Ubuntu: ``apt-get install calculix-ccx``), 2.20 when
this was written. Where it is not installed these tests are skipped, and say so.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from calculix import AXES, CCX, apart, judged, ragged, run
from component_meshes import LINING, STEEL, box
from own_blocks import block, write_blocks
from test_model_file import built

from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.solid_meshes import mesh_of_grid
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.models.components.faces import boundary
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.materials import Anisotropic
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix

pytestmark = pytest.mark.skipif(
    CCX is None,
    reason="ELEMENTS ARE NOT CHECKED BY CALCULIX: there is no program ccx (Debian: calculix-ccx)",
)
SKEW = Anisotropic.of_stiffness(
    LINING.stiffness() + 500.0 * (np.ones((6, 6)) - np.eye(6)), LINING.density
)
VERIFIED = [name for name, f in FORMULATIONS.items() if f.verified.startswith("K and M")]


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize(
    "material", [STEEL, LINING, SKEW], ids=["isotropic", "orthotropic", "anisotropic"]
)
@pytest.mark.parametrize("name", VERIFIED)
def test_matrices_of_an_element(tmp_path, name, material, axes):
    mesh = ragged(name, material, AXES[axes])
    K, M = judged(tmp_path, mesh)
    assert apart(stiffness_matrix(mesh), K) < 1e-10
    assert apart(mass_matrix(mesh, "as_stiffness"), M) < 1e-10


def test_full_mass_of_reduced_hexahedra_is_that_of_full_ones(tmp_path):
    """CalculiX takes 2 x 2 x 2 points for the mass of C3D20R: 20 % and more apart."""
    mesh = box("C3D20R", (2, 1, 1), uneven=0.2)
    full = box("C3D20", (2, 1, 1), uneven=0.2)
    _, M = judged(tmp_path, full)
    assert apart(mass_matrix(mesh), M) < 1e-10
    (tmp_path / "reduced").mkdir()
    _, M = judged(tmp_path / "reduced", mesh)
    assert apart(mass_matrix(mesh), M) > 0.15


@pytest.mark.parametrize(("uneven", "stiffness"), [(0.0, 1e-10), (0.2, None)])
def test_incompatible_modes_agree_on_parallelepipeds(tmp_path, uneven, stiffness):
    """Of other shapes the inner slopes of CalculiX lack a ratio, and fail the patch test."""
    mesh = box("C3D8I", (2, 2, 2), uneven=uneven)
    K, M = (A.tocsc() for A in judged(tmp_path, mesh))
    n = 3 * len(mesh.nodes)
    condensed = K[:n, :n] - K[:n, n:] @ sp.linalg.spsolve(K[n:, n:], K[n:, :n])
    assert apart(mass_matrix(mesh), M[:n, :n]) < 1e-10
    u = (mesh.nodes @ np.array([[1, 2, 3], [0, 1, 2], [0, 0, -1.0]])).ravel()
    inside = ((mesh.nodes > 1e-9) & (mesh.nodes < np.array([3, 2, 2.5]) - 1e-9)).all(axis=1)
    force = (condensed @ u).reshape(-1, 3)
    rest = np.abs(force[inside]).max() / np.abs(force).max()
    if stiffness:
        assert apart(stiffness_matrix(mesh), condensed) < stiffness
        assert rest < 1e-11
    else:
        assert rest > 1e-3


def test_mass_of_mean_dilatation(tmp_path):
    """Its stiffness is published: C3D8 of CalculiX has plain strains."""
    mesh = box("C3D8_BBAR", (2, 1, 1), uneven=0.2)
    K, M = judged(tmp_path, mesh)
    assert apart(mass_matrix(mesh), M) < 1e-10
    assert apart(stiffness_matrix(mesh), K) > 1e-2


@pytest.fixture(scope="module")
def pad():
    mesher = BrakeMesher(MODELS["disc_brake"].defaults(), COARSE)
    return mesh_of_grid("pad", mesher.component("outer_pad").grid, mesher.materials("outer_pad"))


def test_matrices_of_a_generated_pad(tmp_path, pad):
    """Two materials, one orthotropic, metres and kilograms; sets and surfaces are taken too."""
    few = np.arange(0, len(pad.nodes), 7)
    pad = replace(pad, node_sets={"FEW": few}, surfaces={"SKIN": boundary(pad)})
    K, M = judged(tmp_path, pad)
    assert "WARNING" not in run(tmp_path, pad)
    assert apart(stiffness_matrix(pad), K) < 1e-10
    assert apart(mass_matrix(pad), M) < 1e-10


def test_free_frequencies_of_a_generated_pad(tmp_path, pad):
    said = run(tmp_path, pad, "*STEP", "*FREQUENCY", "14", "*END STEP")
    lines = (tmp_path / "job.dat").read_text().split("\n")
    rows = [line.split() for line in lines]
    hz = [float(r[3]) for r in rows if len(r) == 5 and r[0].isdigit()][:14]
    assert len(hz) == 14, said
    omega, _ = real_modes(mass_matrix(pad), stiffness_matrix(pad), 1.05 * hz[-1])
    np.testing.assert_allclose(omega[6:14] / (2 * np.pi), hz[6:14], rtol=1e-6)


def test_matrices_that_calculix_has_stored_are_a_component(tmp_path):
    """Rows of what is held are not in them: it is held in the model too."""
    slider = block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")
    held = [f"{n}, 1, 1" for n in slider.numbers[slider.node_set("ENDS")]]
    step = ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP"]
    of_mesh = ('mesh = "slider.inp"', 'mass = "as_stiffness"\nmesh = "slider.inp"')
    table = 'K = "job.sti"\nM = "job.mas"\ndof = "job.dof"\nnodes = "slider.inp"'
    fixed = ("[parameters]", '[[fixed]]\nset = "slider.ENDS"\ndofs = [1]\n[parameters]')
    for name, lines, changes in (
        ("free", step, [of_mesh]),
        ("held", ["*BOUNDARY", *held, *step], [of_mesh, fixed]),
    ):
        write_blocks(tmp_path / name, *changes)
        expected = built(tmp_path / name / "blocks.toml")
        write_blocks(tmp_path / name, (of_mesh[0], table))
        said = run(tmp_path / name, slider, *lines)
        assert (tmp_path / name / "job.sti").is_file(), said
        found = built(tmp_path / name / "blocks.toml")
        for A, B in zip(expected.components, found.components, strict=True):
            assert A.n_dof == B.n_dof
            assert apart(B.K, A.K) < 1e-10
            assert apart(B.M, A.M) < 1e-10


def test_a_mass_on_a_node(tmp_path):
    """CalculiX's element MASS, on a corner."""
    slider = block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")
    (corner,) = slider.numbers[slider.node_set("CORNER")]
    element = [f"*ELEMENT, TYPE=MASS, ELSET=WEIGHT\n9001, {corner}", "*MASS, ELSET=WEIGHT\n2e-6"]
    step = ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP"]
    said = run(tmp_path, slider, *element, *step)
    assert (tmp_path / "job.sti").is_file(), said
    table = 'K = "job.sti"\nM = "job.mas"\ndof = "job.dof"\nnodes = "slider.inp"'
    mesh = ('mesh = "slider.inp"', 'mass = "as_stiffness"\nmesh = "slider.inp"')
    mass = '[[point_mass]]\nname = "weight"\non = "slider.CORNER"\nmass = 2e-6\n[parameters]'
    write_blocks(tmp_path, mesh, ("[parameters]", mass))
    expected = built(tmp_path / "blocks.toml").components[1]
    write_blocks(tmp_path, (mesh[0], table))
    found = built(tmp_path / "blocks.toml").components[1]
    assert apart(found.K, expected.K) < 1e-10
    assert apart(found.M, expected.M) < 1e-10
