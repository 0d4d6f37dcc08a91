"""Final states of runs: of a batch in one file, of runs with histories each in its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_runs import plan_of, solved
from study_texts import study_text

from squealstudy.engine.final_states import read_state, state_files, state_names
from squealstudy.engine.result_names import STATES
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import Store
from squealstudy.errors import StudyFileError

TEXT = (
    study_text("states", "transient", "hulten")
    + '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.3, 0.5]\n'
    + "[modes]\nband = [10.0, 1000.0]\n"
    + "[transient]\nduration = 0.1\nstep = 1e-4\nsave_every = 0\nperturbation = 1e-3\n"
    + 'slope_pilot = "never"\n'
)
MODEL = {"prepared_key": "k", "representation": "modal"}
IDS = [16 * "a", 16 * "b"]
WHOLE = {"point_id": np.array(IDS), "q": np.arange(4.0).reshape(2, 2), "v": np.zeros((2, 2))}
BAD = {
    "no row of the point": {"point_id": np.array(2 * [16 * "c"])},
    "other rows": {"q": np.zeros((3, 2)), "v": np.zeros((3, 2))},
    "one row": {"q": np.zeros(2), "v": np.zeros(2)},
    "other length": {"v": np.zeros((2, 3))},
    "no numbers": {"q": np.full((2, 2), np.nan)},
    "three axes": {"q": np.zeros((2, 2, 1)), "v": np.zeros((2, 2, 1))},
}


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Results:
    return solved(TEXT, tmp_path_factory.mktemp("states") / "r")


def apart(folder: Path) -> Results:
    """The same runs with histories, and so with a file each."""
    return solved(TEXT.replace("save_every = 0", "save_every = 4"), folder / "apart")


def test_a_batch_has_one_file_and_the_states_of_each_run(results, tmp_path):
    assert len(list((results.directory / STATES).iterdir())) == 1
    other = apart(tmp_path)
    assert len(list((other.directory / STATES).iterdir())) == 3
    for one, two in zip(results.points["point_id"], other.points["point_id"], strict=True):
        states = [
            read_state(x.directory / state_names(Store(x.directory))[i], i)
            for x, i in ((results, one), (other, two))
        ]
        for a, b in zip(*states, strict=True):
            np.testing.assert_array_equal(a, b)
    assert len({tuple(read_state(x, i).q) for i, x in paths(results).items()}) == 3


def paths(results: Results) -> dict[str, Path]:
    return {i: results.directory / x for i, x in state_names(Store(results.directory)).items()}


def test_a_run_goes_on_from_one_of_several(results, tmp_path):
    name = results.points["point_id"].iloc[1]
    more = TEXT.replace("[0.1, 0.3, 0.5]", "[0.3]").replace("perturbation = 1e-3\n", "")
    more += f'start = "{results.directory}"\n'
    with pytest.raises(StudyFileError, match="has 3 final states: name one by start_point"):
        run_study(plan_of(more), tmp_path / "none", jobs=1)
    found = solved(more + f'start_point = "{name}"\n', tmp_path / "more")
    assert found.points["status"].tolist() == ["ok"]
    whole = TEXT.replace("[0.1, 0.3, 0.5]", "[0.3]").replace("duration = 0.1", "duration = 0.2")
    ends = [next(iter(paths(x).items())) for x in (found, solved(whole, tmp_path / "whole"))]
    continued, at_once = (read_state(path, point).q for point, path in ends)
    np.testing.assert_allclose(continued, at_once, rtol=1e-3, atol=1e-6 * np.abs(at_once).max())


def test_a_damaged_file_is_made_again_with_all_its_runs(tmp_path):
    results = solved(TEXT, tmp_path / "r")
    (file,) = (results.directory / STATES).iterdir()
    content = file.read_bytes()
    file.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    report = run_study(plan_of(TEXT), results.directory, jobs=1)
    assert report.n_solved == 3
    assert file.read_bytes() == content


@pytest.mark.parametrize("name", BAD)
def test_files_of_several_that_hold_no_state_of_a_point_are_refused(tmp_path, name):
    np.savez(tmp_path / "good.npz", **(MODEL | WHOLE))
    assert read_state(tmp_path / "good.npz", IDS[1]).q.tolist() == [2.0, 3.0]
    np.savez(tmp_path / "bad.npz", **(MODEL | WHOLE | BAD[name]))
    with pytest.raises(ValueError, match=r"it holds no|an array"):
        read_state(tmp_path / "bad.npz", IDS[1])


def test_ids_of_a_foreign_file_are_ids(tmp_path):
    """Whatever else stands there would come to the screen."""
    (tmp_path / STATES).mkdir()
    foreign = {"point_id": np.array([IDS[0], "\x1b[2J" + 12 * "a"])}
    np.savez(tmp_path / STATES / f"{16 * 'f'}.npz", **(MODEL | WHOLE | foreign))
    assert list(state_names(Store(tmp_path))) == [IDS[0]]


def test_one_state_keeps_the_name_of_its_point():
    state = {IDS[0]: (np.zeros(2), np.ones(2))}
    assert list(state_files(state, "k", "modal", in_own_folder=False)) == [f"{STATES}/{IDS[0]}.npz"]
    assert state_files({}, "k", "modal", in_own_folder=False) == {}
