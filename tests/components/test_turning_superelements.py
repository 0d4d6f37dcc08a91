"""Superelements whose boundary nodes turn: a frame of beams, alone and on a block of solids."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from frames import ENDS, NODES, craig_bampton, frame, names, numbers
from own_blocks import write_blocks
from study_runs import solved
from test_model_file import built, stiffness

from squealstudy.engine.plan import Plan
from squealstudy.errors import StudyFileError
from squealstudy.models.components.bodies import body_of
from squealstudy.models.components.faces import facets
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.geometry import geometry_of
from squealstudy.models.components.inp import read_inp
from squealstudy.study.components import build_of, free_component, inspected, read_model
from squealstudy.study.definition import load_study

ALL = 10**6
HERTZ = 2 * np.pi
SHIFT = np.array([20.0, 0.0, 3.0])


def dmig(K, M, rows):
    """Free fields; modal coordinates are scalar points."""
    points = [
        row.split(".") if row != "modal" else (f"{900 + k}", "0") for k, row in enumerate(rows)
    ]
    lines = ["BEGIN BULK"]
    for name, A in (("KAAX", K), ("MAAX", M)):
        lines.append(f"DMIG,{name},0,6,2,0")
        for j, (column, c) in enumerate(points):
            for i, (row, d) in enumerate(points[: j + 1]):
                if A[i, j]:
                    lines.append(f"DMIG*,{name},{column},{c},\n*,{row},{d},{A[i, j]:.16e}")
    return "\n".join([*lines, "ENDDATA", ""])


def write_frame(folder, n_modes=ALL, form="npz", recovery=False, more=""):
    """The frame's files, and the component's table of a model file."""
    folder.mkdir(parents=True, exist_ok=True)
    K, M, R = craig_bampton(n_modes)
    rows = names(len(K) - 12)
    ends = [NODES[list(ENDS)], NODES][recovery]
    of = [numbers()[list(ENDS)], numbers()][recovery]
    if form == "dmig":
        (folder / "frame.pch").write_text(dmig(K, M, rows))
        table = "".join(f'{k} = {{file = "frame.pch", name = "{k}AAX"}}\n' for k in "KM")
        grids = [
            f"GRID,{n},,{x!r},{y!r},{z!r}" for n, (x, y, z) in zip(of, ends.tolist(), strict=True)
        ]
        (folder / "frame.bdf").write_text("\n".join([*grids, "PLOTEL,1,101,107", ""]))
        table += 'nodes = "frame.bdf"\n'
    else:
        order = np.random.default_rng(1).permutation(len(K))
        K, M, R = K[np.ix_(order, order)], M[np.ix_(order, order)], R[:, order]
        (folder / "frame.dof").write_text("\n".join(rows[k] for k in order) + "\n")
        for name, A in (("K", K), ("M", M)):
            sp.save_npz(folder / f"frame_{name}.npz", sp.csr_matrix(A))
        lines = [
            f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in zip(of, ends.tolist(), strict=True)
        ]
        (folder / "frame.inp").write_text("\n".join(["*NODE", *lines, ""]))
        table = 'K = "frame_K.npz"\nM = "frame_M.npz"\ndof = "frame.dof"\nnodes = "frame.inp"\n'
        if recovery:
            moved = R.reshape(len(NODES), 6, -1)[:, :3].reshape(3 * len(NODES), -1)
            np.savez(folder / "R.npz", R=moved)
            table += 'recovery = "R.npz"\n'
    return f"[components.frame]\n{table}{more}\n"


def alone(folder, table, tail=""):
    (folder / "m.toml").write_text(f'units = "t-mm-s"\n{table}\n{tail}')
    return read_model(folder / "m.toml", unfinished=True)


def roots(K, M):
    return la.eigh(K, M, eigvals_only=True)


@pytest.mark.parametrize("more", ["", "rotate = {axis = [1, 2, 3], angle = 50}\n"])
@pytest.mark.parametrize("form", ["npz", "dmig"])
def test_free_frequencies_are_those_of_the_frame(tmp_path, form, more):
    model = alone(tmp_path, write_frame(tmp_path, form=form, more=more))
    body, (K, M), _ = free_component(model, "frame")
    assert K.shape == (42, 42)
    expected = roots(*frame())
    np.testing.assert_allclose(roots(K.toarray(), M.toarray())[6:], expected[6:], rtol=1e-6)
    assert set(body.mesh.node_sets) == {"NODE101", "NODE107"}
    assert body.expansion.turning.all()
    found, _ = inspected(model)
    told = " ".join(text for _, text in found.facts)
    assert "12 turns" not in told
    assert "6 turns of nodes, 30 modal coordinates" in told
    assert "6 rigid modes" in told
    assert not [d for d in found.doubts if "rigid" in d]
    mass = 7.8e-9 * 36 * np.linalg.norm(np.diff(NODES, axis=0), axis=1).sum()
    assert f"{mass:.4g} t" in told


def test_clamped_frequencies_are_those_of_the_frame(tmp_path):
    table = write_frame(tmp_path)
    for dofs, held in (("", (0, 1, 2)), ("dofs = [1, 2, 3, 4, 5, 6]\n", range(6))):
        model = alone(tmp_path, table, f'[[fixed]]\nset = "frame.NODE101"\n{dofs}')
        geometry = geometry_of(build_of(model).brake)
        kept = geometry.kept["frame"]
        K, M = (A[kept][:, kept].toarray() for A in body_of(geometry.brake, "frame").matrices[:2])
        free = np.setdiff1d(np.arange(42), list(held))
        expected = roots(*(A[np.ix_(free, free)] for A in frame()))
        first = 6 - len(list(held))
        np.testing.assert_allclose(roots(K, M)[first:], expected[first:], rtol=1e-6)


def test_fewer_modes_come_near_from_above(tmp_path):
    expected = roots(*frame())[6:12]
    before = np.inf
    for n in (0, 4, 12):
        table = write_frame(tmp_path / str(n), n)
        _, (K, M), _ = free_component(alone(tmp_path / str(n), table), "frame")
        off = (roots(K.toarray(), M.toarray())[6:12] / expected - 1).max()
        assert -1e-9 < off < before
        before = off
    assert before < 0.02


def test_all_nodes_are_recovered(tmp_path):
    more = "rotate = {axis = [0, 0, 1], angle = 30}\n"
    model = alone(tmp_path, write_frame(tmp_path, 12, recovery=True, more=more))
    body, (K, M), _ = free_component(model, "frame")
    _, v = la.eigh(K.toarray(), M.toarray())
    _, u = la.eigh(*frame())
    turn = np.array([[np.sqrt(3), -1, 0], [1, np.sqrt(3), 0], [0, 0, 2]]) / 2
    for k in range(6, 9):
        mine = body.expansion.E @ v[:, k]
        theirs = (u[:, k].reshape(-1, 6)[:, :3] @ turn.T).ravel()
        assert (mine @ theirs) ** 2 > 0.9999 * (mine @ mine) * (theirs @ theirs)
    x = body.nodes
    moved = np.cross([1.0, 2.0, 3.0], x).reshape(-1, 1)
    turned = np.tile([1.0, 2.0, 3.0], len(x))[:, None]
    q = body.expansion.freedoms(moved, turned)
    np.testing.assert_allclose(body.expansion.E @ q, moved, atol=1e-9)
    assert abs(K @ q).max() < 1e-6 * abs(K).max() * abs(q).max()


# -- on the slider of the two blocks ------------------------------------------------------------
COUPLING = '[[coupling]]\nname = "pin"\nnode = "frame.NODE101"\nface = "slider.END"\n'


def assembled(folder, tail, more=""):
    """The two blocks with the frame beside the slider's end, and what joins them."""
    table = write_frame(folder, more=f"translate = {SHIFT.tolist()}\n" + more)
    write_blocks(folder, ("[parameters]", f"{tail}\n{table}\n[parameters]"))
    text = (folder / "slider.inp").read_text()
    mesh = read_inp(folder / "slider.inp")
    last = [f for f in mesh.surfaces["ENDS"].tolist() if f[0] in (4, 5)]
    lines = "".join(f"{mesh.labels[e]}, S{f}\n" for e, f in last)
    (folder / "slider.inp").write_text(text + f"*SURFACE, NAME=END\n{lines}")
    return built(folder / "blocks.toml")


