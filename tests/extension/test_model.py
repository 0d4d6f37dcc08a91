"""A minimal model from one file outside the package, and its structural parameter in a sweep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_runs import load_plan

import squealstudy as sq
from squealstudy import open_results
from squealstudy.engine.runner import run_study
from squealstudy.errors import StudyFileError
from squealstudy.extensions import load_extension

FILE = Path(__file__).with_name("my_model.py")
STUDY = f"""
[study]
name = "rubbed"
kind = "complex_modes"
extensions = ["{FILE}"]

[model]
name = "rubbed_mass"

[parameters]
mass = 2.0
stiffness = 1e6

[[sweep]]
parameter = "added_mass"
values = [0.5, 1.0, 2.0]

[modes]
band = [1.0, 1000.0]
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_frequency_of_the_mass_with_what_is_added(tmp_path, jobs):
    path = tmp_path / "rubbed.toml"
    path.write_text(STUDY)
    run_study(load_plan(path), tmp_path / "out", jobs)
    results = open_results(tmp_path / "out")
    assert len(results.manifest["structures"]) == 1  # of a batch, whatever the values
    assert results.manifest["units"]["added_mass"] == "kg"
    modes = results.modes.merge(results.points[["point_id", "added_mass"]], on="point_id")
    lowest = modes.groupby("added_mass")["frequency_hz"].min()
    exact = np.sqrt(1e6 / (2.0 + lowest.index.to_numpy())) / (2 * np.pi)
    np.testing.assert_allclose(lowest, exact, rtol=1e-9)


def test_a_parameter_that_it_has_not_is_refused(tmp_path):
    path = tmp_path / "rubbed.toml"
    path.write_text(STUDY.replace("mass = 2.0\n", "masss = 2.0\n"))
    with pytest.raises(StudyFileError, match="did you mean 'mass'"):
        load_plan(path)


def test_the_library_takes_it_as_any_other():
    load_extension(FILE)
    system = sq.model("rubbed_mass").at(friction=[0.0, 0.3], added_mass=[1.0, 3.0])
    along = system.modes().lam[:, 0]
    np.testing.assert_allclose(np.abs(along), np.sqrt(1e6 / np.array([3.0, 5.0])), rtol=1e-9)
