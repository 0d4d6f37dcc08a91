"""Sparse factors: one interface over SuperLU and, where installed, PARDISO and CHOLMOD.

PARDISO comes with the extra `mkl`, CHOLMOD (by cholespy, large definite matrices) with `large`.

Cholesky factors F^T F of symmetric positive definite matrices come out of SuperLU.
"""

from __future__ import annotations

import contextlib
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextvars import ContextVar
from importlib.util import find_spec
from typing import Any, ParamSpec, Protocol, TypeVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.errors import ConvergenceError
from squealstudy.faults import raise_if_memory

SINGULAR = "singular"  # status of the failure
# largest backward error of a trial after which solves are not refined: round-off is 1e-15, and what
# a refined solve leaves of b is no smaller then, however large it is beside b
PLAIN_ERROR = 1e-14
# rows from which CHOLMOD is taken; of a brake's 48,588 it takes 6.3 s of a core for the factor and
# 0.9 s for 64 right-hand sides, SuperLU 5.1 and 1.2 s: a reduction has about a thousand
CHOLMOD_MIN_ROWS = 50_000
RHS_PER_SOLVE = 64  # right-hand sides a call: SuperLU works on copies, this bounds them
CHOLMOD_BLOCK = 8  # of 115,959 rows 4 to 8 at once take 0.039 s of a core each, 64 0.044, 1 0.113
DENSE_FILL_RATIO = 0.2  # of all entries: a projected assembly is block by block full
# smaller matrices stay with SuperLU: time does not matter, and its bits are repeatable
LEAST_FULL = 1000
# a pivot below this share of its diagonal entry is the round-off of a singular matrix
LEAST_PIVOT = 1e-12

FEW_ROWS = 200  # fewer rows are solved faster than a thread starts (0.1 ms)

PARDISO_DEFINITE, PARDISO_UNSYMMETRIC = 2, 11  # PARDISO's types of real matrices

MODULES = {"pardiso": "pypardiso", "cholmod": "cholespy"}
LABELS = {"pardiso": "PARDISO", "cholmod": "CHOLMOD", "superlu": "SuperLU"}

P = ParamSpec("P")
R = TypeVar("R")
_threads: ContextVar[int] = ContextVar("threads", default=1)


@contextlib.contextmanager
def solve_threads(count: int) -> Iterator[None]:
    """Threads for what can be shared inside the context: solves with many right-hand sides."""
    token = _threads.set(count)
    try:
        yield
    finally:
        _threads.reset(token)


def threads_to_share() -> int:
    """How many threads may work at once here."""
    return _threads.get()


def side_by_side(rows: int) -> Executor:
    """A pool of that many threads; each of them shares its own solves with no other.

    Of systems of few `rows`, where starting a thread takes longer than its work, it does what it
    is given at once.
    """
    return AtOnce() if rows < FEW_ROWS else ThreadPoolExecutor(_threads.get())