def constrained(folder, rows):
    """Roots where rows over the freedoms of the assembly, which is not joined, are zero."""
    assembly = assembled(folder, "")
    K, M = stiffness(assembly)
    N = la.null_space(rows(*face_and_node(assembly, folder)))
    return np.sqrt(roots(N.T @ K @ N, N.T @ M @ N))


def turns_of(folder):
    """Turns (3, n) of the pin from the frame's freedoms."""
    brake = build_of(read_model(folder / "blocks.toml")).brake
    return body_of(brake, "frame").expansion.turns[:3].toarray()


def face_and_node(assembly, folder):
    """Gauss points of the slider's end (m, 3), weights, their displacements, the pin's six."""
    slider, frame_of = assembly.components[1], assembly.components[2]
    spans = np.cumsum([0, *(c.n_dof for c in assembly.components)])
    mesh = read_inp(folder / "slider.inp")
    blocks = tuple(group.nodes for group in facets(mesh, "END"))
    surface, _ = Facets(slider.coordinates, blocks, "END").gauss_points(3)
    moved = np.zeros((3, len(surface.area), spans[-1]))
    for axis, e in enumerate(np.eye(3)):
        moved[axis][:, spans[1] : spans[2]] = surface.observe(e).toarray()
    pin = np.zeros((6, spans[-1]))
    own = frame_of.dofs
    pin[:3, spans[2] + np.flatnonzero((own >= 0) & (own < 3))] = np.eye(3)
    pin[3:, spans[2] :] = turns_of(folder)
    return surface, moved, pin, frame_of.coordinates[0]


