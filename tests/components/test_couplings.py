"""Ties and couplings of a component: against CalculiX, closed forms, one mesh; what is refused."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from calculix import CCX, apart, run
from component_meshes import box, rigid_shapes
from coupled_boxes import HIGH, LOW, stacked
from own_blocks import write_blocks
from test_model_file import built, frequencies

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.study.components import inspected, read_model

TIE = ("*TIE, NAME=GLUE", "UPPER, LOWER")
KINEMATIC = ("*COUPLING, CONSTRAINT NAME=C, REF NODE={ref}, SURFACE=TOP", "*KINEMATIC", "1, 3")
DISTRIBUTING = (KINEMATIC[0], "*DISTRIBUTING", "1, 3")
RIGID = ("*RIGID BODY, NSET=TOPS, REF NODE={ref}, ROT NODE={rot}",)
REFERENCE = (1.7, 1.2, 6.0)
needs_ccx = pytest.mark.skipif(
    CCX is None,
    reason="COUPLINGS ARE NOT CHECKED BY CALCULIX: there is no program ccx (Debian: calculix-ccx)",
)


def boxes(lines, formulation="C3D20", **more):
    """Two boxes, with two reference nodes where lines name them; the lines."""
    coupled = any("{ref}" in line for line in lines)
    mesh = stacked(formulation, more=(REFERENCE,) * (2 * coupled), **more)
    if coupled:
        tops = {**mesh.node_sets, "TOPS": mesh.node_set("TOP")}
        mesh = replace(mesh, node_sets=tops)
    ref, rot = mesh.numbers[-2:]
    return mesh, [line.format(ref=ref, rot=rot) for line in lines]


def read(folder, lines, formulation="C3D20", **more):
    """The boxes read from a file, placed on their masters; how their nodes move; K and M."""
    mesh, lines = boxes(lines, formulation, **more)
    write_inp(mesh, folder / "boxes.inp", lines)
    mesh = read_inp(folder / "boxes.inp")
    check_mesh(mesh)
    mesh, expansion = expanded(mesh)
    K, M = stiffness_matrix(mesh), mass_matrix(mesh, "as_stiffness")
    return mesh, expansion, expansion.restricted(K), expansion.restricted(M)


def free_hz(K, M, n):
    """The first elastic frequencies of a free body, Hz, and the largest of the six rigid ones."""
    w2 = la.eigh(K.toarray(), M.toarray(), eigvals_only=True)[: n + 6]
    hz = np.sqrt(np.abs(w2)) / (2 * np.pi)
    return hz[6:], hz[:6].max()


@needs_ccx
@pytest.mark.parametrize("lines", [TIE, (*TIE, *KINEMATIC), (*TIE, *RIGID)])
@pytest.mark.parametrize("formulation", ["C3D20", "C3D8", "C3D10"])
def test_free_modes_of_calculix(tmp_path, lines, formulation):
    if "*KINEMATIC" in lines and formulation == "C3D20":
        lines = (*lines, "*ELEMENT, TYPE=MASS, ELSET=W", "9001, {ref}", "*MASS, ELSET=W", "1e-7")
    mesh, written = boxes(lines, formulation)
    (tmp_path / "ccx").mkdir()
    said = run(tmp_path / "ccx", mesh, *written, "*STEP", "*FREQUENCY", "14", "*END STEP")
    rows = [row.split() for row in (tmp_path / "ccx" / "job.dat").read_text().split("\n")]
    hz = [float(r[3]) for r in rows if len(r) == 5 and r[0].isdigit()][6:14]
    assert len(hz) == 8, said
    ours = [
        line for line in lines if ("MASS" not in line and line[0] not in "19") or line == "1, 3"
    ]
    mesh, e, K, M = read(tmp_path, ours, formulation)
    if ours != list(lines):
        weight = np.zeros(3 * len(mesh.nodes))
        weight[3 * mesh.used_without_element[0] :][:3] = 1e-7
        M = M + e.restricted(sp.diags(weight).tocsr())
    # its Lanczos steps leave 3e-4 on first-order elements; matrices are compared below
    tolerance = {"C3D20": 1e-5, "C3D8": 1e-3, "C3D10": 1e-4}[formulation]
    np.testing.assert_allclose(free_hz(K, M, 8)[0], hz, rtol=tolerance)


@needs_ccx
@pytest.mark.parametrize("gap", [0.0, 0.01])
@pytest.mark.parametrize("formulation", ["C3D20", "C3D8", "C3D10"])
def test_a_tie_is_that_of_calculix(tmp_path, formulation, gap):
    """Its matrices are without the slave's freedoms, and nodes off the master are moved there."""
    line = "*TIE, NAME=T, POSITION TOLERANCE=0.1" if gap else "*TIE, NAME=T"
    mesh, lines = boxes((line, "UPPER, LOWER"), formulation, gap=gap)
    (tmp_path / "ccx").mkdir()
    step = ("*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP")
    said = run(tmp_path / "ccx", mesh, *lines, *step)
    assert (tmp_path / "ccx" / "job.sti").exists(), said
    mesh, e, K, M = read(tmp_path, lines, formulation, gap=gap)
    words = [w.split(".") for w in (tmp_path / "ccx" / "job.dof").read_text().split()]
    places = np.array([3 * (int(n) - 1) + int(d) - 1 for n, d in words])
    np.testing.assert_array_equal(np.sort(places), e.places)
    at = np.searchsorted(e.places, places)
    for ending, A in (("sti", K), ("mas", M)):
        row, column, value = np.loadtxt(tmp_path / "ccx" / f"job.{ending}").T
        i, j = at[row.astype(int) - 1], at[column.astype(int) - 1]
        half = sp.coo_matrix((value, (i, j)), shape=A.shape).tocsr()
        whole = half + half.T - sp.diags(half.diagonal())
        assert apart(A, whole) < 1e-8  # it finds a place on a facet to 1e-9


