"""*NONSTRUCTURAL MASS: mass of an element set that is no material's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from component_meshes import LINING, STEEL, box

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import _in_si as in_si
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_matrices import mass_matrix
from squealstudy.models.components.sectors import Repetition, repeated

FIRST = box("C3D8", (2, 1, 1), (3.0, 2.0, 2.5), uneven=0.0)  # 7.5 mm3 each
VOLUME = 7.5


def read(folder, *lines, materials=("S", "S")):
    of = np.array(materials, dtype=object)
    both = {"S": STEEL, "L": LINING}
    mesh = replace(
        FIRST,
        materials={name: both[name] for name in set(materials)},
        material=of,
        element_sets={"ONE": np.array([0]), "BOTH": np.arange(2)},
    )
    write_inp(mesh, folder / "a.inp", lines)
    return read_inp(folder / "a.inp")


def mass_of(mesh, rule="full"):
    shift = np.tile([1.0, 0.0, 0.0], len(mesh.nodes))
    return shift @ mass_matrix(mesh, rule) @ shift


STEEL_MASS = 2 * VOLUME * 7.8e-9
CARD = "*NONSTRUCTURAL MASS, ELSET={}, UNITS={}"


@pytest.mark.parametrize("rule", ["full", "lumped", "as_stiffness"])
@pytest.mark.parametrize(
    ("card", "value", "added"),
    [
        (CARD.format("ONE", "TOTAL MASS"), "3e-8", 3e-8),
        (CARD.format("BOTH", "total mass"), "3e-8", 3e-8),
        (CARD.format("ONE", "MASS PER VOLUME"), "2e-9", 2e-9 * VOLUME),
        (CARD.format("BOTH", "TOTAL MASS") + ", DISTRIBUTION=VOLUME PROPORTIONAL", "1e-8", 1e-8),
    ],
)
def test_mass_is_added(tmp_path, card, value, added, rule):
    mesh = read(tmp_path, card, value)
    assert mass_of(mesh, rule) == pytest.approx(STEEL_MASS + added, rel=1e-12)
    assert mass_of(in_si(mesh, "t-mm-s"), rule) == pytest.approx(1e3 * (STEEL_MASS + added))


def test_it_is_where_its_elements_are(tmp_path):
    mesh = read(tmp_path, CARD.format("ONE", "TOTAL MASS"), "3e-8")
    there, beside = mesh.part(np.array([0])), mesh.part(np.array([1]))
    assert mass_of(there) == pytest.approx(STEEL_MASS / 2 + 3e-8)
    assert mass_of(beside) == pytest.approx(STEEL_MASS / 2)
    with pytest.raises(ModelError, match="mass in addition to that of materials cannot be written"):
        write_inp(mesh, tmp_path / "b.inp")
    middle = np.array([0.0, 0.5 * mesh.nodes[:, 1].max(), 0.0])  # of the side that meets itself
    two = repeated(mesh, Repetition(middle, np.array([0.0, 0.0, 1.0]), 2))
    assert mass_of(two) == pytest.approx(2 * (STEEL_MASS + 3e-8))


@pytest.mark.parametrize(
    ("card", "value", "materials", "message"),
    [
        (CARD.format("ONE", "MASS PER AREA"), "1.", "SS", "UNITS=MASSPERAREA is not supported"),
        (CARD.format("ONE", "TOTAL MASS"), "-1.", "SS", "expected a mass of zero or above"),
        (CARD.format("ONE", "TOTAL MASS"), "1., 2.", "SS", "expected 1 numbers"),
        (CARD.format("TWO", "TOTAL MASS"), "1.", "SS", "there is no element set 'TWO'"),
        (CARD.format("BOTH", "TOTAL MASS"), "1.", "SL", "to that of several materials"),
        ("*NONSTRUCTURAL MASS, ELSET=ONE", "1.", "SS", "needs UNITS="),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, card, value, materials, message):
    with pytest.raises(ModelError, match=rf"a\.inp, line \d+: .*{message}"):
        read(tmp_path, card, value, materials=tuple(materials))
