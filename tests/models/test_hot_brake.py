"""A hot disc and hot pads of the generated brake open gaps as closed forms say."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import COARSE, build_model
from study_runs import plan_of
from study_texts import study_text
from tiny_meshes import tiny_cache, tiny_meshes

import squealstudy as sq
from squealstudy.engine.export import export_model
from squealstudy.errors import ParameterError, SquealstudyError
from squealstudy.models.catalogue import MODELS

FREE = {"hub.stiffness": 1e3, "disc.bell_height": 2e-4, "disc.top_thickness": 2e-4}
LOOSE = {f"abutment.{way}_stiffness": 1.0 for way in ("radial", "tangential", "axial")}
LOOSE |= {"fingers.stiffness": 1e3}
BAND, PAD = 0.012, 0.015  # m, thicknesses


@pytest.fixture(autouse=True)
def tiny():
    with tiny_meshes(tiny_cache()):
        yield


def opened(**values):
    """Gaps, radii and which are of the outer pad."""
    contact = build_model("disc_brake", COARSE, **values).contact
    return contact.gap0, contact.points[:, :2], np.array(contact.pairs) == "outer_pad"


def curvature(gap, places):
    """Of the paraboloid through gaps, rigid motions aside, 1/m; and how far they are from it."""
    x, y = places.T
    shapes = np.column_stack([np.ones_like(x), x, y, (x**2 + y**2) / 2])
    found = np.linalg.lstsq(shapes, gap)[0]
    return found[3], np.abs(shapes @ found - gap).max() / np.ptp(gap)


def test_a_disc_hotter_outside_cones_by_alpha_dt_over_h():
    """Away from the outer pad, towards the inner one; the bell is too thin to hold it."""
    gap, places, outer = opened(**FREE, **{"disc.temperature_difference": 50.0})
    free = 1.1e-5 * 50.0 / BAND
    for side, sign in ((outer, 1.0), (~outer, -1.0)):
        bent, apart = curvature(gap[side], places[side])
        assert bent == pytest.approx(sign * free, rel=0.01)
        assert apart < 0.01


def test_a_pad_hotter_where_it_rubs_is_convex_there():
    """Lining and plate alike, so that no stress holds it: its ends lift off."""
    gap, places, outer = opened(**LOOSE, **{"pad.temperature_difference": 50.0})
    for side in (outer, ~outer):
        bent, apart = curvature(gap[side], places[side])
        assert bent == pytest.approx(1.2e-5 * 50.0 / PAD, rel=1e-4)
        assert apart < 1e-4


def test_a_warm_disc_is_thicker():
    """Both gaps together close by alpha dT h, wherever it stands; nothing is hot by default."""
    gap, places, outer = opened(**FREE, **{"disc.temperature_rise": 80.0})
    one, other = (np.lexsort(np.round(places[s], 9).T) for s in (outer, ~outer))
    assert places[outer][one] == pytest.approx(places[~outer][other], abs=1e-12)
    assert gap[outer][one] + gap[~outer][other] == pytest.approx(-1.1e-5 * 80.0 * BAND, rel=1e-6)
    assert not opened()[0].any()


def test_a_degree_celsius_of_a_difference_is_a_kelvin():
    brake = sq.model("disc_brake", **COARSE)
    for value in (80.0, "80 K", "80 degC"):
        assert brake.at(**{"disc.temperature_rise": value}).point.values[
            "disc.temperature_rise"
        ] == pytest.approx(80.0)
    sweep = '[[sweep]]\nparameter = "disc.temperature_rise"\nvalues = ["0 degC", "80 degC"]\n'
    plan = plan_of(study_text("hot", "complex_modes", "disc_brake") + sweep)
    assert [t.values["disc.temperature_rise"] for t in plan.tasks] == [0.0, 80.0]


def test_what_a_symmetric_disc_has_not_is_one_sentence():
    """An angle; and temperatures in files of the exported brake."""
    with pytest.raises(ParameterError, match="symmetric about its axis, so that no angle changes"):
        sq.model("disc_brake").at(rotor_angle=5.0)
    assert "rotor_angle" not in MODELS["disc_brake"].defaults()


def test_a_hot_brake_is_not_exported_cold(tmp_path):
    hot = '[parameters]\n"disc.temperature_rise" = 80.0\n'
    study = plan_of(study_text("hot", "complex_modes", "disc_brake") + hot).study
    with pytest.raises(SquealstudyError, match=r"expected 0 K for disc\.temperature_rise, "):
        export_model(study, tmp_path)
