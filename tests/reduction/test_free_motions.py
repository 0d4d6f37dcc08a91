"""Singular points: what is free is named, and the others of a study are solved all the same."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import own_blocks
import pytest
import scipy.sparse as sp
from component_meshes import STEEL, box
from study_runs import plan_of, solved

from squealstudy.errors import SquealstudyError
from squealstudy.models.assembly import Component
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.reduction.free_motions import _free_motions_text as named

SWEEP = own_blocks.STUDY.replace('"friction"', '"guides.x"').replace("[0.3, 0.6]", "[0.0, 1e7]")


def brake(folder, stiffness):
    """The blocks with guides of this stiffness."""
    own_blocks.write_blocks(folder)
    path = folder / "blocks.toml"
    path.write_text(path.read_text().replace("[2e4, 1.5e4, 1e3]", stiffness))


def test_one_singular_point_is_a_row_that_names_what_is_free(tmp_path):
    """The value of the model file itself is singular too."""
    brake(tmp_path, "[0.0, 1.5e4, 1e3]")
    study = SWEEP.replace("reference_points = 1", "reference_points = 0")
    points = solved(plan_of(study, tmp_path / "study.toml"), tmp_path / "r").points
    status = points.set_index("guides.x")["status"]
    assert status.to_dict() == {0.0: "structure", 1e7: "ok"}
    (message,) = points.loc[points["status"] != "ok", "message"]
    assert "1 motion is free, of slider along x:" in message


def test_a_run_of_singular_points_alone_names_what_is_free(tmp_path):
    brake(tmp_path, "[0.0, 0.0, 0.0]")
    plan = plan_of(own_blocks.STUDY, tmp_path / "study.toml")
    told = r"study\.toml: .*3 motions are free, of slider along x, slider along y, slider about z:"
    with pytest.raises(SquealstudyError, match=told):
        solved(plan, tmp_path / "r")


@pytest.mark.parametrize("cells", [(2, 1, 1), (6, 5, 5)])  # all eigenvalues, and the least
def test_what_is_loose_within_a_component(cells):
    mesh = box("C3D8", cells, materials={"S": STEEL})
    K, M = stiffness_matrix(mesh), mass_matrix(mesh)
    nodes = np.vstack([mesh.nodes, mesh.nodes + np.array([5.0, 0, 0])])
    pair = Component("pads", sp.block_diag([M, M]), sp.block_diag([K, K]), coordinates=nodes)
    held = np.zeros(pair.n_dof)
    held[: len(held) // 2] = K.diagonal().mean()  # the first of two bodies
    other = Component("disc", M, K, coordinates=mesh.nodes)
    bed = np.full(other.n_dof, K.diagonal().mean())
    bed[2::3] = 0.0
    both = sp.block_diag([pair.K + sp.diags(held), other.K + sp.diags(bed)]).tocsr()
    told = named(SimpleNamespace(components=(pair, other)), both)
    assert told == "7 motions are free, of pads in itself, disc along z"


FAMILY = """
[study]
name = "f"
kind = "complex_modes"
[model]
name = "matrices"
[[model.term]]
matrix = "M"
file = "a.npz"
[[model.term]]
matrix = "M"
file = "b.npz"
coefficient = "p"
[[model.term]]
matrix = "K"
file = "a.npz"
coefficient = "1e4"
[[model.term]]
matrix = "K"
file = "b.npz"
coefficient = "4e4 * p"
[parameters]
p = 0.0
[[sweep]]
parameter = "p"
values = [0.0, 1.0]
[modes]
band = [1.0, 100.0]
reference_points = 0
"""


def test_matrices_that_are_singular_at_the_values_of_parameters(tmp_path):
    for name, diagonal in (("a", [1.0, 0.0]), ("b", [0.0, 1.0])):
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(np.diag(diagonal)))
    results = solved(plan_of(FAMILY, tmp_path / "f.toml"), tmp_path / "r")
    assert results.points.set_index("p")["status"].to_dict() == {0.0: "singular", 1.0: "ok"}
    expected = np.array([100.0, 200.0]) / (2 * np.pi)
    np.testing.assert_allclose(np.sort(results.modes["frequency_hz"]), expected, rtol=1e-12)
    alone = plan_of(FAMILY.replace("[0.0, 1.0]", "[0.0]"), tmp_path / "g.toml")
    with pytest.raises(SquealstudyError, match=r"every design point failed \(1 singular\)"):
        solved(alone, tmp_path / "s")
