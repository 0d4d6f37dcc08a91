"""A reduced size of the faults campaign, studies/benchmarks/faults.py: every part, few cases."""

import importlib
import os
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "studies" / "benchmarks"
FEW = {
    "kills": 1,
    "damage": 3,
    "hostile": 4,
    "study_files": 20,
    "matrix_files": 40,
    "model_files": 12,
    "environment": 3,
}
RARE = ("model_files", "environment")  # whose scenes take ten seconds to make
SMALL = ("hulten_modes",)
SCENES = {"kills": SMALL, "hostile": SMALL, "damage": SMALL, "environment": SMALL}
NOTICED = {  # a campaign whose disturbances are never noticed would pass as well
    "kills": lambda finding: "came too late" not in finding.done,
    "damage": lambda finding: "damaged" in finding.text or "missing" in finding.text,
}


@pytest.mark.skipif(
    not sys.platform.startswith("linux") or os.geteuid() != 0,
    reason="NOT TRIED HERE: the campaign needs Linux and mount namespaces",
)
@pytest.mark.parametrize(
    "part",
    [pytest.param(p, marks=[pytest.mark.full_size] * (p in RARE)) for p in FEW],
)
def test_what_is_disturbed_ends_right_or_in_a_sentence(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
    module = importlib.import_module(f"fault_campaign.{part}")
    more = {"names": SCENES[part]} if part in SCENES else {}
    if part == "kills":  # a cluster takes its time; tests/test_cluster.py kills its processes
        more["on_cluster"] = ()
    if part == "hostile":
        monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))  # which it changes
        more["pictures"] = False
    findings = list(module.run(FEW[part], 1, tmp_path, **more))
    assert len(findings) == FEW[part]
    assert [str(f) for f in findings if not f.good] == []
    noticed = NOTICED.get(part, lambda finding: finding.verdict == "message")
    assert any(noticed(finding) for finding in findings)