@pytest.mark.parametrize("lines", [TIE, (*TIE, *KINEMATIC), (*TIE, *RIGID), (*TIE, *DISTRIBUTING)])
def test_rigid_motions_cost_nothing(tmp_path, lines):
    """Nor do they leave the places that they should have: freedoms, and reference nodes."""
    mesh, e, K, M = read(tmp_path, lines)
    R = rigid_shapes(mesh.nodes)
    q = e.freedoms(R)
    np.testing.assert_allclose(e.E @ q, R, atol=1e-12 * abs(R).max())
    assert abs(K @ q).max() < 1e-9 * abs(K).max() * abs(q).max()
    volume = np.prod(LOW) + np.prod(HIGH)
    assert (q.T @ (M @ q))[0, 0] == pytest.approx(7.8e-9 * volume, rel=1e-12)
    hz, rigid = free_hz(K, M, 1)
    assert rigid < 1e-5 * hz[0]


def test_meshes_that_fit_are_one_mesh(tmp_path):
    """Tied node on node, the bar of two is that of one mesh, else near it."""
    _, _, K, M = read(tmp_path, TIE, low=(2, 2, 2), high=(2, 2, 2))
    one, _ = free_hz(K, M, 6)

    lines = np.concatenate([np.linspace(0, LOW[2], 3), LOW[2] + np.linspace(0, HIGH[2], 3)[1:]])
    bar = box("C3D20", (2, 2, 4), (LOW[0], LOW[1], 4.0))
    z = np.interp(bar.nodes[:, 2], np.arange(5.0), lines)
    bar = replace(bar, nodes=np.column_stack([bar.nodes[:, :2], z]))
    whole, _ = free_hz(stiffness_matrix(bar), mass_matrix(bar, "as_stiffness"), 6)
    np.testing.assert_allclose(one, whole, rtol=1e-9)
    for cells, tolerance in (((3, 3, 2), 4e-3), ((4, 4, 2), 4e-3), ((5, 5, 2), 5e-3)):
        mesh, _, K, M = read(tmp_path, TIE, low=(2, 2, 2), high=cells)
        np.testing.assert_allclose(free_hz(K, M, 6)[0], whole, rtol=tolerance)
        assert not mesh.constraints[0].coarse
    mesh, _, K, M = read(tmp_path, TIE, low=(2, 2, 2), high=(1, 2, 2))
    assert mesh.constraints[0].coarse  # and 30 % off, since the master is free between its nodes
    assert free_hz(K, M, 1)[0] < 0.95 * whole[0]


