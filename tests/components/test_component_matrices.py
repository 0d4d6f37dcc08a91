"""Matrices of components as Abaqus, CalculiX, Nastran and ANSYS write them, and their maps."""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.sparse as sp
from own_blocks import block, write_blocks
from study_runs import command
from test_model_file import built, frequencies

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.node_maps import FreedomsOf, read_map
from squealstudy.models.matrices.files import read_component_matrix
from squealstudy.models.matrices.labelled import LabelledMatrix

SLIDER = ("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")


@pytest.fixture(scope="module")
def slider():
    """Mesh, K and M of the slider, numbers of its nodes with gaps between them."""
    mesh = block(*SLIDER)
    return mesh, stiffness_matrix(mesh), mass_matrix(mesh)


def entries(A, half=True):
    """Row, column and value of one triangle, or of all; a pair now in one, now in the other."""
    coo = sp.coo_matrix(A)
    kept = coo.row >= coo.col if half else slice(None)
    i, j, value = coo.row[kept], coo.col[kept], coo.data[kept]
    if half:
        swapped = np.random.default_rng(0).random(len(i)) < 0.5
        i, j = np.where(swapped, j, i), np.where(swapped, i, j)
    return zip(i, j, value, strict=True)


def at(mesh, row):
    return mesh.numbers[row // 3], row % 3 + 1


def abaqus(mesh, A, half=True):
    lines = ["** written by a test"]
    for i, j, value in entries(A, half):
        (n, d), (m, e) = at(mesh, i), at(mesh, j)
        lines.append(f"{n},{d}, {m},{e}, {value:22.15e}")
    return "\n".join(lines) + "\n"


def punched(mesh, A, name, half=True):
    """As a .pch has it: a small head, large columns."""
    lines = ["$TITLE   = SLIDER", f"DMIG    {name:8}{0:8}{6 if half else 1:8}{2:8}{0:8}"]
    columns = {}
    for i, j, value in entries(A, half):
        columns.setdefault(j, []).append((i, value))
    for j, own in columns.items():
        lines.append("DMIG*   {:16}{:16}{:16}{:16}".format(name, *at(mesh, j), ""))
        for i, value in own:
            number = f"{value:.9E}".replace("E", "D") if abs(value) >= 1e-99 else "0."
            lines.append("*       {:16}{:16}{:>16}".format(*at(mesh, i), number))
    return "\n".join(lines) + "\n"


def in_free_fields(mesh, A, name):
    """Two entries a line of continuation, reals without E."""
    lines = ["SOL 103", "BEGIN BULK", "GRID,1,,0.,0.,0.", f"DMIG,{name},0,6,1,0,,,{A.shape[0]}"]
    columns = {}
    for i, j, value in entries(A):
        columns.setdefault(j, []).append((*at(mesh, i), f"{value:.7e}".replace("e", "")))
    for j, own in columns.items():
        first, *rest = own
        lines.append(",".join(map(str, ("DMIG", name, *at(mesh, j), "", *first, ""))))
        for k in range(0, len(rest), 2):
            words = [str(w) for entry in rest[k : k + 2] for w in (*entry, "")]
            lines.append("+," + ",".join(words))
    return "\n".join([*lines, "ENDDATA"]) + "\n"


def calculix(A):
    upper = sp.coo_matrix(sp.triu(A))
    rows = zip(upper.row, upper.col, upper.data, strict=True)
    return "".join(f"{i + 1} {j + 1} {value:.13e}\n" for i, j, value in rows)


def harwell(A):
    """As HBMAT writes it: one number a line, the right-hand side behind."""
    lower = sp.csc_matrix(sp.tril(A))
    lower.sort_indices()
    n, m = A.shape[0], lower.nnz
    head = [
        "Stiffness matrix from file.full".ljust(72) + "STIFF",
        f"{n + 1 + m + m + n:14}{n + 1:14}{m:14}{m:14}{n:14}",
        f"{'RSA':14}{n:14}{n:14}{m:14}{0:14}",
        f"{'(1I14)':16}{'(1I14)':16}{'(1E25.16)':20}{'(1E25.16)':20}",
        f"{'F':14}{1:14}{0:14}",
    ]
    numbers = [f"{k + 1:14}" for k in (*lower.indptr, *lower.indices)]
    numbers += [f"{v:25.16E}".replace("E", "D") for v in (*lower.data, *np.zeros(n))]
    return "\n".join([*head, *numbers]) + "\n"


def same(found, A, rtol=1e-12):
    return abs(found - A).max() <= rtol * abs(A).max()


def in_order_of(mesh, found: LabelledMatrix):
    rows = FreedomsOf(mesh, "slider.inp").at(found.nodes, found.directions)
    to = sp.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))))
    return to @ found.matrix @ to.T


