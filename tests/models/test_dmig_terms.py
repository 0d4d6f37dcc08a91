"""Terms of a family of matrices from Nastran's DMIG cards, unsymmetric friction among them."""

from __future__ import annotations

import numpy as np
import pytest
from study_runs import plan_of, solved

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.matrices.files import read_term_matrix
from squealstudy.models.matrices.labelled import LabelledMatrix

STUDY = """
[study]
name = "pch"
kind = "complex_modes"
[model]
name = "matrices"
[[model.term]]
matrix = "M"
file = "model.pch"
variable = "MAAX"
[[model.term]]
matrix = "K"
file = "model.pch"
variable = "KAAX"
[[model.term]]
matrix = "K"
file = "{file}"
{variable}
coefficient = "mu"
[parameters]
mu = 0.4
[[sweep]]
parameter = "mu"
values = [0.0, 0.4]
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
FREEDOMS = [(7, 1), (7, 3), (9, 2), (12, 0)]  # the last is a scalar point
K = 1e6 * np.array([[3.0, -1, 0, 0.5], [-1, 4, -1, 0], [0, -1, 5, 0], [0.5, 0, 0, 2]])
M = np.diag([1.0, 2.0, 3.0, 1.0])
FRICTION = np.zeros((4, 4))
FRICTION[1:3, 1:3] = 1e6 * np.array([[0.0, 3.0], [-2.5, 0.5]])


def cards(name, A, form):
    """Free fields, an entry a card; of form 6 one triangle."""
    lines = [f"DMIG,{name},0,{form},2,0,,,{len(A)}"]
    for column, row in np.argwhere(A.T):
        if form == 6 and row > column:
            continue
        (n, d), (m, e) = FREEDOMS[column], FREEDOMS[row]
        lines.append(f"DMIG,{name},{n},{d},,{m},{e},{A[row, column]:.12E}")
    return "\n".join(lines) + "\n"


def write(folder, file="model.pch", variable='variable = "K2PP"'):
    text = cards("KAAX", K, 6) + cards("MAAX", M, 6)
    (folder / "model.pch").write_text(text + cards("K2PP", FRICTION, 1))
    return STUDY.format(file=file, variable=variable)


def eigenvalues(mu):
    found = np.linalg.eigvals(np.linalg.solve(M, K + mu * FRICTION))
    return np.sort_complex(np.sqrt(-found.astype(complex)))


def test_friction_of_k2pp_is_a_term_of_the_stiffness(tmp_path):
    results = solved(plan_of(write(tmp_path), tmp_path / "a.toml"), tmp_path / "r")
    points = results.points.set_index("point_id")["mu"]
    for point, own in results.modes.groupby("point_id"):
        roots = eigenvalues(points[point])
        expected = np.sort(np.abs(roots) / (2 * np.pi))
        np.testing.assert_allclose(np.sort(own["frequency_hz"]), expected, rtol=1e-9)
        growth = np.sort(np.abs(own["growth_rate"]))
        np.testing.assert_allclose(growth, np.sort(np.abs(roots.real)), atol=1e-6)
    assert results.modes["growth_rate"].max() > 40.0


def test_terms_of_fewer_freedoms_lie_where_their_nodes_are(tmp_path):
    write(tmp_path)
    found = read_term_matrix(tmp_path / "model.pch", "k2pp")
    assert isinstance(found, LabelledMatrix)
    assert list(zip(found.nodes, found.directions, strict=True)) == FREEDOMS[1:3]
    np.testing.assert_allclose(found.matrix.toarray(), FRICTION[1:3, 1:3])


def test_a_matrix_market_term_has_rows_in_that_order(tmp_path):
    text = write(tmp_path, "f.mtx", "")
    rows, columns = np.nonzero(FRICTION)
    lines = [f"{i + 1} {j + 1} {FRICTION[i, j]:.12e}" for i, j in zip(rows, columns, strict=True)]
    head = f"%%MatrixMarket matrix coordinate real general\n4 4 {len(lines)}\n"
    (tmp_path / "f.mtx").write_text(head + "\n".join(lines) + "\n")
    results = solved(plan_of(text, tmp_path / "a.toml"), tmp_path / "r")
    other = solved(plan_of(write(tmp_path), tmp_path / "b.toml"), tmp_path / "s")
    assert results.modes["growth_rate"].max() == pytest.approx(other.modes["growth_rate"].max())


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("f.mtx", "%%MatrixMarket matrix coordinate real general\n2 2 1\n1 1 1.\n", "2 x 2, the"),
        ("f.pch", "DMIG,K2PP,0,1,3,0\nDMIG,K2PP,7,1,,7,1,1.,1.\n", "found type 3"),
        ("f.pch", "DMIG,K2PP,0,2,1,0\nDMIG,K2PP,7,1,,7,1,1.\n", "found form 2"),
        (
            "f.pch",
            "DMIG,K2PP,0,1,1,0\nDMIG,K2PP,7,1,,7,1,1.,,\nDMIG,K2PP,7,1,,7,1,2.\n",
            "line 3: this entry is there twice",
        ),
        ("f.pch", "DMIG,K2PP,0,1,1,0\nDMIG,K2PP,7,1,,7,1,1.,,,9,2,3.\n", "line 2: more than eight"),
        (
            "f.pch",
            "DMIG    K2PP    0       1       1\nDMIG    K2PP    7       1               7       1"
            "       1.\n9       2       3.\n",
            "line 3: expected a card, found '9 2 3.'",
        ),
    ],
)
def test_terms_that_are_none(tmp_path, file, content, message):
    text = write(tmp_path, file, "")
    (tmp_path / file).write_text(content)
    plan = plan_of(text, tmp_path / "a.toml")
    with pytest.raises((StudyFileError, ModelError), match=message):
        solved(plan, tmp_path / "r")


def test_a_line_that_ends_with_a_comma_goes_on_with_data(tmp_path):
    file = tmp_path / "f.pch"
    file.write_text("DMIG,K2PP,0,1,1,0\nDMIG,K2PP,7,1,,7,1,1.,\n9,2,3.\nDMIG,K2PP,9,2,,9,2,4.\n")
    np.testing.assert_array_equal(read_term_matrix(file).matrix.toarray(), [[1.0, 0.0], [3.0, 4.0]])
