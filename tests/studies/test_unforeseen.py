"""An error that nobody foresaw is the failed row of its design point, in every kind of study."""

from pathlib import Path

import numpy as np
import pytest
from stick_slip_cycle import stick_slip
from study_runs import solved
from study_texts import study_text

from squealstudy.errors import MachineError
from squealstudy.kinds.complex_modes import batch
from squealstudy.study.design import DesignPoint

SWEEP = '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.2, 0.25]\n'
SHORT = '[transient]\nduration = 0.02\nstep = 1e-4\nslope_pilot = "never"\n'
FAULTY = 0.2
DAMPED = "[parameters]\ndamping_ratio = 0.2\nsliding_speed = 5.0\n"
KINDS = {"complex_modes": "", "sensitivity": "", "limit_cycles": DAMPED, "transient": SHORT}


def break_points(patch: pytest.MonkeyPatch, error: Exception) -> None:
    """Have the mechanics of the design point with friction `FAULTY` end with an error."""
    original = DesignPoint.state

    def state(point: DesignPoint):
        if point.values["friction"] == FAULTY:
            raise error
        return original(point)

    patch.setattr(DesignPoint, "state", state)


def break_batches(patch: pytest.MonkeyPatch, error: Exception) -> None:
    """Have the mechanics of a batch with that design point in it end with an error."""
    original = batch.system_of

    def system_of(points):
        if (points.column("friction") == FAULTY).any():
            raise error
        return original(points)

    patch.setattr(batch, "system_of", system_of)


def test_an_error_nobody_foresaw_in_a_batch_is_one_failed_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_batches(monkeypatch, RuntimeError("nobody foresaw this"))
    results = solved(study_text("faulty", "complex_modes", "hulten") + SWEEP, tmp_path / "r")
    assert results.points["status"].tolist() == ["ok", "failed", "ok"]
    assert "nobody foresaw this" in results.points["message"].tolist()[1]


@pytest.mark.usefixtures("one_by_one")
@pytest.mark.parametrize("kind", KINDS)
def test_an_error_nobody_foresaw_is_one_failed_row(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_points(monkeypatch, KeyError("a name that nobody gave"))
    text = study_text("faulty", kind, "belt") + SWEEP + KINDS[kind]
    results = solved(text, tmp_path / "r")
    points = results.points
    assert points["status"].tolist() == ["ok", "failed", "ok"], points["message"].tolist()
    message = points["message"].tolist()[1]
    assert message.startswith("KeyError: 'a name that nobody gave'")
    assert results.manifest["n_failed"] == 1


def test_what_the_machine_refuses_is_no_fault_of_a_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_batches(monkeypatch, OSError(28, "No space left on device"))
    with pytest.raises((OSError, MachineError)):
        solved(study_text("faulty", "complex_modes", "hulten") + SWEEP, tmp_path / "r")


def test_a_point_without_a_mode_in_the_band_has_its_class_and_level(tmp_path: Path) -> None:
    """Sliding at 0.05 m/s the mass on the belt has two real roots: no complex mode to follow."""
    text = study_text("creeping", "transient", "belt") + (
        '[parameters]\n"friction_law.decay_speed" = 0.05\n'
        '[[sweep]]\nparameter = "sliding_speed"\nvalues = [0.2, 0.05]\n'
        "[modes]\nband = [50.0, 300.0]\n"
        '[transient]\nduration = 2.0\nstep = 2e-5\nperturbation = 0.1\nslope_pilot = "never"\n'
    )
    results = solved(text, tmp_path / "r")
    points = results.points
    assert points["class"].tolist() == ["limit_cycle", "limit_cycle"]
    assert points["predicted_growth_rate"].isna().tolist() == [False, True]
    omega = 200 * np.pi
    for row in points.itertuples():
        true = stick_slip(1.0, omega**2, omega, 0.5, 2.0, 0.05, row.sliding_speed, 0.05)
        assert row.torque_rms == pytest.approx(true.rms, rel=0.02)
        assert row.frequency_hz == pytest.approx(true.frequency_hz, rel=0.01)
    assert results.growth["point_id"].unique().tolist() == [points["point_id"].tolist()[0]]
