"""Slow, readable twins of integrator kernels: numpy, one design point, no prediction of forces."""

from __future__ import annotations

import newmark_reference as newmark
import numpy as np
import scipy.linalg as la


def central_difference(system, design, h, n_steps, q, v):
    """Leap-frog with implicit modal damping and extrapolated velocities for friction."""
    c, a = design.c, newmark.acceleration(system, design, q, v)
    half = v + h / 2 * a
    states = [(q, v)]
    for _ in range(n_steps):
        q = q + h * half
        guess = half + h / 2 * a
        force = newmark.acceleration(system, design, q, guess) + c * guess
        after = (half + h * (force - c * half / 2)) / (1 + h * c / 2)
        v, a, half = (half + after) / 2, (after - half) / h, after
        states.append((q, v))
    return np.array(states)


def generalised_alpha(system, design, h, n_steps, q, v, rho):
    """Chung & Hulbert 1993 as printed, solved by Newton with a difference Jacobian."""
    am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma, beta = 0.5 - am + af, 0.25 * (1 - am + af) ** 2
    a = newmark.acceleration(system, design, q, v)
    states = [(q, v)]
    for _ in range(n_steps):

        def end(a1, q=q, v=v, a=a):
            q1 = q + h * v + h * h * ((0.5 - beta) * a + beta * a1)
            return q1, v + h * ((1 - gamma) * a + gamma * a1)

        def imbalance(a1, q=q, v=v, a=a, end=end):
            q1, v1 = end(a1)
            inner = (1 - af) * q1 + af * q, (1 - af) * v1 + af * v
            return (1 - am) * a1 + am * a - newmark.acceleration(system, design, *inner)

        a1 = a
        for _ in range(30):
            R = imbalance(a1)
            size = 1e-3 * (1 + np.abs(a1).max())
            J = np.column_stack([(imbalance(a1 + size * e) - R) / size for e in np.eye(len(a))])
            step = np.linalg.solve(J, R)
            a1 = a1 - step
            if np.linalg.norm(step) <= 1e-11 * np.linalg.norm(a1) + 1e-13:
                break
        q, v = end(a1)
        a = a1
        states.append((q, v))
    return np.array(states)


def exponential_2(system, design, h, n_steps, q, v):
    """Free modes by expm, forces beyond them held, then linear over the step (PEC)."""
    n = system.n
    L = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(system.omega2), -np.diag(design.c)]])
    E, one = la.expm(h * L), np.eye(2 * n)
    held = np.linalg.solve(L, E - one)  # h phi_1
    ramp = np.linalg.solve(L, held - h * one) / h  # h phi_2

    def beyond(y):
        free = design.c * y[n:] + system.omega2 * y[:n]
        g = newmark.acceleration(system, design, y[:n], y[n:]) + free
        return np.concatenate([np.zeros(n), g])

    y = np.concatenate([q, v])
    g = beyond(y)
    states = [(q, v)]
    for _ in range(n_steps):
        guess = E @ y + held @ g
        new = beyond(guess)
        y, g = guess + ramp @ (new - g), new
        states.append((y[:n], y[n:]))
    return np.array(states)
