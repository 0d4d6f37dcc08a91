"""What `squealstudy inspect` says of a model file, and of ten that are broken."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from own_blocks import block, write_blocks
from study_runs import command
from test_model_file import SLIDER_OF_MATRICES, write_slider_matrices

from squealstudy.models.components.inp_writer import write_inp
from squealstudy.study.components import free_component, read_model

PARTS = {"plate": ((4, 2, 1), (80.0, 30.0, 20.0), "STEEL"),
         "slider": ((3, 1, 2), (50.0, 20.0, 20.0), "LINING")}  # fmt: skip
# ten times as large: a part of a brake weighs more than some grams
LARGER = (
    ("[4.0, -100.0, 0.0]", "[40.0, -100.0, 0.0]"),
    ("[1.5, 0.5, 2.0]", "[15.0, 5.0, 20.0]"),
)


def mesh(name):
    return block(name, *PARTS[name])


def model(folder: Path, *changes: tuple[str, str]) -> Path:
    """The model file of two blocks of the size of a pad."""
    write_blocks(folder, *LARGER, *changes)
    for name in PARTS:
        write_inp(mesh(name), folder / f"{name}.inp")
    return folder / "blocks.toml"


def said(capsys, path: Path, *more: str) -> tuple[int, str, str]:
    """Exit code, facts, and messages, each on one line."""
    code = command("inspect", str(path), *more)
    out, err = capsys.readouterr()
    return code, " ".join(out.split()), " ".join(err.split())


def test_a_picture_is_what_its_suffix_says(tmp_path, capsys):
    drawn, refused = tmp_path / "blocks.svg", tmp_path / "blocks.pdf"
    assert said(capsys, model(tmp_path), "--picture", str(drawn))[0] == 0
    assert b"<svg" in drawn.read_bytes()
    code, _, message = said(capsys, model(tmp_path), "--picture", str(refused))
    assert code == 2
    assert "a picture is .png or .svg" in message
    assert not refused.exists()


def test_what_was_read(tmp_path, capsys):
    picture = tmp_path / "blocks.png"
    code, facts, messages = said(capsys, model(tmp_path), "--picture", str(picture))
    assert (code, messages) == (0, "")
    assert "plate.inp: 89 nodes, 8 C3D20; materials STEEL" in facts
    assert "80 x 30 x 20 mm, 0.0003744 t (0.3744 kg), inertia 0.0406, 0.212, 0.228 t mm2" in facts
    assert facts.count("6 rigid modes, first free modes") == 2
    assert "from [0, 0, 0] to [50, 20, 20] mm; moved from [15, 5, 20] to [65, 25, 40] mm" in facts
    assert "every component, by contact, springs, layers " in facts
    assert "sliding: slider.BOTTOM on plate.TOP, 27 points, 1000 mm2, 100.0 % of the slave" in facts
    assert "normal of the slave [0, 0, -1]; gap" in facts
    assert "plate turns about [0, 0, 1] through [40, -100, 0]" in facts
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "pressure pushes slider.TOP along [0, 0, -1]; no reaction" in facts
    assert "lining.E3 2e+09 Pa slider.materials.LINING.E[3]" in facts
    assert "477 degrees of freedom, 27 contact points; a reduction needs about 0.4 GB" in facts
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_springs_layers_and_friction_of_a_contact_are_told(tmp_path, capsys):
    """In SI, with the values that parameters give them: 2000 N/mm3 is 2e12 N/m3."""
    changes = (
        ("search = 0.1", "search = 0.1\nfriction_factor = 0.8"),
        ("tangential = 1000.0", "tangential = 1000.0\nin_static = false"),
        ('"guides.x" = {path = "spring.guides.stiffness[1]"}',
         '"guides.x" = {path = "spring.guides.stiffness[1]", default = 3e4}'),
    )  # fmt: skip
    code, facts, messages = said(capsys, model(tmp_path, *changes))
    assert code in (0, 1), messages
    assert "100.0 % of the slave, friction_factor 0.8" in facts
    assert "bed layer: plate.BOTTOM to ground, normal 2e+12, in plane 1e+12 N/m3; in v" in facts
    assert "guides spring: slider.ENDS to ground, x 3e+07, y 1.5e+07, z 1e+06 N/m" in facts


def test_springs_of_an_unfinished_model_are_told(tmp_path, capsys):
    text = '[[load]]\npressure_on = "slider.TOP"\narea = 10.0\n'
    _, facts, _ = said(capsys, model(tmp_path, (text, "")))
    assert "not yet load" in facts
    assert "guides spring: slider.ENDS to ground, x 2e+07, y 1.5e+07, z 1e+06 N/m" in facts


def test_a_model_of_the_catalogue_is_told_to_be_one(capsys):
    assert command("inspect", "disc_brake") == 2
    assert "squealstudy models disc_brake tells" in " ".join(capsys.readouterr().err.split())


def test_what_is_fixed_is_told(tmp_path, capsys):
    path = model(tmp_path)
    path.write_text(path.read_text() + '[[fixed]]\nset = "slider.ENDS"\ndofs = [1, 2]\n')
    _, facts, _ = said(capsys, path)
    assert "every component, by contact, springs, layers, fixed slider.ENDS (1, 2) " in facts


def test_the_first_free_modes_are_those_of_the_component(tmp_path, capsys):
    """A beam of steel, 80 x 30 x 20 mm: bending at about 16 kHz (Timoshenko)."""
    _, facts, _ = said(capsys, model(tmp_path))
    first = float(facts.split("first free modes ")[1].split(",")[0])
    E, rho, length, height = 2.1e11, 7800.0, 0.08, 0.02
    slender = 22.37 / (2 * np.pi * length**2) * np.sqrt(E * height**2 / (12 * rho))
    assert 0.75 * slender < first < slender


def test_numbers_are_those_of_the_parameters_defaults(tmp_path, capsys):
    """Not those written in the file: free modes, masses, damping and gaps of a study."""
    text = (
        '[[point_mass]]\nname = "m"\non = "slider.TOP"\nmass = 1e-3\n\n[parameters]\n'
        '"pm" = {path = "point_mass.m.mass", default = 0.5, unit = "kg"}\n'
        '"beta" = {path = "slider.stiffness_damping", default = "3 us"}\n'
        '"gap" = {path = "contact.contact_1.initial_gap", default = "20 um"}'
    )
    changes = (
        ("[parameters]", text),
        ("default = 2e3", "default = 8e3"),
        ("search = 0.1", "search = 0.1\ninitial_gap = 0.0"),
    )
    path = model(tmp_path, *changes)
    code, facts, _ = said(capsys, path)
    assert code == 0
    assert "mass m: 0.0005 t, spread over slider.TOP" in facts
    assert "0.00055 t (0.55 kg)" in facts
    assert "damping: stiffness_damping 3e-06 s" in facts
    assert "taken as 0.02 mm" in facts
    _, (K, M), _ = free_component(read_model(path), "slider")
    omega = np.sqrt(np.maximum(la.eigh(K.toarray(), M.toarray(), eigvals_only=True), 0.0))
    first = ", ".join(f"{w / (2 * np.pi):.1f}" for w in omega[6:9])
    assert f"first free modes {first} Hz" in facts


def other_units(folder):
    return model(folder, ('"t-mm-s"', '"SI"'), (', unit = "MPa"', "")), (
        "plate weighs 0.000374 kg and is 8e+04 mm long", "are its numbers in SI?")  # fmt: skip


def placed_wrongly(folder):
    return model(folder, ("[15.0, 5.0, 20.0]", "[15.0, 5.0, 32.0]")), (
        "line 15, key 'contact[1]'", "nothing lies within", "placed wrongly")  # fmt: skip


def normals(folder):
    return model(folder, ('"plate.TOP"', '"plate.BOTTOM"'), ("search = 0.1", "search = 30.0")), (
        "key 'contact[1]'", "point the same way")  # fmt: skip


def missing_set(folder):
    return model(folder, ('"plate.TOP"', '"plate.TIP"')), (
        "key 'contact[1].master'", "plate (plate.inp) has no surface or node set 'TIP'",
        "did you mean 'TOP'?")  # fmt: skip


def wrong_map(folder):
    """A map in the order of the mesh for matrices in another."""
    path = model(folder, ('mesh = "slider.inp"', SLIDER_OF_MATRICES))
    lines = write_slider_matrices(folder, 10.0)
    (folder / "slider.dof").write_text("\n".join(sorted(lines)))
    return path, ("slider: ", "of six, for motions", "are its rows those of other nodes?")


def unsupported(folder):
    path = model(folder)
    text = (folder / "plate.inp").read_text().replace("TYPE=C3D20", "TYPE=C3D20H")
    (folder / "plate.inp").write_text(text)
    return path, ("key 'components.plate.mesh'", "plate.inp, line ", "C3D20H")


def nothing_holds(folder):
    """Without its guides the slider can turn and slide."""
    path = model(folder, ("stiffness = [2e4, 1.5e4, 1e3]", "stiffness = [0, 1.5e4, 1e3]"))
    return path, ("1 motion of components that nothing holds, of slider along x",)


def doubled(folder):
    """The plate as two halves that only touch."""
    path, whole = model(folder), mesh("plate")
    half = np.flatnonzero(whole.nodes[whole.blocks[0].nodes].mean(axis=1)[:, 0] > 40.0)
    nodes = whole.blocks[0].nodes.copy()
    moved = np.unique(nodes[half])
    shared = np.intersect1d(moved, np.delete(nodes, half, axis=0))
    place = {int(n): len(whole.nodes) + i for i, n in enumerate(shared)}
    nodes[half] = np.vectorize(lambda n: place.get(int(n), n))(nodes[half])
    numbers = np.append(whole.numbers, whole.numbers.max() + 1 + np.arange(len(shared)))
    cut = replace(
        whole,
        nodes=np.vstack([whole.nodes, whole.nodes[shared]]),
        numbers=numbers,
        blocks=(replace(whole.blocks[0], nodes=nodes),),
    )
    write_inp(cut, folder / "plate.inp")
    return path, ("key 'components.plate.mesh'", "lie at one place", "merge the nodes")


def negative(folder):
    path, whole = model(folder), mesh("plate")
    nodes = whole.blocks[0].nodes.copy()
    nodes[3] = nodes[3][[6, 1, 2, 3, 4, 5, 0, *range(7, 20)]]
    write_inp(replace(whole, blocks=(replace(whole.blocks[0], nodes=nodes),)), folder / "plate.inp")
    return path, ("key 'components.plate.mesh'", "element 104: a negative Jacobian")


def empty_contact(folder):
    return model(folder, ('"slider.BOTTOM"', '"slider.CORNER"')), (
        "key 'contact[1].slave'", "no facet of the boundary")  # fmt: skip


def cancelling_load(folder):
    return model(folder, ('pressure_on = "slider.TOP"', 'pressure_on = "slider.ENDS"')), (
        "brake: the forces of the pressure on slider.ENDS cancel",)  # fmt: skip


BROKEN = [cancelling_load, other_units, placed_wrongly, normals, missing_set, wrong_map,
          unsupported, nothing_holds, doubled, negative, empty_contact]  # fmt: skip


@pytest.mark.parametrize("broken", BROKEN, ids=lambda f: f.__name__)
def test_a_broken_model_gets_a_message_that_says_what_to_change(broken, tmp_path, capsys):
    path, parts = broken(tmp_path)
    code, _, messages = said(capsys, path)
    assert code != 0
    for part in parts:
        assert part in messages


@pytest.mark.parametrize(
    ("change", "doubt"),
    [
        (
            ("search = 0.1", "search = 0.1\ninitial_gap = 0.02"),
            r"contact_1 is open without pressure, by [\d.]+ lengths of the law or more",
        ),
        (
            ('pressure_on = "slider.TOP"', 'pressure_on = "slider.BOTTOM"'),
            "contact_1: the pressure pulls slider.BOTTOM and plate.TOP apart, with 100 % of",
        ),
    ],
)
def test_a_contact_that_the_pressure_may_not_close(change, doubt, tmp_path, capsys):
    code, _, err = said(capsys, model(tmp_path, change))
    assert code == 1
    assert re.search(doubt, err)
    _, _, err = said(capsys, model(tmp_path / "right"))
    assert not re.search("is open|apart", err)


def test_a_support_left_in_the_matrix(tmp_path, capsys):
    """A spring to ground in K: motions along x strain it."""
    path = model(tmp_path, ('mesh = "slider.inp"', SLIDER_OF_MATRICES))
    write_slider_matrices(tmp_path, 10.0)
    K = sp.load_npz(tmp_path / "K.npz").tolil()
    lines = (tmp_path / "slider.dof").read_text().split()
    row = next(i for i, text in enumerate(lines) if text.endswith(".1"))
    K[row, row] += 1e4
    sp.save_npz(tmp_path / "K.npz", K.tocsr())
    code, _, messages = said(capsys, path)
    assert code == 1
    assert "slider: 5 rigid modes of six" in messages
    assert "is a support still in the matrix" in messages


STUDY = """[study]
name = "blocks"
kind = "complex_modes"
[model]
file = "blocks.toml"
[[sweep]]
parameter = "friction"
values = [0.2, 0.4]
"""


@pytest.mark.parametrize(
    ("change", "code", "told"),
    [
        (("stiffness = [2e4,", "stiffness = [0,"), 0, "nothing holds, of slider along x"),
        (("slider.BOTTOM", "slider.BELOW"), 2, "key 'contact[1].slave': slider (slider.inp) has"),
    ],
)
def test_check_looks_at_the_model_file_before_a_reduction(
    change, code, told, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "empty"))
    path = model(tmp_path, change)
    study = path.with_name("study.toml")
    study.write_text(STUDY)
    assert command("check", str(study)) == code
    out, err = capsys.readouterr()
    assert told in " ".join(err.split())
    assert ("pressure = 1.2 MPa, sliding_speed = 0.5 m/s" in " ".join(out.split())) == (code == 0)