class AtOnce(Executor):
    """Runs what it is given, at once, in the same thread."""

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """A future that is done; an exception is raised by its ``result``."""
        future: Future[R] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Factor(Protocol):
    """A factorised sparse matrix."""

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution of A x = b, b real or complex, (n,) or (n, k)."""
        ...


def factorise(
    A: sp.spmatrix | np.ndarray, backend: str = "auto", definite: bool = False
) -> RefinedFactor:
    """Factorise a real sparse matrix of symmetric pattern, or a dense definite one.

    Parameters
    ----------
    A : sparse (n, n)
        Definite, or nearly: pivots stay on the diagonal, refinement repairs the rest. A dense one
        is LAPACK's, whatever the backend.
    backend : str
        ``pardiso``, ``cholmod`` (a definite A alone) or ``superlu``; ``auto``: PARDISO where it is
        installed, CHOLMOD where it is, the matrix is `definite` and has CHOLMOD_MIN_ROWS rows,
        else SuperLU.
    definite : bool
        Whether A is symmetric and positive definite.

    Raises
    ------
    ConvergenceError
        ``singular``, where SuperLU meets a zero pivot, CHOLMOD or LAPACK one that is not positive.
    """
    if isinstance(A, np.ndarray):
        return DenseCholesky(A)
    if backend == "auto":
        backend = automatic_backend(A.shape[0], definite)
    if backend == "pardiso":
        return PardisoFactor(A, definite)
    return CholmodFactor(A) if backend == "cholmod" else SuperLUFactor(A)


def automatic_backend(n: int, definite: bool) -> str:
    """Backend that ``auto`` chooses for a sparse matrix of n rows."""
    preferred = {"pardiso": True, "cholmod": definite and n >= CHOLMOD_MIN_ROWS}
    installed = (name for name, use in preferred.items() if use and find_spec(MODULES[name]))
    return next(installed, "superlu")


def is_definite(A: sp.spmatrix) -> bool:
    """Whether a symmetric sparse A (n, n) is positive definite, beyond round-off."""
    try:
        if A.shape[0] >= CHOLMOD_MIN_ROWS and find_spec(MODULES["cholmod"]):
            CholmodFactor(A)
        else:
            SparseCholesky(A)
    except ConvergenceError:
        return False
    return True


def symmetric_lu(A: sp.spmatrix) -> spla.SuperLU:
    """SuperLU in symmetric mode: pivots on the diagonal, minimum-degree ordering of A + A^T.

    Raises
    ------
    RuntimeError
        SuperLU's own, "Factor is exactly singular", where a pivot is zero.
    """
    return spla.splu(
        A.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


class RefinedFactor(ABC):
    """Solves with a real sparse A (n, n), refined, over a real `solve_once`.

    Attributes
    ----------
    A : csr_matrix (n, n)
    """

    A: sp.csr_matrix

    def __reduce__(self) -> tuple[type[RefinedFactor], tuple[Any, ...]]:
        """Factorised anew where it is unpickled."""
        return type(self), (self.A,)

    @abstractmethod
    def solve_once(self, b: np.ndarray) -> np.ndarray:
        """Solution of a real b without refinement: half the time, some digits less."""

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve with one step of iterative refinement; see `Factor.solve`."""
        if np.iscomplexobj(b):
            stacked = np.column_stack([b.real.reshape(len(b), -1), b.imag.reshape(len(b), -1)])
            x = self.solve(stacked)
            half = x.shape[1] // 2
            return (x[:, :half] + 1j * x[:, half:]).reshape(b.shape)
        x = self.solve_once(b)
        return x + self.solve_once(b - self.A @ x)

    @property
    def plain_error(self) -> float:
        """Largest |b - A x| / (|A| |x| + |b|) of an unrefined solve of some b, row by row.

        The componentwise backward error (Oettli and Prager 1964).
        """
        b = np.random.default_rng(0).standard_normal(self.A.shape[0])
        x = self.solve_once(b)
        size = abs(self.A) @ np.abs(x) + np.abs(b)
        return float((np.abs(b - self.A @ x) / size).max())

    def lean(self) -> Callable[[np.ndarray], np.ndarray]:
        """Solutions of a real b, without refinement where a trial shows that it is not needed.

        Half the time.
        """
        return self.solve_once if self.plain_error <= PLAIN_ERROR else self.solve


def is_full(A: sp.spmatrix) -> bool:
    """Whether a sparse matrix (k, n) has so many entries that LAPACK is faster."""
    k, n = A.shape
    return n >= LEAST_FULL and bool(A.nnz > DENSE_FILL_RATIO * k * n)


class FullLU:
    """LU of a sparse matrix that is full, by LAPACK; its solves are called as SuperLU's are."""

    def __init__(self, A: sp.spmatrix | np.ndarray) -> None:
        full = A if isinstance(A, np.ndarray) else A.toarray()
        self._lu, self._pivots, lapack_status = la.lapack.get_lapack_funcs("getrf", (full,))(full)
        if lapack_status > 0:
            raise RuntimeError("Factor is exactly singular")

    def solve(self, b: np.ndarray, trans: str = "N") -> np.ndarray:
        """Solution of A x = b, or with the transposed (T) or adjoint (H) of A."""
        how = ("N", "T", "H").index(trans)
        x: np.ndarray = la.lu_solve((self._lu, self._pivots), b, trans=how, check_finite=False)
        return x


class SuperLUFactor(RefinedFactor):
    """A sparse LU factorisation by SuperLU, pivots on the diagonal; by LAPACK of a full matrix."""

    _lu: Any
    _of: Callable[[sp.spmatrix], Any] = staticmethod(
        lambda A: FullLU(A) if is_full(A) else symmetric_lu(A)
    )

    def __init__(self, A: sp.spmatrix) -> None:
        self.A = A.tocsr()
        try:
            self._lu = self._of(A)
        except RuntimeError as error:  # "Factor is exactly singular"
            raise_if_memory(error)
            raise ConvergenceError(SINGULAR, f"a stiffness matrix is singular ({error})") from error

    def solve_once(self, b: np.ndarray) -> np.ndarray:
        """See `RefinedFactor.solve_once`; in parts."""
        if b.ndim == 1 or b.shape[1] <= RHS_PER_SOLVE:
            return self._lu.solve(np.ascontiguousarray(b))
        parts = [b[:, i : i + RHS_PER_SOLVE] for i in range(0, b.shape[1], RHS_PER_SOLVE)]
        with side_by_side(len(b)) as pool:  # SuperLU lets go of the interpreter
            return np.hstack(list(pool.map(self._lu.solve, parts)))


