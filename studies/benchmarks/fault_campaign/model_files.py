"""Model files and what they read, mutated: one message that names the file, or a brake of numbers.

Models of two parts: meshes of CalculiX, gmsh and Nastran, matrices of four programs, superelements.
What must not matter, such as the ends of lines, must give the same matrices.
"""

from __future__ import annotations

import functools
import io
import random
import re
import shutil
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fault_campaign import matrix_files, study_files
from fault_campaign.copies import Judged, in_a_copy
from fault_campaign.finding import Finding
from same_tables import ROOT

import squealstudy as sq
from squealstudy.errors import SquealstudyError
from squealstudy.models.assembly import Assembly
from squealstudy.study.components import inspected, read_model

PART = "model files"
PATIENCE_S, MEMORY = 60, 6 << 30
MODEL, STUDY = "blocks.toml", "study.toml"
SOLVED = 4  # of what is read one in so many is solved too
EVERY = 50  # cases one is given to the real command as well
OF_MODEL_FILE = 0.2  # of the cases; the others are of a file that it names
NO_NUMBERS = ("nan", "inf", "-Infinity", "0x10", "1_000", "1.5abc", "１", "true", "None", "1;2")
NUMBER = re.compile(r"[-+]?\d+\.?\d*([eEdD][-+]?\d+)?")
PADS = """\
units = "t-mm-s"
rotation.axis = [0, 0, 1]
[components.lower]
mesh = "pad_tet10.msh"
materials.BACK = {E = 2.1e5, nu = 0.3, rho = 7.8e-9}
materials.LINING = {E = 8e3, nu = 0.3, rho = 2.5e-9}
[components.upper]
mesh = "pad_hex20.msh"
translate = [0, 0, 13.0]
materials.BACK = {E = 2.1e5, nu = 0.3, rho = 7.8e-9}
materials.LINING = {E = 8e3, nu = 0.3, rho = 2.5e-9}
[[contact]]
kind = "sliding"
slave = "lower.FRICTION"
master = "upper.PISTON"
search = 0.1
[[layer]]
name = "bed"
between = ["upper.FRICTION", "ground"]
normal = 2000.0
tangential = 1000.0
[[spring]]
name = "guides"
between = ["lower.PISTON", "ground"]
stiffness = [2e4, 1.5e4, 1e3]
[[load]]
pressure_on = "lower.PISTON"
area = 10.0
"""


@dataclass(frozen=True)
class Seed:
    """A folder with a model file, a study and what they read; matrices of the brake as it is."""

    name: str
    folder: Path
    sums: np.ndarray

    @property
    def files(self) -> list[Path]:
        """What the model file reads."""
        known = (MODEL, STUDY)
        return sorted(path for path in self.folder.iterdir() if path.name not in known)


def run(count: int, seed: int, work: Path) -> Iterator[Finding]:
    """Read `count` mutated models, each in a copy of this process; a finding for each."""
    rng, made = random.Random(seed), _seeds(work / "model_files")
    for number in range(count):
        one = rng.choice(made)
        folder = work / "model_files" / f"case{number}"
        shutil.copytree(one.folder, folder)
        if rng.random() < OF_MODEL_FILE:
            path, (done, refused, same) = folder / MODEL, _of_model(folder / MODEL, rng)
        else:
            path = folder / rng.choice(one.files).name
            done, refused, same = _of_what_it_reads(path, rng)
        solved = number % SOLVED == 0
        judge = functools.partial(_judged, folder, path.name, one, refused, same, solved)
        verdict, text = in_a_copy(judge, PATIENCE_S, MEMORY)
        if verdict in ("ok", "message") and number % EVERY == 0:
            verdict, text = _by_command(folder / MODEL, verdict, text)
        if verdict in ("ok", "message"):
            shutil.rmtree(folder)
        yield Finding(PART, number, f"{one.name}: {path.name} {done}", verdict, text)


