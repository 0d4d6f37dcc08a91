"""Families of matrices from files: reading, solving, studies end to end, and every clear error."""

from __future__ import annotations

import importlib.util
import json
import struct
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import reference
import scipy.io
import scipy.sparse as sp
from reference import MU_C, W1, W2
from study_runs import plan_of, solved
from study_texts import study_text, sweep_text

import squealstudy
from squealstudy.cli import app as cli
from squealstudy.engine.cache import is_prepared, load_any
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.engine.schema import study_schema
from squealstudy.errors import ConvergenceError, ModelError, SquealstudyError, StudyFileError
from squealstudy.linalg.band_roots import FIRST_ROOTS, pair_residuals, roots_in_band
from squealstudy.models.matrices.expression import Expression
from squealstudy.models.matrices.family import FamilyTerm, MatrixFamily
from squealstudy.models.matrices.files import read_matrix
from squealstudy.modes.full_order.modes import (
    family_system,
    solve_family_point,
)
from squealstudy.reduction.prepared import prepare_family, spanning
from squealstudy.study.definition import load_study, parse_study
from squealstudy.study.family import RESERVED_NAMES

HULTEN = (
    study_text("family", "complex_modes", "matrices")
    + """\
[[model.term]]
matrix = "M"
file = "m.mtx"
[[model.term]]
matrix = "K"
file = "k.mat"
variable = "elastic"
[[model.term]]
matrix = "K"
file = "k.mat"
variable = "coupling"
coefficient = "mu"
[parameters]
mu = 0.1
"""
    + sweep_text("mu", 0.0, 0.6, 13)
    + """\
[modes]
band = [1.0, 1000.0]
"""
)


def random_matrix(n: int = 30, seed: int = 0) -> sp.csr_matrix:
    rng = np.random.default_rng(seed)
    A = sp.random(n, n, 0.2, random_state=rng, data_rvs=rng.standard_normal)
    return (A + sp.identity(n)).tocsr()


def write_hulten(folder: Path) -> Path:
    scipy.io.mmwrite(folder / "m.mtx", sp.identity(2))
    coupling = np.array([[0.0, -(W2**2)], [W1**2, 0.0]])
    scipy.io.savemat(
        folder / "k.mat",
        {"elastic": sp.diags([W1**2, W2**2]), "coupling": coupling, "note": "by the test"},
    )
    path = folder / "family.toml"
    path.write_text(HULTEN)
    return path


def chain(n: int = 160, free: bool = False) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
    """M, C, K of a damped chain with a circulatory coupling; `free` at both ends: K is singular."""
    K = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)).tolil()
    if free:
        K[0, 0] = K[-1, -1] = 1.0
    skew = sp.diags([0.02, -0.02], [3, -3], shape=(n, n)) if not free else sp.csr_matrix((n, n))
    M = sp.diags(1.0 + 0.5 * np.sin(np.arange(n)))
    return M.tocsr(), (1e-3 * K).tocsr(), (1e6 * (K + skew)).tocsr()


# -- files --------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [".mtx", ".mtx.gz", ".mat", ".npz", ".rua", ".rb"])
def test_round_trip_of_each_format(ending, tmp_path):
    A, path = random_matrix(), tmp_path / f"a{ending}"
    if ending.startswith(".mtx"):
        scipy.io.mmwrite(tmp_path / "a.mtx", A, precision=17)
        if ending == ".mtx.gz":
            import gzip

            path.write_bytes(gzip.compress((tmp_path / "a.mtx").read_bytes()))
    elif ending == ".mat":
        scipy.io.savemat(path, {"A": A})
    elif ending == ".npz":
        sp.save_npz(path, A)
    else:
        scipy.io.hb_write(path, A.tocsc())
    with warnings.catch_warnings():  # SciPy 1.18 warns of arrays to come: no matter of the user's
        warnings.simplefilter("error")
        found = read_matrix(path)
    assert isinstance(found, sp.csr_matrix)
    assert found.dtype == float
    np.testing.assert_allclose(found.toarray(), A.toarray(), rtol=1e-15)


