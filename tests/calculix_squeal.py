"""Squeal by CalculiX: a whole brake of a model file written as a deck, and its complex modes.

Load, slide until every point slips, then a perturbation step with the tangent of sliding friction.
Rows of springs and layers become equations of a node of their own, which hangs on one spring, so
that they are the same on both sides.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from calculix import CCX
from own_blocks import MODEL, block

from squealstudy import read_study
from squealstudy.engine.export import MODEL_FILE, export_model
from squealstudy.laws import contact_law
from squealstudy.linalg.band_roots import BandRoots
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import Brake
from squealstudy.models.components.build import build_assembly
from squealstudy.models.components.geometry import geometry_of
from squealstudy.models.components.inp_writer import number, write_inp
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.linear_interfaces import SpringInterface, StressStiffness
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.full_order.modes import full_order_roots, full_order_system
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.stress_stiffening import sliding_displacement, stress_term
from squealstudy.reduction.working_point import WorkingPoint, working_point
from squealstudy.study.components import read_model

MARGIN = 1.1  # friction falls by so much before the modes: else round-off lets points stick
FAST = 1e12  # m/s: friction does not damp across the sliding direction


@dataclass(frozen=True)
class Case:
    """A brake with linear contact, as both sides solve it.

    Attributes
    ----------
    brake : Brake
    pressure : float
        Pa, on the load of the model file.
    friction : float
        Of the perturbation; while sliding it is MARGIN times that.
    contact_stiffness : float
        Pa/m.
    stick : float
        Slope of friction before it slips in CalculiX, which it keeps across the slip, Pa/m.
    slide : float
        Angle [rad] by which what holds the rotors is turned.
    """

    brake: Brake
    pressure: float
    friction: float
    contact_stiffness: float
    stick: float
    slide: float

    @property
    def assembly(self) -> Assembly:
        """With springs that are there at rest too, and friction's slope across the sliding."""
        law = contact_law("unilateral", stiffness=self.contact_stiffness)
        found = build_assembly(self.brake, law, {})
        springs = tuple(replace(s, in_static=True) for s in found.springs)
        return replace(found, springs=springs)


@dataclass(frozen=True)
class Ours:
    """The working point and the complex modes of the unreduced equations."""

    assembly: Assembly
    point: WorkingPoint
    modes: BandRoots


def own_modes(
    case: Case, band_hz: tuple[float, float], friction: float | None = None, stress: bool = False
) -> Ours:
    """The side of squealstudy: its contact, its working point, its full-order eigenproblem.

    With `stress` that of stresses, too, while it slides with MARGIN times the friction.
    """
    mu = case.friction if friction is None else friction
    assembly = case.assembly
    operating = OperatingPoint(mu, case.pressure, FAST, assembly.contact.law)
    space = contact_space(assembly, case.contact_stiffness, np.zeros((assembly.n_dof, 0)))
    sliding = replace(operating, friction=MARGIN * mu)
    point = working_point(space, sliding)
    contact = assembly.contact
    closed = point.tangent > 0
    across = SpringInterface(
        "stick", contact.T_perp, np.where(closed, case.stick / MARGIN * contact.area, 0.0)
    )
    added: list[SpringInterface | StressStiffness] = [across]
    if stress:
        meshes = {name: body.mesh for name, body in geometry_of(case.brake).bodies.items()}
        u = sliding_displacement(assembly, space, point, sliding)
        added.append(stress_term(assembly, meshes, u))
    held = replace(assembly, springs=(*assembly.springs, *added))
    system = full_order_system(held, {}, point, DesignState(operating), 2 * band_hz[1])
    band = (2 * np.pi * band_hz[0], 2 * np.pi * band_hz[1])
    return Ours(held, point, full_order_roots(system, band))


# -- the deck ------------------------------------------------------------------------------------
def merged(case: Case) -> tuple[SolidMesh, dict[str, int]]:
    """All components as one mesh, surfaces as COMPONENT-NAME; first node of each."""
    bodies = geometry_of(case.brake).bodies
    first, kinds, nodes, surfaces = {}, [], [], {}
    material, orientation, materials, axes = [], [], {}, {}
    n_nodes = n_elements = 0
    for name, body in bodies.items():
        mesh = _turned_back(case, name, body.mesh)
        first[name] = n_nodes
        for own in mesh.blocks:
            labels = 1 + n_elements + np.arange(len(own.labels))
            kinds.append(replace(own, nodes=own.nodes + n_nodes, labels=labels))
            n_elements += len(labels)
        start = n_elements - mesh.n_elements
        for label, faces in mesh.surfaces.items():
            surfaces[f"{name}-{label}"] = np.add(faces, [start, 0])
        material += [f"{name}-{m}" for m in mesh.material]
        orientation += [f"{name}-{o}" if o else "" for o in mesh.orientation]
        materials |= {f"{name}-{k}": v for k, v in mesh.materials.items()}
        axes |= {f"{name}-{k}": v for k, v in mesh.orientations.items()}
        nodes.append(mesh.nodes)
        n_nodes += len(mesh.nodes)
    whole = np.vstack(nodes)
    return (
        SolidMesh(
            origin=Path("brake.inp"),
            nodes=whole,
            numbers=1 + np.arange(len(whole)),
            blocks=tuple(kinds),
            surfaces=surfaces,
            materials=materials,
            material=np.array(material, dtype=object),
            orientations=axes,
            orientation=np.array(orientation, dtype=object),
        ),
        first,
    )


