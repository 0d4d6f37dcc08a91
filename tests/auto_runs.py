"""AUTO-07p as an outside judge: equilibria to a Hopf point, then cycles from there.

Debian packages `auto-07p` and `gfortran`. What it prints of multipliers has six digits.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass

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
SUBROUTINE BCND
END SUBROUTINE
SUBROUTINE ICND
END SUBROUTINE
SUBROUTINE FOPT
END SUBROUTINE
SUBROUTINE PVLS
END SUBROUTINE
"""
SCRIPT = """\
common = dict(e='model', NDIM={n}, NTST=100, NCOL=4, IAD=3, NPR=0, IID=2, ISP=2,
              EPSL=1e-10, EPSU=1e-10, EPSS=1e-8, RL0={low!r}, RL1={high!r})
r = run(IPS=1, ICP=[1], ILP=0, DS={step!r}, DSMIN=1e-7, DSMAX={largest!r}, NMX=400, **common)
save(r, 'steady')
c = run(r('HB1'), IPS=2, ICP=[1, 11], ISW=1, ILP=1, DS={first!r}, DSMIN=1e-7, DSMAX={far!r},
        NMX={count}, UZR={{1: {at!r}}}, SP=['UZ{zeros}'], **common)
save(c, 'cycles')
"""
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d+)(?:e([-+]\d+))?(?![\dD])")  # in double precision
MULTIPLIER = re.compile(
    r"^\s*-?\d+\s+(\d+)\s+Multiplier\s+\d+\s+(\S+)\s+(\S+)\s+Abs", flags=re.MULTILINE
)


@dataclass(frozen=True)
class AutoPoint:
    """A labelled point: type, parameter, L2 norm, period, multipliers with the trivial one."""

    kind: str
    parameter: float
    norm: float
    period: float
    multipliers: tuple[complex, ...]


def auto_cycles(folder, equations, n, start, state=None, **settings):
    """Labelled points of the equilibria, and of the cycles from their first Hopf point.

    `equations` are lines of Fortran that set F from U and PAR(1).
    """
    lines = [f"U({i + 1})={value!r}" for i, value in enumerate(state or [0.0] * n)]
    text = FORTRAN.format(equations=equations, start=start, state="\n".join(lines))
    text = NUMBER.sub(lambda m: f"{m[1]}D{m[2] or 0}", text)
    (folder / "model.f90").write_text(text)
    defaults = {"count": 400, "first": 0.01, "far": 0.1, "largest": 0.05, "zeros": 2}
    (folder / "run.auto").write_text(SCRIPT.format(n=n, **(defaults | settings)))
    done = subprocess.run(
        ["auto-07p", "run.auto"], cwd=folder, capture_output=True, text=True, timeout=300
    )
    files = [folder / f"b.{name}" for name in ("steady", "cycles")]
    assert all(f.is_file() for f in files), done.stdout + done.stderr
    multipliers: dict[int, list[complex]] = {}
    for point, re_, im in MULTIPLIER.findall((folder / "d.cycles").read_text()):
        multipliers.setdefault(int(point), []).append(complex(float(re_), float(im)))
    return (
        [_point(row, {}, False) for row in _rows(files[0])],
        [_point(row, multipliers, True) for row in _rows(files[1])],
    )


def _rows(path):
    """Rows with a label."""
    for line in path.read_text().splitlines():
        words = line.split()
        if len(words) > 5 and words[0] != "0" and int(words[3]) != 0:
            yield words


def _point(words, multipliers, cycle):
    number = abs(int(words[1]))
    return AutoPoint(
        TYPES.get(int(words[2]), words[2]),
        float(words[4]),
        float(words[5]),
        float(words[-1]) if cycle else 0.0,
        tuple(multipliers.get(number, ())),
    )