def _judged(
    folder: Path, name: str, whole: Seed, refused: bool, same: bool, solved: bool
) -> Judged:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            sums = _sums(folder / MODEL)
            if solved:
                sq.run(folder / STUDY, folder / "results", jobs=1)
    except SquealstudyError as error:
        said = str(error)
        if same:
            return "differs", said
        if not any(str(folder / one) in said for one in (name, MODEL, STUDY, "results")):
            return "differs", f"names no file: {said}"
        return ("differs" if "\x00" in said or len(said) > 4000 else "message"), said
    if refused:
        return "silent", "read as if it were right"
    if not np.isfinite(sums).all():
        return "silent", f"no numbers: {sums}"
    if same and not np.array_equal(sums, whole.sums):
        return "silent", "another brake"
    return "ok", ""


def _sums(path: Path) -> np.ndarray:
    """Figures that change with any matrix of a brake, and with the ways of its contact."""
    model = read_model(path)
    inspected(model)
    options = {option.name: option.choices[0] for option in model.options}
    assembly: Assembly = model.build(options, model.defaults())
    found = [assembly.load, assembly.contact.gap0]
    for part in (*assembly.components, assembly.contact):
        for A in (getattr(part, key, None) for key in ("M", "K", "C", "N", "T")):
            if A is not None:
                at = A.tocoo()
                found.append(at.data * np.cos(at.row + 0.1 * at.col))
    return np.array([np.sum(values) for values in found])