def test_what_reference_nodes_do(tmp_path):
    """Rigid: the nodes keep their distances. Distributing: nothing is stiffer than without."""
    rng = np.random.default_rng(1)
    mesh, e, *_ = read(tmp_path, (*TIE, *KINEMATIC))
    u = (e.E @ rng.standard_normal(e.E.shape[1])).reshape(-1, 3)
    c = mesh.constraints[1]
    X, U = (a[[*c.nodes, c.reference]] for a in (mesh.nodes, u))
    stretch = np.einsum("ijk,ijk->ij", X[:, None] - X, U[:, None] - U)
    assert abs(stretch).max() < 1e-12 * abs(u).max() * abs(mesh.nodes).max()
    alone = read(tmp_path, TIE)
    mesh, e, K, M = read(tmp_path, (*TIE, *DISTRIBUTING))
    n = alone[1].E.shape[0]
    assert abs(K - alone[2]).max() == 0
    assert abs(M - alone[3]).max() == 0
    assert e.E.shape[1] == alone[1].E.shape[1]
    # a force there is spread without a change of its moment
    force = np.array([3.0, -1.0, 2.0])
    onto = (e.E[3 * mesh.used_without_element[0] :][:3].T @ force).reshape(-1, 1)
    felt = (e.freedoms(rigid_shapes(mesh.nodes)).T @ onto).ravel()
    at = np.array(REFERENCE)
    np.testing.assert_allclose(felt, [*force, *np.cross(at, force)], atol=1e-12)
    assert n == e.E.shape[0] - 3  # of the reference node


def test_partial_kinematic_couplings(tmp_path):
    lines = (*TIE, KINEMATIC[0], "*KINEMATIC", "3")
    mesh, e, _, _ = read(tmp_path, lines)
    follows = np.setdiff1d(np.arange(3 * len(mesh.nodes)), e.places)
    tied, c = mesh.constraints[0].nodes, mesh.constraints[1]
    expected = np.concatenate([3 * tied, 3 * tied + 1, 3 * tied + 2, 3 * c.nodes + 2])
    unmoved = [3 * c.reference, 3 * c.reference + 1]
    np.testing.assert_array_equal(follows, np.sort([*expected, *unmoved]))
    assert (e.places < 0).sum() == 2  # a turn about z moves nothing along it


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("*TIE, NAME=T",), "expected a line with a slave and a master surface"),
        (("*TIE, NAME=T", "UPPER"), "expected a slave and a master surface"),
        (("*TIE, NAME=T", "UPPER, LOW"), "there is no surface 'LOW'; there is"),
        (("*TIE, NAME=T", "LOWER, UPPERS"), "the master 'UPPERS' has no faces"),
        (("*TIE, NAME=T, TYPE=X", "UPPER, LOWER"), "TYPE=X is not supported"),
        (("*TIE, ADJUST=0.1", "UPPER, LOWER"), "ADJUST=0.1 is not supported"),
        (("*TIE, POSITION TOLERANCE=x", "UPPER, LOWER"), "expected a distance, found 'x'"),
        (KINEMATIC[:1], "expected *KINEMATIC or *DISTRIBUTING after *COUPLING"),
        (KINEMATIC[1:], "*KINEMATIC belongs after *COUPLING"),
        ((*KINEMATIC[:2], "1, 7"), "expected the first and the last of the directions 1 to 6"),
        ((*KINEMATIC[:2], "4, 6"), "none of the directions 1 to 3 is coupled"),
        ((KINEMATIC[0], "*DISTRIBUTING, WEIGHTING METHOD=CUBIC"), "CUBIC is not supported"),
        (("*COUPLING, REF NODE=9999, SURFACE=TOP", "*KINEMATIC"), "there is no node 9999"),
        (("*COUPLING, REF NODE=TOPS, SURFACE=TOP", "*KINEMATIC"), "REF NODE=TOPS is 29 nodes"),
        (("*COUPLING, SURFACE=TOP", "*KINEMATIC"), "*COUPLING needs REFNODE=..."),
        (("*RIGID BODY, REF NODE={ref}",), "*RIGID BODY needs NSET=... or ELSET=..."),
        (("*RIGID BODY, NSET=NO, REF NODE={ref}",), "there is no node set 'NO'"),
        (("*EQUATION", "2", "1, 1, 1."), "expected 2 terms of an equation, found 1"),
        (("*EQUATION", "1", "1, 1, 1., 2, 1, 1."), "expected 1 terms of an equation, found 2"),
        (("*EQUATION", "1", "1, 1"), "expected terms of a node, a direction and a factor"),
        (("*EQUATION", "1", "1, 4, 1."), "an equation of turns, which nodes of solids do not have"),
        (("*EQUATION", "1", "9999, 1, 1."), "there is no node 9999"),
        (("*EQUATION", "1", "1, 1, 0."), "the factor of the first term is zero"),
        (("*MPC", "ELBOW, 1, 2"), "*MPC of type ELBOW is not supported: supported are TIE, PIN"),
        (("*MPC", "DIST, 1, 1, 1, 2, 2, 2, 3"), "a largest distance of two nodes"),
        (("*MPC", "TIE, 1"), "expected a type and two nodes or sets"),
    ],
)
def test_broken_files_are_said_with_their_line(tmp_path, lines, message):
    mesh, _ = boxes((*TIE, *KINEMATIC))
    ref = mesh.numbers[-2]
    write_inp(mesh, tmp_path / "boxes.inp", [line.format(ref=ref) for line in lines])
    with pytest.raises(ModelError, match=re.escape(message)) as caught:
        read_inp(tmp_path / "boxes.inp")
    count = (tmp_path / "boxes.inp").read_text().count("\n")
    line = int(re.search(r"boxes.inp, line (\d+): ", str(caught.value))[1])
    assert count - len(lines) < line <= count


