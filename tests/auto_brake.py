"""A brake on few coordinates, with its equations once more: in Fortran for AUTO-07p, and in numpy.

They are written from THEORY.md eqs. (1), (2), (4), (7) to (9), and share no code with the kernels:

    q'' + C q' + K q = f + N^T A p + T1^T A t1 + T2^T A t2

with q from steady sliding at the reference friction on, and K without contact. AUTO's states are
q and q' in units of `LENGTH` and of `LENGTH RATE`, by the time RATE t.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
from conftest import COARSE

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.catalogue import MODELS
from squealstudy.modes.point import linearised_point
from squealstudy.motion.point import friction_law, motion_point
from squealstudy.motion.shared_modes import project, shared_modes
from squealstudy.study.design import DesignPoint

LENGTH, RATE = 1e-6, 2 * np.pi * 3150.0  # modal displacement, rad/s
MODES = (2800.0, 3750.0)  # Hz: the assembly modes that take part in the squeal
SQUEAL = (3100.0, 3200.0)  # Hz
FORTRAN = """\
MODULE BRAKE
IMPLICIT NONE
INTEGER, PARAMETER :: N=$N, NC=$NC
DOUBLE PRECISION :: UNIT, RATE, START, STATE(2*N), K(N,N), C(N,N), F0(N)
DOUBLE PRECISION :: BN(NC,N), B1(NC,N), B2(NC,N), GAP(NC), AREA(NC), PHI(NC), SPEED(NC)
DOUBLE PRECISION :: P0, LAMBDA, KT, RATIO, DECAY, SMOOTH
LOGICAL :: READY=.FALSE.
CONTAINS
SUBROUTINE LOAD
IF(READY) RETURN
OPEN(77,FILE='brake.txt',STATUS='OLD')
READ(77,*) UNIT, RATE, START, STATE, K, C, F0, BN, B1, B2, GAP, AREA, PHI, SPEED
READ(77,*) P0, LAMBDA, KT, RATIO, DECAY, SMOOTH
CLOSE(77)
READY=.TRUE.
END SUBROUTINE
END MODULE
SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
USE BRAKE
IMPLICIT NONE
INTEGER NDIM, IJAC, ICP(*)
DOUBLE PRECISION U(NDIM), PAR(*), F(NDIM), DFDU(NDIM,*), DFDP(NDIM,*)
DOUBLE PRECISION Q(N), V(N), PULL(N), P(NC), W1(NC), W2(NC), S(NC), B(NC), T(NC)
CALL LOAD
Q=UNIT*U(1:N)
V=UNIT*RATE*U(N+1:2*N)
P=P0*EXP(-LAMBDA*(GAP+MATMUL(BN,Q)))
W1=SPEED+MATMUL(B1,V)
W2=MATMUL(B2,V)
S=SQRT(W1**2+W2**2)
B=PAR(1)*(1D0+(RATIO-1D0)*EXP(-S/DECAY))*P
IF(SMOOTH>0D0) THEN
T=B*TANH(KT*S/B)
ELSE
T=MIN(KT*S,B)
END IF
T=-PHI*T/S
PULL=F0-MATMUL(C,V)-MATMUL(K,Q)+MATMUL(AREA*P,BN)+MATMUL(AREA*T*W1,B1)+MATMUL(AREA*T*W2,B2)
F(1:N)=U(N+1:2*N)
F(N+1:2*N)=PULL/(UNIT*RATE**2)
END SUBROUTINE
SUBROUTINE STPNT(NDIM,U,PAR,T)
USE BRAKE
IMPLICIT NONE
INTEGER NDIM
DOUBLE PRECISION U(NDIM), PAR(*), T
CALL LOAD
PAR(1)=START
U=STATE
END SUBROUTINE
"""


class SmallBrake:
    """The coarse generated brake on assembly modes about its squeal, and on the complex mode.

    Parameters
    ----------
    prepared : PreparedModel
        Of the coarse brake.
    friction : float
        Of the reference: its modes, its complex mode, q = 0.
    kind : str
        Regularisation of friction.
    saturation : float
        Speed at which friction reaches its bound, m/s.
    values : dict
        Parameters of the brake.
    """

    def __init__(self, prepared, friction, kind, saturation, values):
        model = MODELS["disc_brake"]
        options = {o.name: o.choices[0] for o in model.options} | COARSE
        values = model.defaults() | values | {"friction": friction}
        state = DesignPoint(model, options, values).state()
        steady, _ = linearised_point(prepared, state)
        whole = shared_modes(prepared.model, steady, state)
        reference = project(whole, _basis(whole))
        law = friction_law(prepared.model, state, steady, 0.0, saturation, kind)
        self.system = reference.system
        made = motion_point(reference, steady, state, law, None, 1e-9)
        p = np.exp(-made.contact.parameters[1] * made.gap) * made.contact.parameters[0]
        self.reference = replace(made, force=self._forces(made, p))

    @cached_property
    def equations(self):
        """C, K, f: what is linear, and the load."""
        s, base = self.system, self.reference
        osc = ContactOscillator(s, base).oscillator
        K = osc.K - s.N.T @ (s.k_ref[:, None] * s.N)
        return osc.C, K, -(s.N.T @ base.force[:, 0] + s.T1.T @ base.force[:, 1])

    def _forces(self, point, p):
        """Normal and friction forces (nc, 3) of steady sliding, by pressures."""
        s, law = self.system, point.friction
        t = _traction(law, p, point.speed * s.speed_factor)
        return np.column_stack([s.area * p, -s.area * s.frictional * t, 0.0 * p])

    def steady(self, friction):
        """q of steady sliding, and its design point."""
        s, (_, K, load) = self.system, self.equations
        point = replace(
            self.reference, friction=replace(self.reference.friction, friction=friction)
        )
        p0, rate = point.contact.parameters
        q = np.zeros(s.n)
        for _ in range(40):
            gap = self.reference.gap + s.N @ q
            p = p0 * np.exp(-rate * gap)
            force = self._forces(point, p)
            R = load + s.N.T @ force[:, 0] + s.T1.T @ force[:, 1] - K @ q
            # near enough where friction has all but reached its bound
            slope = -rate * (s.N.T @ (force[:, :1] * s.N) + s.T1.T @ (force[:, 1:2] * s.N)) - K
            step = la.solve(slope, R)
            change = rate * np.abs(s.N @ step).max()
            if change < 1e-13:
                return q, replace(point, gap=gap, force=force)
            q = q - step / max(1.0, change)
        raise AssertionError("no steady sliding")

    def at(self, friction):
        """The house's oscillator about steady sliding."""
        return ContactOscillator(self.system, self.steady(float(friction))[1])

    def torque(self, friction, states):
        """Of the friction forces at AUTO's states (S, 2 n), N m."""
        s, point = self.system, self.reference
        q, v = LENGTH * states[:, : s.n], LENGTH * RATE * states[:, s.n :]
        p0, rate = point.contact.parameters
        p = p0 * np.exp(-rate * (point.gap + q @ s.N.T))
        w1, w2 = point.speed * s.speed_factor + v @ s.T1.T, v @ s.T2.T
        sliding = np.hypot(w1, w2)
        t = _traction(replace(point.friction, friction=friction), p, sliding)
        return (t * w1 / sliding) @ (s.radius * s.area * s.frictional)

    def write(self, folder, friction):
        """The data of the program that is returned, for a start at steady sliding."""
        s, point, law = self.system, self.reference, self.reference.friction
        C, K, load = self.equations
        start = np.concatenate([self.steady(friction)[0] / LENGTH, np.zeros(s.n)])
        arrays = [K, C, load, s.N, s.T1, s.T2, point.gap, s.area, s.frictional]
        values = [LENGTH, RATE, friction, *start, *(x for A in arrays for x in A.ravel("F"))]
        values += [*(point.speed * s.speed_factor), *point.contact.parameters, law.k_t]
        values += [*law.curve.parameters, float(law.regularisation == "smooth")]
        lines = [repr(float(x)) for x in values]
        (folder / "brake.txt").write_text("\n".join(lines) + "\n")
        return FORTRAN.replace("$NC", str(len(s.area))).replace("$N", str(s.n))


