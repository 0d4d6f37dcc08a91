"""Couplings in some directions alone, in axes of their own; parts that are turned; assemblies."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from calculix import run
from component_meshes import STEEL, box
from test_couplings import REFERENCE, boxes, needs_ccx, read

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import _placed_mesh as moved
from squealstudy.models.components.body_matrices import freedom_matrices
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.inp import read_inp

TIE = ("*TIE, NAME=GLUE", "UPPER, LOWER")
ORIENTATIONS = {
    "cylindrical": ("*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL", "-3., .4, 0., -3., .6, 1."),
    "rectangular": ("*ORIENTATION, NAME=O", "1., 2., .3, -2., 1., .4", "2, 20."),
}
COUPLING = "*COUPLING, CONSTRAINT NAME=C, REF NODE={ref}, SURFACE=TOP, ORIENTATION=O"
TURN = la.expm(np.cross(np.eye(3), [0.3, -0.7, 0.5]))
C = 1e14  # (rad/s)^2, about those of the fastest modes
SHIFT = np.array([3.0, -2.0, 1.0])


def matrices(mesh):
    """Where freedoms are, K and M."""
    mesh, e = expanded(mesh)
    return e.places, *(A.toarray() for A in freedom_matrices(mesh, e, "as_stiffness"))


def roots(mesh):
    """Those of the pencil C M, K + C M, between 0 and 1; freedoms may have no mass."""
    _, K, M = matrices(mesh)
    found: np.ndarray = la.eigvalsh(C * M, K + C * M)
    return found


@needs_ccx
@pytest.mark.parametrize("system", ORIENTATIONS)
@pytest.mark.parametrize("directions", ["1", "2, 3"])
def test_some_directions_in_axes_of_their_own_are_those_of_calculix(tmp_path, system, directions):
    """A face that a held node guides."""
    lines = (*TIE, *ORIENTATIONS[system], COUPLING, "*KINEMATIC", directions)
    mesh, written = boxes(lines)
    (tmp_path / "ccx").mkdir()
    held = ("*BOUNDARY", f"{mesh.numbers[-2]}, 1, 6")
    run(tmp_path / "ccx", mesh, *written, *held, "*STEP", "*FREQUENCY", "14", "*END STEP")
    rows = [row.split() for row in (tmp_path / "ccx" / "job.dat").read_text().split("\n")]
    hz = np.array([float(r[3]) for r in rows if len(r) == 5 and r[0].isdigit()])
    mesh = read(tmp_path, lines)[0]
    places, K, M = matrices(mesh)
    free = np.flatnonzero((places >= 0) & ~np.isin(places // 3, mesh.used_without_element))
    w2 = la.eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)
    ours = np.sqrt(np.abs(w2[:14])) / (2 * np.pi)
    assert len(hz) == 14
    elastic = hz > 1e-3 * hz[-1]
    assert elastic.sum() >= 8
    np.testing.assert_allclose(ours[elastic], hz[elastic], rtol=2e-5)


@pytest.mark.parametrize("kind", ["*KINEMATIC", "*DISTRIBUTING"])
@pytest.mark.parametrize("system", ["", "rectangular", "cylindrical"])
def test_directions_turn_with_the_component(tmp_path, kind, system):
    coupling = COUPLING if system else COUPLING.partition(", ORIENTATION")[0]
    mass = ("*ELEMENT, TYPE=MASS, ELSET=W", "9001, {ref}", "*MASS, ELSET=W", "1e-7")
    spring = ("*ELEMENT, TYPE=SPRING1, ELSET=V", "9002, {ref}", "*SPRING, ELSET=V", "3", "40.")
    lines = (*TIE, *ORIENTATIONS.get(system, ()), coupling, kind, "1, 2", *mass, *spring)
    mesh = read(tmp_path, lines)[0]
    expected = roots(mesh)
    np.testing.assert_allclose(roots(moved(mesh, TURN, SHIFT)), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("system", ["rectangular", "cylindrical"])
def test_a_mean_motion_in_axes_of_its_own(tmp_path, system):
    """What the reference node does along the axes is the mean motion along them, and no more."""
    lines = (*TIE, *ORIENTATIONS[system], COUPLING, "*DISTRIBUTING", "1")
    mesh, e, *_ = read(tmp_path, lines)
    whole = read(tmp_path, (*TIE, COUPLING.partition(", ORIENTATION")[0], "*DISTRIBUTING"))[1]
    at = 3 * mesh.used_without_element[0] + np.arange(3)
    c = mesh.constraints[1]
    (axis,) = c.along(np.array(REFERENCE))
    q = np.random.default_rng(4).standard_normal(whole.E.shape[1])
    mean = whole.E[at] @ q
    own = e.freedoms((whole.E @ q)[:, None])[:, 0]
    assert axis @ (e.E[at] @ own) == pytest.approx(axis @ mean, rel=1e-10)
    across = la.null_space(axis[None]).T
    assert abs(across @ e.E[at].toarray()).max() > 0.1  # free there


PART = """*PART, NAME=P
*NODE
{nodes}
*ELEMENT, TYPE=C3D8, ELSET=E
{elements}
*SOLID SECTION, ELSET=E, MATERIAL=S
{of_part}
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=I, PART=P
{placed}
*END INSTANCE
{of_assembly}
*END ASSEMBLY
*MATERIAL, NAME=S
*ELASTIC
210000., .3
*DENSITY
7.8e-9
"""


def assembly(folder, of_assembly=(), placed=(), of_part=()):
    """A box of three elements as an instance, with lines; `dialect` is that of CalculiX."""
    mesh = box("C3D8", (3, 1, 1), materials={"S": STEEL})
    text = PART.format(
        nodes="\n".join(
            ", ".join([str(n), *map(repr, map(float, x))])
            for n, x in zip(mesh.numbers, mesh.nodes, strict=True)
        ),
        elements="\n".join(
            ", ".join(map(str, [label, *mesh.numbers[nodes]]))
            for label, nodes in zip(mesh.blocks[0].labels, mesh.blocks[0].nodes, strict=True)
        ),
        of_part="\n".join(of_part),
        placed="\n".join(placed),
        of_assembly="\n".join(of_assembly),
    )
    text = "\n".join(line for line in text.splitlines() if line)
    (folder / "a.inp").write_text(text)
    return read_inp(folder / "a.inp", dialect="calculix")


QUARTER = ("1., 2., 3.", "0., 0., 0., 0., 0., 1., 90.")  # about z at the origin, after the shift


def test_directions_of_an_assembly_are_global(tmp_path):
    """An equation of the assembly says y where the part, turned by 90 degrees, says x."""
    x = ("*EQUATION", "2", "{0}11, 1, 1., {0}17, 1, -1.")
    of_part = assembly(tmp_path, of_part=[line.format("") for line in x])
    y = ("*EQUATION", "2", "I.11, 2, 1., I.17, 2, -1.")
    of_assembly = assembly(tmp_path, y, QUARTER)
    expected = roots(of_part)
    np.testing.assert_allclose(roots(of_assembly), expected, rtol=0, atol=1e-9)
    assert abs(roots(assembly(tmp_path, y)) - expected).max() > 1e-4


def test_transforms_of_a_part_turn_with_it_and_are_those_of_the_assembly_too(tmp_path):
    turned = ("*NSET, NSET=T", "11, 17", "*TRANSFORM, NSET=T", "1., 1., 0., -1., 1., 0.")
    equation = ("*EQUATION", "2", "{0}11, 1, 1., {0}17, 2, -1.")
    in_part, in_assembly = ([line.format(w) for line in equation] for w in ("", "I."))
    expected = roots(assembly(tmp_path, of_part=[*turned, *in_part]))
    for placed in ((), QUARTER):
        for lines in ({"of_part": [*turned, *in_part]},
                      {"of_part": turned, "of_assembly": in_assembly}):  # fmt: skip
            found = roots(assembly(tmp_path, placed=placed, **lines))
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "lines",
    [
        ("*EQUATION", "2", "11, 1, 1., 17, 1, -1."),
        ("*NSET, NSET=END", "11, 12, 13", "*SURFACE, NAME=F, TYPE=NODE", "END",
         "*COUPLING, REF NODE=26, SURFACE=F", "*KINEMATIC", "1"),
        ("*ELEMENT, TYPE=SPRING1, ELSET=V", "91, 11", "*SPRING, ELSET=V", "1", "5."),
        ("*ELEMENT, TYPE=ROTARYI, ELSET=V", "91, 11", "*ROTARY INERTIA, ELSET=V", "1., 1., 2."),
    ],
)  # fmt: skip
def test_directions_of_a_part_that_turns_are_asked_for(tmp_path, lines):
    assembly(tmp_path, of_part=lines, placed=("1., 2., 3.",))
    with pytest.raises(ModelError, match="directions of a part that turns with its instance"):
        assembly(tmp_path, of_part=lines, placed=QUARTER)


@pytest.mark.parametrize(
    ("mine", "turned"),
    [
        (("1., 0., 0., 0., 1., 0.",), ("0., 1., 0., -1., 0., 0.",)),
        (
            ("-1., -.7, 0., -1., -.7, 1.",),
            ("-1.3, 0., 3., -1.3, 0., 4.",),  # (x, y) + (1, 2) is turned to (-y - 2, x + 1)
        ),
    ],
)
def test_orientations_of_an_assembly_are_global(tmp_path, mine, turned):
    system = "RECTANGULAR" if mine[0].startswith("1.") else "CYLINDRICAL"
    lines = (
        "*NSET, NSET={}END{}",
        "{}",
        "*SURFACE, NAME=F, TYPE=NODE",
        "END",
        f"*ORIENTATION, NAME=O, SYSTEM={system}",
    )
    end = [*range(11, 15)]
    of_part = [lines[0].format("", ""), ", ".join(map(str, end)), *lines[2:], *mine]
    coupling = ("*COUPLING, REF NODE={}, SURFACE=F, ORIENTATION=O", "*KINEMATIC", "1")
    mesh = assembly(tmp_path, of_part=[*of_part, coupling[0].format(26), *coupling[1:]])
    of_assembly = [lines[0].format("", ", INSTANCE=I"), ", ".join(map(str, end)), *lines[2:]]
    of_assembly += [*turned, coupling[0].format("I.26"), *coupling[1:]]
    other = assembly(tmp_path, of_assembly, QUARTER)
    expected = roots(mesh)
    np.testing.assert_allclose(roots(other), expected, rtol=0, atol=1e-9)
    (c,), (d,) = mesh.constraints, other.constraints
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(
        d.along(other.nodes[d.nodes]), c.along(mesh.nodes[c.nodes]) @ turn.T, atol=1e-12
    )


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ((COUPLING, "*KINEMATIC", "2"), "there is no orientation 'O'"),
        (
            (
                "*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL",
                "0., 0., 0., 0., 0., 1.",
                COUPLING,
                "*KINEMATIC",
                "2",
            ),
            "lies on the axis of the orientation, and has no direction there",
        ),
    ],
)
def test_axes_that_are_none(tmp_path, lines, message):
    with pytest.raises(ModelError, match=rf"line \d+: .*{message}"):
        read(tmp_path, (*TIE, *lines))


def test_masses_in_an_assembly_are_a_line_to_paste(tmp_path):
    text = r'\*SPRING in the assembly is not supported: .*pass_over = \["SPRING"\]'
    with pytest.raises(ModelError, match=text):
        assembly(tmp_path, ("*SPRING, ELSET=X", "1", "1."))