@pytest.mark.parametrize(
    ("lines", "gap", "message"),
    [
        (TIE, 0.5, "no node of its slave lies on its master"),
        (("*TIE, ADJUST=NO", "UPPER, LOWER"), 0.01, "lie off the master and are not to be moved"),
        ((*TIE, "*TIE, NAME=U", "UPPERS, LOWER"), 0.0, "follows others by *TIE GLUE"),
        ((*TIE, "*TIE, NAME=U", "LOWER, UPPER"), 0.0, "in a circle"),
        ((*TIE, "*NSET, NSET=ONE\n1", "*RIGID BODY, NSET=ONE, REF NODE=2"), 0.0, "lie on a line"),
        ((*TIE, "*RIGID BODY, NSET=REF2, REF NODE={ref}"), 0.0, "which no element has"),
    ],
)
def test_what_cannot_be_coupled(tmp_path, lines, gap, message):
    with pytest.raises(ModelError, match=re.escape(message)):
        read(tmp_path, lines, gap=gap)


def test_nodes_beside_the_master_are_told(tmp_path):
    mesh, lines = boxes(TIE)
    wide = np.where(mesh.nodes[:, 2:] > LOW[2] - 1e-9, [1.4, 1, 1], 1.0)
    upper = np.unique(np.concatenate([mesh.blocks[0].nodes[b].ravel() for b in range(12, 18)]))
    nodes = mesh.nodes.copy()
    nodes[upper] *= wide[upper]
    write_inp(replace(mesh, nodes=nodes), tmp_path / "boxes.inp", lines)
    mesh, e = expanded(read_inp(tmp_path / "boxes.inp"))
    (note,) = [p for p in mesh.passed_over if "not on the master" in p.why]
    free = int(note.why.split()[0])
    assert 0 < free < 29
    assert mesh.constraints[0].beside == free
    assert 3 * free == 3 * len(mesh.nodes) - (3 * len(mesh.nodes) - e.E.shape[1]) - (
        3 * len(mesh.nodes) - 3 * 29
    )


# -- model files ---------------------------------------------------------------------------------
TIED = (
    "[[load]]",
    '[[tie]]\nname = "glue"\nslave = "slider.BOTTOM"\nmaster = "plate.TOP"\n\n[[load]]',
)