# -- round trips ---------------------------------------------------------------------------------
@pytest.mark.parametrize("half", [True, False])
def test_abaqus_names_nodes(slider, tmp_path, half):
    mesh, K, _ = slider
    path = tmp_path / "job_STIF1.mtx"
    path.write_text(abaqus(mesh, K, half))
    assert same(in_order_of(mesh, read_component_matrix(path)), K)
    path.write_text(abaqus(mesh, K, half).replace(",", " ").replace("e", "D"))  # LABELS, by blanks
    assert same(in_order_of(mesh, read_component_matrix(path)), K)


def test_matrix_market_has_the_same_ending(tmp_path):
    text = "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 2.0\n2 1 -1\n2 2 2\n"
    for mark in ("", "\ufeff"):
        (tmp_path / "a.mtx").write_text(mark + text, encoding="utf-8")
        found = read_component_matrix(tmp_path / "a.mtx")
        assert found.toarray().tolist() == [[2.0, -1.0], [-1.0, 2.0]]


def test_abaqus_by_coordinates(slider, tmp_path):
    _, K, _ = slider
    path = tmp_path / "job_STIF1.mtx"
    path.write_text("".join(f"{i + 1}, {j + 1}, {v:.15e}\n" for i, j, v in entries(K, half=False)))
    assert same(read_component_matrix(path), K)


@pytest.mark.parametrize("form", ["punched", "whole", "free"])
def test_dmig(slider, tmp_path, form):
    mesh, K, M = slider
    write = {
        "punched": punched,
        "whole": lambda *a: punched(*a, half=False),
        "free": in_free_fields,
    }[form]
    path = tmp_path / "panel.bdf"
    path.write_text(write(mesh, K, "KAAX") + write(mesh, M, "MAAX"))
    for name, A in (("KAAX", K), ("maax", M)):
        found = in_order_of(mesh, read_component_matrix(path, name))
        assert same(found, A, 1e-7 if form == "free" else 1e-9)
    path.write_text(write(mesh, K, "KAAX"))
    assert same(in_order_of(mesh, read_component_matrix(path)), K, 1e-7)


def test_touching_columns_of_dmig(tmp_path):
    """Nastran leaves no blank between a direction and a negative number."""
    path = tmp_path / "a.pch"
    path.write_text(
        "DMIG    KAAX           0       6       2       0                       2\n"
        "DMIG*   KAAX                          21               2\n"
        "*                     21               2 2.261491337D+08\n"
        "*                     22               1-1.866666647-003\n"
        "DMIG*   KAAX                          22               1\n"
        "*                     22               1 1.5\n"
    )
    found = read_component_matrix(path)
    assert found.nodes.tolist() == [21, 22]
    assert found.directions.tolist() == [2, 1]
    assert found.matrix.toarray().tolist() == [
        [2.261491337e8, -1.866666647e-3],
        [-1.866666647e-3, 1.5],
    ]


def test_small_fields_hold_two_entries_a_line(tmp_path):
    path = tmp_path / "a.bdf"
    path.write_text(
        "DMIG    STIF    0       6       1       0\n"
        "DMIG    STIF    27      1               27      1       3.+5            +A\n"
        "+A      27      3       2.5+10  0.      50      1       1.0     0.\n"
        "$ the end\n"
        "DMIG    STIF    50      1               50      1       7.0\n"
        "FORCE   1       50      0       1.0     0.      0.      1.0\n"
        "+       1       2\n"
    )
    found = read_component_matrix(path)
    assert found.matrix.toarray().tolist() == [[3e5, 2.5e10, 1.0], [2.5e10, 0, 0], [1.0, 0, 7.0]]


