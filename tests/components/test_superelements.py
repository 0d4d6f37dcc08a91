"""Craig-Bampton superelements as components: all modes give the full one, fewer come near."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.io
import scipy.linalg as la
import scipy.sparse as sp
from own_blocks import block, write_blocks
from study_runs import solved
from test_model_file import built, frequencies

from squealstudy.engine.plan import Plan
from squealstudy.errors import StudyFileError
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.study.components import inspected, read_model
from squealstudy.study.definition import load_study

ALL = 10**6
BETA = 3e-8
LINING = ('"lining.E3" = {path = "slider.materials.LINING.E[3]", default = 2e3, unit = "MPa"}', "")


def craig_bampton(mesh, n_modes):
    """Reduced K, M, their boundary freedoms, and displacements of all nodes by rows of K."""
    K, M = stiffness_matrix(mesh).toarray(), mass_matrix(mesh).toarray()
    faces = np.unique(np.concatenate([mesh.node_set(s) for s in ("TOP", "BOTTOM", "ENDS")]))
    b = (3 * faces[:, None] + np.arange(3)).ravel()
    i = np.setdiff1d(np.arange(len(K)), b)
    psi = -la.solve(K[np.ix_(i, i)], K[np.ix_(i, b)], assume_a="pos")
    _, phi = la.eigh(K[np.ix_(i, i)], M[np.ix_(i, i)])
    phi = phi[:, :n_modes]
    R = np.zeros((len(K), len(b) + phi.shape[1]))
    R[b, np.arange(len(b))] = 1.0
    R[np.ix_(i, np.arange(len(b)))] = psi
    R[np.ix_(i, np.arange(len(b), R.shape[1]))] = phi
    reduced = [R.T @ A @ R for A in (K, M)]
    return [(A + A.T) / 2 for A in reduced], b, R


def names_of(mesh, b, m):
    """Node and direction of each row; scalar points behind the nodes for modal coordinates."""
    top = int(mesh.numbers.max())
    return [
        *((int(mesh.numbers[k // 3]), int(k % 3) + 1) for k in b),
        *((top + 1 + j, 0) for j in range(m)),
    ]


def dmig(rows, matrices):
    """In free fields, entries of more digits than small fields have."""
    lines = ["SOL 103", "BEGIN BULK"]
    for name, A in matrices.items():
        lines.append(f"DMIG,{name},0,6,2,0")
        lines += [
            f"DMIG*,{name},{rows[j][0]},{rows[j][1]},\n*,{rows[i][0]},{rows[i][1]},{A[i, j]:.16e}"
            for j in range(len(A))
            for i in range(j + 1)
            if A[i, j]
        ]
    return "\n".join([*lines, "ENDDATA"]) + "\n"


def write_superelement(
    folder, n_modes, form="npz", recovery=False, damping=False, more="", shift=0
):
    """The two blocks with the slider as a superelement, its rows in another order; its parts."""
    mesh = block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")
    (K, M), b, R = craig_bampton(mesh, n_modes)
    folder.mkdir(parents=True, exist_ok=True)
    order = np.random.default_rng(2).permutation(len(K))
    rows = [names_of(mesh, b, len(K) - len(b))[k] for k in order]
    K, M = (A[np.ix_(order, order)] for A in (K, M))
    R = R[:, order]
    matrices = {"K": K, "M": M} | ({"C": BETA * K} if damping else {})
    if form == "dmig":
        (folder / "se.pch").write_text(dmig(rows, {f"{k}AAX": A for k, A in matrices.items()}))
        table = "\n".join(f'{k} = {{file = "se.pch", name = "{k}AAX"}}' for k in matrices)
    else:
        lines = [f"{node}.{d}" if d else "modal" for node, d in rows]
        (folder / "se.dof").write_text("\n".join(lines[: len(lines) - shift]) + "\n")
        for k, A in matrices.items():
            if form == "npz":
                sp.save_npz(folder / f"{k}.npz", sp.csr_matrix(A))
            elif form == "mat":
                scipy.io.savemat(folder / f"{k}.mat", {"A": A})
            else:
                scipy.io.mmwrite(folder / f"{k}.mtx", sp.coo_matrix(A), precision=17)
        table = 'dof = "se.dof"\n' + "\n".join(f'{k} = "{k}.{form}"' for k in matrices)
    if recovery:
        np.savez(folder / "R.npz", R=R)
        table += '\nrecovery = "R.npz"'
    changes = [('mesh = "slider.inp"', f'nodes = "slider.inp"\n{table}\n{more}'), LINING]
    write_blocks(folder, *changes)
    write_slider(folder, mesh)
    return mesh, b, R, order


def write_slider(folder, mesh):
    write_inp(mesh, folder / "slider.inp")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The blocks with the slider's whole mesh."""
    folder = tmp_path_factory.mktemp("whole")
    write_blocks(folder, LINING)
    write_slider(folder, block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING"))
    return built(folder / "blocks.toml")


@pytest.mark.parametrize("form", ["npz", "mat", "mtx", "dmig"])
def test_with_all_modes_it_is_the_whole_component(whole, tmp_path, form):
    write_superelement(tmp_path, ALL, form)
    found = built(tmp_path / "blocks.toml")
    assert found.n_dof == whole.n_dof
    np.testing.assert_allclose(frequencies(found, 40), frequencies(whole, 40), rtol=1e-9)


def test_fewer_modes_come_near_from_above(whole, tmp_path):
    expected, before = frequencies(whole, 12), np.inf
    for n_modes, most in ((0, 0.1), (10, 1e-2), (25, 3e-3)):
        write_superelement(tmp_path / str(n_modes), n_modes)
        found = frequencies(built(tmp_path / str(n_modes) / "blocks.toml"), 12)
        off = found / expected - 1
        assert (off > -1e-9).all()
        assert off.max() < min(most, before)
        before = off.max()


def test_all_nodes_move_where_they_can_be_recovered(whole, tmp_path):
    mesh, b, R, order = write_superelement(tmp_path, 20, recovery=True)
    assembly = built(tmp_path / "blocks.toml")
    slider = assembly.components[1]
    q = np.random.default_rng(0).standard_normal(slider.n_dof)
    column = np.argsort(order)  # boundary freedoms ascend, modal ones are as the file has them
    freedom = np.concatenate([column[: len(b)], np.sort(column[len(b) :])])
    columns = slider.at_nodes(np.eye(slider.n_dof))  # modal coordinates have a scale of their own
    scale = np.linalg.norm(columns, axis=0) / np.linalg.norm(R[:, freedom], axis=0)
    np.testing.assert_allclose(scale[: len(b)], 1.0)
    atol = 1e-12 * abs(R).max()
    np.testing.assert_allclose(columns / scale, R[:, freedom], atol=atol)
    np.testing.assert_allclose(slider.at_nodes(q), R[:, freedom] @ (scale * q), atol=atol)
    assert slider.cells is not None
    assert sum(len(n) for _, n in slider.cells.blocks) == mesh.n_elements
    rigid = np.tile([1.0, 0.0, 0.0], len(mesh.nodes))
    moved = np.where(slider.dofs >= 0, (slider.dofs % 3 == 0).astype(float), 0.0)
    np.testing.assert_allclose(slider.at_nodes(moved), rigid, atol=1e-9)
    assert slider.mass == pytest.approx(whole.components[1].mass, rel=1e-9)
    found, _ = inspected(read_model(tmp_path / "blocks.toml"))
    told = " ".join(text for _, text in found.facts)
    assert "20 modal coordinates, all nodes recovered" in told
    assert told.count("6 rigid modes") == 2
    assert not [d for d in found.doubts if "rigid" in d]
    write_superelement(tmp_path / "bare", 20)
    found, _ = inspected(read_model(tmp_path / "bare" / "blocks.toml"))
    assert "20 modal coordinates" in " ".join(text for _, text in found.facts)


@pytest.mark.full_size  # by default with all modes: above
def test_its_damping(tmp_path):
    write_superelement(tmp_path, 20, damping=True, more="mass_damping = 7.0")
    slider = built(tmp_path / "blocks.toml").components[1]
    expected = BETA * slider.K + 7.0 * slider.M
    assert abs(slider.C - expected).max() < 1e-9 * abs(expected).max()
    write_superelement(tmp_path / "dmig", 20, form="dmig", damping=True)
    slider = built(tmp_path / "dmig" / "blocks.toml").components[1]
    assert abs(slider.C - BETA * slider.K).max() < 1e-9 * abs(slider.C).max()


def test_it_turns_with_its_placement(whole, tmp_path):
    """A quarter turn there and back in the mesh is none."""
    turn = "rotate = {axis = [0, 0, 1], angle = 90, point = [2.5, 1.0, 0.0]}"
    write_superelement(tmp_path, ALL, recovery=True, more=turn)
    slider = built(tmp_path / "blocks.toml").components[1]
    again = whole.components[1]
    w2 = la.eigh(slider.K.toarray(), slider.M.toarray(), eigvals_only=True)
    expected = la.eigh(again.K.toarray(), again.M.toarray(), eigvals_only=True)
    np.testing.assert_allclose(w2[6:40], expected[6:40], rtol=1e-8)
    moved = np.where(slider.dofs >= 0, (slider.dofs % 3 == 1).astype(float), 0.0)
    rigid = np.tile([0.0, 1.0, 0.0], len(slider.coordinates))
    np.testing.assert_allclose(slider.at_nodes(moved), rigid, atol=1e-9)


def test_a_study_of_a_superelement(tmp_path):
    write_superelement(tmp_path, 40, recovery=True)
    results = solved(Plan(load_study(tmp_path / "study.toml")), tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    assert results.points["reference_frequency_error"].min() < 1e-2
    shape = results.shape()
    assert np.isfinite(shape.displacement).all()


@pytest.mark.parametrize(
    ("what", "key", "message"),
    [
        ("dof", "components.slider.dof", "has no line in se.dof"),
        ("word", "components.slider.dof", "expected 'node.direction' or 'modal', got 'mode'"),
        ("shape", "components.slider.recovery", "R.npz is 3 x 3: expected three rows for each"),
        ("other", "components.slider.recovery", "does it belong to them"),
        ("same", "components.slider.recovery", "depend on each other"),
        ("text", "components.slider.recovery", "expected a file .npz or .mat"),
        ("mesh", "components.slider", "expected mesh, or K, M and nodes; got mesh and recovery"),
        ("held", "fixed[1].set", None),
    ],
)
def test_what_is_wrong_is_said_with_its_key(tmp_path, what, key, message):
    _, b, R, order = write_superelement(tmp_path, 5, recovery=True, shift=what == "dof")
    path = tmp_path / "blocks.toml"
    text = path.read_text()
    if what == "word":
        lines = (tmp_path / "se.dof").read_text()
        (tmp_path / "se.dof").write_text(lines.replace("modal", "mode", 1))
    elif what == "shape":
        np.savez(tmp_path / "R.npz", R=np.eye(3))
    elif what == "other":
        np.savez(tmp_path / "R.npz", R=R[::-1])
    elif what == "same":
        modal = np.flatnonzero(order >= len(b))
        R[:, modal[1]] = 2 * R[:, modal[0]]
        np.savez(tmp_path / "R.npz", R=R)
    elif what == "text":
        path.write_text(text.replace("R.npz", "R.mtx"))
        (tmp_path / "R.mtx").write_text("")
    elif what == "mesh":
        path.write_text(
            text.replace('mesh = "plate.inp"', 'mesh = "plate.inp"\nrecovery = "R.npz"')
        )
        key = "components.plate"
    elif what == "held":
        mesh = block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")
        inner = np.setdiff1d(
            np.arange(len(mesh.nodes)),
            np.concatenate([mesh.node_set(s) for s in ("TOP", "BOTTOM", "ENDS")]),
        )
        write_slider(tmp_path, replace(mesh, node_sets={"INNER": inner}))
        path.write_text(
            text.replace("[parameters]", '[[fixed]]\nset = "slider.INNER"\n[parameters]')
        )
        message = "follow others by a tie, a coupling, or the recovery"
    with pytest.raises(StudyFileError, match=re.escape(message)) as caught:
        built(path)
    assert str(caught.value.key).startswith(key)


def test_a_scalar_point_is_no_node(tmp_path):
    """A direction that is missing is not taken for a modal coordinate."""
    mesh, *_ = write_superelement(tmp_path, 1, form="dmig")
    text = (tmp_path / "se.pch").read_text()
    top = int(mesh.numbers.max())
    assert f",{top + 1},0," in text
    (tmp_path / "se.pch").write_text(text.replace(f",{top + 1},0,", f",{mesh.numbers[0]},0,"))
    message = f"has no direction of node {mesh.numbers[0]}: expected 1 to 6"
    with pytest.raises(StudyFileError, match=message):
        built(tmp_path / "blocks.toml")