def test_tied_faces_of_two_components(tmp_path):
    """The bedding is a thousand times that of elements: ten times more changes next to nothing."""
    stiffer = (TIED[0], TIED[1].replace("\n\n", "\nbedding = 1.1e9\n\n"))
    hz = []
    for folder, change in (("own", TIED), ("stiffer", stiffer)):
        write_blocks(tmp_path / folder, change)
        hz.append(frequencies(built(tmp_path / folder / "blocks.toml"), 6))
    np.testing.assert_allclose(hz[0], hz[1], rtol=1e-3)
    tie = next(s for s in built(tmp_path / "own" / "blocks.toml").springs if s.name == "glue")
    moved = np.tile([0.0, 1.0, 0.0], tie.B.shape[1] // 3)
    assert abs(tie.B @ moved).max() < 1e-12
    n = len(tie.stiffness) // 3
    k = tie.stiffness[:n]
    assert k.sum() == pytest.approx(tie.stiffness[n : 2 * n].sum())
    found, _ = inspected(read_model(tmp_path / "own" / "blocks.toml"))
    (told,) = (text for name, text in found.facts if name == "glue")
    assert "tie: slider.BOTTOM on plate.TOP, 27 points, 100.0 % of the slave" in told


def test_the_bedding_of_a_tie_is_a_parameter(tmp_path):
    named = TIED[1].replace("\n\n", "\nbedding = 1e6\n\n")
    parameter = '[parameters]\n"glue" = {path = "tie.glue.bedding"}\n'
    write_blocks(tmp_path, (TIED[0], named), ("[parameters]\n", parameter))
    (found,) = (p for p in read_model(tmp_path / "blocks.toml").parameters if p.name == "glue")
    assert (found.unit, found.default, found.positive) == ("N/m3", 1e15, True)
    one, two = (
        next(s for s in built(tmp_path / "blocks.toml", **v).springs if s.name == "glue")
        for v in ({}, {"glue": 3e15})
    )
    np.testing.assert_allclose(two.stiffness, 3 * one.stiffness, rtol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("plate.TOP", "plate.TOPP", "did you mean 'TOP'?"),
        ("plate.TOP", "slider.TOP", "expected faces of two components"),
        ('"plate.TOP"', '"plate.TOP"\nbedding = -1', "expected more than 0"),
    ],
)
def test_broken_ties_of_a_model_file(tmp_path, old, new, message):
    write_blocks(tmp_path, (TIED[0], TIED[1].replace(old, new)))
    with pytest.raises(StudyFileError, match=re.escape(message)) as caught:
        built(tmp_path / "blocks.toml")
    assert str(caught.value.key).startswith("tie[1]")


def test_faces_that_do_not_touch_are_not_tied(tmp_path):
    lifted = ("translate = [1.5, 0.5, 2.0]", "translate = [1.5, 0.5, 2.01]")
    write_blocks(tmp_path, TIED, lifted)
    with pytest.raises(StudyFileError, match="would strain in rigid turns"):
        built(tmp_path / "blocks.toml")


def test_a_component_with_couplings_in_a_model(tmp_path):
    """A spring at a reference node, held masters, and what an inspection says."""
    write_blocks(tmp_path)
    mesh, lines = boxes((*TIE, *KINEMATIC))
    write_inp(mesh, tmp_path / "slider.inp", lines)
    text = (tmp_path / "blocks.toml").read_text()
    for old, new in (
        ('slave = "slider.BOTTOM"', 'slave = "slider.BOTTOM"\nname = "rub"'),
        ("slider.ENDS", "slider.REF1"),
        ('"lining.E3" = {path = "slider.materials.LINING.E[3]", default = 2e3, unit = "MPa"}', ""),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "blocks.toml").write_text(text)
    assembly = built(tmp_path / "blocks.toml")
    slider = assembly.components[1]
    volume = (np.prod(LOW) + np.prod(HIGH)) * 1e-9
    assert slider.mass == pytest.approx(7800 * volume, rel=1e-12)
    guides = next(s for s in assembly.springs if s.name == "guides")
    assert guides.B.nnz == 3
    u = np.random.default_rng(0).standard_normal(assembly.n_dof)
    moved = assembly.at_nodes(u)[assembly.node_slices["slider"]]
    at = np.flatnonzero(slider.dofs == 3 * (len(moved) - 2))
    assert moved[-2, 0] == u[assembly.slices["slider"]][at[0]]
    found, _ = inspected(read_model(tmp_path / "blocks.toml"))
    told = " ".join(text for _, text in found.facts)
    assert "*TIE GLUE" in told
    assert "a reference node moves 29 nodes" in told
    assert "6 rigid modes" in told
    for name, message in (
        ("UPPERS", "follow others by a tie, a coupling, or the recovery"),
        ("REF1", None),
    ):
        held = f'[[fixed]]\nset = "slider.{name}"\n\n[parameters]'
        (tmp_path / "held.toml").write_text(text.replace("[parameters]", held))
        if message:
            with pytest.raises(StudyFileError, match=message):
                built(tmp_path / "held.toml")
        else:
            assert built(tmp_path / "held.toml").n_dof == assembly.n_dof - 3
