"""A slow, readable twin of the Newmark kernel: numpy, one design point, Newton at every step."""

from __future__ import annotations

import numpy as np

from squealstudy.motion.system import ModalSystem, MotionPoint


def mu_of(f, s):
    ratio, v_mu = f.curve.parameters
    return f.friction * (1 + (ratio - 1) * np.exp(-s / v_mu))


def friction_force(system, design, p, W):
    """Friction forces (nc, 2) at pressures p (nc,) and sliding velocities W (nc, 2)."""
    f = design.friction
    s = np.linalg.norm(W, axis=1)
    bound = mu_of(f, s) * system.frictional * np.maximum(p, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        if f.regularisation == "smooth":
            size = np.where(bound > 0, bound * np.tanh(f.k_t * s / bound), 0.0)
        else:
            size = np.minimum(f.k_t * s, bound)
        unit = np.where(s[:, None] > 0, W / s[:, None], 0.0)
    return -(system.area * size)[:, None] * unit


def forces(system, design, q, v):
    """Generalised contact forces beyond the reference, with the reference stiffness taken out."""
    x = system.N @ q
    p, _ = design.contact.evaluate(system.gap + x)
    speed = design.speed * system.speed_factor
    W = np.column_stack([speed + system.T1 @ v, system.T2 @ v])
    t = friction_force(system, design, p, W) - system.force[:, 1:]
    normal = system.area * p - system.force[:, 0] + system.k_ref * x
    return system.N.T @ normal + system.T1.T @ t[:, 0] + system.T2.T @ t[:, 1]


def acceleration(system, design, q, v):
    """q'' of the equation of motion."""
    U, n, m = system.shapes, system.n, len(system.shapes)
    load = np.zeros(n) if design.load is None else design.load
    d = np.zeros(m) if design.d is None else design.d
    s = np.zeros(m) if design.s is None else design.s
    linear = design.c * v + system.omega2 * q + U.T @ (d * (U @ v) + s * (U @ q))
    if design.damping_between is not None:
        linear = linear + design.damping_between @ v
    return load - linear + forces(system, design, q, v)


def newmark(system: ModalSystem, design: MotionPoint, h, n_steps, q, v):
    """Average acceleration; returns the states (n_steps + 1, 2, n)."""
    a = acceleration(system, design, q, v)
    states = [(q, v)]
    for _ in range(n_steps):
        qb, vb = q + h * v + h * h / 4 * a, v + h / 2 * a

        def imbalance(x, qb=qb, vb=vb):
            return x - acceleration(system, design, qb + h * h / 4 * x, vb + h / 2 * x)

        for _ in range(30):
            R = imbalance(a)
            size = 1e-3 * (1 + np.abs(a).max())
            J = np.column_stack([(imbalance(a + size * e) - R) / size for e in np.eye(len(a))])
            step = np.linalg.solve(J, R)
            a = a - step
            if np.linalg.norm(step) <= 1e-11 * np.linalg.norm(a) + 1e-13:
                break
        q, v = qb + h * h / 4 * a, vb + h / 2 * a
        states.append((q, v))
    return np.array(states)