class PardisoFactor(RefinedFactor):
    """A sparse factorisation by MKL PARDISO (extra `mkl`), of a definite A by half of it."""

    def __init__(self, A: sp.spmatrix, definite: bool = False) -> None:
        from pypardiso import PyPardisoSolver
        from pypardiso.pardiso_wrapper import PyPardisoError

        self.A, self._definite = A.tocsr(), definite
        self._held = sp.triu(self.A, format="csr") if definite else self.A
        self._solver = PyPardisoSolver(PARDISO_DEFINITE if definite else PARDISO_UNSYMMETRIC)
        weakref.finalize(self, self._solver.free_memory, everything=True)  # it does not by itself
        try:
            self._solver.factorize(self._held)
        except PyPardisoError as error:  # a pivot that is not positive
            raise ConvergenceError(SINGULAR, f"a stiffness matrix is singular ({error})") from error

    def __reduce__(self) -> tuple[type[RefinedFactor], tuple[Any, ...]]:
        """Factorised anew where it is unpickled."""
        return type(self), (self.A, self._definite)

    def solve_once(self, b: np.ndarray) -> np.ndarray:
        """See `RefinedFactor.solve_once`."""
        return self._solver.solve(self._held, np.asfortranarray(b))


class CholmodFactor(RefinedFactor):
    """A sparse Cholesky factorisation by CHOLMOD (extra `large`), of a definite A alone."""

    def __init__(self, A: sp.spmatrix) -> None:
        from cholespy import CholeskySolverD, MatrixType

        self.A = A.tocsr()
        try:
            self._solver = CholeskySolverD(
                self.A.shape[0],
                self.A.indptr.astype(np.int32),
                self.A.indices.astype(np.int32),
                self.A.data,
                MatrixType.CSR,
            )
        except ValueError as error:  # "Matrix is not positive definite!"
            raise ConvergenceError(SINGULAR, f"a stiffness matrix is singular ({error})") from error

    def solve_once(self, b: np.ndarray) -> np.ndarray:
        """See `RefinedFactor.solve_once`; in parts."""
        x = np.empty(b.shape)
        if b.ndim == 1:
            self._solver.solve(np.ascontiguousarray(b, dtype=float), x)
            return x
        for i in range(0, b.shape[1], CHOLMOD_BLOCK):
            part = np.ascontiguousarray(b[:, i : i + CHOLMOD_BLOCK], dtype=float)
            solution = np.empty_like(part)
            self._solver.solve(part, solution)
            x[:, i : i + CHOLMOD_BLOCK] = solution
        return x


class DenseCholesky(RefinedFactor):
    """A Cholesky factorisation of a dense definite matrix (n, n) by LAPACK."""

    def __init__(self, A: np.ndarray) -> None:
        self.A = A
        try:
            self._factor = la.cho_factor(A)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(SINGULAR, f"a stiffness matrix is singular ({error})") from error

    def solve_once(self, b: np.ndarray) -> np.ndarray:
        """See `RefinedFactor.solve_once`."""
        x: np.ndarray = la.cho_solve(self._factor, b)
        return x


class SparseCholesky(SuperLUFactor):
    """F with F^T F = A, by its products.

    SuperLU with pivots on the diagonal of a symmetric matrix gives P A P^T = L D L^T, so that
    F = D^(1/2) L^T P. F^-1 z is A^-1 F^T z, which needs no triangular solve of its own.

    Parameters
    ----------
    A : sparse (n, n)
        Symmetric.

    Raises
    ------
    ConvergenceError
        ``singular``, where A is not positive definite.
    """

    _of = staticmethod(symmetric_lu)

    def __init__(self, A: sp.spmatrix) -> None:
        super().__init__(A)
        order = self._lu.perm_c
        pivots = self._lu.U.diagonal()
        diagonal = np.empty(len(order))
        diagonal[order] = self.A.diagonal()
        if (order != self._lu.perm_r).any() or (pivots <= LEAST_PIVOT * np.abs(diagonal)).any():
            raise ConvergenceError(SINGULAR, "a stiffness matrix is not positive definite")
        self._order = order
        self._back = np.argsort(order)
        self._lower = (self._lu.L @ sp.diags(np.sqrt(pivots))).tocsr()

    def root(self, X: np.ndarray) -> np.ndarray:
        """F X, real (n, m)."""
        product: np.ndarray = self._lower.T @ X[self._back]
        return product

    def from_root(self, Z: np.ndarray) -> np.ndarray:
        """F^-1 Z, real (n, m)."""
        return self.solve((self._lower @ Z)[self._order])
