"""Elements of components: functions, faces, patch tests, rigid modes, mass, affine moduli."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from component_meshes import LINING, STEEL, box, rigid_shapes

from squealstudy.errors import ModelError
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.solid_meshes import mesh_of_grid
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.faces import boundary, facets
from squealstudy.models.components.formulations import FORMULATIONS, integration
from squealstudy.models.components.materials import Orientation, Orthotropic, moduli
from squealstudy.models.components.mesh import ElementBlock, SolidMesh
from squealstudy.models.components.mesh_matrices import (
    coefficients,
    mass_matrix,
    stiffness_matrix,
    stiffness_terms,
)
from squealstudy.models.element_shapes import SHAPES
from squealstudy.models.fem.solid import FULL_INTEGRATION_ORDER, Isotropic

ALL = sorted(FORMULATIONS)
VOLUME = {"tet": 1 / 6, "pyramid": 1 / 3, "wedge": 1 / 2, "hex": 1.0}
# Abaqus Analysis User's Guide, "Solid element library": corners of faces S1, S2, ..., from 1
ABAQUS = {
    "tet": ["123", "142", "243", "341"],
    "pyramid": ["1234", "152", "253", "354", "451"],
    "wedge": ["123", "465", "1452", "2563", "3641"],
    "hex": ["1234", "5876", "1562", "2673", "3784", "4851"],
}


def family(shape):
    return shape.name.rstrip("0123456789")


# -- shapes --------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", SHAPES)
def test_functions_are_one_at_their_node(name):
    shape = SHAPES[name]
    N, _ = shape.functions(shape.places)
    np.testing.assert_allclose(N, np.eye(shape.nodes), atol=1e-15)


@pytest.mark.parametrize("name", SHAPES)
def test_slopes_are_those_of_the_functions(name):
    shape = SHAPES[name]
    X = np.random.default_rng(1).uniform(0.1, 0.3, (5, 3))
    _, dN = shape.functions(X)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        change = (shape.functions(X + step)[0] - shape.functions(X - step)[0]) / 2e-6
        np.testing.assert_allclose(dN[:, :, axis], change, atol=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_faces_are_those_of_abaqus_seen_from_outside(name):
    shape = SHAPES[name]
    middle = shape.places.mean(axis=0)
    assert len(shape.faces) == len(ABAQUS[family(shape)])
    for face, published in zip(shape.faces, ABAQUS[family(shape)], strict=True):
        corners = [i for i in face if shape.is_corner(i)]
        assert {i + 1 for i in corners} == {int(c) for c in published}
        a, b, c = shape.places[corners[:3]]
        assert np.cross(b - a, c - b) @ (a - middle) > 0
        ends = zip(corners, [*corners[1:], corners[0]], strict=True)
        middles = [(shape.places[i] + shape.places[j]) / 2 for i, j in ends]
        if len(face) > len(corners):
            np.testing.assert_array_equal(shape.places[list(face[len(corners) :])], middles)


@pytest.mark.parametrize("name", ALL)
def test_weights_are_positive_and_add_up_to_the_volume(name):
    kind = FORMULATIONS[name]
    for rule in (kind.stiffness, kind.mass):
        weights = integration(rule).weights
        assert (weights > 0).all()
        assert weights.sum() == pytest.approx(VOLUME[family(kind.shape)], rel=1e-14)


# -- patch tests, rigid modes, mass --------------------------------------------------------------
@pytest.mark.parametrize("name", ALL)
def test_patch_of_constant_strain(name):
    mesh = box(name, (2, 2, 2), uneven=0.25)
    slope = np.random.default_rng(5).standard_normal((3, 3))
    u = (mesh.nodes @ slope.T).ravel()
    strain = (slope + slope.T) / 2
    e = np.array([*np.diag(strain), *(2 * strain[i, j] for i, j in ((1, 2), (0, 2), (0, 1)))])
    K = stiffness_matrix(mesh)
    assert u @ K @ u == pytest.approx(e @ STEEL.stiffness() @ e * 15.0, rel=1e-12)
    inside = ((mesh.nodes > 1e-9) & (mesh.nodes < np.array([3, 2, 2.5]) - 1e-9)).all(axis=1)
    assert inside.any()
    force = (K @ u).reshape(-1, 3)
    assert np.abs(force[inside]).max() < 1e-12 * np.abs(force).max()


@pytest.mark.parametrize("name", ALL)
def test_six_rigid_modes_and_no_more(name):
    mesh = box(name, (2, 2, 2), uneven=0.2)
    K = stiffness_matrix(mesh)
    assert abs(K - K.T).max() == 0.0
    R = rigid_shapes(mesh.nodes)
    assert np.abs(K @ R).max() < 1e-12 * abs(K).max()
    values = np.linalg.eigvalsh(K.toarray())
    assert (np.abs(values[:6]) < 1e-12 * values[-1]).all()
    assert values[6] > 1e-6 * values[-1]


@pytest.mark.parametrize("name", ALL)
def test_mass_and_inertia_of_a_box(name):
    mesh = box(name, (2, 2, 2))
    R = rigid_shapes(mesh.nodes - [1.5, 1.0, 1.25])
    mass = 7.8e-9 * 15.0
    sides = np.array([3.0, 2.0, 2.5]) ** 2
    inertia = mass / 12 * (sides.sum() - sides)
    expected = np.diag([mass] * 3 + list(inertia))
    np.testing.assert_allclose(R.T @ mass_matrix(mesh) @ R, expected, atol=1e-12 * mass)
    uneven = box(name, (2, 2, 2), uneven=0.2)
    shift = rigid_shapes(uneven.nodes)[:, :3]
    for rule in ("full", "as_stiffness"):
        M = mass_matrix(uneven, rule)
        np.testing.assert_allclose(shift.T @ M @ shift, mass * np.eye(3), atol=1e-12 * mass)


@pytest.mark.parametrize("name", ALL)
def test_mass_is_positive_definite(name):
    """So is no mass of C3D10, C3D15, C3D20R with the points of their stiffness in one element."""
    M = mass_matrix(box(name, (1, 1, 1)))
    values = np.linalg.eigvalsh(M.toarray())
    assert values[0] > 1e-4 * values[-1]


def test_incompatible_modes_bend_exactly():
    """Pure bending of one brick, free to contract: what C3D8 takes for half as much again."""
    L, h, b, E, nu = 4.0, 1.0, 1.0, 2.1e5, 0.3
    energy = {}
    for name in ("C3D8I", "C3D8"):
        mesh = box(name, (1, 1, 1), (L, b, h))
        x = mesh.nodes - [L / 2, b / 2, h / 2]
        u = np.zeros_like(x)
        u[:, 0] = x[:, 0] * x[:, 2]  # curvature 1
        u[:, 1] = -nu * x[:, 1] * x[:, 2]
        energy[name] = u.ravel() @ stiffness_matrix(mesh) @ u.ravel() / 2
    exact = E * b * h**3 / 12 * L / 2
    assert energy["C3D8I"] == pytest.approx(exact, rel=1e-12)
    assert energy["C3D8"] > 1.5 * exact


def test_mean_dilatation_has_one_change_of_volume_an_element():
    rank = {}
    for name in ("C3D8", "C3D8_BBAR"):
        mesh = box(name, (1, 1, 1))
        mesh = replace(mesh, nodes=mesh.nodes + np.random.default_rng(0).uniform(0, 0.2, (8, 3)))
        volume = next(K for term, K in stiffness_terms(mesh, "S") if term == "S.lambda")
        rank[name] = np.linalg.matrix_rank(volume.toarray(), tol=1e-9)
    assert rank["C3D8"] > rank["C3D8_BBAR"] == 1


def cantilever(name, cells):
    """First frequency [rad/s] of a bar 10 x 1 x 1, held at one end, that does not contract."""
    material = replace(STEEL, poisson_ratio=0.0)  # else stresses are singular where it is held
    mesh = box(name, cells, (10.0, 1.0, 1.0), materials={"S": material})
    free = np.flatnonzero(np.repeat(mesh.nodes[:, 0] > 0, 3))
    K, M = (A[free][:, free].tocsc() for A in (stiffness_matrix(mesh), mass_matrix(mesh)))
    value = spla.eigsh(K, 1, M, sigma=0.0, which="LM", return_eigenvectors=False)
    return float(np.sqrt(value[0]))


@pytest.mark.parametrize("name", ALL)
def test_frequency_of_a_cantilever_converges(name):
    fine = cantilever("C3D20", (20, 2, 2))
    beam = 1.875104**2 * np.sqrt(STEEL.young_modulus / 12 / STEEL.density) / 100
    assert 0.99 < fine / beam < 0.995  # shear and rotary inertia take .65 %
    coarse, finer = (cantilever(name, cells) / fine - 1 for cells in ((5, 2, 2), (10, 2, 2)))
    assert finer < coarse / 2
    assert abs(finer) < {"C3D4": 0.7, "C3D5": 0.4, "C3D6": 0.1, "C3D8": 0.3, "C3D8_BBAR": 0.2}.get(
        name, 3e-3
    )


# -- moduli --------------------------------------------------------------------------------------
RECTANGULAR = Orientation("rectangular", (1, 2, 0.3), (-1, 1, 0.2), turn=(3, 25.0))
CYLINDRICAL = Orientation("cylindrical", (-5, -4, 0), (-5.1, -4, 1))


def oriented(name, material, orientation=None):
    mesh = box(name, (2, 1, 1), uneven=0.2, materials={"S": material})
    if orientation is None:
        return mesh
    which = np.full(mesh.n_elements, "O", dtype=object)
    which[0] = ""
    return replace(mesh, orientations={"O": orientation}, orientation=which)


def summed(mesh, material, changed=None):
    factors = coefficients(mesh, material, changed)
    terms = stiffness_terms(mesh, material)
    assert [t.name for t in terms] == list(factors)
    return sum(factors[t.name] * t.K for t in terms)


@pytest.mark.parametrize("orientation", [None, RECTANGULAR, CYLINDRICAL])
@pytest.mark.parametrize("material", [STEEL, LINING])
@pytest.mark.parametrize("name", ALL)
def test_stiffness_is_the_sum_of_its_terms(name, material, orientation):
    mesh = oriented(name, material, orientation)
    K = stiffness_matrix(mesh)
    assert abs(summed(mesh, "S") - K).max() < 1e-13 * abs(K).max()


@pytest.mark.parametrize("name", [n for n in ALL if n != "C3D8I"])
def test_changed_moduli_need_no_new_assembly(name):
    mesh = oriented(name, LINING, RECTANGULAR)
    changed = Orthotropic.from_engineering(
        (8e3, 9e3, 1e3), (0.1, 0.2, 0.1), (1e3, 2e3, 3e3), 2.5e-9
    )
    K = stiffness_matrix(replace(mesh, materials={"S": changed}))
    assert abs(summed(mesh, "S", changed) - K).max() < 1e-13 * abs(K).max()


def test_condensed_freedoms_take_a_common_factor_only():
    mesh = oriented("C3D8I", STEEL)
    twice = replace(STEEL, young_modulus=2 * STEEL.young_modulus)
    K = stiffness_matrix(replace(mesh, materials={"S": twice}))
    assert abs(summed(mesh, "S", twice) - K).max() < 1e-13 * abs(K).max()
    with pytest.raises(ModelError, match="one common factor only"):
        coefficients(mesh, "S", replace(STEEL, poisson_ratio=0.25))
    with pytest.raises(ModelError, match="another kind"):
        coefficients(mesh, "S", LINING)


def test_isotropic_material_needs_no_axes():
    there, here = (stiffness_matrix(oriented("C3D10", STEEL, o)) for o in (None, CYLINDRICAL))
    assert abs(there - here).max() < 1e-13 * abs(here).max()


def test_turned_material_is_the_turned_body():
    """A body turned with its axes has the turned stiffness."""
    mesh = oriented("C3D20", LINING, RECTANGULAR)
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    mesh = replace(mesh, orientation=np.full(mesh.n_elements, "O", dtype=object))
    moved = replace(
        mesh,
        nodes=mesh.nodes @ turn.T + [1.0, 2.0, 3.0],
        orientations={"O": RECTANGULAR.moved(turn, np.array([1.0, 2.0, 3.0]))},
    )
    K, there = stiffness_matrix(mesh), stiffness_matrix(moved)
    T = np.kron(np.eye(len(mesh.nodes)), turn)
    assert np.abs(T @ K.toarray() @ T.T - there.toarray()).max() < 1e-13 * abs(K).max()


def test_engineering_constants_and_tensor_agree():
    S = np.linalg.inv(LINING.stiffness())
    np.testing.assert_allclose(1 / np.diag(S), [9e3, 7e3, 2e3, 3e3, 1.2e3, 1.5e3], rtol=1e-12)
    np.testing.assert_allclose(
        [-S[0, 1] * 9e3, -S[0, 2] * 9e3, -S[1, 2] * 7e3], [0.2, 0.1, 0.15], rtol=1e-12
    )
    assert [m.name for m in moduli(LINING)][:3] == ["D1111", "D1122", "D2222"]


# -- two formulations in one mesh; the generated brake -------------------------------------------
def mixed():
    """A box of hexahedra beside one of wedges, nodes shared, two materials."""
    left, right = box("C3D8", (1, 1, 1)), box("C3D6", (1, 1, 1))
    nodes, number = np.unique(
        np.vstack([left.nodes, right.nodes + np.array([3.0, 0, 0])]), axis=0, return_inverse=True
    )
    blocks = tuple(
        ElementBlock(
            b.formulation, number.ravel()[b.nodes + k * 8], np.arange(len(b.labels)) + 1 + 10 * k
        )
        for k, b in enumerate((left.blocks[0], right.blocks[0]))
    )
    mesh = SolidMesh(
        Path("mixed.inp"),
        nodes,
        np.arange(len(nodes)) + 1,
        blocks,
        node_sets={"END": np.flatnonzero(nodes[:, 0] == 6.0), "ALL": np.arange(len(nodes))},
        element_sets={"LEFT": np.array([0]), "RIGHT": np.array([1, 2])},
        surfaces={"SIDE": np.array([[0, 1], [1, 1]])},
    )
    axes = ("axes", RECTANGULAR)
    return mesh.with_material("iron", STEEL).with_material("pad", LINING, "right", axes)


def test_two_formulations_and_materials_in_one_mesh():
    mesh = mixed()
    check_mesh(mesh)
    K = stiffness_matrix(mesh)
    total = summed(mesh, "iron") + summed(mesh, "pad")
    assert abs(K - total).max() < 1e-13 * abs(K).max()
    assert mesh.orientation.tolist() == ["", "axes", "axes"]
    alone = stiffness_matrix(mesh.part(np.array([0])))
    assert alone.shape == (24, 24)
    assert abs(summed(mesh, "iron")).sum() == pytest.approx(abs(alone).sum())
    assert np.abs(K @ rigid_shapes(mesh.nodes)).max() < 1e-12 * abs(K).max()


def test_one_material_of_plain_and_condensed_elements():
    mesh = box("C3D8", (2, 1, 1), uneven=0.2)
    block = mesh.blocks[0]
    mesh = replace(
        mesh,
        blocks=tuple(
            replace(
                block,
                formulation=name,
                nodes=block.nodes[k : k + 1],
                labels=block.labels[k : k + 1],
            )
            for k, name in enumerate(("C3D8", "C3D8I"))
        ),
    )
    assert list(coefficients(mesh, "S")) == ["S.lambda", "S.mu", "S.scale"]
    K = stiffness_matrix(mesh)
    assert abs(summed(mesh, "S") - K).max() < 1e-13 * abs(K).max()


def test_facets_of_surfaces_and_node_sets():
    mesh = mixed()
    triangles, squares = facets(mesh, "side")
    assert triangles.nodes.shape == (1, 3)
    assert squares.nodes.shape == (1, 4)
    (end,) = facets(mesh, "END")
    np.testing.assert_array_equal(end.faces[:, 0], [2])
    areas = {}
    for group in facets(mesh, "ALL"):
        x = mesh.nodes[group.nodes]
        normals = np.cross(x[:, 1] - x[:, 0], x[:, -1] - x[:, 0])
        outward = x.mean(axis=1) - mesh.nodes.mean(axis=0)
        assert (np.einsum("ij,ij->i", normals, outward) > 0).all()
        areas[group.nodes.shape[1]] = np.linalg.norm(normals, axis=1).sum()
    assert areas[3] / 2 + areas[4] == pytest.approx(2 * (6 * 2 + 6 * 2.5 + 2 * 2.5))
    assert len(boundary(mesh)) == 5 + 3 + 4
    with pytest.raises(ModelError, match=r"lie between elements, .* such as of C3D8 element 1"):
        facets(replace(mesh, surfaces={"IN": np.array([[0, 4]])}), "IN")
    with pytest.raises(
        ModelError, match=r"mixed.inp has no node set or surface 'X'; it has ALL, END, SIDE"
    ):
        facets(mesh, "X")
    with pytest.raises(ModelError, match="no facet of the boundary has all its nodes in"):
        facets(replace(mesh, node_sets={"ONE": np.array([0])}), "ONE")
    others = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.node_set("END"))
    more = np.append(mesh.node_set("END"), others[0])
    with pytest.raises(ModelError, match=rf"'MORE' is no face: .* node {mesh.numbers[others[0]]} "):
        facets(replace(mesh, node_sets={"MORE": more}), "MORE")


BRAKE = MODELS["disc_brake"].defaults()


@pytest.mark.parametrize("name", ["disc", "outer_pad", "caliper"])
def test_generated_components_have_the_same_matrices(name):
    mesher = BrakeMesher(BRAKE, COARSE, FULL_INTEGRATION_ORDER)
    solid = mesher.component(name)
    mesh = mesh_of_grid(name, solid.grid, mesher.materials(name))
    check_mesh(mesh)
    np.testing.assert_array_equal(mesh.nodes, solid.coordinates)
    K, M = stiffness_matrix(mesh), mass_matrix(mesh)
    assert abs(K - solid.K).max() < 1e-12 * abs(K).max()
    assert abs(M - solid.M).max() < 1e-12 * abs(M).max()


# -- faults --------------------------------------------------------------------------------------
def swapped(mesh):
    block = mesh.blocks[0]
    nodes = block.nodes.copy()
    nodes[1, [0, 1]] = nodes[1, [1, 0]]
    return replace(mesh, blocks=(replace(block, nodes=nodes),))


def with_slit(mesh):
    """The last element with a node of its own beside one that it shared."""
    block = mesh.blocks[0]
    nodes = block.nodes.copy()
    shared = nodes[-1, 0]
    nodes[-1, 0] = len(mesh.nodes)
    return replace(
        mesh,
        nodes=np.vstack([mesh.nodes, mesh.nodes[shared]]),
        numbers=np.append(mesh.numbers, 999),
        blocks=(replace(block, nodes=nodes),),
    )


def repeated(mesh):
    block = mesh.blocks[0]
    nodes = block.nodes.copy()
    nodes[0, 2] = nodes[0, 1]
    return replace(mesh, blocks=(replace(block, nodes=nodes),))


def copied(mesh):
    block = mesh.blocks[0]
    copy = replace(block, labels=block.labels + 100)
    return replace(mesh, blocks=(block, copy), material=np.tile(mesh.material, 2), orientation=[])


FAULTS = {
    r"box.inp: C3D8 element 102: a negative Jacobian": swapped,
    r"box.inp: C3D8 element 101: a node is named twice": repeated,
    r"box.inp: C3D8 elements 101, 102, 201, 202: a face belongs to more than two": copied,
    r"nodes \d+ and 999 lie at one place: C3D8 elements? .*102.* not connected": with_slit,
    r"box.inp: node 999: no element has this node": lambda mesh: replace(
        mesh, nodes=np.vstack([mesh.nodes, [9, 9, 9]]), numbers=np.append(mesh.numbers, 999)
    ),
    r"box.inp: node 11: coordinates that are no finite numbers": lambda mesh: replace(
        mesh, nodes=np.vstack([[np.nan] * 3, mesh.nodes[1:]])
    ),
}


@pytest.mark.parametrize("message", FAULTS)
def test_faults_name_the_elements(message):
    with pytest.raises(ModelError, match=message):
        check_mesh(FAULTS[message](box("C3D8", (2, 1, 1))))


def test_elements_without_material_are_named():
    mesh = box("C3D4", (1, 1, 1), material=np.array(["S", "", "S", "", "S", "S"], dtype=object))
    with pytest.raises(ModelError, match="C3D4 elements 102, 104 have no material"):
        stiffness_matrix(mesh)
    with pytest.raises(ModelError, match="no material 'X', its materials are S"):
        stiffness_terms(mesh, "X")


@pytest.mark.parametrize(
    ("system", "a", "b"),
    [
        ("rectangular", (1.0, 2.0, 3.0), (2.0, 4.0, 6.0)),
        ("cylindrical", (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)),
    ],
)
def test_points_that_give_no_axes_are_refused(system, a, b):
    with pytest.raises(ModelError, match="orientation"):
        Orientation(system, a, b)


def test_moduli_that_are_no_stiffness_are_refused():
    with pytest.raises(ModelError, match="no positive definite stiffness"):
        Orthotropic((1.0, 2.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0), 1.0)
    with pytest.raises(ModelError, match="positive density"):
        Orthotropic((1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0), 0.0)
    with pytest.raises(ModelError):
        Isotropic(1.0, 0.5, 1.0).stiffness()
