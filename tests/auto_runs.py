"""AUTO-07p as an outside judge: equilibria to a Hopf point, then cycles from there.

Debian packages `auto-07p` and `gfortran`. What it prints of multipliers has six digits.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass

import numpy as np

MISSING = [name for name in ("auto-07p", "gfortran") if shutil.which(name) is None]
TYPES = {-4: "UZ", 3: "HB", 5: "LP", 7: "PD", 8: "TR", 9: "EP", -9: "MX", 1: "BP", -1: "HB"}
FORTRAN = """\
SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
IMPLICIT NONE
INTEGER NDIM, IJAC, ICP(*)
DOUBLE PRECISION U(NDIM), PAR(*), F(NDIM), DFDU(NDIM,*), DFDP(NDIM,*), N, M, X1, X2
{equations}
END SUBROUTINE
SUBROUTINE STPNT(NDIM,U,PAR,T)
IMPLICIT NONE
INTEGER NDIM
DOUBLE PRECISION U(NDIM), PAR(*), T
PAR(1)={start!r}
{state}
END SUBROUTINE
"""
UNUSED = "".join(
    f"SUBROUTINE {name}\nEND SUBROUTINE\n" for name in ("BCND", "ICND", "FOPT", "PVLS")
)
SCRIPT = """\
common = dict(e='model', NDIM={n}, NTST={mesh}, NCOL=4, IAD=3, NPR=0, IID=2, ISP=2,
              EPSL=1e-10, EPSU=1e-10, EPSS=1e-8, RL0={low!r}, RL1={high!r})
r = run(IPS=1, ICP=[1], ILP=0, DS={step!r}, DSMIN=1e-7, DSMAX={largest!r}, NMX=400, **common)
save(r, 'steady')
c = run(r('HB1'), IPS=2, ICP=[1, 11], ISW=1, ILP=1, DS={first!r}, DSMIN=1e-7, DSMAX={far!r},
        NMX={count}, UZR={{1: {at!r}}}, SP=['UZ{zeros}'], **common)
save(c, 'cycles')
"""
FOLDS = """\
folds = dict(IPS=2, ICP=[1, 11, 2], ISW=2, ILP=0, DSMIN=1e-7, DSMAX=0.1)
begun = run(c('LP1'), DS=0.01, NMX=5, **folds, **common)
save(run(begun, DS=0.01, NMX={count}, **folds, **common)
     + run(begun, DS=-0.01, NMX={count}, **folds, **common), 'folds')
"""
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d+)(?:e([-+]\d+))?(?![\dD])")  # in double precision
MULTIPLIER = re.compile(
    r"^\s*-?\d+\s+(\d+)\s+Multiplier\s+\d+\s+(\S+)\s+(\S+)\s+Abs", flags=re.MULTILINE
)


@dataclass(frozen=True)
class AutoPoint:
    """A labelled point: type, parameter, L2 norm, period, multipliers with the trivial one.

    Of cycles also times (4 k + 1,) over the period in k intervals of four steps, and the states
    (4 k + 1, n) there.
    """

    kind: str
    parameter: float
    norm: float
    period: float
    multipliers: tuple[complex, ...]
    times: np.ndarray
    states: np.ndarray

    def mean(self, f):
        """Over the period, of values (4 k + 1,) at the times, by Boole's rule."""
        weights = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0
        return sum(
            (self.times[k + 4] - self.times[k]) * weights @ f[k : k + 5]
            for k in range(0, len(f) - 1, 4)
        )


def auto_cycles(folder, equations, n, start, state=None, second=None, **settings):
    """Labelled points of the equilibria, and of the cycles from their first Hopf point.

    `equations` are lines of Fortran that set F from U, PAR(1), and PAR(2), which is `second`.
    """
    lines = [f"U({i + 1})={value!r}" for i, value in enumerate(state or [0.0] * n)]
    lines += [] if second is None else [f"PAR(2)={second!r}"]
    text = FORTRAN.format(equations=equations, start=start, state="\n".join(lines))
    return run_auto(folder, NUMBER.sub(lambda m: f"{m[1]}D{m[2] or 0}", text), n, **settings)


def auto_folds(folder, equations, n, start, second, count, **settings):
    """The first fold of cycles continued over PAR(2), both ways: PAR(1), period, PAR(2) (m, 3)."""
    more = FOLDS.format(count=count)
    auto_cycles(folder, equations, n, start, second=second, more=more, **settings)
    rows = (line.split() for line in (folder / "b.folds").read_text().splitlines())
    own = [w for w in rows if len(w) > 5 and w[0] != "0"]
    return np.array([[float(w[4]), *map(float, w[-2:])] for w in own])


def run_auto(folder, program, n, more="", **settings):
    """As `auto_cycles`, of a whole program in Fortran with n states; `more` ends the script."""
    (folder / "model.f90").write_text(program + UNUSED)
    defaults = {"count": 400, "first": 0.01, "far": 0.1, "largest": 0.05, "zeros": 2, "mesh": 100}
    (folder / "run.auto").write_text(SCRIPT.format(n=n, **(defaults | settings)) + more)
    done = subprocess.run(
        ["auto-07p", "run.auto"], cwd=folder, capture_output=True, text=True, timeout=300
    )
    files = [folder / f"b.{name}" for name in ("steady", "cycles")]
    assert all(f.is_file() for f in files), done.stdout + done.stderr
    multipliers: dict[int, list[complex]] = {}
    for point, re_, im in MULTIPLIER.findall((folder / "d.cycles").read_text()):
        multipliers.setdefault(int(point), []).append(complex(float(re_), float(im)))
    solutions = dict(_solutions(folder / "s.cycles"))
    return (
        [_point(row, {}, {}) for row in _rows(files[0])],
        [_point(row, multipliers, solutions) for row in _rows(files[1])],
    )


def _rows(path):
    """Rows with a label."""
    for line in path.read_text().splitlines():
        words = line.split()
        if len(words) > 5 and words[0] != "0" and int(words[3]) != 0:
            yield words


def _solutions(path):
    """Times and states by label: a line of integers, rows of (time, states), other lines."""
    lines = iter(path.read_text().splitlines())
    for line in lines:
        head = [int(x) for x in line.split()]
        label, points, width, count = head[3], head[6], head[7], head[8]
        rest = " ".join(next(lines) for _ in range(count)).split()
        rows = np.array(rest[: points * width], dtype=float).reshape(points, width)
        yield label, (rows[:, 0], rows[:, 1:])


def _point(words, multipliers, solutions):
    number = abs(int(words[1]))
    nothing = np.zeros(0), np.zeros((0, 0))
    return AutoPoint(
        TYPES.get(int(words[2]), words[2]),
        float(words[4]),
        float(words[5]),
        float(words[-1]) if solutions else 0.0,
        tuple(multipliers.get(number, ())),
        *solutions.get(int(words[3]), nothing),
    )