# -- components of model files -------------------------------------------------------------------
def with_matrices(folder, slider, kind):
    """The blocks with a slider of matrices, its nodes in another order than the matrices."""
    mesh, K, M = slider
    order = np.random.default_rng(1).permutation(K.shape[0])
    shuffled = [A[order][:, order] for A in (K, M)]
    files = {"abaqus": ("K.mtx", "M.mtx"), "nastran": ("se.pch",), "calculix": ("K.sti", "K.mas"),
             "ansys": ("K.matrix", "M.matrix")}[kind]  # fmt: skip
    lines = [f'K = "{files[0]}"', f'M = "{files[-1]}"', 'nodes = "slider.inp"']
    text = {
        "abaqus": lambda: [abaqus(mesh, A) for A in (K, M)],
        "nastran": lambda: [punched(mesh, K, "KAAX") + punched(mesh, M, "MAAX")],
        "calculix": lambda: [calculix(A) for A in shuffled],
        "ansys": lambda: [harwell(A) for A in shuffled],
    }[kind]()
    if kind == "nastran":
        lines[:2] = [f'{k} = {{file = "se.pch", name = "{k}AAX"}}' for k in "KM"]
    if kind == "calculix":
        lines.append('dof = "K.dof"')
        (folder / "K.dof").write_text("".join("{}.{}\n".format(*at(mesh, i)) for i in order))
    if kind == "ansys":
        lines.append('dof = "K.mapping"')
        rows = [
            "{:>10}{:>10}   U{}\n".format(k + 1, at(mesh, i)[0], "XYZ"[i % 3])
            for k, i in enumerate(order)
        ]
        shuffled_rows = [rows[i] for i in np.random.default_rng(2).permutation(len(rows))]
        head = " Matrix Eqn      Node   DOF\n"
        (folder / "K.mapping").write_text(head + "".join(shuffled_rows))
    for name, content in zip(files, text, strict=True):
        (folder / name).write_text(content)
    return "\n".join(lines)


