"""Decks of others: which are read, why others are refused, and whether CalculiX has their matrices.

Run:  python studies/benchmarks/decks.py read FOLDER
      python studies/benchmarks/decks.py judge FOLDER [LARGEST]
      python studies/benchmarks/decks.py lumped DECK

`read`: every `.inp`, `.bdf`, `.nas` and `.dat` below a folder that has solids, by what becomes of
it: what is refused by the first words of its message, what is read by whether the model file has to
state materials. `judge`: the `.inp` among them up to LARGEST elements (by default 4000): largest
difference of K and M from those of CalculiX (program ccx), of the deck itself without steps,
supports and contact, as a share of the largest entry; missing materials are put in on both sides.
Freedoms that only CalculiX has must have neither mass nor stiffness; where others are eliminated,
the roots of the pencil are compared. `lumped`: the first six frequencies of a deck of Nastran whose
SPC1 hold all displacements of a node each: `cantibox.nas` of Alneos/vega has 4.135520, 8.150635,
25.61649, 48.88153, 58.27839, 70.47247 Hz in its `.f06`.

Asked were the folder `test` of Dhondtguido/CalculiX and `models` of SteveDoyle2/pyNastran.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh, spsolve

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from calculix import CCX, apart

from squealstudy.errors import ModelError
from squealstudy.models.components.body_matrices import freedom_matrices
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.inp_cards import read_cards
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_files import NASTRAN, read_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.fem.solid import Isotropic

SOLIDS = {
    ".inp": re.compile(r"^\*ELEMENT\b.*TYPE *= *C3D\d", re.I | re.M),
    **dict.fromkeys(NASTRAN, re.compile(r"^ *(CHEXA|CTETRA|CPENTA|CPYRA)", re.I | re.M)),
}
JUDGED = (  # keywords that the judge sees
    *("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "MATERIAL", "ELASTIC", "DENSITY", "INCLUDE"),
    *(
        "SOLIDSECTION",
        "ORIENTATION",
        "DISTRIBUTION",
        "TRANSFORM",
        "TIE",
        "RIGIDBODY",
        "COUPLING",
        "KINEMATIC",
    ),
    *("DISTRIBUTING", "DISTRIBUTINGCOUPLING", "EQUATION", "MPC", "SPRING", "DASHPOT", "MASS"),
)
BESIDE = re.compile(r"\s*\*\s*(TIE\b.*CYCLIC|ELEMENT\b.*TYPE *= *(D|GAPUNI)\b *(,|$))", re.I)
SECTOR = "CYCLICSYMMETRYMODEL"  # matrices of CalculiX are those of the sector
STATED = Isotropic(1e5, 0.3, 1.0)  # where a deck states nothing
STEP = ("*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP", "")
SAME = 1e-9
DENSE = 2500  # freedoms up to which roots are compared


def decks(folder: Path) -> Iterator[Path]:
    """Those below a folder that have solids."""
    for path in sorted(folder.rglob("*")):
        pattern = SOLIDS.get(path.suffix.lower())
        if pattern is None or not path.is_file():
            continue
        if pattern.search(path.read_text(encoding="utf-8", errors="replace")):
            yield path


def read(path: Path, *pass_over: str) -> SolidMesh:
    """A deck as it is."""
    return read_mesh(path, ComponentTable(mesh=path.name, pass_over=pass_over))


def causes(folder: Path) -> None:
    """Print what becomes of decks."""
    found: Counter[str] = Counter()
    for path in decks(folder):
        try:
            mesh = read(path)
        except ModelError as error:
            text = re.sub(r"^.*?(, line \d+)?: ", "", str(error), count=1)
            text = re.sub(r"'[^']*'|\d+", "..", text.removeprefix(f"{path.name}: "))
            found[f"refused: {text[:70]}"] += 1
            continue
        stated = "read, materials to be stated" if mesh.unfinished else "read"
        found[stated] += 1
    for text, count in found.most_common():
        print(f"{count:5} {text}")
    print(
        f"{sum(found.values()):5} decks, {sum(v for k, v in found.items() if k[:4] == 'read')} read"
    )


def whole(mesh: SolidMesh) -> SolidMesh:
    """With what no deck states."""
    stated = {
        name: replace(m.moduli or STATED, density=m.density or STATED.density)
        for name, m in mesh.unfinished.items()
    }
    return replace(mesh, materials={**mesh.materials, **stated}, unfinished={})


def for_judge(path: Path) -> str:
    """A deck without steps, supports, contact, with materials where they are missing."""
    kept: list[str] = []
    stated: dict[str, set[str]] = {}
    keep = step = False
    material = ""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.lstrip().startswith("*"):
            keyword = re.sub(r"\s", "", line.split(",")[0]).lstrip("*").upper()
            step = step or keyword == "STEP"
            keep = keyword in JUDGED and not step and not BESIDE.match(line)
            step = step and keyword != "ENDSTEP"
            if keyword == "MATERIAL" and keep:
                material = line
                stated[line] = set()
            if material and keep:
                stated[material].add(keyword)
        if keep:
            kept.append(line)
    lines = []
    for line in kept:
        lines.append(line)
        if line in stated:
            lines += ["*DENSITY", "1."] * ("DENSITY" not in stated[line])
            lines += ["*ELASTIC", "1e5, .3"] * ("ELASTIC" not in stated[line])
    return "\n".join([*lines, *STEP])


def judged(path: Path, mesh: SolidMesh) -> str:
    """How far K and M are from those of ccx."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "job.inp").write_text(for_judge(path))
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        assert CCX is not None
        subprocess.run([CCX, "job"], cwd=folder, capture_output=True, env=environment, timeout=300)
        if not (folder / "job.sti").is_file():
            return "CalculiX made no matrices"
        words = [w.split(".") for w in (folder / "job.dof").read_text().split()]
        found = []
        for ending in ("sti", "mas"):
            row, column, value = np.loadtxt(folder / f"job.{ending}", ndmin=2).T
            A = sp.coo_matrix(
                (value, (row.astype(int) - 1, column.astype(int) - 1)), [len(words)] * 2
            )
            found.append((A + A.T - sp.diags(A.diagonal())).tocsr())
    place = {int(n): i for i, n in enumerate(mesh.numbers)}
    known = {
        int(line.words()[0]) for c in read_cards(path) if c.keyword == "NODE" for line in c.data
    }
    inner = np.array([int(n) not in place and int(n) not in known for n, _ in words])
    own = np.array([int(n) in place for n, _ in words])
    K, M = (A[own][:, own] for A in found)
    if inner.any():
        K = K - found[0][own][:, inner] @ spsolve(
            found[0][inner][:, inner].tocsc(), found[0][inner][:, own].tocsc()
        )
    rows = [3 * place[int(n)] + int(d) - 1 for (n, d), o in zip(words, own, strict=True) if o]
    mesh, expansion = expanded(mesh)
    k, m = freedom_matrices(mesh, expansion, "as_stiffness")
    ours = {int(p): i for i, p in enumerate(expansion.places)}
    both = [j for j, p in enumerate(rows) if p in ours]
    if len(both) == len(ours):
        rest = np.setdiff1d(np.arange(len(rows)), both)
        if len(rest) and max(abs(M[rest]).max(), abs(K[rest]).max()) > 0:
            return f"{len(rest)} freedoms of CalculiX alone"
        o = np.array([ours[rows[j]] for j in both])
        K, M = (A.tocsr()[both][:, both] for A in (K, M))
        return f"K {apart(k[o][:, o], K):.1e} M {apart(m[o][:, o], M):.1e}"
    if len(rows) != len(expansion.places) or len(rows) > DENSE:
        return "freedoms that differ"
    c = abs(K).max() / abs(M).max()
    x, y = (la.eigvalsh((c * B).toarray(), (A + c * B).toarray()) for A, B in ((k, m), (K, M)))
    return f"K {abs(x - y).max():.1e} M 0.0e+00 by roots"