def test_symmetric_storage_is_expanded(tmp_path):
    A = random_matrix()
    S, Z = (A + A.T).tocsc(), (A - A.T).tocsc()
    scipy.io.mmwrite(tmp_path / "s.mtx", S, symmetry="symmetric", precision=17)
    for name, matrix in (("s.rsa", S), ("z.rza", Z)):
        scipy.io.hb_write(tmp_path / name, sp.tril(matrix).tocsc())
        lines = (tmp_path / name).read_text().splitlines(keepends=True)
        lines[2] = name[-3:].upper() + lines[2][3:]
        (tmp_path / name).write_text("".join(lines))
    for name, matrix in (("s.mtx", S), ("s.rsa", S), ("z.rza", Z)):
        np.testing.assert_allclose(
            read_matrix(tmp_path / name).toarray(), matrix.toarray(), rtol=1e-14, atol=1e-15
        )


def test_harwell_boeing_with_fortran_exponents(tmp_path):
    A, path = random_matrix(), tmp_path / "a.rua"
    scipy.io.hb_write(path, A.tocsc())
    lines = path.read_text().splitlines(keepends=True)
    lines[3] = lines[3].replace("(3E25.16)", "(1P,3D25.16)")
    assert "1P" in lines[3]
    lines[4:] = [line.replace("E", "D").replace("e", "D") for line in lines[4:]]
    path.write_text("".join(lines))
    np.testing.assert_allclose(read_matrix(path).toarray(), A.toarray(), rtol=1e-15)


def test_variables_of_files_that_hold_several(tmp_path):
    A, B = random_matrix(seed=1), random_matrix(seed=2).toarray()
    scipy.io.savemat(tmp_path / "ab.mat", {"A": A, "B": B})
    np.savez(tmp_path / "ab.npz", A=A.toarray(), B=B)
    for name in ("ab.mat", "ab.npz"):
        np.testing.assert_array_equal(read_matrix(tmp_path / name, "B").toarray(), B)
        with pytest.raises(ModelError, match="no variable 'b', its variables are A, B"):
            read_matrix(tmp_path / name, "b")
        with pytest.raises(ModelError, match=r"holds 2 variables \(A, B\): expected the name"):
            read_matrix(tmp_path / name)


@pytest.mark.parametrize("storage", ["dense", "nonbigmat", "bigmat"])
@pytest.mark.parametrize("binary", [True, False])
def test_output4_of_nastran(tmp_path, storage, binary):
    with np.printoptions():
        op4 = pytest.importorskip("pyyeti.nastran.op4")
    A, B, path = random_matrix(seed=1), random_matrix(seed=2), tmp_path / "ab.op4"
    given = [m.toarray() for m in (A, B)] if storage == "dense" else [A.tocoo(), B.tocoo()]
    op4.write(str(path), ["KAA", "MAA"], given, sparse=storage, binary=binary, digits=17)
    np.testing.assert_allclose(read_matrix(path, "MAA").toarray(), B.toarray(), rtol=1e-15)
    with pytest.raises(
        ModelError, match=r"ab.op4 holds 2 variables \(kaa, maa\): expected the name"
    ):
        read_matrix(path)
    with pytest.raises(ModelError, match="no variable 'kgg', its variables are kaa, maa"):
        read_matrix(path, "KGG")
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(ModelError, match=r"ab\.op4"):
        read_matrix(path, "MAA")


@pytest.mark.parametrize("ending", [".op4", ".op2"])
def test_a_matrix_of_nastran_is_what_its_form_says(tmp_path, ending):
    """One triangle of a symmetric one, and an identity without entries, were read as they stood."""
    with np.printoptions():
        op4 = pytest.importorskip("pyyeti.nastran.op4")
    A, path = random_matrix(seed=1).toarray(), tmp_path / f"a{ending}"
    for form, B, text in (
        (6, A + A.T, ""),
        (6, np.tril(A + A.T), r"by its form \(6\) it is symmetric, by its entries it is not"),
        (8, np.zeros_like(A), "found form 8"),
        (4, np.tril(A), ""),
    ):
        if ending == ".op4":
            op4.write(str(path), ["KAA"], [B], forms=[form], digits=17)
        else:
            path.write_bytes(output2([("KAA", B)], form))
        if text:
            with pytest.raises(ModelError, match=text):
                read_matrix(path)
        else:
            np.testing.assert_allclose(read_matrix(path).toarray(), B, rtol=1e-15)


