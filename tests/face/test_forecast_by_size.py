"""What `check` tells of a study of which nothing is in the cache: by its size, and by the past."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from squealstudy.engine import cache, forecast_by_size
from squealstudy.engine.forecast_by_size import ELSEWHERE, HERE
from squealstudy.engine.forecast_by_size import forecast_by_size as forecast
from squealstudy.errors import ModelError
from squealstudy.files import sealed

DOCS = Path(__file__).parents[2] / "docs"


def plan_of(n_dof):
    return SimpleNamespace(
        first=SimpleNamespace(assembly=lambda: SimpleNamespace(n_dof=n_dof)),
    )


def test_times_follow_those_measured_and_bound_them(monkeypatch):
    monkeypatch.setattr(forecast_by_size, "past_reductions", list)
    for n_dof, reduction_s, point_s in ((14_769, 21.0, 0.29), (115_959, 253.0, 0.70)):
        size = forecast(plan_of(n_dof))
        assert size.reduction_s == pytest.approx([f * reduction_s for f in ELSEWHERE])
        assert size.point_s == pytest.approx([f * point_s for f in ELSEWHERE])
        assert "another machine" in size.by
    # 544,929 degrees of freedom took 8,748 s as a study of 174 points, most of it two reductions
    low, high = forecast(plan_of(544_929)).reduction_s
    assert low < 3000 < high


def test_memory_is_told_before_a_machine_runs_out_of_it(monkeypatch):
    """By what reductions took; a study of 544,929 degrees of freedom took 20.8 GB by CHOLMOD."""

    def of_size(n_dof, backend):
        monkeypatch.setattr(forecast_by_size, "automatic_backend", lambda n, definite: backend)
        return forecast(plan_of(n_dof))

    for n_dof, backend, measured_gb in (
        (28_875, "superlu", 1.15),
        (95_217, "cholmod", 2.7),
        (544_929, "cholmod", 20.8),
    ):
        low, high = of_size(n_dof, backend).memory_gb
        assert low < measured_gb < high < 3 * low
    assert of_size(544_929, "cholmod").factors == "CHOLMOD"
    size = of_size(544_929, "superlu")  # both triangles
    needed = "a reduction needs about 28.3 GB, 17.4 to 46.3 GB"
    assert size.memory_gb[0] > 1.4 * of_size(544_929, "cholmod").memory_gb[0]
    assert size.memory_text(64.0) == needed
    assert size.memory_text(20.0) == f"{needed}: it may not fit into the 20.0 GB that are left here"
    assert size.memory_text(16.0).startswith(f"{needed}: more than the 16.0 GB that are left here")


def test_the_page_on_cost_has_the_same_figures():
    page = (DOCS / "explanation" / "cost-and-size.md").read_text(encoding="utf-8")
    sizes = " / ".join(f"{n:,}" for n in forecast_by_size.MEASURED_DOF)
    seconds = " / ".join(f"{s:g}" for s in forecast_by_size.MEASURED_REDUCTION_S)
    assert f"| a reduction, {sizes} degrees of freedom | {seconds} s |" in page
    of_point = " / ".join(f"{s:.2f}" for s in forecast_by_size.MEASURED_POINT_S)
    assert f"| a design point after it | {of_point} s" in page


def test_past_reductions_of_like_size_say_more(monkeypatch):
    past = [(14_769, 42.0), (27_810, 2 * 45.0), (500_000, 1.0)]  # half as fast; another size
    monkeypatch.setattr(forecast_by_size, "past_reductions", lambda: past)
    size = forecast(plan_of(14_769))
    low, high = size.reduction_s
    assert HERE[0] * 42.0 <= low <= 42.0 <= high <= 1.1 * HERE[1] * 42.0
    assert size.by == "by 2 reductions of like size in the cache"

    def vanishes():
        raise ModelError("vanishes")

    assert forecast(SimpleNamespace(first=SimpleNamespace(assembly=vanishes))) is None


def test_the_cache_tells_what_reductions_took(monkeypatch, tmp_path):
    monkeypatch.setattr(cache, "cache_directory", lambda: tmp_path)

    def keep(name, n_dof, **seconds):
        fields = {"n_dof": n_dof, "timings": {"mapping": seconds}}
        folder = tmp_path / cache.MODELS / name
        folder.mkdir(parents=True)
        text = sealed({"format": 4, "value": {"fields": fields}, "files": {}})
        (folder / cache.META).write_text(text, encoding="utf-8")

    keep("a", 14_769, assembly_s=3.0, reduction_s=20.0)
    keep("b", 14_769, projection_s=1.0, reduction_s=2.0)  # by the basis of a range
    keep("c", 2, reduction_s=0.01)  # two masses
    (tmp_path / cache.MODELS / "d").mkdir()
    (tmp_path / cache.MODELS / "d" / cache.META).write_text(json.dumps([1]), encoding="utf-8")
    assert cache.past_reductions() == [(14_769, 23.0)]
