"""Onsets told by their neighbours alone, against zeros of the damping of random families."""

from __future__ import annotations

import numpy as np
import pytest
from matrix_families import write_family
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from study_runs import plan_of, solved
from study_texts import study_text

from squealstudy.modes.tracking.onsets import cubic_onsets

HZ = 2 * np.pi
END = 2.0  # of the parameter, from 0


def random_matrices(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C, K and F of M = 1, C, K + mu F: modes that veer, cross and lock in."""
    n = int(rng.integers(3, 7))
    w = HZ * np.sort(rng.uniform(100, 600, n))
    A, B, D = rng.normal(size=(3, n, n))
    size = np.sqrt(np.outer(w, w))
    K = np.diag(w**2) + rng.uniform(0, 0.08) * (A + A.T) * size**2
    C = np.diag(2 * rng.uniform(0.001, 0.02, n) * w) + rng.uniform(0, 0.002) * (D @ D.T) * size
    return C, K, rng.uniform(0.1, 0.3) * B * size**2


def roots(C: np.ndarray, K: np.ndarray) -> list[np.ndarray]:
    """Roots above the real axis of many K (n, m, m)."""
    n, m, _ = K.shape
    blocks = np.zeros((n, 2 * m, 2 * m))
    blocks[:, :m, m:], blocks[:, m:, m:], blocks[:, m:, :m] = np.eye(m), -C, -K
    return [lam[lam.imag > 1e-6] for lam in np.linalg.eigvals(blocks)]


def damping_crossings(rng: np.random.Generator, count: int):
    """Ends, damping ratios of modes in steps of 1/400, and a value at which each vanishes."""
    found = []
    while len(found) < count:
        C, K, F = random_matrices(rng)
        x = np.linspace(0.0, END, 401)
        lams = roots(C, K + x[:, None, None] * F)
        rows = lams[:1]
        for lam in lams[1:]:
            ahead = rows[-1] if len(rows) < 2 else 2 * rows[-1] - rows[-2]
            if len(lam) != len(ahead):
                break
            near = np.abs(ahead[:, None] - lam).argmin(axis=1)
            if len(set(near.tolist())) < len(ahead):
                break
            rows.append(lam[near])
        if len(rows) < 100:
            continue
        x, zeta = x[: len(rows)], -np.real(rows) / np.abs(rows)
        for z in zeta.T:
            curve = CubicSpline(x, z)
            found += [
                (x[-1], curve, brentq(curve, x[i], x[i + 1], xtol=1e-13))
                for i in np.flatnonzero(z[:-1] * z[1:] < 0)
            ]
    return found


def test_no_cubic_onset_of_random_families_is_beyond_its_error():
    """Unequal steps; and equal ones, where the third difference of four points may vanish."""
    rng = np.random.default_rng(5)
    told = beyond = 0
    for end, curve, zero in damping_crossings(rng, 25):
        for n in (12, 25, 50, 60, 90, 120, 180, 240, 360, 480):
            for step in (np.ones(n), rng.uniform(0.1, 2, n), 10 ** rng.uniform(-1.3, 1.3, n)):
                x = np.cumsum(step) - step[0]
                x *= end / x[-1]
                k = int(np.searchsorted(x, zero))
                if not 2 <= k <= n - 2:
                    continue
                x = np.pad(x, 1, constant_values=np.nan)[k - 2 : k + 4]
                f = curve(x)
                if f[2] * f[3] >= 0:  # it vanishes twice between both
                    continue
                (value,), (error,) = cubic_onsets(x[None], f[None])
                if error <= 0.5e-4 * end:
                    told += 1
                    beyond += abs(value - zero) > error + 1e-9
    assert told > 125
    assert beyond == 0


def test_four_points_alone_tell_no_onset():
    x = np.array([[np.nan, 0.0, 1.0, 2.0, 3.0, np.nan]])
    assert np.isinf(cubic_onsets(x, 1.4 - x)[1]).all()
    x[0, 0] = -1.0
    (value,), (error,) = cubic_onsets(x, 1.4 - x)
    assert abs(value - 1.4) <= error + 1e-12 < 1e-11


@pytest.mark.parametrize(
    ("count", "least"), [(5, 2), pytest.param(12, 10, marks=pytest.mark.full_size)]
)
def test_onsets_of_studies_in_unequal_steps_are_within_their_errors(count, least, tmp_path):
    """Whatever tells them: all that have an error, against brentq on eigenvalues of numpy."""
    told, rng = [], np.random.default_rng(11)
    for seed in range(count):
        C, K, F = random_matrices(rng)
        values = np.sort(rng.uniform(0.0, END, 40))
        folder = tmp_path / str(seed)
        folder.mkdir()
        text = study_text("unequal", "complex_modes", "matrices")
        terms = {"M": ("M", np.eye(len(C))), "C": ("C", C), "K": ("K", K), "F": ("K", F)}
        text += write_family(folder, terms, {"F": "mu"})
        text += f'[parameters]\nmu = 1.0\n[[sweep]]\nparameter = "mu"\nvalues = {values.tolist()}\n'
        text += "[modes]\nband = [5.0, 5000.0]\nreference_points = 0\n"
        onsets = solved(plan_of(text, folder / "study.toml"), folder / "results").onsets

        def damping(mu, hz, C=C, K=K, F=F):
            (lam,) = roots(C, (K + mu * F)[None])
            own = lam[np.abs(np.abs(lam) / HZ - hz).argmin()]
            return -own.real / abs(own) + 1e-7  # stability_tolerance

        for row in onsets[onsets["error_estimate"].notna()].to_dict("records"):
            reach = max(3 * row["error_estimate"], 1e-3)
            near = np.linspace(row["onset"] - reach, row["onset"] + reach, 61)
            zeta = [damping(mu, row["frequency_hz"]) for mu in near]
            zeros = [
                brentq(damping, near[i], near[i + 1], args=(row["frequency_hz"],))
                for i in np.flatnonzero(np.diff(np.sign(zeta)) != 0)
            ]
            off = min((abs(zero - row["onset"]) for zero in zeros), default=np.inf)
            told.append((row["status"], off <= row["error_estimate"]))
    assert len(told) > least
    assert all(within for _, within in told)