@pytest.fixture(scope="module")
def blocks_of_mesh(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blocks")
    write_blocks(folder)
    return built(folder / "blocks.toml")


@pytest.mark.parametrize("kind", ["abaqus", "nastran", "calculix", "ansys"])
def test_a_component_of_matrices_is_that_of_the_mesh(slider, blocks_of_mesh, tmp_path, kind):
    table = with_matrices(tmp_path, slider, kind)
    write_blocks(tmp_path, ('mesh = "slider.inp"', table))
    found = built(tmp_path / "blocks.toml")
    assert frequencies(found) == pytest.approx(frequencies(blocks_of_mesh), rel=1e-8)


def test_ten_digits_leave_six_rigid_modes(slider, tmp_path, capsys):
    """Of a punched file, whose rigid motions are not quite free of strain."""
    write_blocks(tmp_path, ('mesh = "slider.inp"', with_matrices(tmp_path, slider, "nastran")))
    command("inspect", str(tmp_path / "blocks.toml"))
    facts = " ".join(capsys.readouterr().out.split())
    assert "70 nodes of matrices" in facts
    assert facts.count("6 rigid modes, no other mode up to 64000 Hz") == 2


def test_files_that_hold_several_matrices_need_a_name(slider, tmp_path):
    table = with_matrices(tmp_path, slider, "nastran")
    wrong = table.replace('{file = "se.pch", name = "KAAX"}', '"se.pch"')
    write_blocks(tmp_path, ('mesh = "slider.inp"', wrong))
    with pytest.raises(StudyFileError, match="holds the matrices KAAX, MAAX: expected the name"):
        built(tmp_path / "blocks.toml")
    (tmp_path / "blocks.toml").unlink()
    write_blocks(tmp_path, ('mesh = "slider.inp"', table.replace("MAAX", "MGG")))
    with pytest.raises(StudyFileError, match="no matrix 'MGG'; its matrices are KAAX, MAAX") as it:
        built(tmp_path / "blocks.toml")
    assert it.value.key == "components.slider.M"


def test_matrices_of_another_mesh(slider, tmp_path):
    table = with_matrices(tmp_path, slider, "abaqus")
    text = (tmp_path / "M.mtx").read_text()
    (tmp_path / "M.mtx").write_text(text + "9999,1, 9999,1, 1.0\n")
    write_blocks(tmp_path, ('mesh = "slider.inp"', table))
    with pytest.raises(
        StudyFileError, match=r"slider\.inp has no node 9999; .*is it the mesh"
    ) as it:
        built(tmp_path / "blocks.toml")
    assert it.value.key == "components.slider.M"
    write_blocks(tmp_path, ('mesh = "slider.inp"', table + '\ndof = "K.dof"'))
    (tmp_path / "K.dof").write_text("1.1\n")
    with pytest.raises(StudyFileError, match="names nodes and directions itself"):
        built(tmp_path / "blocks.toml")


# -- messages ------------------------------------------------------------------------------------
ABAQUS = "1,1, 1,1, 2.0\n2,1, 1,1, -1.0\n2,1, 2,1, 2.0\n"
DMIG = """\
DMIG    KAAX           0       6       2       0
DMIG*   KAAX                           1               1
*                      1               1 2.000000000D+00
*                      2               1-1.000000000D+00
DMIG*   KAAX                           2               1
*                      2               1 2.000000000D+00
"""
STI = "1 1 2.0\n1 2 -1.0\n2 2 2.0\n"
HEAD = "DMIG    KAAX           0       6       2       0"


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("a.mtx", "2.0\n2", "x\n2", "line 1: expected row node and .*found '1,1, 1,1, x'"),
        ("a.mtx", "2,1, 1,1,", "2,1, 1,1,,", "line 2: expected row node"),
        ("a.mtx", "-1.0", "-1,0", "line 2: expected row node"),
        ("a.mtx", "-1.0", "1e400", "line 2: expected a finite value"),
        ("a.mtx", "-1.0", "", "line 2: expected row node"),
        ("a.mtx", "2,1, 2,1, 2.0\n", "-1,1, -1,1, 2.0\n", "line 3: expected a node of the mesh"),
        ("a.mtx", "2,1, 2,1", "2,7, 2,7", "line 3: expected a direction 1 to 6"),
        ("a.mtx", "2,1, 2,1, 2.0", "2,1, 2,1, 1e36", r"line 3: 1e\+36 stands for a boundary"),
        ("a.mtx", "2,1, 2,1, 2.0", "2,1, 1,1, 2.0", "line 3: this entry is there twice"),
        ("a.mtx", "2,1, 2,1, 2.0", "1,1, 2,1, -3.0", "line 2: -1, in the other triangle -3"),
        ("a.mtx", "2,1, 2,1, 2.0", "2,1, 2,1, 2.0\n1,1, 2,1, -1.0\n3,1, 1,1, 7.",
         "line 5: not symmetric: it is not in the other triangle"),
        ("a.mtx", "1,1, 1,1", "*CLOAD, REAL\n1,1, 1,1", "line 1: expected entries .*'\\*CLOAD"),
        ("a.mtx", ABAQUS, "", "expected entries of a matrix, the file has none"),
        ("a.mtx", ABAQUS, "** only this\n", "expected entries of a matrix, the file has none"),
        ("a.mtx", ABAQUS, "\x00\x01\x02", "line 1: expected row"),
        ("a.sti", "-1.0", "-1.0 4", "line 2: expected row and column and a value"),
        ("a.sti", "1 2 -1.0", "0 2 -1.0", "line 2: expected a row at least 1, found 0"),
        ("a.sti", "1 2 -1.0", "1 2000000000 -1.0", "line 2: expected a column at most 3"),
        ("a.sti", "1 2 -1.0", "1.5 2 -1.0", "line 2: expected row and column and a value"),
        ("a.sti", "1 2 -1.0", "1 1 -1.0", "line 2: this entry is there twice"),
        ("a.sti", STI, "", "expected entries of a matrix, the file has none"),
        ("a.pch", "2.000000000D+00\n*   ", "two\n*   ", "line 3: expected a number, found 'two'"),
        ("a.pch", HEAD + "\n", "", "line 1: expected a card with 0 in field 3"),
        ("a.pch", "       6  ", "       9  ", "line 1: expected a square .*found form 9"),
        ("a.pch", "6       2  ", "6       4  ", "line 1: expected real values.*found type 4"),
        ("a.pch", "       6  ", "       1  ", "line 4: not symmetric: it is not in the other"),
        ("a.pch", "2               1-1", "2               8-1", "line 4: expected a direction 1"),
        ("a.pch", "2               1-1", "N               1-1", "line 4: expected a node, found"),
        ("a.pch", "-1.000000000D+00", "-1.000000000D+00        1.000D+00", "an imaginary part"),
        ("a.pch", "-1.000000000D+00", "", "line 4: expected a number, found ''"),
        ("a.pch", "-1.000000000D+00", "-1.00000000D+999", "line 4: a number too large"),
        ("a.pch", "*                      2               1-1.000000000D+00",
         "*                      1               1-1.000000000D+00", "line 4: this entry is there"),
        ("a.pch", DMIG, HEAD + "\n" + HEAD + "\n", "line 2: the matrix KAAX has a head already"),
        ("a.pch", DMIG, HEAD + "\n", "the matrix KAAX has no entries"),
        ("a.pch", DMIG, "GRID,1\n", "has no DMIG card"),
        ("a.pch", DMIG, "DMIG\n", "line 1: expected the name"),
        ("a.pch", HEAD, "PARAM,CM2,0.5\n" + HEAD, "line 1: CM2 multiplies matrices"),
        ("a.pch", HEAD, "PARAM   CK2     2.\n" + HEAD, "line 1: CK2 multiplies matrices"),
        ("a.pch", HEAD, "K2GG = 2.0*KAAX\n" + HEAD, "line 1: K2GG multiplies matrices"),
    ],
)  # fmt: skip
def test_a_malformed_line_is_named(tmp_path, file, old, new, message):
    text = {"a.mtx": ABAQUS, "a.sti": STI, "a.pch": DMIG}[file]
    assert old in text
    path = tmp_path / file
    for ends in ("\n", "\r\n"):
        path.write_bytes(text.replace(old, new, 1).replace("\n", ends).encode())
        with pytest.raises(ModelError, match=message) as raised:
            read_component_matrix(path)
        assert str(path) in str(raised.value)