@pytest.mark.parametrize("kind", ["rigid", "distributing"])
def test_a_coupling_is_the_constraint_it_stands_for(tmp_path, kind):
    def rows(surface, moved, pin, at):
        arm = surface.points - at
        lever = np.array([np.column_stack([np.cross(e, r) for e in np.eye(3)]) for r in arm])
        if kind == "rigid":
            follows = np.einsum("mab,bn->amn", lever, pin[3:]) + pin[:3, None]
            return (moved - follows).reshape(-1, pin.shape[1])
        w = surface.area / surface.area.sum()
        centre = w @ surface.points
        r = surface.points - centre
        mean = np.einsum("m,amn->an", w, moved)
        inertia = (
            np.einsum("m,mab->ab", w, np.sum(r**2, axis=1)[:, None, None] * np.eye(3))
            - (r.T * w) @ r
        )
        spin = np.stack([r[:, 1, None] * moved[2] - r[:, 2, None] * moved[1],
                         r[:, 2, None] * moved[0] - r[:, 0, None] * moved[2],
                         r[:, 0, None] * moved[1] - r[:, 1, None] * moved[0]])  # fmt: skip
        turn = la.solve(inertia, np.einsum("m,amn->an", w, spin))
        lever = np.column_stack([np.cross(e, at - centre) for e in np.eye(3)])
        return np.vstack([pin[:3] - mean - lever @ turn, pin[3:] - turn])

    expected = constrained(tmp_path / "apart", rows)[:30]
    found = []
    for name, more in (("default", ""), ("stiff", "bedding = 1e9\n")):
        assembly = assembled(tmp_path / name, f'{COUPLING}kind = "{kind}"\n{more}')
        found.append(np.sqrt(roots(*stiffness(assembly)))[:30])
    np.testing.assert_allclose(found[0], expected, rtol=5e-3)
    np.testing.assert_allclose(found[1], expected, rtol=2e-5)


