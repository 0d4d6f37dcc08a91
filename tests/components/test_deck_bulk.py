"""Cards of Nastran, OptiStruct: bars, bushes, masses off nodes, moduli over temperature, SURF."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from component_meshes import LINING, STEEL, box
from test_component_judge import apart
from test_component_nastran import card, deck
from test_deck_turns import BOX, FACE, K0, M0, OTHER, REF, X0, moved, on, rigid, same, turned

from squealstudy.errors import ModelError
from squealstudy.models.components.body_matrices import freedom_matrices
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.nastran import read_bdf

PLAIN = {"CHEXA8": "C3D8"}
NUMBERS = BOX.numbers
GRID = f"GRID,900,,{REF[0]},{REF[1]},{REF[2]}"
RBE2 = "RBE2,800,900,123456," + ",".join(str(n) for n in NUMBERS[FACE])


def written(mesh):
    """With bricks as decks have them."""
    name = {"C3D8": "C3D8I"}
    blocks = [replace(b, formulation=name.get(b.formulation, b.formulation)) for b in mesh.blocks]
    return replace(mesh, blocks=tuple(blocks))


def read(folder, *cards, mesh=BOX, **options):
    (folder / "a.bdf").write_text(deck(written(mesh), more=["PARAM,COUPMASS,1", *cards]))
    return read_bdf(folder / "a.bdf", treat_as=PLAIN, **options)


def matrices(folder, *cards):
    mesh, expansion = expanded(read(folder, *cards))
    K, M = freedom_matrices(mesh, expansion, "full")
    return K.toarray(), M.toarray()


def held(rows):
    """K and M of the box where rows (m, 3 n) . u = 0."""
    N = la.null_space(np.array(rows).reshape(len(rows), -1))
    return N.T @ K0 @ N, N.T @ M0 @ N


def row(*terms):
    found = np.zeros((len(X0), 3))
    for node, vector in terms:
        found[node] += vector
    return found.ravel()


# -- rigid elements -----------------------------------------------------------------------------
@pytest.mark.parametrize(
    "name", ["RBAR,850,{},{},123456", "RBAR,850,{},{},,123456", "RROD,850,{},{}"]
)
def test_a_bar_alone_keeps_a_distance(tmp_path, name):
    along = X0[9] - X0[2]
    found = matrices(tmp_path, name.format(NUMBERS[2], NUMBERS[9]))
    same(found, held([row((9, along), (2, -along))]))


def test_bars_that_meet_are_one_rigid_body(tmp_path):
    cards = [
        f"RBAR,{850 + k},{NUMBERS[FACE[0]]},{NUMBERS[node]},123456"
        for k, node in enumerate(FACE[1:])
    ]
    place = X0[FACE[0]]
    N = moved([(FACE, on(place, FACE))], 6)
    same(matrices(tmp_path, *cards), (N.T @ K0 @ N, N.T @ M0 @ N))


def test_a_bar_from_the_middle_of_a_rigid_element(tmp_path):
    cards = [RBE2, GRID, f"RBAR,850,900,{NUMBERS[OTHER[0]]},123456"]
    N = moved([([*FACE, OTHER[0]], on(REF, [*FACE, OTHER[0]]))], 6)
    same(matrices(tmp_path, *cards), (N.T @ K0 @ N, N.T @ M0 @ N))


# -- masses and bushes --------------------------------------------------------------------------
def test_a_mass_off_a_node_that_turns(tmp_path):
    offset = np.array([0.5, -1.0, 2.0])
    cards = [RBE2, GRID, "CONM2,700,900,,2e-8,.5,-1.,2.,,+", "+,5e-8,1e-9,6e-8,2e-9,3e-9,7e-8"]
    G = np.hstack([np.eye(3), turned(offset)])
    inertia = 1e-8 * np.array([[5, -0.1, -0.2], [-0.1, 6, -0.3], [-0.2, -0.3, 7]])
    block = 2e-8 * G.T @ G
    block[3:, 3:] += inertia
    same(matrices(tmp_path, *cards), rigid([("M", block)]))


@pytest.mark.parametrize(
    ("bush", "axes"),
    [
        ("CBUSH,700,5,{},{},,,,0", np.eye(3)),
        ("CBUSH,700,5,{},{},,,,7", np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])),
        ("CBUSH,700,5,{},{},0.,0.,1.", None),
    ],
)
def test_bushes_between_nodes(tmp_path, bush, axes):
    k = [1e4, 2e4, 3e4]
    cards = ["PBUSH,5,K,1e4,2e4,3e4", bush.format(NUMBERS[2], NUMBERS[9])]
    cards.append("CORD2R,7,,0.,0.,0.,1.,0.,0.,+\n+,0.,1.,0.")  # z along x, x along y
    if axes is None:
        x = (X0[9] - X0[2]) / np.linalg.norm(X0[9] - X0[2])
        z = np.cross(x, [0, 0, 1.0])
        z /= np.linalg.norm(z)
        axes = np.array([x, np.cross(z, x), z])
    added = np.zeros_like(K0)
    for stiffness, axis in zip(k, axes, strict=True):
        r = row((9, axis), (2, -axis))
        added += stiffness * np.outer(r, r)
    found, M = matrices(tmp_path, *cards)
    assert apart(found - K0, added) < 1e-9
    assert apart(M, M0) < 1e-12


def test_a_bush_to_ground_against_turns(tmp_path):
    cards = [RBE2, GRID, "PBUSH,5,K,1e4,2e4,3e4,4e4,5e4,6e4", "CBUSH,700,5,900,,,,,0"]
    same(matrices(tmp_path, *cards), rigid([("K", np.diag([1e4, 2e4, 3e4, 4e4, 5e4, 6e4]))]))


@pytest.mark.parametrize(("share", "at"), [("", 0.5), (".2", 0.2)])
def test_a_bush_of_some_length_has_levers(tmp_path, share, at):
    """From the middle of a rigid face to a node of the other end: it acts where it is."""
    node = OTHER[0]
    cards = [RBE2, GRID, "PBUSH,5,K,1e4,2e4,3e4", f"CBUSH,700,5,900,{NUMBERS[node]},,,,0,+"]
    cards.append(f"+,{share}")
    K, M = matrices(tmp_path, *cards)
    N = moved([(FACE, on(REF, FACE))], 6)
    free = [k for k in range(len(X0)) if k not in FACE]
    relative = np.zeros((3, N.shape[1]))
    relative[:, 3 * free.index(node) : 3 * free.index(node) + 3] = np.eye(3)
    relative[:, -6:] = -np.hstack([np.eye(3), turned(at * (X0[node] - REF))])
    same((K, M), (N.T @ K0 @ N + relative.T @ np.diag([1e4, 2e4, 3e4]) @ relative, N.T @ M0 @ N))


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        (["PBUSH,5,K,1e4,2e4", "CBUSH,700,5,{},{},,,,0,+", "+,,3,1.,2.,3."], "OCID: a place off"),
        (["RBAR,850,{},{},123,456"], "expected CNA or CNB = 123456"),
        (["RBAR,850,{},{},123456", "RBAR,851,{1},{0},123456"], "are one rigid body: expected one"),
        (["CBUSH,700,5,{},{},,,,0"], "there is no PBUSH 5"),
        (["PBUSH,5,K,1e4,2e4", "CBUSH,700,5,{},{}"], "expected G0 or X1, X2, X3, or CID"),
        (["PBUSH,5,K,1e4,,,2.", "CBUSH,700,5,{},{},,,,0"], "at a node that does not turn"),
        (["PBUSH,5,K,-1.", "CBUSH,700,5,{},{},,,,0"], "stiffnesses of zero or above"),
        ([RBE2, GRID, "CONM2,700,900,,0.,,,,,+", "+,-1."], "not those of a mass"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, cards, message):
    cards = [c.format(NUMBERS[2], NUMBERS[9]) for c in cards]
    with pytest.raises(ModelError, match=rf"a\.bdf, line \d+: .*{message}"):
        matrices(tmp_path, *cards)


# -- materials ----------------------------------------------------------------------------------
TABLE = {
    "TABLEM1": "TABLEM1,4,,,,,,,,+\n+,0.,2.1e5,100.,1.9e5,200.,1.4e5,ENDT",
    "TABLEM2": "TABLEM2,4,20.,,,,,,,+\n+,-20.,1.,80.,.9047619,180.,.6666667,ENDT",
    "TABLEM3": "TABLEM3,4,0.,100.,,,,,,+\n+,0.,1.,1.,.9047619,2.,.6666667,ENDT",
    "TABLEM4": "TABLEM4,4,0.,100.,0.,2.,,,,+\n+,1.,-.1,ENDT",
}


@pytest.mark.parametrize(
    ("table", "temperature", "young"),
    [
        ("TABLEM1", 50.0, 2.0e5),
        ("TABLEM1", 150.0, 1.65e5),
        ("TABLEM2", 150.0, 1.65e5),
        ("TABLEM3", 150.0, 1.65e5),
        ("TABLEM4", 50.0, 2.1e5 * 0.95),
        ("TABLEM1", None, 2.1e5),
    ],
)
def test_moduli_over_temperature(tmp_path, table, temperature, young):
    mesh = read(tmp_path, "MATT1,7,4", TABLE[table], temperature=temperature)
    assert mesh.materials["MAT7"].young_modulus == pytest.approx(young, rel=1e-6)
    assert mesh.materials["MAT7"].poisson_ratio == 0.3
    told = [note.keyword for note in mesh.passed_over]
    assert ("MATT1" in told) == (temperature is None)


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        (
            ["MATT1,7,4", TABLE["TABLEM1"]],
            "temperature = 300 is outside of the table, .* from 0 to 200",
        ),
        (["MATT1,7,5", TABLE["TABLEM1"]], "there is no TABLEM 5"),
        (["MATT1,7,4", TABLE["TABLEM1"].replace("200.", "90.")], "ascending temperatures"),
        (["MATT1,7,4", TABLE["TABLEM1"].replace("4,,", "4,LOG,")], "axes that are not LINEAR"),
    ],
)
def test_tables_that_are_none(tmp_path, cards, message):
    with pytest.raises(ModelError, match=rf"a\.bdf, line \d+: .*{message}"):
        read(tmp_path, *cards, temperature=300.0)


def test_orthotropic_materials(tmp_path):
    text = deck(written(BOX), more=["PARAM,COUPMASS,1"])
    E, nu, G = (9e3, 7e3, 2e3), (0.2, 0.1, 0.15), (1.5e3, 1.2e3, 3e3)
    own = card("free", "MAT11", 7, *E, *nu, *G, 2.5e-9)
    start, rest = text.split("MAT1,", 1)
    (tmp_path / "a.bdf").write_text(start + own + "\n" + rest.split("\n", 1)[1])
    mesh = read_bdf(tmp_path / "a.bdf", treat_as=PLAIN)
    expected = box("C3D8", (3, 1, 1), materials={"S": LINING})
    assert apart(stiffness_matrix(mesh), stiffness_matrix(expected)) < 1e-10
    assert apart(mass_matrix(mesh), mass_matrix(expected)) < 1e-10


# -- surfaces -----------------------------------------------------------------------------------
LABELS = BOX.labels
LAST = [NUMBERS[k] for k in BOX.blocks[0].nodes[-1]]  # 1 2 6 5 is the face that looks along x


def test_surfaces_of_optistruct(tmp_path):
    a, b, c, d = (LAST[k] for k in (1, 2, 6, 5))
    mesh = read(
        tmp_path,
        f"SURF,3,ELFACE,,,,,,,+\n+,{LABELS[-1]},{a},{c}",
        f"SURF,4,FACE,,,,,,,+\n+,{a},{b},{c},{d}",
        "SURF,5,ELEM,LIST,,,,,,+\n+,101",
    )
    assert {k: f.tolist() for k, f in mesh.surfaces.items()} == {
        "SURF3": [[2, 4]],
        "SURF4": [[2, 4]],
    }
    nodes = BOX.blocks[0].nodes[-1][list(BOX.blocks[0].kind.shape.faces[3])]
    assert (X0[nodes, 0] == 3.0).all()
    assert "a SURF that lists neither ELFACE nor FACE" in [n.why for n in mesh.passed_over]
    with pytest.raises(ModelError, match=rf"{LABELS[-1]}: {a}, {b} does not say which"):
        read(tmp_path, f"SURF,3,ELFACE,,,,,,,+\n+,{LABELS[-1]},{a},{b}")


def test_faces_of_tetrahedra_and_wedges(tmp_path):
    tet = box("C3D4", (1, 1, 1), materials={"S": STEEL})
    n = [tet.numbers[k] for k in tet.blocks[0].nodes[0]]
    mesh = read(tmp_path, f"SURF,3,ELFACE,,,,,,,+\n+,101,{n[0]},{n[3]}", mesh=tet)
    assert mesh.surfaces["SURF3"].tolist() == [[0, 1]]  # nodes 1, 2, 3
    wedge = box("C3D6", (1, 1, 1), materials={"S": STEEL})
    n = [wedge.numbers[k] for k in wedge.blocks[0].nodes[0]]
    mesh = read(tmp_path, f"SURF,3,ELFACE,,,,,,,+\n+,101,{n[4]}", mesh=wedge)
    assert mesh.surfaces["SURF3"].tolist() == [[0, 2]]  # the triangle 4, 5, 6


def test_plates_that_a_surface_lists(tmp_path):
    a, b, c, d = (LAST[k] for k in (1, 2, 6, 5))
    cards = [f"CQUAD4,500,9,{a},{b},{c},{d}", "BSURF,2,500"]
    options = {"treat_as": {**PLAIN, "CQUAD4": "faces"}}
    (tmp_path / "a.bdf").write_text(deck(written(BOX), more=cards))
    mesh = read_bdf(tmp_path / "a.bdf", **options)
    assert mesh.surfaces["BSURF2"].tolist() == [[2, 4]]
    mesh = read(tmp_path, "BSURF,2,500")
    assert not mesh.surfaces


# -- how lines are read --------------------------------------------------------------------------
@pytest.mark.parametrize(
    "lines",
    [
        "SET1,4,{0},{1},{2},{3},{4},{5},{6},\n{7},{8}",  # a comma at the end goes on
        "SET1,4,{0},{1},{2},{3},{4},{5},{6}\n        {7},{8}",
        "SET1    4,{0},{1},{2},{3},{4},{5},{6}\n,{7},{8}",
        "SET1,4,{0},{1},{2},{3},{4},{5},{6},+A\n+A,{7},{8}",
    ],
)
def test_lines_in_free_fields_that_go_on(tmp_path, lines):
    mesh = read(tmp_path, lines.format(*NUMBERS))
    np.testing.assert_array_equal(mesh.node_sets["SET4"], np.arange(9))


def test_p_elements_are_said_to_be_others(tmp_path):
    text = r"ADAPT \(1, .*PVAL \(1, .*p-elements have orders and curved sides"
    with pytest.raises(ModelError, match=text):
        read(tmp_path, "ADAPT,1,,,2", "        errtol=.1,PART=TIP", "PVAL,2,6,6,6,,SET,1")


def test_sources_and_edges_of_fluids_are_passed_over(tmp_path):
    mesh = read(tmp_path, "ACPLNW,101,REAL,1.,101", "AMLREG,2,1,AML source")
    assert {"ACPLNW", "AMLREG"} <= {note.keyword for note in mesh.passed_over}


def test_elements_of_a_fluid_are_no_solids(tmp_path):
    text = deck(written(BOX))
    card = next(line for line in text.splitlines() if line.startswith("PSOLID"))
    label, material = card.replace(",", " ").split()[1:3]
    (tmp_path / "a.bdf").write_text(text.replace(card, f"PSOLID,{label},{material},,,,,PFLUID"))
    with pytest.raises(ModelError, match=r"PFLUID: the elements of PID\d+ are a fluid's"):
        read_bdf(tmp_path / "a.bdf")