def _turned_back(case: Case, name: str, mesh: SolidMesh) -> SolidMesh:
    """A rotor before it slides: where it has slid it is where the model file has it."""
    rotors = geometry_of(case.brake).rotors
    assert rotors is not None
    if name not in rotors.names:
        return mesh
    arm = np.cross(rotors.direction, mesh.nodes - rotors.point)
    return replace(mesh, nodes=mesh.nodes - case.slide * arm)


def deck(case: Case, n_modes: int) -> tuple[SolidMesh, list[str]]:
    """Mesh and the lines behind it."""
    mesh, first = merged(case)
    assembly = case.assembly
    place = np.concatenate([3 * first[c.name] + c.places for c in assembly.components])
    ground = len(mesh.nodes) + 1  # moves by 1 in x where the rotors' supports turn
    turn = _turned(assembly, place, mesh.nodes)
    extra = [f"{ground}, 0., 0., 0."]
    equations, springs = [], []
    element = mesh.n_elements
    for spring in assembly.springs:
        B = spring.B.tocsr()
        moved = B @ turn
        for row in range(B.shape[0]):
            if not spring.stiffness[row]:
                continue
            span = slice(B.indptr[row], B.indptr[row + 1])
            node = ground + len(extra)
            element += 1
            extra.append(f"{node}, 0., 0., 0.")
            terms = [(node, 1, 1.0)]
            terms += [
                (int(place[j]) // 3 + 1, int(place[j]) % 3 + 1, -b)
                for j, b in zip(B.indices[span], B.data[span], strict=True)
                if b
            ]
            terms += [(ground, 1, moved[row])] if moved[row] else []
            equations += _equation(terms)
            springs += [
                f"*ELEMENT, TYPE=SPRING1, ELSET=SP{element}",
                f"{element}, {node}",
                f"*SPRING, ELSET=SP{element}",
                "1",
                number(float(spring.stiffness[row])),
            ]
    own = range(ground + 1, ground + len(extra))
    held = np.setdiff1d(np.arange(3 * len(mesh.nodes)), place)
    fixed = [f"{i // 3 + 1}, {i % 3 + 1}, {i % 3 + 1}" for i in held]
    fixed += [line for n in own for line in (f"{n}, 2, 3",)] + [f"{ground}, 2, 3"]
    load = case.pressure * assembly.load
    forces = [
        f"{int(p) // 3 + 1}, {int(p) % 3 + 1}, {number(float(f))}"
        for p, f in zip(place, load, strict=True)
        if f
    ]
    static = MARGIN * case.friction
    contact = [
        "*SURFACE INTERACTION, NAME=RUB",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{case.contact_stiffness:.10e}",
        "*FRICTION",
        f"{static:.10f}, {case.stick:.10e}",
    ]
    for table in case.brake.file.contact:
        slave, master = (n.replace(".", "-") for n in (table.slave, table.master))
        contact += [
            "*CONTACT PAIR, INTERACTION=RUB, TYPE=SURFACE TO SURFACE",
            f"{slave}, {master}",
        ]
    steps = [
        "*STEP, NLGEOM, INC=1000",
        "*STATIC",
        "0.2, 1., 1e-6, 0.5",
        "*BOUNDARY",
        f"{ground}, 1, 1, 0.",
        "*CLOAD",
        *forces,
        "*END STEP",
        "*STEP, NLGEOM, INC=1000",
        "*STATIC",
        "0.1, 1., 1e-6, 0.2",
        "*BOUNDARY",
        f"{ground}, 1, 1, {case.slide:.10e}",
        "*END STEP",
        "*STEP, PERTURBATION",
        "*CHANGE FRICTION, INTERACTION=RUB",
        "*FRICTION",
        f"{case.friction:.10f}, {case.stick:.10e}",
        "*FREQUENCY",
        f"{n_modes}",
        "*END STEP",
    ]
    lines = ["*NODE", *extra, *springs, *equations, "*BOUNDARY", *fixed, *contact, *steps]
    return mesh, lines


def _turned(assembly: Assembly, place: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Displacement (n_dof,) of the rotors turned by one radian, 0 of other components."""
    rotors = assembly.rotors
    assert rotors is not None
    turned = np.cross(rotors.direction, nodes - rotors.point).ravel()[place]
    for name, span in assembly.slices.items():
        if name not in rotors.names:
            turned[span] = 0.0
    return turned


def _equation(terms: list[tuple[int, int, float]]) -> Iterator[str]:
    yield "*EQUATION"
    yield f"{len(terms)}"
    words = [f"{n}, {d}, {number(float(b))}" for n, d, b in terms]
    for k in range(0, len(words), 4):
        yield ", ".join(words[k : k + 4])


def judged_modes(folder: Path, case: Case, n_modes: int) -> tuple[np.ndarray, str]:
    """Roots (m,) [rad/s] with Re lam of either sign, as CalculiX tells |Re|; what it printed."""
    folder.mkdir(parents=True, exist_ok=True)
    mesh, lines = deck(case, n_modes)
    write_inp(mesh, folder / "job.inp", lines)
    done = subprocess.run(
        [str(CCX), "job"],
        cwd=folder,
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    rows = [line.split() for line in (folder / "job.dat").read_text().split("\n")]
    told = [r for r in rows if len(r) == 4 and r[0].isdigit()]
    lam = np.array([abs(float(r[3])) + 1j * float(r[1]) for r in told])
    return lam, done.stdout


# -- what is judged ------------------------------------------------------------------------------
COARSE, FINE = ((8, 3, 1), (5, 2, 2)), ((17, 3, 2), (10, 2, 4))  # cells of plate and slider
STEEL_SLIDER = (
    ('LINING.E[3]", default = 2e3', 'STEEL.E", default = 2.1e5'),
    ("normal = 2000.0", "normal = 1600.0"),
    ("tangential = 1000.0", "tangential = 8400.0"),
    ("[2e4, 1.5e4, 1e3]", "[1400, 1400, 140]"),
    ("[1.5, 0.5, 2.0]", "[1.5, 0.5, 1.0]"),
)
STUDY = """
[study]
name = "judged"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 3
[[sweep]]
parameter = "friction"
values = [0.5]
"""


def blocks(folder: Path, cells: tuple[tuple[int, ...], ...], **more: float) -> Case:
    """A slider of steel on a plate whose meshes do not match, which squeals near 28 kHz."""
    folder.mkdir(parents=True, exist_ok=True)
    write_inp(block("plate", cells[0], (8.0, 3.0, 1.0), "STEEL"), folder / "plate.inp")
    write_inp(block("slider", cells[1], (5.0, 2.0, 3.0), "STEEL"), folder / "slider.inp")
    text = MODEL
    for old, new in STEEL_SLIDER:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "blocks.toml").write_text(text, encoding="utf-8")
    numbers = {"pressure": 1e4, "friction": 0.4, "contact_stiffness": 1e12, "stick": 1e11}
    brake = read_model(folder / "blocks.toml").build.brake
    return Case(brake, **({**numbers, "slide": 1e-4} | more))


def whole_brake(folder: Path, **more: float) -> Case:
    """The coarse generated brake, exported, of C3D20 and with clipped contact."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    export_model(read_study(folder / "study.toml").plan().study, folder)
    for path in folder.glob("*.inp"):
        path.write_text(path.read_text().replace("C3D20R", "C3D20"))
    text = (folder / MODEL_FILE).read_text()
    contact, layer, rest = text.partition("[[layer]]")
    contact = contact.replace('quadrature = "gauss"\npoints = 3\n', "")
    assert "gauss" not in contact
    (folder / MODEL_FILE).write_text(contact + layer + rest)
    numbers = {"pressure": 1.2e5, "friction": 0.5, "contact_stiffness": 2e10, "stick": 2e9}
    brake = read_model(folder / MODEL_FILE).build.brake
    return Case(brake, **({**numbers, "slide": 1e-3} | more))


def paired(own: np.ndarray, judge: np.ndarray, top_hz: float) -> np.ndarray:
    """Rows (m, 4): frequency [Hz] and growth [1/s] of ours, then of the judge's nearest mode."""
    rows = []
    for lam in own[(own.imag > 0) & (own.real > -1e-6 * np.abs(own))]:
        if lam.imag <= 2 * np.pi * top_hz:
            near = judge[np.abs(judge - lam).argmin()]
            rows.append([lam.imag, lam.real, near.imag, near.real])
    return np.array(rows) / [2 * np.pi, 1, 2 * np.pi, 1]