def _traction(law, p, s):
    """Friction at pressures and sliding speeds, Pa: THEORY.md eqs. (7) to (9)."""
    ratio, decay = law.curve.parameters
    bound = law.friction * (1 + (ratio - 1) * np.exp(-s / decay)) * p
    if law.regularisation == "smooth":
        return bound * np.tanh(law.k_t * s / bound)
    return np.minimum(law.k_t * s, bound)


def _basis(whole):
    """Columns (n, r): assembly modes, and what the complex mode of the squeal has beyond them."""
    omega = whole.system.frequencies
    hz = omega / (2 * np.pi)
    kept = np.eye(len(hz))[:, (hz > MODES[0]) & (hz < MODES[1])]
    lam, psi = dense_roots(whole.C, whole.K, tuple(2 * np.pi * x for x in SQUEAL))
    mode = psi[:, np.argmax(lam.real)] * omega
    mode = mode * np.exp(-0.5j * np.angle(mode @ mode))
    beyond = np.column_stack([mode.real, mode.imag])
    beyond = la.orth(beyond - kept @ (kept.T @ beyond)) / omega[:, None]
    basis, _ = la.qr(np.hstack([kept, beyond]), mode="economic")
    _, turn = la.eigh(basis.T @ (whole.system.omega2[:, None] * basis))
    return basis @ turn