def test_what_is_written_there_is_read(tmp_path):
    """The texts that the messages above start from are sound."""
    of_deck = "PARAM,CM2,1.\nPARAM,WTMASS,0.5\n" + DMIG  # Nastran's M2GG is not multiplied by it
    for name, text in (("a.mtx", ABAQUS), ("a.sti", STI), ("a.pch", DMIG), ("c.pch", of_deck)):
        (tmp_path / name).write_text(text)
        found = read_component_matrix(tmp_path / name)
        matrix = found.matrix if isinstance(found, LabelledMatrix) else found
        assert matrix.toarray().tolist() == [[2.0, -1.0], [-1.0, 2.0]]
    with pytest.raises(ModelError, match="one matrix without a name"):
        read_component_matrix(tmp_path / "a.mtx", "K")
    with pytest.raises(ModelError, match="there is no file"):
        read_component_matrix(tmp_path / "b.pch")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 11 UX\n2 11 TEMP\n", "line 2: TEMP: expected one of UX, UY, UZ, ROTX"),
        ("1 11 UX\n2 11\n", "line 2: expected equation, node and UX ... ROTZ, got '2 11'"),
        ("1 11 UX\n1 11 UY\n", "line 2: equation 1 is there already"),
        ("1 11 UX\n2 11 UX\n", "line 2: 11.1 is in line 1 already"),
        ("Eqn Node DOF\n\n1 11 UX\n3 11 UY\n", "has 2 equations, but none with number 2"),
        ("1 11 UX\nEnd of file\n", "line 2: expected equation"),
        ("1 900 UX\n", "line 1: slider.inp has no node 900"),
    ],
)
def test_a_malformed_mapping_is_named(slider, tmp_path, text, message):
    path = tmp_path / "a.mapping"
    path.write_text(text)
    with pytest.raises(ModelError, match=re.escape(message)):
        read_map(path, FreedomsOf(slider[0], "slider.inp"))


def test_no_bytes_at_all_raise_anything_else(tmp_path):
    """Torn and shuffled files are a matrix or one error."""
    rng = np.random.default_rng(5)
    for name, text in (("a.mtx", ABAQUS), ("a.sti", STI), ("a.pch", DMIG)):
        for _ in range(300):
            data = bytearray(text.encode())
            for _ in range(rng.integers(1, 4)):
                data[rng.integers(len(data))] = rng.integers(256)
            (tmp_path / name).write_bytes(bytes(data[: rng.integers(1, len(data) + 1)]))
            try:
                found = read_component_matrix(tmp_path / name)
            except ModelError:
                continue
            matrix = found.matrix if isinstance(found, LabelledMatrix) else found
            assert np.isfinite(matrix.data).all()
            assert abs(matrix - matrix.T).max() <= 1e-8 * abs(matrix).max()


@pytest.mark.parametrize("key", ["K", "M"])
def test_matrices_with_a_negative_direction_are_refused(slider, tmp_path, key):
    """One entry beside the diagonal that is far too large, its mirror too."""
    mesh, *both = slider
    A = both["KM".index(key)] = both["KM".index(key)].tolil()
    A[0, 5] = A[5, 0] = 3 * A.diagonal().max()
    table = with_matrices(tmp_path, (mesh, *(B.tocsr() for B in both)), "abaqus")
    write_blocks(tmp_path, ('mesh = "slider.inp"', table))
    with pytest.raises(StudyFileError, match=f"slider.{key}.*not positive"):
        built(tmp_path / "blocks.toml")
