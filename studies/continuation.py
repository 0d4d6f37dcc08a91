"""Follow the modes of a model over friction to where they lock in, with the mechanics alone.

Steps of one's own: each root is predicted by its derivative, taken with its left vector, and the
step is as long as predictions hold. Run `python studies/continuation.py [picture.png]`.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import squealstudy as sq

BAND = (10.0, 1000.0)  # Hz
SMALL, LARGE = 1e-5, 1e-3  # error of a prediction, relative: the step may grow, has to shrink


def slopes(model: sq.Model, friction: float, change: float = 1e-6) -> np.ndarray:
    """d lam / d friction of all modes: -y^H K' x, for friction enters the stiffness alone."""
    modes = model.at(friction=friction).modes(BAND)
    K = model.at(friction=[friction - change, friction + change]).linear.K
    return -np.einsum("ij,ij->j", modes.left.conj(), (K[1] - K[0]) / (2 * change) @ modes.right)


def followed(
    model: sq.Model, start: float, end: float, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Frictions (m,) and roots (m, k) [rad/s], in order along each mode, up to the lock-in."""
    friction, roots = [start], [model.at(friction=start).modes(BAND).lam]
    while friction[-1] < end and step > 1e-9:
        mu = min(friction[-1] + step, end)
        predicted = roots[-1] + (mu - friction[-1]) * slopes(model, friction[-1])
        found = model.at(friction=mu).modes(BAND).lam
        error = np.abs(found - predicted).max() / np.abs(found).max()
        if error > LARGE or found.real.max() > SMALL:  # beyond the lock-in one of them grows
            step /= 2
            continue
        friction.append(mu)
        roots.append(found)
        step *= 1.5 if error < SMALL else 1.0
    return np.array(friction), np.array(roots)


if __name__ == "__main__":
    model = sq.model("hulten")
    mu, lam = followed(model, 0.01, 0.6, 0.02)
    w1, w2 = 2 * np.pi * 100.0, 2 * np.pi * 75.0
    exact = (w1**2 - w2**2) / (2 * w1 * w2)
    print(f"{len(mu)} points up to a friction of {mu[-1]:.8f}; lock-in at {exact:.8f}")
    beyond = np.linspace(mu[-1] + 1e-4, 0.6, 60)
    batch = model.at(friction=beyond).modes(BAND)
    figure, axes = plt.subplots(2, sharex=True)
    for part, grid, roots in (("o-", mu, lam), ("-", beyond, batch.lam)):
        axes[0].plot(grid, np.abs(roots) / (2 * np.pi), part, ms=3)
        axes[1].plot(grid, roots.real, part, ms=3)
    axes[0].set_ylabel("frequency [Hz]")
    axes[1].set(xlabel="friction", ylabel="growth rate [1/s]")
    figure.savefig(sys.argv[1] if sys.argv[1:] else "continuation.png")
