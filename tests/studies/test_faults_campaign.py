"""A reduced size of the faults campaign, studies/benchmarks/faults.py: every part, few cases."""

import importlib
import os
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "studies" / "benchmarks"
FEW = {
    "kills": 1,
    "damage": 2,
    "hostile": 4,
    "study_files": 10,
    "matrix_files": 20,
    "model_files": 12,
    "environment": 3,
    "cache_entries": 2,
    "bad_numbers": 3,
    "mesh_kills": 1,
    "memory_limits": 1,
    "far_workers": 1,
}
RARE = (  # whose scenes take ten seconds to make; test_runner.py kills, too
    *("kills", "model_files", "environment", "cache_entries"),
    *("mesh_kills", "memory_limits", "far_workers"),
)
SMALL = ("hulten_modes",)
SCENES = {
    **dict.fromkeys(("kills", "hostile", "damage", "environment", "memory_limits"), SMALL),
    **{"cache_entries": ("matrices_modes",), "bad_numbers": ("hulten",)},
    **{"mesh_kills": ("own_blocks",), "far_workers": ("own_blocks",)},
}
ANY = {
    "cache_entries",
    "mesh_kills",
    "memory_limits",
    "far_workers",
}  # all may be equal
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
    if (
        part == "kills"
    ):  # a cluster takes its time; tests/studies/test_cluster.py kills its processes
        more["on_cluster"] = ()
    if part in ("hostile", "cache_entries", "bad_numbers"):
        monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))  # which it changes
    if part == "hostile":
        more["pictures"] = False
    findings = list(module.run(FEW[part], 1, tmp_path, **more))
    assert len(findings) == FEW[part]
    assert [str(f) for f in findings if not f.good] == []
    if part in ANY:
        return
    noticed = NOTICED.get(part, lambda finding: finding.verdict == "message")
    assert any(noticed(finding) for finding in findings)
