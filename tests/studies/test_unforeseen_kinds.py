"""A mistake nobody foresaw in kinds that ask for their own points: failed rows, no more.

Searches, refined borders, compared methods and maps of methods go on with what is left.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest
from study_texts import study_text, sweep_text

import squealstudy as sq
from squealstudy.errors import SquealstudyError

BAND = "[modes]\nband = [1.0, 1000.0]\n"
HULTEN = study_text("modes", "complex_modes", "hulten") + sweep_text("friction", 0.0, 0.6, 3)
KINDS = "squealstudy.kinds"
STUDIES = {
    "boundary": HULTEN.replace("modes", "boundary", 1)
    + sweep_text("frequency_1", 80.0, 110.0, 2)
    + '[design]\ntype = "boundary"\nlevels = 1\n'
    + BAND,
    "work_precision": '[study]\nname = "a"\nkind = "work_precision"\n'
    '[work_precision]\nbase = "modes.toml"\npoints = 2\nseed = 2\nrepeats = 1\n'
    'quantities = ["frequency", "damping_ratio"]\ntolerance = 1e-4\n'
    '[reference]\nname = "dense"\nset.modes.method = "dense"\n'
    '[[method]]\nname = "windows"\nset.modes.method = "windows"\n'
    'knob = "modes.tolerance"\nvalues = [1e-2, 1e-4]\n',
    "method_stability": '[study]\nname = "b"\nkind = "method_stability"\n'
    '[method_stability]\ncase = "impact_energy"\n'
    '[[knob]]\nname = "step"\nstart = 1e-5\nstop = 1e-3\nnum = 2\nscale = "log"\n'
    '[[knob]]\nname = "lambda"\nstart = 1e4\nstop = 1e5\nnum = 2\nscale = "log"\n',
    "design": study_text("c", "design", "hoffmann")
    + "[parameters]\ndamping_ratio = 0.01\n"
    + sweep_text("friction", 0.3, 0.6, 2)
    + '[[variable]]\nparameter = "damping_ratio"\nbounds = [0.0, 0.1]\n'
    + BAND
    + "[goal]\nmargin = {damping_ratio = 0.002}\ncycles = 0\nscan = 2\nstarts = 1\ndesigns = 4\n",
    "fidelity": HULTEN.replace("modes", "fidelity", 1) + BAND + "[fidelity]\ntolerance = 1e-3\n",
}
ALL = -1
CASES = [  # study, where the mistake is, at which calls, rows of the first table that fail
    ("boundary", f"{KINDS}.complex_modes.batch", "system_of", {1, 2, 3}, 2),
    ("work_precision", f"{KINDS}.work_precision.kind", "_measured", {1, 2}, 2),
    ("method_stability", f"{KINDS}.method_stability.kind", "asdict", {1, 2}, 2),
    ("design", f"{KINDS}.design.kind", "design_row", {0, 1}, 1),
    ("design", f"{KINDS}.design.kind", "uncoupled_modes", None, 0),
    ("fidelity", f"{KINDS}.complex_modes.measuring", "reduction_seconds", None, ALL),
    ("work_precision", "squealstudy.engine.structures", "reduced_with_basis", None, ALL),
    ("fidelity", "squealstudy.engine.structures", "reduced_with_basis", {0}, 0),
]


@pytest.mark.parametrize(("kind", "module", "name", "calls", "n_failed"), CASES)
def test_a_mistake_fails_its_own_points(
    kind: str,
    module: str,
    name: str,
    calls: set[int] | None,
    n_failed: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if name == "reduced_with_basis":  # which a filled cache never asks for
        monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    (tmp_path / "modes.toml").write_text(HULTEN + BAND)
    (tmp_path / "study.toml").write_text(STUDIES[kind])
    whole, made = getattr(import_module(module), name), list[int]()

    def failing(*arguments, **options):
        made.append(len(made))
        if calls is None or made[-1] in calls:
            return ()[3]  # IndexError
        return whole(*arguments, **options)

    monkeypatch.setattr(import_module(module), name, failing)

    def run() -> sq.Results:
        return sq.run(tmp_path / "study.toml", tmp_path / "r", jobs=1, yes=True, warn=str)

    if n_failed == ALL:
        with pytest.raises(SquealstudyError, match=r"IndexError|no reduction"):
            run()
        assert made
        return
    found = run()
    assert made
    table = found.table(found.tables[0])
    assert (table["status"] != "ok").sum() == n_failed
    assert all("IndexError" in text for text in table["message"][table["status"] != "ok"])
    found.screen.findings(found)
    found.screen.facts(found)