def output2(matrices, form=1):
    """An OUTPUT2 file of dense matrices in double precision: records, with keys before them."""

    def record(body):
        size = struct.pack("<i", len(body))
        return size + body + size

    def keys(*numbers):
        return b"".join(record(struct.pack("<i", number)) for number in numbers)

    found = b""
    for number, (name, A) in enumerate(matrices, start=101):
        rows, columns = A.shape
        title = name.ljust(8).encode()
        trailer = (number, columns, rows, form, 2, 2 * rows, 10000)
        found += keys(2) + record(title) + keys(-1, 7) + record(struct.pack("<7i", *trailer))
        found += keys(-2, 1, 0, 4) + record(title + bytes(8))
        for j in range(columns):
            found += keys(-3 - j, 1, 1, 1 + 2 * rows)
            found += record(struct.pack("<i", 1) + A[:, j].astype("<f8").tobytes())
        found += keys(-3 - columns, 1, 0, 0)
    return found


def test_output2_of_nastran(tmp_path):
    pytest.importorskip("pyyeti")
    A, B, path = (
        random_matrix(seed=1).toarray(),
        random_matrix(seed=2).toarray(),
        tmp_path / "a.op2",
    )
    path.write_bytes(output2([("KAA", A), ("MAA", B)]))
    np.testing.assert_array_equal(read_matrix(path, "maa").toarray(), B)
    with pytest.raises(ModelError, match=r"a.op2 holds 2 variables \(KAA, MAA\): expected"):
        read_matrix(path)
    path.write_bytes(output2([("KAA", A), ("KAA", B)]))
    with pytest.raises(ModelError, match="has two matrices of one name"):
        read_matrix(path, "KAA")
    path.write_bytes(output2([("KAA", A[:, :-1])]))
    with pytest.raises(ModelError, match="expected a square matrix"):
        read_matrix(path, "KAA")
    whole = output2([("KAA", A)])
    for cut in (10, 60, len(whole) // 2, len(whole) - 30):
        path.write_bytes(whole[:cut])
        with pytest.raises(ModelError, match=r"a\.op2"):
            read_matrix(path, "KAA")
    path.write_bytes(whole.replace(struct.pack("<2i", *A.shape), struct.pack("<2i", 10**9, 10**9)))
    with pytest.raises(ModelError, match=r"a\.op2"):
        read_matrix(path, "KAA")


def test_reading_output4_leaves_how_numpy_prints(tmp_path):
    """Its reader sets that of numpy 1.13 when it is imported first."""
    if importlib.util.find_spec("pyyeti") is None:
        pytest.skip("could not import pyyeti")
    (tmp_path / "none.op4").write_bytes(b"")
    code = (
        "import numpy as np\nfrom pathlib import Path\n"
        "from squealstudy.models.matrices.files import read_matrix\n"
        "try:\n    read_matrix(Path('none.op4'))\nexcept Exception:\n    pass\n"
        "import sys\nprint('pyyeti' in sys.modules, np.array([120.0, 40.0]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "True [120.  40.]\n"


def test_output4_without_its_reader(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyyeti.nastran", None)
    (tmp_path / "a.op4").write_bytes(b"")
    with pytest.raises(ModelError, match=r"OP4 needs pyyeti: pip install 'squealstudy\[op4\]'"):
        read_matrix(tmp_path / "a.op4")


def test_unusable_files(tmp_path):
    eye = np.eye(3)
    bad = {
        "complex": eye * 1j,
        "wide": eye[:2],
        "infinite": np.full((3, 3), np.inf),
        "text": "a text",
        "cell": np.array([eye, eye[:2]], dtype=object),
    }
    scipy.io.savemat(tmp_path / "bad.mat", bad)
    messages = {
        "complex": "expected real values, found complex ones",
        "wide": "expected a square matrix, found 2 x 3",
        "infinite": "9 values are not finite",
        "text": "expected a matrix of numbers",
        "cell": "expected a matrix of numbers",
    }
    for name, message in messages.items():
        with pytest.raises(ModelError, match=message):
            read_matrix(tmp_path / "bad.mat", name)
    sp.save_npz(tmp_path / "one.npz", sp.identity(3, format="csr"))
    with pytest.raises(ModelError, match="leave out the variable"):
        read_matrix(tmp_path / "one.npz", "A")
    with pytest.raises(ModelError, match="there is no file"):
        read_matrix(tmp_path / "none.mtx")
    (tmp_path / "a.xyz").write_text("1")
    with pytest.raises(ModelError, match=r"unknown format '\.xyz', expected an ending of \.mtx"):
        read_matrix(tmp_path / "a.xyz")
    for ending in ("mtx", "mat", "npz", "rua"):
        (tmp_path / f"damaged.{ending}").write_text("no matrix\n" * 6)
        with pytest.raises(ModelError, match=f"damaged.{ending}"):
            read_matrix(tmp_path / f"damaged.{ending}")
    scipy.io.hb_write(tmp_path / "c.rua", sp.identity(3, format="csc"))
    for kind in ("CUA", "PUA", "RUE"):
        text = (tmp_path / "c.rua").read_text().replace("RUA", kind)
        (tmp_path / "d.rua").write_text(text)
        with pytest.raises(ModelError, match=r"real assembled matrix|pattern without values"):
            read_matrix(tmp_path / "d.rua")


# -- families -----------------------------------------------------------------------------------


def family_of(*terms: tuple[int, sp.spmatrix, str]) -> MatrixFamily:
    return MatrixFamily(tuple(FamilyTerm(o, sp.csr_matrix(A), Expression(c)) for o, A, c in terms))


def test_weights_and_matrices():
    A, B, D = (random_matrix(seed=s) for s in range(3))
    family = family_of((2, A, "1"), (1, B, "x*y"), (0, D, "x**2"), (0, A, "1/y"))
    at = {"x": 3.0, "y": 2.0}
    assert family.names == ("x", "y")
    assert family.weights(at) == (1.0, 6.0, 9.0, 0.5)
    M, C, K = (X.toarray() for X in family.matrices(at))
    np.testing.assert_allclose(M, A.toarray())
    np.testing.assert_allclose(C, 6 * B.toarray())
    np.testing.assert_allclose(K, 9 * D.toarray() + 0.5 * A.toarray())
    for sparse, dense in zip(
        family_system(family).sparse_matrices(family.weights(at)), (M, C, K), strict=True
    ):
        np.testing.assert_allclose(sparse.sparse.toarray(), dense)


def test_terms_that_do_not_fit():
    A = random_matrix()
    with pytest.raises(ModelError, match="at least one term of M"):
        family_of((0, A, "1"))
    with pytest.raises(ModelError, match="term 2 is 4 x 4, the first is 30 x 30"):
        family_of((2, A, "1"), (0, random_matrix(4), "1"))


def test_roots_against_lapack():
    M, C, K = chain()
    band = (100.0, 600.0)
    roots = roots_in_band(M, C, K, band)
    one = np.eye(M.shape[0])
    lower = -np.linalg.solve(M.toarray(), np.hstack([K.toarray(), C.toarray()]))
    every = np.linalg.eigvals(np.vstack([np.hstack([0 * one, one]), lower]))
    expected = every[(every.imag >= 0) & (abs(every) >= band[0]) & (abs(every) <= band[1])]
    expected = expected[np.argsort(abs(expected))]
    assert len(roots.lam) == len(expected) > 20
    np.testing.assert_allclose(roots.lam, expected, rtol=1e-9)
    assert roots.n_below == (abs(every) <= band[1]).sum()
    assert reference.residuals(M, C, K, roots.lam, roots.psi).max() < 1e-9
    about = roots_in_band(M, C, K, band, first=10, shift=20.0)
    np.testing.assert_allclose(about.lam, roots.lam, rtol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(roots.psi, axis=0), 1.0, rtol=1e-12)


def test_bands_with_most_of_the_roots_or_none():
    M, C, K = chain()
    everything = roots_in_band(M, C, K, (0.0, 1e5))
    assert everything.n_below == 2 * M.shape[0]
    assert len(roots_in_band(M, C, K, (1e4, 1e5)).lam) == 0
    assert len(roots_in_band(M, C, K, (1e-3, 1e-2)).lam) == 0


def test_shapes_span_the_basis_they_are_compared_in():
    """Whatever their lengths are; the first coordinate stands in where there are none."""
    rng = np.random.default_rng(0)
    psi = rng.standard_normal((9, 2, 2)).view(complex)[..., 0] * [1e-6, 1e6]
    basis = spanning(psi)
    assert basis.shape == (9, 4)
    np.testing.assert_allclose(basis @ (basis.T @ psi), psi, rtol=1e-9)
    assert spanning(psi[:, :1].real + 0j).shape == (9, 1)
    np.testing.assert_array_equal(spanning(psi[:, :0]), np.eye(9)[:, :1])


def test_a_family_asks_for_about_the_roots_of_its_band():
    """Those of both signs below its top, and a few more: too few are solved for twice."""
    n = 120
    w = 2 * np.pi * np.linspace(10.0, 1200.0, n)
    made = MatrixFamily(
        tuple(
            FamilyTerm(order, sp.csr_matrix(A), Expression("1"))
            for order, A in ((2, np.eye(n)), (1, np.diag(1e-3 * w)), (0, np.diag(w**2)))
        )
    )
    for count in (5, 60):
        prepared = prepare_family(made, {}, (60.0, 1.001 * w[count - 1]))
        assert max(2 * count, FIRST_ROOTS) <= prepared.n_roots <= max(2.5 * count, FIRST_ROOTS)


@pytest.mark.parametrize("n", [20, 160])
def test_free_structures_and_massless_points(n):
    """K singular (a rigid mode) and M singular (points without mass)."""
    M, C, K = chain(n, free=True)
    f = np.linalg.eigvalsh(
        np.linalg.solve(np.sqrt(M.toarray()), K.toarray()) / np.sqrt(M.diagonal())
    )
    roots = roots_in_band(M, sp.csr_matrix((n, n)), K, (1.0, 700.0))
    elastic = np.sqrt(f[(f > 1.0) & (f <= 700.0**2)])
    np.testing.assert_allclose(roots.lam.imag, np.sort(elastic), rtol=1e-8)
    M, C, K = chain(n)
    M = sp.csr_matrix(M.multiply((np.arange(n) % 2 == 0)[:, None]))
    roots = roots_in_band(M, C, K, (1.0, 900.0))
    assert len(roots.lam) > 3
    assert reference.residuals(M, C, K, roots.lam, roots.psi).max() < 1e-8


def friction_that_lags():
    """m x'' + c x' + k x = slope z with lag z' + z = x': z is a coordinate without mass."""
    C = {"1": np.array([[5.0, 0.0], [-1.0, 0.0]]), "lag": np.diag([0.0, 1.0])}
    K = {"1": np.diag([1e6, 1.0]), "slope": np.array([[0.0, -1.0], [0.0, 0.0]])}
    return squealstudy.matrices(np.diag([1.0, 0.0]), K, C=C, slope=20.0, lag=0.0)


@pytest.mark.parametrize(("lag", "unstable"), [(0.0, True), (1e-3, True), (1e-2, False)])
def test_a_friction_law_with_a_state_is_a_coordinate_without_mass(lag, unstable):
    """Friction that falls with a speed that lags, against the roots of its polynomial."""
    table = friction_that_lags().sweep(lag=[lag])
    exact = np.roots([lag, 1.0 + 5.0 * lag, 5.0 - 20.0 + 1e6 * lag, 1e6])
    exact = exact[(exact.imag > 0) & (np.abs(exact) < 1e4)]
    oscillating = table[~table["overdamped"]]
    np.testing.assert_allclose(oscillating["growth_rate"], exact.real, rtol=1e-9)
    np.testing.assert_allclose(2 * np.pi * oscillating["frequency_hz"], np.abs(exact), rtol=1e-9)
    assert oscillating["unstable"].tolist() == [unstable]


def test_a_stiffness_without_diagonal_needs_pivots():
    n = 200
    w = np.linspace(100.0, 300.0, n)
    swap = sp.identity(n, format="csr")[np.arange(n)[::-1]]
    M, K = swap, (swap @ sp.diags(w**2)).tocsr()
    roots = roots_in_band(M, sp.csr_matrix((n, n)), K, (90.0, 150.0))
    np.testing.assert_allclose(roots.lam.imag, w[w <= 150.0], rtol=1e-9)


def test_no_roots_is_an_error():
    Z = sp.csr_matrix((200, 200))
    with pytest.raises(ConvergenceError):
        roots_in_band(Z, Z, Z, (1.0, 10.0))


def test_residuals_see_a_wrong_root():
    M, C, K = chain()
    roots = roots_in_band(M, C, K, (100.0, 300.0))
    off = pair_residuals(M, C, K, 1.001 * roots.lam, roots.psi)
    assert (off > 1e3 * pair_residuals(M, C, K, roots.lam, roots.psi)).all()


def test_points_agree_with_a_second_factorisation_and_follow_their_shapes():
    M, C, K = chain()
    family = family_of((2, M, "1"), (1, C, "damping"), (0, K, "stiffness**2"))
    at, band_hz = {"damping": 1.0, "stiffness": 1.0}, (10.0, 90.0)
    prepared = prepare_family(family, at, (2 * np.pi * 10.0, 2 * np.pi * 90.0))
    basis = prepared.shape_basis
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-12)
    point = solve_family_point(prepared, at, band_hz)
    check = solve_family_point(prepared, at, band_hz, check=True)
    np.testing.assert_allclose(check.lam, point.lam, rtol=1e-9)
    assert point.residual.max() < 1e-10
    assert point.energies.shape == (0, len(point.lam))
    assert point.working_point is None
    stiffer = solve_family_point(prepared, {**at, "stiffness": 1.001}, band_hz)
    m = min(len(point.lam), len(stiffer.lam))
    mac = abs((point.shapes[:m].conj() * stiffer.shapes[:m]).sum(axis=1)) ** 2
    assert mac.min() > 0.999
    with pytest.raises(ConvergenceError, match=r"no value at x = 0: division by zero"):
        solve_family_point(
            prepare_family(family_of((2, M, "1"), (0, K, "1/x")), {"x": 1.0}, (60.0, 600.0)),
            {"x": 0.0},
            band_hz,
        )


# -- studies ------------------------------------------------------------------------------------


def _ordered(modes):
    """By point, frequency and growth: merged modes have the same modulus, in either order."""
    point = modes["point_id"].factorize()[0]
    order = np.lexsort((modes["growth_rate"], modes["frequency_hz"].round(6), point))
    return modes.iloc[order].reset_index(drop=True)


def test_a_family_equals_the_hulten_model(tmp_path):
    results = {}
    hulten = HULTEN[HULTEN.index("[[sweep]]") :].replace('"mu"', '"friction"')
    head = '[study]\nname = "hulten"\nkind = "complex_modes"\n[model]\nname = "hulten"\n'
    plans = {
        "family": Plan(load_study(write_hulten(tmp_path))),
        "hulten": plan_of(head + hulten, tmp_path / "hulten.toml"),
    }
    for name, plan in plans.items():
        report = run_study(plan, tmp_path / name, jobs=1)
        assert report.manifest["n_failed"] == 0
        results[name] = squealstudy.open_results(tmp_path / name)
    mine, theirs = (_ordered(results[name].modes) for name in ("family", "hulten"))
    assert len(mine) == len(theirs) > 20
    for column in ("frequency_hz", "growth_rate"):
        np.testing.assert_allclose(mine[column], theirs[column], rtol=1e-9, atol=1e-6)
    assert (results["family"].points["mu"] == results["hulten"].points["friction"]).all()
    for found in results.values():
        assert found.rank()["threshold"].iloc[0] == pytest.approx(MU_C, abs=1e-4)


def test_a_study_end_to_end(tmp_path, capsys):
    path = write_hulten(tmp_path)
    cli.run(path, tmp_path / "r", 1)
    printed = capsys.readouterr().out
    assert "a second factorisation" in " ".join(printed.split())
    assert "nan" not in printed
    results = squealstudy.open_results(tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    assert results.points["working_point_residual"].isna().all()
    assert not results.modes.filter(like="energy_").columns.size
    columns = {*results.points, *results.modes, *results.onsets} - {"mu"}
    assert columns <= RESERVED_NAMES  # no parameter of somebody's matrices has the name of a column
    assert (results.modes["residual"] < 1e-12).all()
    ranking = results.rank()
    assert ranking["threshold"].iloc[0] == pytest.approx(MU_C, abs=1e-4)
    assert ranking["main_component"].iloc[0] == ""
    assert results.points["reference_frequency_error"].max() < 1e-12
    drawn = sorted(p.stem for p in (tmp_path / "r").glob("*.png"))
    assert {"stability_diagram", "ranking", "evolution_mu"} <= set(drawn)
    again = run_study(Plan(load_study(path)), tmp_path / "r", jobs=1)
    assert again.n_solved == 0
    scipy.io.mmwrite(tmp_path / "m.mtx", 2.0 * sp.identity(2))  # other content, same name
    assert run_study(Plan(load_study(path)), tmp_path / "r", jobs=1).n_solved == 13


def test_no_kind_is_advised_that_serves_no_matrices(tmp_path, capsys):
    """Neither where modes are unstable nor where none is: matrices have complex modes alone."""
    path = write_hulten(tmp_path)
    for text, found in ((HULTEN, "T1 at"), (HULTEN.replace("num = 13", "num = 1"), "No mode")):
        path.write_text(text)
        cli.run(path, tmp_path / found, 1)
        printed = capsys.readouterr().out
        assert found in printed
        assert "click through" in printed
        assert 'kind = "' not in printed


def test_a_point_without_value_is_a_failed_row(tmp_path):
    path = write_hulten(tmp_path)
    path.write_text(HULTEN.replace('coefficient = "mu"', 'coefficient = "1/(10*mu)"'))
    points = solved(Plan(load_study(path)), tmp_path / "r").points
    assert points["status"].tolist() == ["undefined"] + ["ok"] * 12
    assert "division by zero" in points["message"].iloc[0]


@pytest.mark.parametrize("design", ["latin_hypercube", "sobol", "boundary"])
def test_other_designs(design, tmp_path):
    samples = "" if design == "boundary" else "samples = 8\n"
    text = write_hulten(tmp_path).read_text()
    text = text.replace("num = 13\n", "num = 4\n" if design == "boundary" else "")
    path = tmp_path / "designed.toml"
    path.write_text(f'{text}[design]\ntype = "{design}"\n{samples}')
    results = solved(Plan(load_study(path)), tmp_path / "r")
    points = results.points
    assert len(points) >= 7
    assert (points["n_unstable"] == (points["mu"] > MU_C)).all()
    if design == "boundary":  # 3 x 2^3 intervals of 0.025, only those about MU_C halved
        assert len(points) < 25
        assert np.diff(np.sort(points["mu"])).min() == pytest.approx(0.025)


def test_prepared_families_are_read_back_as_they_were(tmp_path, monkeypatch):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    plan = Plan(load_study(write_hulten(tmp_path)))
    run_study(plan, tmp_path / "r", jobs=1)
    (structure,) = plan.structures
    assert is_prepared(structure)
    found = load_any(structure)
    modes = solve_family_point(found, plan.tasks[4].plain_values(), plan.band_hz)
    table = squealstudy.open_results(tmp_path / "r").modes
    own = table[table["point_id"] == plan.tasks[4].point_id]
    np.testing.assert_array_equal(np.abs(modes.lam) / (2 * np.pi), own["frequency_hz"])


@pytest.mark.parametrize("where", ["folder", "environment", "absolute"])
def test_where_the_files_are(where, tmp_path, monkeypatch):
    data = tmp_path / "data"
    data.mkdir()
    text = write_hulten(data).read_text()
    if where == "absolute":
        text = text.replace('"m.mtx"', f'"{data / "m.mtx"}"').replace('"k.mat"', f'"{data}/k.mat"')
    else:
        named = "data" if where == "folder" else "nowhere"
        text = text.replace('name = "matrices"', f'name = "matrices"\nfolder = "{named}"')
    if where == "environment":
        monkeypatch.setenv("SQUEALSTUDY_DATA", str(data))
    study = tmp_path / "study.toml"
    study.write_text(text)
    assert run_study(Plan(load_study(study)), tmp_path / "r", jobs=1).n_solved == 13


def test_absent_files_are_missed_before_anything_is_written(tmp_path):
    path = write_hulten(tmp_path)
    (tmp_path / "k.mat").unlink()
    with pytest.raises(StudyFileError, match=r"there is no file k\.mat in .*SQUEALSTUDY_DATA") as e:
        run_study(Plan(load_study(path)), tmp_path / "r", jobs=1)
    assert (e.value.key, e.value.line) == ("model.term[2].file", 12)
    assert not (tmp_path / "r").exists()
    path.write_text(HULTEN.replace('"matrices"\n', '"matrices"\nfolder = "there"\n'))
    with pytest.raises(StudyFileError, match=r"there is no folder .*there;"):
        run_study(Plan(load_study(path)), tmp_path / "r", jobs=1)


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ('"coupling"', '"couplnig"', "model.term[3].variable", "no variable 'couplnig'"),
        ('variable = "elastic"\n', "", "model.term[2].file", "holds 3 variables"),
        ('"elastic"', '"note"', "model.term[2].variable", "expected a matrix of numbers"),
        ('"m.mtx"', '"wide.mtx"', "model.term[2].file", "2 x 2, the first term's matrix 3 x 3"),
    ],
)
def test_files_that_cannot_be_used_are_named_with_their_line(old, new, key, message, tmp_path):
    path = write_hulten(tmp_path)
    scipy.io.mmwrite(tmp_path / "wide.mtx", sp.identity(3))
    path.write_text(HULTEN.replace(old, new))
    with pytest.raises(StudyFileError, match=message) as caught:
        run_study(Plan(load_study(path)), tmp_path / "r", jobs=1)
    assert caught.value.key == key
    assert caught.value.line is not None


@pytest.mark.parametrize(
    ("old", "new", "key", "message"),
    [
        ('= "mu"\n[p', '= "nu"\n[p', "model.term[3].coefficient", "did you mean 'mu'|'nu' has no"),
        ("mu = 0.1", "", "model.term[3].coefficient", r"no value under \[parameters\]; give mu"),
        ("mu = 0.1", "mu = 0.1\nmus = 1.0", "parameters.mus", "none of the coeff.*mean 'mu'"),
        ("mu = 0.1", "mu = 0.1\npi = 3.0", "parameters.pi", "constant or function"),
        ('= "mu"\n[p', '= "__import__(1)"\n[p', "model.term[3].coefficient", "is no function"),
        ('= "mu"\n[p', '= "mu.real"\n[p', "model.term[3].coefficient", "attribute"),
        ('= "mu"\n[p', "= [1]\n[p", "model.term[3].coefficient", "number or an expression"),
        ('= "mu"\n[p', "= true\n[p", "model.term[3].coefficient", "number or an expression"),
        ('= "mu"\n[p', '= "mu*mode"\n[p', "model.term[3].coefficient", "column of the tables"),
        ('matrix = "M"', 'matrix = "D"', "model.term[1].matrix", "expected one of 'M', 'C' or 'K'"),
        ('matrix = "M"', 'matrix = "K"', "model", 'needs a .*matrix = "M"'),
        ('file = "m.mtx"', 'fiel = "m.mtx"', "model.term[1]", "'file' is missing|did you mean"),
        ('name = "matrices"', 'name = "matrices"\nmesh = 1', "model.mesh", "unknown key"),
        ('name = "matrices"', 'name = "matrixes"', "model.name", "did you mean 'matrices'"),
        ('"complex_modes"', '"transient"', "study.kind", "neither contact nor components"),
        ('"complex_modes"', '"sensitivity"', "study.kind", "expected 'complex_modes'"),
        ('parameter = "mu"', 'parameter = "muu"', "sweep[1].parameter", "did you mean 'mu'"),
        (
            'parameter = "mu"',
            'parameter = "modes[3].damping_ratio"',
            "sweep[1].parameter",
            "no components",
        ),
    ],
)
def test_study_files_with_mistakes(old, new, key, message, tmp_path):
    assert old in HULTEN
    with pytest.raises(StudyFileError, match=message) as caught:
        parse_study(HULTEN.replace(old, new, 1), tmp_path / "study.toml")
    assert caught.value.key.startswith(key)
    assert caught.value.line is not None


@pytest.mark.parametrize("key", ["term", "folder"])
def test_other_models_have_no_terms(key, tmp_path):
    given = 'folder = "."\n' if key == "folder" else ""
    term = '[[model.term]]\nmatrix = "M"\nfile = "m.mtx"\n' if key == "term" else ""
    text = f'[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "hulten"\n{given}{term}'
    with pytest.raises(StudyFileError, match="unknown key of model 'hulten'") as caught:
        parse_study(text, tmp_path / "study.toml")
    assert (caught.value.key, caught.value.line) == (f"model.{key}", 6)


def test_numbers_are_coefficients_too(tmp_path):
    text = HULTEN.replace('coefficient = "mu"', "coefficient = 2").replace("mu = 0.1", "")
    text = text[: text.index("[[sweep]]")]
    study = parse_study(text, tmp_path / "study.toml")
    assert study.values == {}
    assert [t.coefficient for t in study.model.sources] == ["1.0", "1.0", "2"]


def test_nominal_values_without_a_solution_are_said(tmp_path):
    path = write_hulten(tmp_path)
    path.write_text(HULTEN.replace('"mu"\n[p', '"log(mu)"\n[p').replace("mu = 0.1", "mu = 0"))
    with pytest.raises(SquealstudyError, match=r"at the values of \[parameters\].*domain"):
        run_study(Plan(load_study(path)), tmp_path / "r", jobs=1)


def test_commands_and_schema(tmp_path, capsys):
    schema = json.dumps(study_schema())
    for word in ("matrices", "TermSection", "coefficient", "SQUEALSTUDY_DATA"):
        assert word in schema
    cli.models()
    assert "matrices" in capsys.readouterr().out
    cli.models("matrices")
    assert "[[model.term]]" in capsys.readouterr().out
    cli.check(write_hulten(tmp_path), tmp_path / "r", 1)
    shown = " ".join(capsys.readouterr().out.split())
    assert "3 terms read, parameters mu" in shown
    assert "2 degrees of freedom" in shown
    assert not (tmp_path / "r").exists()
