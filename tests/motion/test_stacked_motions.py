"""Design points of a batch in time: equal to each alone, and none fails with its neighbours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from squealstudy.errors import ParameterError
from squealstudy.mechanics import motion_points
from squealstudy.mechanics.motion_points import motion_at, motions_at, reference_modes
from squealstudy.models.catalogue import MODELS
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.operating import REGULARISATION_SPEED, SLOPE
from squealstudy.motion.growing_modes import GrowingModes, growing_modes
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import SharedModes
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel, prepare
from squealstudy.stacked.growing_modes import stacked_growing_modes

WHOLE = ReductionSettings(np.inf, np.inf, 0.0)
BAND = (5.0, 1000.0)
SETTINGS = MotionSettings(0.1, 1e-4, 0, integrator=ExactFreeMotion())
CASES = {
    "belt": ("belt", {}, {"friction": (0.1, 0.6), "damping_ratio": (0.0, 0.1)}),
    "hulten": (
        "hulten",
        {"contact_law": "cubic"},
        {"friction": (0.0, 0.9), "contact.cubic_stiffness": (1e17, 1e19)},
    ),
    "damped": (
        "hulten",
        {},
        {
            "friction": (0.0, 0.9),
            "stiffness_damping": (0.0, 1e-4),
            "modes[2].damping_ratio": (0.0, 0.1),
            "mass.modes[1].damping_ratio": (0.0, 0.1),
            "mass.modes[2].frequency_scale": (0.9, 1.1),
        },
    ),
    "exponential": (
        "hoffmann",
        {"contact_law": "exponential"},
        {"friction": (0.0, 1.2), "friction_law.static_ratio": (1.0, 1.5)},
    ),
}


def points_of(case: str, count: int = 6) -> list[ModelPoint]:
    """Random design points of one structure."""
    name, options, ranges = CASES[case]
    model, rng = MODELS[name], np.random.default_rng(len(case))
    options = {o.name: o.choices[0] for o in model.options} | options
    fixed = model.defaults() | {SLOPE.name: 0.0, REGULARISATION_SPEED.name: 1e-3}
    drawn = {parameter: rng.uniform(*ends, count) for parameter, ends in ranges.items()}
    rows = [{k: float(x[i]) for k, x in drawn.items()} for i in range(count)]
    return [ModelPoint(model, options, fixed | row) for row in rows]


def shared(points: Sequence[ModelPoint]) -> tuple[SharedModes, PreparedModel]:
    """The modes that they share, and their structure."""
    first = points[0]
    operating = first.operating_point()
    prepared = prepare(first.assembly(), operating, WHOLE)
    keys = sorted({(p.component, m) for p in first.mode_parameters() for m in p.modes})
    return reference_modes(prepared, operating, keys), prepared


def assert_same_modes(one: GrowingModes, other: GrowingModes) -> None:
    """Equal but for the phases of vectors, and what turns with these."""
    for name in ("n_unstable", "n_above", "n_below"):
        assert getattr(one, name) == getattr(other, name), name
    for name in ("lam", "energy", "growth_outside", "frequency_outside", "integrated"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-12)
    for name in ("right", "left", "sensors", "overlap"):
        assert getattr(one, name).shape == getattr(other, name).shape
    m, n = len(one.lam), one.sensors.shape[1]
    seen = [x.sensors[: 4 * m].reshape(m, 2, 2, n) for x in (one, other)]
    planes = [x.sensors[4 * m :].reshape(m, 2, 2, n) for x in (one, other)]
    for k in range(m):
        for name in ("right", "left"):
            product = np.vdot(getattr(one, name)[:, k], getattr(other, name)[:, k])
            assert abs(product) == pytest.approx(1.0, rel=1e-12)
        # |xi|^2 of velocities and of displacements, and the energy on the plane
        for a, b in [*zip(*(x[k] for x in seen), strict=True)]:
            np.testing.assert_allclose(
                a.T @ a, b.T @ b, rtol=1e-9, atol=1e-9 * np.abs(a).max() ** 2
            )
        a, b = (np.concatenate([*x[k]], axis=1) for x in planes)
        np.testing.assert_allclose(a.T @ a, b.T @ b, atol=1e-9 * np.abs(a).max() ** 2)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_growing_modes_of_random_systems(n: int) -> None:
    """Unstable ones in, above and below the band, several or one, damped ones where none grows."""
    rng, m = np.random.default_rng(n), 30
    w2 = np.sort(rng.uniform(200.0, 1500.0, n) ** 2)
    K = np.diag(w2) + 0.3 * np.sqrt(np.outer(w2, w2)) * rng.normal(size=(m, n, n))
    C = np.diag(rng.uniform(-5.0, 40.0, n)) + 5.0 * rng.normal(size=(m, n, n))
    band = (60.0, 200.0)
    together = stacked_growing_modes(C, K, w2, band, 1e-7)
    for one, damping, stiffness in zip(together, C, K, strict=True):
        assert_same_modes(one, growing_modes(damping, stiffness, w2, band, 1e-7))
    if n == 7:
        assert {len(one.lam) for one in together} >= {1, 2}
        assert any(one.n_above for one in together)
        assert any(one.n_below for one in together)


@pytest.mark.parametrize("case", CASES)
def test_points_are_those_of_each_alone(case: str, monkeypatch) -> None:
    """Arrays of all points make them: no point goes its own way."""
    points = points_of(case)
    reference, prepared = shared(points)
    arguments = ("regularised", BAND, 1e-7)
    alone = [
        motion_at(reference, prepared, point, *arguments, settings=SETTINGS) for point in points
    ]
    monkeypatch.delattr(motion_points, "watched_point")
    known = [None] * len(points)
    together = motions_at(reference, prepared, points, *arguments, known, SETTINGS)
    for pair, (steady, motion) in zip(together, alone, strict=True):
        assert isinstance(pair, tuple)
        np.testing.assert_array_equal(pair[0].gap, steady.gap)
        for name in ("c", "d", "s", "gap", "force"):
            np.testing.assert_array_equal(getattr(pair[1], name), getattr(motion, name))
        assert_same_modes(pair[1].growing, motion.growing)
        assert pair[1].growing.integrated.shape[1] == len(motion.growing.lam) > 0


def test_a_point_that_cannot_run_is_its_own_failure() -> None:
    points = points_of("belt", 3)
    too_soft = dict(points[1].values) | {SLOPE.name: 1.0}
    points[1] = ModelPoint(points[1].model, points[1].options, too_soft)
    reference, prepared = shared(points)
    arguments = ("regularised", BAND, 1e-7)
    made = motions_at(reference, prepared, points, *arguments, [None] * 3)
    assert isinstance(made[1], ParameterError)
    with pytest.raises(ParameterError) as alone:
        motion_at(reference, prepared, points[1], *arguments)
    assert str(made[1]) == str(alone.value)
    assert isinstance(made[0], tuple)
    assert isinstance(made[2], tuple)


def test_of_a_batch_with_matrices_beyond_numbers_each_goes_by_itself() -> None:
    """Damping whose square is none: the others are as without it."""
    points = points_of("belt", 3)
    huge = dict(points[1].values) | {"stiffness_damping": 1e300}
    points[1] = ModelPoint(points[1].model, points[1].options, huge)
    reference, prepared = shared(points)
    made = motions_at(reference, prepared, points, "regularised", BAND, 1e-7, [None] * 3)
    assert getattr(made[1], "status", "") == "overflow"
    assert [isinstance(one, tuple) for one in made] == [True, False, True]