def judge(folder: Path, largest: int) -> None:
    """Print what is further from CalculiX than SAME, and how many are not."""
    if CCX is None:
        sys.exit("there is no program ccx")
    found: Counter[str] = Counter()
    for path in decks(folder):
        if path.suffix.lower() != ".inp":
            continue
        try:
            mesh = read(path, SECTOR)
            if mesh.n_elements > largest:
                found["too large"] += 1
                continue
            text = judged(path, whole(mesh))
        except ModelError:
            found["refused"] += 1
            continue
        except (subprocess.TimeoutExpired, RuntimeError, ValueError, la.LinAlgError) as error:
            text = f"no comparison: {type(error).__name__}"
        numbers = [float(w) for w in re.findall(r"[KM] (\S+)", text)]
        equal = len(numbers) == 2 and max(numbers) < SAME
        found["equal" if equal else "else"] += 1
        if not equal:
            print(f"{path.name}: {text}", flush=True)
    print(", ".join(f"{count} {what}" for what, count in found.most_common()))


def lumped(path: Path) -> None:
    """Print the frequencies of a deck that SPC1 hold."""
    mesh = read(path)
    lines = [line for line in path.read_text().splitlines() if line.startswith("SPC1")]
    held = np.searchsorted(mesh.numbers, sorted({int(line[24:32]) for line in lines}))
    free = np.setdiff1d(np.arange(3 * len(mesh.nodes)), 3 * held[:, None] + np.arange(3))
    rule = "lumped" if mesh.lumped else "full"
    K, M = (A[free][:, free].tocsc() for A in (stiffness_matrix(mesh), mass_matrix(mesh, rule)))
    roots = eigsh(K, 6, M, sigma=1.0, return_eigenvectors=False)
    print(rule, *(f"{hz:.7g}" for hz in np.sqrt(np.sort(roots)) / (2 * np.pi)), "Hz")


def main() -> None:
    """One of the three."""
    what, where, *more = sys.argv[1:]
    if what == "read":
        causes(Path(where))
    elif what == "judge":
        judge(Path(where), int(more[0]) if more else 4000)
    else:
        lumped(Path(where))


if __name__ == "__main__":
    main()