def _by_command(path: Path, verdict: str, text: str) -> Judged:
    """What the command says of it."""
    command = [sys.executable, "-m", "squealstudy", "inspect", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if "Traceback" in done.stderr or "internal error" in done.stderr:
        return "traceback", done.stderr
    if done.returncode not in ((2,) if verdict == "message" else (0, 1)):
        # a model is read, its study refused
        return ("message", text) if verdict == "message" else ("crash", done.stderr)
    return verdict, text


# -- whole models -------------------------------------------------------------------------------
def _seeds(folder: Path) -> list[Seed]:
    """Models of each format, as the tests write them."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "components")]
    import own_blocks
    import test_component_matrices as matrices
    import test_component_nastran as nastran
    import test_superelements as superelements

    def blocks(to: Path) -> None:
        own_blocks.write_blocks(to)

    def pads(to: Path) -> None:
        own_blocks.write_blocks(to)
        for name in ("plate.inp", "slider.inp"):
            (to / name).unlink()
        for name in ("pad_tet10.msh", "pad_hex20.msh"):
            shutil.copy(ROOT / "tests" / "meshes" / name, to)
        (to / MODEL).write_text(PADS)

    def bulk(to: Path, form: str) -> None:
        own_blocks.write_blocks(to)
        mesh = own_blocks.block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL")
        sets = [
            nastran.card("small", "SET1", number, *map(int, mesh.numbers[mesh.node_set(name)]))
            for number, name in ((1, "TOP"), (2, "BOTTOM"))
        ]
        (to / "plate.bdf").write_text(nastran.deck(mesh, form, more=sets))
        (to / "plate.inp").unlink()
        text = (to / MODEL).read_text().replace("plate.inp", "plate.bdf")
        text = text.replace("plate.TOP", "plate.SET1").replace("plate.BOTTOM", "plate.SET2")
        (to / MODEL).write_text(text)

    def of_matrices(to: Path, kind: str) -> None:
        mesh = own_blocks.block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING")
        K, M = matrices.stiffness_matrix(mesh), matrices.mass_matrix(mesh)
        to.mkdir(parents=True)
        table = matrices.with_matrices(to, (mesh, K, M), kind)
        own_blocks.write_blocks(to, ('mesh = "slider.inp"', table), superelements.LINING)

    def reduced(to: Path, form: str) -> None:
        # rows of DMIG stand in an order of their own
        superelements.write_superelement(to, 20, form, recovery=form != "dmig", damping=True)

    makers = {
        "inp": blocks,
        "gmsh": pads,
        **{f"bulk data, {f}": functools.partial(bulk, form=f) for f in ("free", "small", "large")},
        **{k: functools.partial(of_matrices, kind=k) for k in ("abaqus", "nastran", "calculix")},
        "ansys": functools.partial(of_matrices, kind="ansys"),
        **{f"superelement, {f}": functools.partial(reduced, form=f) for f in ("npz", "mat", "mtx")},
        "superelement, dmig": functools.partial(reduced, form="dmig"),
    }
    found = []
    for number, (name, make) in enumerate(makers.items()):
        whole = folder / f"whole{number}"
        make(whole)
        found.append(Seed(name, whole, _sums(whole / MODEL)))
    return found


# -- mutations ----------------------------------------------------------------------------------
Done = tuple[str, bool, bool]  # in words; whether it must be refused; whether it must not matter


def _of_model(path: Path, rng: random.Random) -> Done:
    """Change the model file as study files are."""
    made = rng.choice(study_files.MUTATIONS)(path.read_text(), rng)
    path.write_bytes(made.text)
    return made.done, made.refused, made.same


def _of_what_it_reads(path: Path, rng: random.Random) -> Done:
    what = rng.random()
    if what < 0.05:
        return _as_a_file(path, rng), True, False
    data = path.read_bytes()
    text = path.suffix not in (".npz", ".mat")
    kind = matrix_files.Seed(path.suffix, data, text, None)
    if text and what < 0.15:
        new, done = matrix_files._harmless(kind, rng)
        if path.suffix == ".msh" and "byte-order" in done:  # no mesh of gmsh
            new, done = data, "as it was"
        path.write_bytes(new)
        return done, False, True
    if text and what < 0.35 and (places := _numbers(path.read_text())):
        return _no_number(path, rng.choice(places), rng.choice(NO_NUMBERS)), True, False
    new, done = (matrix_files._text if text else matrix_files._binary)(kind, rng)
    path.write_bytes(new)
    return done, False, False


def _as_a_file(path: Path, rng: random.Random) -> str:
    """What may happen to a whole file."""
    what = rng.choice(("removed", "empty", "a folder", "zeros", "another format", "UTF-16"))
    data = path.read_bytes()
    path.unlink()
    if what == "a folder":
        path.mkdir()
    elif what == "zeros":
        path.write_bytes(bytes(len(data)))
    elif what == "empty":
        path.write_bytes(b"")
    elif what == "another format":
        buffer = io.BytesIO()
        np.savez(buffer, a=np.arange(3))
        text = path.suffix not in (".npz", ".mat")
        path.write_bytes(buffer.getvalue() if text else b"*NODE\n1, 0, 0, 0\n")
    elif what == "UTF-16":
        path.write_bytes(data.decode("latin-1").encode("utf-16"))
    return what


def _numbers(text: str) -> list[re.Match[str]]:
    """Numbers that stand by themselves in lines of numbers."""
    return [place for place in NUMBER.finditer(text) if _counts(text, place)]


def _no_number(path: Path, place: re.Match[str], new: str) -> str:
    """In place of a number something that is none."""
    text = path.read_text()
    path.write_text(text[: place.start()] + new + text[place.end() :])
    line = text.count("\n", 0, place.start()) + 1
    return f"'{new}' for '{place.group()}' on line {line}"


def _counts(text: str, place: re.Match[str]) -> bool:
    """Whether a number is a word of its own, in a line of such words."""
    begin, end = text.rfind("\n", 0, place.start()) + 1, text.find("\n", place.end())
    line = text[begin : None if end < 0 else end]
    words = re.split(r"[\s,]+", line.strip())
    around = text[place.start() - 1 : place.start()] + text[place.end() : place.end() + 1]
    alone = not around.strip(" ,\n")
    return alone and all(NUMBER.fullmatch(word) for word in words if word)
