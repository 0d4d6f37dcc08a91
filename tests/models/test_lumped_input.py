"""Bad input of files of lumped models, with own matrices too: one sentence each."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse as sp
from study_runs import command
from test_lumped import BELT, ROCKER, changed, model_of
from test_report import quickly

import squealstudy as sq
from squealstudy.engine.validity import open_reason
from squealstudy.errors import ModelError, StudyFileError
from squealstudy.study.lumped import read_lumped
from squealstudy.tables.validity import pulling_contact, untouched_contact

BAND = (1.0, 20000.0)

OWN = """\
coordinates = ["pad_x", "pad_y", "disc_y"]
[[term]]
matrix = "M"
file = "m.mtx"
[[term]]
matrix = "K"
file = "k.mtx"
coefficient = "factor"
[[contact]]
normal = ["pad_y", "disc_y"]
sliding = "-pad_x"
stiffness = 1e6
[[load]]
along = "-pad_y"
force = 100
[[spring]]
along = {pad_x = 1, pad_y = 0.5}
stiffness = 1e4
cubic = 1e9
[parameters]
factor = 1.0
"""
BAD = [
    ('["pad_y", "disc_y"]\ns', '["pad_y", "disk_y"]\ns', "contact[1].normal",
     "no coordinate 'disk_y', expected a number from 1 to 3, or one of pad_x, pad_y, disc_y"),
    ('normal = ["pad_y", "disc_y"]\n', "", "contact[1].normal", "'normal' is missing"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = 4\n", "contact[1].normal", "no coordinate '4'"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = 0\n", "contact[1].normal", "no coordinate '0'"),
    ('normal = ["pad_y", "disc_y"]\n', 'normal = "pad_x"\n', "contact[1].sliding",
     "another motion than that of its normal"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = {}\n", "contact[1].normal", "got none"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = 2.3\n", "contact[1].normal",
     "expected a coordinate"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = [1, 2, 3]\n", "contact[1].normal",
     "one coordinate or two, got 3"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = [2, -2]\n", "contact[1].normal", "'2' twice"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = {pad_y = 0.0}\n", "contact[1].normal",
     "all zero"),
    ('normal = ["pad_y", "disc_y"]\n', "normal = {pad_y = inf}\n", "contact[1].normal",
     "finite number"),
    ('normal = ["pad_y", "disc_y"]\n', 'normal = {pad_y = "q"}\n', "contact[1].normal.pad_y",
     "no parameter 'q'"),
    ('sliding = "-pad_x"\n', "", "contact[1]", "'sliding' is missing"),
    ('along = "-pad_y"\n', 'along = "-hub"\n', "load[1].along", "no coordinate 'hub'"),
    ('along = "-pad_y"\nforce', 'along = "disc_z"\nforce', "load[1].along",
     "no coordinate 'disc_z'"),
    ('along = "-pad_y"\n', "", "load[1].along", "'along' is missing"),
    ('"pad_y", "disc_y"]\n[', '"pad_y"]\n[', "coordinates", "expected 3 names"),
    ('"pad_y", "disc_y"]\n[', '"pad_y", "pad_y"]\n[', "coordinates[3]", "row 2 already"),
    ('"pad_y", "disc_y"]\n[', '"pad_y", "3"]\n[', "coordinates[3]", "no number"),
    ('file = "k.mtx"', 'file = "skew.mtx"', "term[2].file",
     "without friction, which [[contact]] adds"),
    ('file = "k.mtx"', 'file = "big.mtx"', "term[2].file", "4 x 4, the first term's 3 x 3"),
    ('file = "k.mtx"', 'file = "wide.mtx"', "term[2].file", "square"),
    ('file = "k.mtx"', 'file = "nan.mtx"', "term[2].file", "nan"),
    ('file = "k.mtx"', 'file = "none.mtx"', "term[2].file", "there is no file"),
    ('file = "k.mtx"', 'file = "negative.mtx"', "term[2]",
     "K has a negative eigenvalue at factor = 1"),
    ('file = "m.mtx"', 'file = "massless.mtx"', "term[1]", "0 on its diagonal in row 2"),
    ('file = "m.mtx"', 'file = "negative.mtx"', "term[1]", "M is not positive definite"),
    ('matrix = "K"', 'matrix = "C"', "term", 'matrix = "K", the stiffness: there is none'),
    ('matrix = "K"', 'matrix = "B"', "term[2].matrix", "'M', 'C', 'K' or 'G'"),
    ("[[contact]]", '[[term]]\nmatrix = "G"\nfile = "k.mtx"\n[[contact]]', "term[3].file",
     "not skew-symmetric"),
    ("factor = 1.0", "factor = -1.0", "term[2]", "K has a negative eigenvalue at factor = -1"),
    ('file = "k.mtx"', 'file = "zero.mtx"', "term[2]", "nothing holds"),
    ("[[contact]]", '[[mass]]\nname = "a"\nmass = 1.0\n[[contact]]', "term", "not both"),
    ("[[contact]]", '[[term]]\nmatrix = "C"\nfile = "skew.mtx"\n[[contact]]', "term[3].file",
     "gyroscopic terms have matrix"),
]  # fmt: skip


def write_matrices(folder):
    """Of one that serves, and of those that do not."""
    K = np.array([[3e6, -1e6, 0], [-1e6, 2e6, 0], [0, 0, 1e6]])
    skew = K + np.array([[0, 1e5, 0], [0, 0, 0], [0, 0, 0]])
    negative = np.array([[1.0, 2, 0], [2, 1, 0], [0, 0, 1]])
    matrices = {
        "m": np.diag([1.0, 2, 3]), "k": K, "skew": skew, "big": np.eye(4), "wide": np.ones((2, 3)),
        "negative": negative, "massless": np.diag([1.0, 0, 1]), "zero": np.zeros((3, 3)),
    }  # fmt: skip
    for name, A in matrices.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", sp.coo_matrix(A))
    text = (folder / "k.mtx").read_text().rstrip()
    (folder / "nan.mtx").write_text(text.rpartition(" ")[0] + " nan\n")


@pytest.mark.parametrize(("old", "new", "key", "words"), BAD)
def test_bad_input_is_one_sentence(old, new, key, words, tmp_path):
    """With file, line and key, and what was expected."""
    write_matrices(tmp_path)
    path = tmp_path / "own.toml"
    path.write_text(OWN)
    read_lumped(path)
    assert OWN.count(old) == 1, old
    path.write_text(OWN.replace(old, new))
    with pytest.raises(StudyFileError) as told:
        read_lumped(path)
    assert words in str(told.value)
    assert key in told.value.key or key in str(told.value)
    assert str(path) in str(told.value)
    assert "\n" not in str(told.value)


def test_loads_come_to_contact_and_coefficients_stay_in_bounds(tmp_path):
    """A load on what nothing joins to a contact; a factor below zero is its own point."""
    write_matrices(tmp_path)
    path = tmp_path / "own.toml"
    path.write_text(OWN.replace('["pad_y", "disc_y"]\nsl', '"disc_y"\nsl'))
    with pytest.raises(StudyFileError, match="no contact is pressed: no stiffness joins"):
        read_lumped(path)
    path.write_text(OWN)
    model = sq.model(str(path))
    batch = model.at(factor=np.array([1.0, -0.5, 2.0])).modes(BAND)
    assert list(batch.status)[0::2] == ["ok", "ok"]
    assert "K has a negative eigenvalue at factor = -0.5" in batch.message[1]
    with pytest.raises(ModelError, match=r"own.toml, term\[2\]"):
        model.at(factor=-0.5).assembly  # noqa: B018


def test_a_model_of_matrices_tells_where_contact_goes(tmp_path):
    """[[model.contact]] of a study, and runs in time of one without contact."""
    write_matrices(tmp_path)
    study = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "matrices"\n'
    study += '[[model.term]]\nmatrix = "M"\nfile = "m.mtx"\n'
    study += '[[model.term]]\nmatrix = "K"\nfile = "k.mtx"\n[modes]\nband = [1.0, 1000.0]\n'
    path = tmp_path / "study.toml"
    for text in (
        study + "[[model.contact]]\nnormal = 1\n",
        study.replace("complex_modes", "transient"),
    ):
        path.write_text(text)
        with pytest.raises(
            StudyFileError, match=r"a file with \[\[term\]\], named by \[model\] file"
        ):
            sq.read_study(path)


NOT_NUMBERS = ["inf", "-inf", "nan", "1e400", "1e60", "true"]
PLACES = [
    (BELT, 'mass = "m"', "mass = {}", "mass[1].mass"),
    (BELT, 'stiffness = "contact_stiffness"', "stiffness = {}", "contact[1].stiffness"),
    (BELT, 'force = "normal_force"', "force = {}", "load[1].force"),
    (BELT, 'direction = "-y"', "direction = [0, {}]", "load[1].direction"),
    (BELT, "friction = 0.5", "friction = {}", "parameters.friction"),
    (BELT, "m = { default = 1.0", "m = { default = {}", "parameters.m.default"),
    (BELT, 'sliding = "-x"', 'sliding = "-x"\ngap = {}', "contact[1].gap"),
    (ROCKER, "at = [0.02, -0.01", "at = [0.02, {}", "contact[2].at[2]"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "key"), PLACES)
def test_what_is_no_number_is_told_with_its_key(text, old, new, key, tmp_path):
    """Not finite, absurdly large, of another type: one sentence each."""
    path = tmp_path / "bad.toml"
    for written in NOT_NUMBERS:
        path.write_text(changed(text, old, new.replace("{}", written)))
        with pytest.raises(StudyFileError) as told:
            read_lumped(path)
        message = str(told.value)
        assert f"key '{key}': expected a" in message, message
        assert ("finite number" in message or "at most 1e+50" in message) or written == "true"
        assert "\n" not in message


def test_expressions_beyond_all_bounds(tmp_path):
    """Of the file at its defaults, and of one design point of a batch."""
    path = tmp_path / "bad.toml"
    path.write_text(changed(BELT, 'mass = "m"', 'mass = "m * 1e60"'))
    with pytest.raises(StudyFileError, match=r"at most 1e\+50, got 1e\+60 of 'm \* 1e60'"):
        read_lumped(path)
    model = model_of(tmp_path, changed(BELT, 'mass = "m"', 'mass = "m**20"'))
    batch = model.at(m=np.array([1.0, 1e4, 1.1])).modes((1.0, 5000.0))
    assert list(batch.status)[0::2] == ["ok", "ok"]
    assert "mass[1].mass" in batch.message[1]
    assert "got 1e+80 of 'm**20' at m = 10000" in batch.message[1]


def test_rows_of_nastran_are_named_by_node_and_direction(tmp_path):
    """Contact between freedoms of DMIG cards, that of a matrix without them by number."""
    for letter, diagonal in (("M", (1.0, 2.0, 3.0)), ("K", (4e6, 5e6, 6e6))):
        places = ((12, 1), (12, 3), (40, 3))
        cards = [f"DMIG,{letter}AA,0,6,1,0"]
        cards += [
            f"DMIG,{letter}AA,{n},{c},,{n},{c},{x}"
            for (n, c), x in zip(places, diagonal, strict=True)
        ]
        (tmp_path / f"{letter}.bdf").write_text("\n".join(cards) + "\n")
    scipy.io.mmwrite(tmp_path / "C.mtx", sp.coo_matrix(np.diag([10.0, 20.0, 30.0])))
    text = "".join(
        f'[[term]]\nmatrix = "{x}"\nfile = "{x}.{end}"\n'
        for x, end in (("M", "bdf"), ("K", "bdf"), ("C", "mtx"))
    )
    text += '[[contact]]\nnormal = ["12.3", "40.3"]\nsliding = "-12.1"\nstiffness = 1e6\n'
    text += '[[load]]\nalong = "-12.3"\nforce = 10\n'
    (tmp_path / "own.toml").write_text(text)
    a = sq.model(str(tmp_path / "own.toml")).at().assembly
    assert a.contact.N.toarray().tolist() == [[0.0, 1.0, -1.0]]
    assert a.contact.T.toarray().tolist() == [[1.0, 0.0, 0.0]]
    assert a.M.diagonal().tolist() == [1.0, 2.0, 3.0]
    assert a.C.diagonal().tolist() == [10.0, 20.0, 30.0]
    (tmp_path / "own.toml").write_text(text.replace('"-12.3"', '"-12.2"'))
    with pytest.raises(StudyFileError, match=r"from 1 to 3, or one of 12\.1, 12\.3"):
        read_lumped(tmp_path / "own.toml")


def test_matrices_that_are_too_large_or_not_there(tmp_path):
    """More coordinates than are solved in full, and a variable that the file does not have."""
    write_matrices(tmp_path)
    path = tmp_path / "own.toml"
    scipy.io.mmwrite(tmp_path / "many.mtx", sp.eye_array(501).tocoo())
    path.write_text(OWN.replace("m.mtx", "many.mtx").replace("k.mtx", "many.mtx"))
    with pytest.raises(StudyFileError, match="it has 501 coordinates, expected at most 500"):
        read_lumped(path)
    np.savez(tmp_path / "two.npz", A=np.eye(3), B=np.eye(3))
    path.write_text(OWN.replace('file = "k.mtx"', 'file = "two.npz"\nvariable = "K"'))
    with pytest.raises(StudyFileError, match=r"key 'term\[2\].variable': .*A, B"):
        read_lumped(path)


LIFTED = """\
[[mass]]
name = "pad"
mass = 1.0
directions = ["x", "y"]
[[spring]]
between = ["pad", "ground"]
direction = "x"
stiffness = 1e6
[[spring]]
between = ["pad", "ground"]
direction = "y"
stiffness = 2e6
[[contact]]
between = ["pad", "disc"]
normal = "y"
sliding = "-x"
stiffness = 1e6
[[load]]
on = "pad"
direction = "y"
force = 100
"""


def test_a_contact_that_nothing_presses_is_said_first(tmp_path, capsys):
    """Its load pulls away: modes of free parts have neither friction nor a verdict of it."""
    (tmp_path / "rocker.toml").write_text(LIFTED)
    study = '[study]\nname = "lifted"\nkind = "complex_modes"\n[model]\nfile = "rocker.toml"\n'
    study += 'contact_law = "unilateral"\n[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.3]\n'
    (tmp_path / "study.toml").write_text(study + "[modes]\nband = [1.0, 20000.0]\n")
    assert command("run", str(tmp_path / "study.toml"), "-o", str(tmp_path / "out"), "-j", "1") == 0
    text = "In steady sliding the contact touches nowhere at any of 2 design points"
    assert " ".join(capsys.readouterr().out.split()).startswith(text)
    page = quickly(sq.open_results(tmp_path / "out"))
    assert text in page


@pytest.mark.parametrize(
    "kind", ["complex_modes", pytest.param("transient", marks=pytest.mark.full_size)]
)
def test_a_bilateral_contact_over_a_gap_is_said_first(kind, tmp_path, capsys):
    """Pressed by 100 N on 2e6 N/m it comes 50 um down: over a gap of 1 mm springs pull it."""
    pressed = LIFTED.replace('direction = "y"\nforce', 'direction = "-y"\nforce')
    (tmp_path / "rocker.toml").write_text(pressed.replace('"-x"\n', '"-x"\ngap = 1e-3\n'))
    study = f'[study]\nname = "gap"\nkind = "{kind}"\n[model]\nfile = "rocker.toml"\n'
    study += '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.3]\n'
    study += "[modes]\nband = [1.0, 20000.0]\n"
    if kind == "transient":
        study += "[transient]\nduration = 0.01\nstep = 1e-5\nperturbation = 1e-6\n"
    (tmp_path / "study.toml").write_text(study)
    run = ("run", str(tmp_path / "study.toml"), "-o", str(tmp_path / "out"), "-j", "1")
    assert command(*run, "--no-pictures") == 0
    text = "In steady sliding the contact pulls at all 2 design points"
    assert " ".join(capsys.readouterr().out.split()).startswith(text)
    assert text in quickly(sq.open_results(tmp_path / "out"))


@pytest.mark.parametrize(
    ("reason", "kind", "pulls"),
    [
        (open_reason("bilateral", 0.2), {}, True),
        (open_reason("unilateral", 0.2), {}, False),
        (open_reason("bilateral", 0.2), {"class": ["limit_cycle"]}, False),  # of its motion
    ],
)
def test_a_motion_that_pulls_is_told_under_validity_alone(reason, kind, pulls):
    points = pd.DataFrame({"valid": [not reason], "invalid_reason": [reason], **kind})
    assert bool(pulling_contact(points)) == pulls
    named = pulling_contact(points, ["left", "right"])
    assert ("a contact pulls at the design point (left, right), where" in named) == pulls


def test_the_contact_that_pulls_is_named_among_several(tmp_path, capsys):
    """Both are pressed by 100 N together; the one with a gap of 1 mm is pulled shut."""
    pressed = LIFTED.replace('direction = "y"\nforce', 'direction = "-y"\nforce')
    near = '[[contact]]\nname = "near"'
    far = near.replace("near", "far") + pressed.split("[[contact]]")[1].split("[[load]]")[0]
    model = pressed.replace("[[contact]]", near).replace("[[load]]", f"{far}gap = 1e-3\n[[load]]")
    (tmp_path / "rocker.toml").write_text(model)
    study = '[study]\nname = "gap"\nkind = "complex_modes"\n[model]\nfile = "rocker.toml"\n'
    study += '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.3]\n'
    (tmp_path / "study.toml").write_text(study + "[modes]\nband = [1.0, 20000.0]\n")
    run = ("run", str(tmp_path / "study.toml"), "-o", str(tmp_path / "out"), "-j", "1")
    assert command(*run, "--no-pictures") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith("In steady sliding a contact pulls at all 2 design points (")
    assert "far at the first of them), where a real one is open" in said


@pytest.mark.parametrize(
    ("share", "untouched"), [(1.0, 1), (1.0 - 1e-12, 1), (0.9997, 0), (0.6, 0)]
)
def test_a_contact_that_one_facet_closes_touches_somewhere(share, untouched):
    reasons = [open_reason("unilateral", share)]
    points = pd.DataFrame({"valid": [False], "invalid_reason": reasons})
    assert bool(untouched_contact(points)) == untouched
