"""Springs, masses and older couplings of decks, beside what a few lines of algebra say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from component_meshes import STEEL, box
from test_component_judge import apart
from test_component_nastran import deck
from test_deck_elements import two
from test_deck_equations import X, Y, Z, null_space, same

from squealstudy.errors import ModelError
from squealstudy.models.components import bodies
from squealstudy.models.components.bodies import Brake
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.model_file import ModelFile

BOX = box("C3D8", (3, 1, 1), materials={"S": STEEL})


def matrices(folder, *lines, units="t-mm-s", rotate=None, **table):
    """K and M of a component of a model file, over its freedoms; its mesh and expansion."""
    write_inp(BOX, folder / "a.inp", [line.format(*BOX.numbers) for line in lines])
    return component(folder, "a.inp", units, rotate=rotate, **table)


def component(folder, name, units="t-mm-s", **table):
    tables = {"p": {"mesh": name, **{k: v for k, v in table.items() if v is not None}}}
    contact = [{"kind": "frictionless", "slave": "p.A", "master": "p.B", "search": 1.0}]
    file = ModelFile.model_validate({"units": units, "components": tables, "contact": contact})
    text = (folder / name).read_text()
    brake = Brake(folder / "m.toml", file, repr((folder, tables, units, text)))
    K, M = bodies.body_matrices(brake, "p", {})
    return K.toarray(), M.toarray(), bodies.body_of(brake, "p")


def added(folder, *lines, **options):
    """What lines of a deck add to K and M of the box without them."""
    K, M, body = matrices(folder, *lines, **options)
    K0, M0, _ = matrices(folder, **options)
    return K - K0, M - M0, body


def block(nodes, vectors):
    row = np.zeros((len(BOX.nodes), 3))
    for node, vector in zip(nodes, vectors, strict=True):
        row[node] += vector
    return np.outer(row.ravel(), row.ravel())


ALONG = BOX.nodes[11] - BOX.nodes[0]
ALONG = ALONG / np.linalg.norm(ALONG)
SPRINGS = {
    "SPRINGA, {0}, {11}|7.": ([0, 11], [-ALONG, ALONG]),
    "SPRING2, {0}, {11}|2, 3|7.": ([0, 11], [Y, -Z]),
    "SPRING1, {4}|1|7.": ([4], [X]),
}


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("units", ["t-mm-s", "SI"])
def test_springs(tmp_path, spring, units):
    element, *data = spring.split("|")
    kind, *nodes = element.split(",")
    lines = [f"*ELEMENT, TYPE={kind}, ELSET=K", ",".join(["900", *nodes])]
    K, M, _ = added(tmp_path, *lines, "*SPRING, ELSET=K", *data, units=units)
    expected = 7.0 * (1e3 if units == "t-mm-s" else 1.0) * block(*SPRINGS[spring])
    np.testing.assert_allclose(K, expected, atol=1e-7 * abs(expected).max())
    assert not M.any()


MASS = ("*ELEMENT, TYPE=MASS, ELSET=W", "900, {3}", "901, {5}", "*MASS, ELSET=W", "2e-6")


def test_masses(tmp_path):
    K, M, _ = added(tmp_path, *MASS)
    expected = sum(block([n], [v]) for n in (3, 5) for v in (X, Y, Z))
    np.testing.assert_allclose(M, 2e-3 * expected, atol=1e-12)  # kg
    assert not K.any()


def test_springs_turn_with_the_component(tmp_path):
    lines = ("*ELEMENT, TYPE=SPRING2, ELSET=K", "900, {0}, {11}", "*SPRING, ELSET=K", "2, 3", "7.")
    K, _, _ = added(tmp_path, *lines, rotate={"axis": [0, 0, 1], "angle": 90.0})
    expected = 7e3 * block([0, 11], [-X, -Z])
    np.testing.assert_allclose(K, expected, atol=1e-7 * abs(expected).max())


def test_a_spring_to_a_node_of_no_element_is_to_ground(tmp_path):
    lines = ("*NODE", "9000, 0., 0., -9.", "*ELEMENT, TYPE=SPRINGA, ELSET=K", "900, {0}, 9000")
    K, _, body = added(tmp_path, *lines, "*SPRING, ELSET=K", "7.")
    expected = 7e3 * block([0], [Z])
    np.testing.assert_allclose(K, expected, atol=1e-7 * abs(expected).max())
    told = [note.why for note in body.mesh.passed_over]
    assert "node 9000: no element: counts as ground" in told


def test_a_mass_on_a_spring(tmp_path):
    lines = ("*NODE", "9000, 0., 0., -9.", "*ELEMENT, TYPE=SPRINGA, ELSET=K", "900, {0}, 9000")
    mass = ("*ELEMENT, TYPE=MASS, ELSET=W", "901, 9000", "*MASS, ELSET=W", "2e-6")
    K, M, body = matrices(tmp_path, *lines, "*SPRING, ELSET=K", "7.", *mass)
    assert len(K) == 3 * len(BOX.nodes) + 3
    np.testing.assert_allclose(M[-3:, -3:], 2e-3 * np.eye(3))
    np.testing.assert_allclose(K[-3:, -3:], 7e3 * np.outer(Z, Z), atol=1e-6)
    assert body.mesh.body_of.max() == 0


def test_dampers_are_passed_over(tmp_path):
    lines = ("*ELEMENT, TYPE=DASHPOTA, ELSET=D", "900, {0}, {11}", "*DASHPOT, ELSET=D", "7.")
    K, M, body = added(tmp_path, *lines)
    assert not K.any()
    assert not M.any()
    assert "*DASHPOT" in [note.keyword for note in body.mesh.passed_over]


OLD = ("*NODE", "9000, 1., 1., 9.", "*ELEMENT, TYPE=DCOUP3D, ELSET=D", "900, 9000")


def test_older_distributing_couplings(tmp_path):
    """Of CalculiX the mean of displacements; of Abaqus forces keep their moments."""
    weighed = ("*DISTRIBUTING COUPLING, ELSET=D", "{0}, 1.", "{1}, 3.")
    write_inp(BOX, tmp_path / "a.inp", [s.format(*BOX.numbers) for s in (*OLD, *weighed)])
    mesh = read_mesh(tmp_path / "a.inp", ComponentTable(mesh="a.inp"))
    _, e = expanded(mesh)
    at = e.E[-3:].toarray()
    np.testing.assert_allclose(at[:, :3], np.eye(3) / 4, atol=1e-15)
    np.testing.assert_allclose(at[:, 3:6], 3 * np.eye(3) / 4, atol=1e-15)
    alike = ("*DISTRIBUTING COUPLING, ELSET=D", "{0}, 1.", "{1}, 1.", "{2}, 1.", "{3}, 1.")
    write_inp(BOX, tmp_path / "b.inp", [s.format(*BOX.numbers) for s in (*OLD, *alike)])
    mesh = read_mesh(tmp_path / "b.inp", ComponentTable(mesh="b.inp", dialect="abaqus"))
    assert mesh.constraints[0].kind == "distributing"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ((*MASS[:-1], "-1."), "expected a mass of zero or above, got -1"),
        ((MASS[0], "900, {3}, {4}", *MASS[3:]), "expected an element and 1 of its nodes, found 3"),
        ((MASS[0], "900, 99999", *MASS[3:]), "there is no node 99999"),
        (("*ELEMENT, TYPE=SPRING1, ELSET=K", "9, {0}", "*SPRING, ELSET=K", "7", "1."), "direction"),
        (("*ELEMENT, TYPE=SPRING2, ELSET=K", "9, {0}, {1}", "*SPRING, ELSET=K", "1."), "line with"),
        (("*ELEMENT, TYPE=SPRINGA, ELSET=K", "9, {0}, {0}", "*SPRING, ELSET=K", "1."), "one place"),
        (("*SPRING, ELSET=K, NONLINEAR", "1."), "NONLINEAR is not supported"),
        ((*OLD, "*DISTRIBUTING COUPLING, ELSET=D", "{0}, -1."), "weights above zero"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, lines, message):
    with pytest.raises(ModelError, match=rf"a\.inp, line \d+: .*{message}"):
        matrices(tmp_path, *lines)


def test_springs_and_masses_are_not_lost_in_writing(tmp_path):
    _, _, body = matrices(
        tmp_path, "*ELEMENT, TYPE=MASS, ELSET=W", "90, {0}", "*MASS, ELSET=W", "3."
    )
    with pytest.raises(ModelError, match="springs and point masses cannot be written"):
        write_inp(body.mesh, tmp_path / "b.inp")


def test_numbers_behind_the_nodes_of_an_element(tmp_path):
    """CalculiX ignores them; of Abaqus they are a mistake."""
    more = "*ELEMENT, TYPE=C3D8, ELSET=E\n9,11,12,13,14,15,16,17,18, 1, 2\n"
    with pytest.raises(ModelError, match="a face belongs to more than two elements"):
        two(tmp_path, more + "*ELEMENT, TYPE=C3D8, ELSET=E\n10,11,12,13,14,15,16,17,18, 1\n")
    with pytest.raises(ModelError, match="expected an element and its 8 nodes, found 11 numbers"):
        two(tmp_path, more, dialect="abaqus")


NASTRAN = {
    "CELAS2,900,7.,1,2,2,3": ([0, 1], [Y, -Z]),
    "CELAS1,900,5,1,1\nPELAS,4,1.,,,5,7.": ([0], [X]),
    "CELAS2,900,7.,,,4,3": ([3], [-Z]),
}


@pytest.mark.parametrize("cards", NASTRAN)
def test_springs_of_nastran(tmp_path, cards):
    mesh = replace(BOX, numbers=np.arange(1, len(BOX.nodes) + 1))
    text = deck(replace(mesh, blocks=(replace(mesh.blocks[0], formulation="C3D8I"),)))
    (tmp_path / "a.bdf").write_text(text)
    (tmp_path / "b.bdf").write_text(text.replace("ENDDATA", f"{cards}\nCONM2,901,2,,2e-6\nENDDATA"))
    K0, M0, _ = component(tmp_path, "a.bdf")
    K, M, _ = component(tmp_path, "b.bdf")
    expected = 7e3 * block(*NASTRAN[cards])
    np.testing.assert_allclose(K - K0, expected, atol=1e-7 * abs(expected).max())
    mass = sum(block([1], [v]) for v in (X, Y, Z))
    np.testing.assert_allclose(M - M0, 2e-3 * mass, atol=1e-12)


def nastran(folder, *cards, case=""):
    mesh = replace(BOX, numbers=np.arange(1, len(BOX.nodes) + 1))
    mesh = replace(mesh, blocks=(replace(mesh.blocks[0], formulation="C3D8I"),))
    text = deck(mesh, more=cards).replace("BEGIN BULK", f"{case}\nBEGIN BULK")
    (folder / "a.bdf").write_text(text)
    return read_mesh(folder / "a.bdf", ComponentTable(mesh="a.bdf", treat_as={"CHEXA8": "C3D8"}))


def test_equations_of_nastran(tmp_path):
    cards = ("MPC,3,1,1,2.,2,2,-1.\n+,,3,3,4.", "MPC,4,5,1,1.,6,1,1.")
    mesh = nastran(tmp_path, *cards, case="  MPC = 3")
    assert len(mesh.constraints) == 1
    assert mesh.constraints[0].nodes.tolist() == [0, 1, 2]
    np.testing.assert_array_equal(mesh.constraints[0].vectors, [2 * X, -Y, 4 * Z])
    assert not nastran(tmp_path, *cards).constraints
    assert len(nastran(tmp_path, *cards, "MPCADD,9,3,4", case="MPC=9").constraints) == 2


@pytest.mark.parametrize(
    ("card", "message"),
    [
        ("CONM2,901,2,,2e-6,1.", "a mass with an offset at a node that does not turn: state a"),
        ("CELAS2,900,7.,1,5", "node 1 does not turn: expected a direction 1 to 3, found 5"),
        ("CELAS1,900,5,1,1", "there is no PELAS 5"),
        ("CELAS2,900,7.,99,1", "there is no node 99"),
    ],
)
def test_what_is_wrong_in_bulk_data(tmp_path, card, message):
    with pytest.raises(ModelError, match=rf"a\.bdf, line \d+: .*{message}"):
        nastran(tmp_path, card)


def test_null_spaces_are_those_of_the_box(tmp_path):
    """The helper of equations has the same box."""
    K, M = null_space(tmp_path, [])
    found = matrices(tmp_path)
    same((found[0] / 1e3, found[1] * 1e3 / 1e3), (K, M * 1e3))
    assert apart(found[0], K * 1e3) < 1e-12


def test_chain_of_masses_in_either_order(tmp_path):
    """Springs may precede those that join them to the solid, with an unused node beside them."""
    x, y, z = BOX.nodes[11]
    nodes = [f"{1001 + k}, {x + k}, {y + k}, {z + 2 * k}" for k in (1, 2, 3)]
    masses = ["*ELEMENT, TYPE=MASS, ELSET=W", "900, 1002", "901, 1003", "*MASS, ELSET=W", "2e-6"]
    springs = [f"{BOX.numbers[11]}, 1002", "1002, 1003"]
    spectra = []
    for order in (springs, springs[::-1]):
        lines_of = [f"{902 + k}, {ends}" for k, ends in enumerate(order)]
        lines = ["*NODE", *nodes, *masses, "*ELEMENT, TYPE=SPRINGA, ELSET=K", *lines_of]
        K, M, body = matrices(tmp_path, *lines, "*SPRING, ELSET=K", "", "7.")
        assert len(body.mesh.nodes) == len(BOX.nodes) + 2
        spectra.append([np.linalg.eigvalsh(K), np.linalg.eigvalsh(M)])
    np.testing.assert_allclose(spectra[1], spectra[0], atol=1e-9 * abs(spectra[0][0]).max())