def test_rotary_springs_and_inertia(tmp_path):
    """At the pin, beside their entries in its freedoms; between it and the mean turn of a face."""
    spring = '[[spring]]\nname = "s"\nbetween = ["frame.NODE101", "ground"]\n'
    spring += "stiffness = [1e3, 2e3, 3e3]\n"
    mass = '[[point_mass]]\nname = "m"\non = "frame.NODE101"\nmass = 1e-6\n'
    plain = assembled(tmp_path / "a", spring + mass)
    other = assembled(
        tmp_path / "b", f"{spring}rotary = [4e5, 5e5, 6e5]\n{mass}inertia = [1e-4, 2e-4, 3e-4]\n"
    )
    start = plain.components[0].n_dof + plain.components[1].n_dof
    T = np.hstack([np.zeros((3, start)), turns_of(tmp_path / "a")])
    K, M = (b - a for a, b in zip(stiffness(plain), stiffness(other), strict=True))
    for A, values in ((K, [4e2, 5e2, 6e2]), (M, [1e-7, 2e-7, 3e-7])):  # N m, kg m2
        expected = T.T @ np.diag(values) @ T
        np.testing.assert_allclose(A, expected, atol=1e-8 * abs(expected).max())
    joined = '[[spring]]\nname = "s"\nbetween = ["frame.NODE101", "slider.END"]\n'
    joined += "stiffness = [0, 0, 0]\nrotary = [4e5, 5e5, 6e5]\n"
    zero = assembled(tmp_path / "c", joined.replace("rotary = [4e5, 5e5, 6e5]\n", ""))
    K = stiffness(assembled(tmp_path / "d", joined))[0] - stiffness(zero)[0]
    values = np.linalg.eigvalsh(K)
    assert (values[-3:] > 1.0).all()
    assert abs(values[:-3]).max() < 1e-9 * values[-1]
    u = np.zeros(len(K))  # all of the slider and the pin turn as one about a place
    spans = np.cumsum([0, *(c.n_dof for c in zero.components)])
    x = zero.components[1].coordinates
    u[spans[1] : spans[2]] = np.cross([1.0, 2.0, 3.0], x - [0.1, 0.2, 0.3]).ravel()
    u[start:] = la.pinv(T[:, start:]) @ [1.0, 2.0, 3.0]
    assert abs(K @ u).max() < 1e-9 * abs(K).max()
    u[start:] = 0.0
    assert u @ K @ u == pytest.approx(4e2 * 1 + 5e2 * 4 + 6e2 * 9, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "frame.NODE101",
            "slider.CORNER",
            r"slider.CORNER is one node, and has no turns",
        ),
        ("frame.NODE101", "slider.TOP", r"slider.TOP has \d+ nodes: expected a set of one node"),
        ("frame.NODE101", "frame.NODE102", "frame .* has no surface or node set 'NODE102'"),
        ("slider.END", "frame.NODE107", "expected bedding = STIFFNESS PER AREA"),
        ('name = "pin"', 'name = "bed"', "'bed' is the name of coupling"),
    ],
)
def test_what_cannot_be_coupled(tmp_path, old, new, message):
    with pytest.raises(StudyFileError, match=message):
        assembled(tmp_path, COUPLING.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("101.4", "101.7", "direction 7: expected 1 to 6"),
        ("101.4", "102.4", "frame.inp has no node 102"),
        ("101.4", "101.5", "101.5 is in line .* already"),
    ],
)
def test_maps_that_are_none(tmp_path, old, new, message):
    table = write_frame(tmp_path)
    text = (tmp_path / "frame.dof").read_text()
    (tmp_path / "frame.dof").write_text(text.replace(f"{old}\n", f"{new}\n", 1))
    with pytest.raises(StudyFileError, match=message):
        free_component(alone(tmp_path, table), "frame")


def test_turns_that_are_none(tmp_path):
    tail = '[[fixed]]\nset = "slider.CORNER"\ndofs = [4]\n'
    with pytest.raises(StudyFileError, match="no turns are freedoms there: expected 1 to 3"):
        assembled(tmp_path, tail)
    lines = (tmp_path / "b").joinpath
    table = write_frame(tmp_path / "b", more="rotate = {axis = [0, 0, 1], angle = 5}\n")
    text = lines("frame.dof").read_text().replace("101.4\n", "modal\n")
    lines("frame.dof").write_text(text)
    with pytest.raises(StudyFileError, match="without all three directions of every node"):
        free_component(alone(tmp_path / "b", table), "frame")


def test_a_study_with_a_frame(tmp_path):
    """Reduced and at full order, and a shape that moves the frame's nodes."""
    table = write_frame(tmp_path, 6, more=f"translate = {SHIFT.tolist()}\n")
    write_blocks(tmp_path, ("[parameters]", f"{COUPLING}\n{table}\n[parameters]"))
    text = (tmp_path / "slider.inp").read_text()
    (tmp_path / "slider.inp").write_text(text + "*SURFACE, NAME=END\n105, S4\n106, S4\n")
    results = solved(Plan(load_study(tmp_path / "study.toml")), tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    assert results.points["reference_frequency_error"].min() < 1e-2
    shape = results.shape()
    assert np.isfinite(shape.displacement).all()
