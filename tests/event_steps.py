"""Steps of DOP853 between located events, for the judge `event_reference`.

The coefficients are those of [Hairer, Norsett & Wanner 1993] as scipy has them. A step at whose end
a phase has been left is shortened by bisection until the event is within round-off of its end.
"""

from __future__ import annotations

import numpy as np
from event_laws import N_ROWS, STICK, TORQUE, Case, D, V, compiled, enter, left, rate
from scipy.integrate._ivp import dop853_coefficients as dop853

STAGES = dop853.N_STAGES
A = np.ascontiguousarray(dop853.A[:STAGES, :STAGES])
B = np.ascontiguousarray(dop853.B)
E3 = np.ascontiguousarray(dop853.E3)
E5 = np.ascontiguousarray(dop853.E5)
INSIDE = (0.25, 0.5, 0.75)  # of a step: where it is looked for events that come in pairs
BISECTIONS = 60
MOST_EVENTS = 10_000  # within one sample: phases that chatter
MOST_STEPS = 20_000  # within one sample: motion that runs away, as of contact that softens
STABLE = 3.0  # step times the rate of a decay; DOP853 is stable up to 6
LEAST = 1e-13  # of a sample: a step that is not made shorter

DONE, CHATTERS, NOT_FINITE = range(3)


@compiled
def trial(case: Case, y, phases, opened, h, k, end, work):
    """One step h from y, whose rate is in k[0], to `end`; rates of all stages in k (STAGES + 1)."""
    for s in range(1, STAGES):
        work[:] = y
        for j in range(s):
            if A[s, j] != 0.0:
                for m in range(V + 2):
                    work[m] += h * A[s, j] * k[j, m]
        rate(case, work, phases, opened, k[s])
    end[:] = y
    for j in range(STAGES):
        if B[j] != 0.0:
            for m in range(N_ROWS):
                end[m] += h * B[j] * k[j, m]
    rate(case, end, phases, opened, k[STAGES])


@compiled
def error(y, end, h, k, tolerance, floor, omega):
    """Error of displacements and velocities over what is allowed, as scipy's DOP853 has it."""
    size = floor
    for j in range(2):
        size = max(size, abs(y[V + j]), abs(end[V + j]))
        size = max(size, omega * abs(y[D + j]), omega * abs(end[D + j]))
    e3 = 0.0
    e5 = 0.0
    for m in range(V + 2):
        scale = tolerance * size / (omega if m < V else 1.0)
        three = 0.0
        five = 0.0
        for j in range(STAGES + 1):
            three += E3[j] * k[j, m]
            five += E5[j] * k[j, m]
        e3 += (three / scale) ** 2
        e5 += (five / scale) ** 2
    if e3 == 0.0 and e5 == 0.0:
        return 0.0
    return h * e5 / np.sqrt((e5 + 0.01 * e3) * 4.0)


@compiled
def between(y, end, h, k, theta, out):
    """Displacements and velocities at a share of a step, by cubics."""
    a = (1.0 + 2.0 * theta) * (1.0 - theta) ** 2
    b = theta * (1.0 - theta) ** 2
    c = theta**2 * (3.0 - 2.0 * theta)
    d = theta**2 * (theta - 1.0)
    out[:] = y
    for m in range(V + 2):
        out[m] = a * y[m] + b * h * k[0, m] + c * end[m] + d * h * k[STAGES, m]


@compiled
def locate(case: Case, y, phases, opened, low, high, k, end, work):
    """The shortest step at whose end a phase is left, between one before and one behind it."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        trial(case, y, phases, opened, middle, k, end, work)
        if left(case, end, phases, opened):
            high = middle
        else:
            low = middle
    trial(case, y, phases, opened, high, k, end, work)
    return high


@compiled
def first_inside(case: Case, y, phases, opened, h, k, end, work):
    """The first share of a step at which a phase is left, 1 where none is."""
    for theta in INSIDE:
        between(y, end, h, k, theta, work)
        if left(case, work, phases, opened):
            return theta
    return 1.0


@compiled
def longest(case: Case, phases):
    """Step at which sticking friction, which decays at k_t A T^2 / m, leaves no ripple."""
    fastest = 0.0
    for i in range(len(case.area)):
        if phases[i] == STICK and case.slope < np.inf:
            size = case.T[i, 0] ** 2 + case.T[i, 1] ** 2
            fastest = max(fastest, case.slope * case.area[i] * size / case.mass)
    return STABLE / fastest if fastest > 0.0 else np.inf


@compiled
def integrate(case: Case, y, sample, rows, extremes, tolerance, floor, omega):
    """States at equal times `sample` [s] apart into rows (n + 1, N_ROWS + 2).

    Behind a state stand torque and normal force. `extremes` (n, 2) are the least and the largest
    torque from one sample to the next, at the ends of all steps, events among them. Returns how it
    ended and the number of events.
    """
    n = len(extremes)
    points = len(case.area)
    phases, opened = np.zeros(points, np.int64), np.zeros(points, np.bool_)
    enter(case, y, phases, opened)
    k, end, work = np.zeros((STAGES + 1, N_ROWS)), np.zeros(N_ROWS), np.zeros(N_ROWS)
    events = 0
    rate(case, y, phases, opened, k[0])
    rows[0, :N_ROWS], rows[0, N_ROWS], rows[0, N_ROWS + 1] = y, k[0, TORQUE], k[0, TORQUE + 2]
    h_next = 0.01 * sample
    for row in range(n):
        done, here, steps = 0.0, 0, 0
        extremes[row] = k[0, TORQUE]
        while done < sample * (1.0 - LEAST):
            steps += 1
            if steps > MOST_STEPS:
                return NOT_FINITE, events
            h = min(h_next, sample - done, longest(case, phases))
            trial(case, y, phases, opened, h, k, end, work)
            e = error(y, end, h, k, tolerance, floor, omega)
            if not np.isfinite(e):
                return NOT_FINITE, events
            if e > 1.0 and h > LEAST * sample:
                h_next = h * max(0.2, 0.9 * e**-0.125)
                continue
            grown = h * min(5.0, 0.9 * max(e, 1e-10) ** -0.125)
            theta = first_inside(case, y, phases, opened, h, k, end, work)
            if theta < 1.0:
                h *= theta
                trial(case, y, phases, opened, h, k, end, work)
            event = left(case, end, phases, opened)
            if event:
                h = locate(case, y, phases, opened, 0.0, h, k, end, work)
            done += h
            h_next = max(grown, LEAST * sample)
            y[:] = end
            extremes[row, 0] = min(extremes[row, 0], k[STAGES, TORQUE])
            extremes[row, 1] = max(extremes[row, 1], k[STAGES, TORQUE])
            if event:
                events, here = events + 1, here + 1
                if here > MOST_EVENTS:
                    return CHATTERS, events
                enter(case, y, phases, opened)
                rate(case, y, phases, opened, k[0])
                extremes[row, 0] = min(extremes[row, 0], k[0, TORQUE])
                extremes[row, 1] = max(extremes[row, 1], k[0, TORQUE])
            else:
                k[0] = k[STAGES]
        rows[row + 1, :N_ROWS] = y
        rows[row + 1, N_ROWS], rows[row + 1, N_ROWS + 1] = k[0, TORQUE], k[0, TORQUE + 2]
    return DONE, events
