"""Every benchmark at its smallest: it runs and prints its table. Its figures are not judged."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from calculix import CCX
from conftest import BENCHMARKS, benchmark
from tiny_meshes import TINY

import squealstudy

ROOT = BENCHMARKS.parents[1]
MAIN = '__name__ == "__main__"'  # what has none serves the others
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Run:
    """A benchmark with the arguments of its smallest run, and words of the table's last lines."""

    script: str
    arguments: str
    prints: str

    def __str__(self) -> str:
        return f"{self.script} {self.arguments}".replace(str(ROOT), "HERE")


HULTEN = BENCHMARKS / "same_tables" / "hulten_fidelity.toml"
RUNS = [
    Run("class_truth", "--jobs 1 --share 0.01 --length 0.01 --families hoffmann", "with a truth"),
    Run("complex_modes", "--mesh coarse --top 1500 --states 1", "peak memory"),
    Run("contact_pairs", "--quick", "3 on 3"),
    Run("cycle_cost", "--scenes hoffmann --harmonics 3 --steps 20", "level alone auto"),
    Run("cycle_verdicts", "--designs 3 --modes 1", "CPU-s"),
    Run("decks", f"read {ROOT / 'tests' / 'meshes'}", "1 decks, 0 read"),
    Run("dense_roots", "--points 4", "all "),
    Run("elements", "cantilever 1", "C3D10"),
    Run("elements", "speed 2", "memory"),
    Run("faults", "--part matrix_files --share 0.001", "matrix_files: 2 cases"),
    Run("fidelity_costs", f"{HULTEN} --points 1 --rounds 1", "most accurate"),
    Run("growth_coverage", "--share 0.01", "all: 3 runs"),
    Run(
        "hybrid",
        "--top 3500 --traces 1500 --damped 1500 --growth 4e-5 --limit-cycle 1e-4",
        "energy balance",
    ),
    Run(
        "integrators",
        "--modes 4 --points 3 --duration 1e-5 --steps 1 --methods newmark",
        "tangential_damping never",
    ),
    Run("irregular_levels", "--runs 4 --duration 1e-3", "4 runs: covers"),
    Run(
        "level_over_basis",
        "--duration 2e-4 --jobs 1 --only 'modes below 8 kHz'",
        "modes below 8 kHz",
    ),
    Run(
        "mesh_convergence",
        "components default --only inner_pad --densities coarse --order 3",
        "coarse 8 points",
    ),
    Run("mesh_convergence", "assembled coarse --top 1500", "coarse: "),
    Run("method_costs", "--quick --top 1500 --varied 1 --points 20", "pays from"),
    Run("opening_cost", "--points 11 --rounds 1", "room in memory: "),
    Run("proofs", "--proofs 1 --of oscillator --linear", "1 proofs refuted"),
    Run("reanalysis", "--quick --top 1500 --points 1 --tolerances 1e-3", "windows 1e-03"),
    Run(
        "reduction_errors",
        "--cases nominal --rungs dense --top 1500 --points 2 --checked 1",
        "nominal",
    ),
    Run("same_tables", f"--then {ROOT} --only hulten_modes --jobs 1", "1 studies, 0 with"),
    Run("size_parts", "points --sizes 15k --top 1500", "a point"),
    Run("size_parts", "checks --sizes 15k --top 1500", "real modes"),
    Run("mode_columns", "--number 1", "CPU-seconds"),
    Run(
        "small_batches",
        "--samples 8 --points 11 --sensitivities 3 --cycles 3 --runs 3 --family 3",
        "scipy.linalg.eig",
    ),
    Run("squeal_judge", "blocks coarse", "ours took"),
    Run("tracking", "--fine 0.35 --steps 0.7 --top 1500 --jobs 1", "step 0.7"),
    Run("transient_kernels", "--modes 4 --points 3 --steps 20 --batches 2", "GB/s"),
    Run("walks", "complex_modes --model hoffmann", "both"),
    Run("unstable_check", "--mesh coarse --top 1500 --points 4 --jobs 1", "unstable modes in 4"),
]
LONG = [  # what starts many processes, or follows cycles of the brake
    Run("cluster", "--points 20 --repeats 1 --empty 20", "efficiency of two workers"),
    Run("cycle_fold", "FOLDER", "fold at friction"),
    Run(
        "cycle_truth",
        "FOLDER --draw 2 --portion 1 --kicks --duration 2e-3 --jobs 1",
        "linearly stable",
    ),
    Run("elements", "judge", "C3D20R"),
    Run("narrow_tongues", "--maps 1", "maps"),
    Run("million", "--points 4", "run again when finished"),
    Run("mutants", "--number 1 --jobs 1 --folders laws --tests friction_law", "noticed"),
    Run("reanalysis", "--m0 --quick", "windows 1e-03"),
    Run("size", "run --sizes 15k --frictions 2 --top 1500 --jobs 1", "full order"),
    Run("size_parts", "windows --sizes 15k --top 1500 --frictions 2", "before the first"),
    Run("speed", f"--then {ROOT} --rows reduction --quick --rounds 1", "reduction"),
]
NEEDED = {  # of a script, or of one of its parts: what must be there
    "cluster": "distributed",
    "mutants": "coverage",
}
OF_RESULTS = ("cycle_screen",)  # it reads those of a study below
ELSEWHERE = ("column_truth", "mode_slopes", "mode_designs")  # test_column_truth, _small_models


@pytest.fixture(scope="module", autouse=True)
def tiny_sizes(tiny_brake):
    tiny_brake.setitem(benchmark("size").SIZES, "15k", TINY)


def printed(run: Run, folder: Path, monkeypatch, capsys) -> str:
    """What a benchmark prints that is run in this process, in a folder of its own."""
    for name in THREADS:
        monkeypatch.setenv(name, "1")  # as one_thread.py does for good
    monkeypatch.chdir(folder)
    arguments = [str(folder) if a == "FOLDER" else a for a in shlex.split(run.arguments)]
    monkeypatch.setattr(sys, "argv", [f"{run.script}.py", *arguments])
    ended = None
    try:
        benchmark(run.script).main()
    except SystemExit as exit_:
        ended = exit_.code
    plt.close("all")
    assert not ended, ended
    return capsys.readouterr().out


RARE = {  # that take longest, and whose parts have tests of their own
    *("complex_modes", "contact_pairs", "cycle_cost", "cycle_verdicts", "hybrid", "integrators"),
    *("irregular_levels", "level_over_basis", "mesh_convergence", "method_costs", "mode_columns"),
    *("narrow_tongues", "proofs", "reanalysis", "reduction_errors", "same_tables", "size_parts"),
    *("small_batches", "squeal_judge", "tracking", "transient_kernels", "unstable_check", "walks"),
}
MARKED = [pytest.param(r, marks=[pytest.mark.full_size] * (r.script in RARE)) for r in RUNS]


@pytest.mark.parametrize("run", MARKED, ids=str)
def test_it_runs_and_prints_its_table(run, tiny_brake, tmp_path, monkeypatch, capsys):
    if run.script == "squeal_judge" and CCX is None:
        pytest.skip("NOT JUDGED BY CALCULIX: there is no program ccx")
    assert run.prints in printed(run, tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize("name", sorted({*RARE, *(run.script for run in LONG)}))
def test_what_runs_on_some_days_alone_says_how(name, monkeypatch, capsys):
    """So it can be imported, too."""
    monkeypatch.setattr(sys, "argv", [f"{name}.py", "--help"])
    ended: int | str | None = None
    try:
        benchmark(name).main()
    except SystemExit as exit_:
        ended = exit_.code
    said = f"{ended or ''}{capsys.readouterr().out}"
    assert re.search(r"^(usage|Run): ", said, re.MULTILINE)


@pytest.mark.by_hand
@pytest.mark.parametrize("run", LONG, ids=str)
def test_it_runs_for_long(run, tmp_path, monkeypatch, capsys, request):
    pytest.importorskip(NEEDED.get(run.script, "numpy"))
    if run.arguments == "judge" and CCX is None:
        pytest.skip("NOT JUDGED BY CALCULIX: there is no program ccx")
    if "--m0" in run.arguments:
        monkeypatch.setenv("SQUEALSTUDY_DATA", str(request.getfixturevalue("m0_files").parent))
    assert run.prints in printed(run, tmp_path, monkeypatch, capsys)


def test_every_benchmark_is_run():
    texts = {path.stem: path.read_text(encoding="utf-8") for path in BENCHMARKS.glob("*.py")}
    scripts = {name for name, text in texts.items() if MAIN in text}
    assert scripts == {run.script for run in [*RUNS, *LONG]} | {*OF_RESULTS, *ELSEWHERE}


# -- studies -------------------------------------------------------------------------------------
COARSER = ('mesh = "medium"', 'mesh = "coarse"')
SHORT_PROOF = "[goal]", "[goal]\nstarts = 1\nscan = 0\nfull_order = 0\nin_time = 0\ncycles = 0"
STUDIES: dict[str, list[tuple[str, str]]] = {
    "brake_families": [
        ("samples = 60", "samples = 1"),
        ('families = "all"', "families = [2]"),
        ("8e3", "3e3"),
    ],
    "brake_verdicts": [
        ("num = 20", "num = 1"),
        ("num = 10", "num = 1"),
        ("2.9e3, 5.3e3", "5e2, 2e3"),
        ("screen = 250.0", "screen = 1.0"),
    ],
    "quiet_brake": [
        ("num = 8", "num = 2"),
        (', "4 bar", "8 bar", "12 bar", "20 bar", "30 bar"]', "]"),
        ('["20 degC", "100 degC", "200 degC", "300 degC"]', '["100 degC"]'),
        ("8000.0", "4000.0"),
        ("7-14", "7-9"),
        ("7-15", "7-9"),
        SHORT_PROOF,
    ],
    "quiet_medium": [
        COARSER,
        ("num = 4", "num = 2"),
        (', "12 bar", "30 bar"]', "]"),
        ("8000.0", "4000.0"),
        ("7-14", "7-9"),
        ("7-15", "7-9"),
        SHORT_PROOF,
    ],
}


def test_every_study_is_run():
    assert {path.stem for path in BENCHMARKS.glob("*.toml")} == {*STUDIES}


MARKED_STUDIES = [
    pytest.param(name, marks=pytest.mark.by_hand if "quiet" in name else pytest.mark.full_size)
    for name in STUDIES
]


@pytest.mark.parametrize("name", MARKED_STUDIES)
def test_a_study_runs(name, tiny_brake, tmp_path, monkeypatch, capsys):
    text = (BENCHMARKS / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in STUDIES[name]:
        assert old in text, old
        text = text.replace(old, new)
    path = tmp_path / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    results = squealstudy.run(path, tmp_path / "results", jobs=1, yes=True)
    assert (results.points["status"] == "ok").all()
    if name == "brake_families":
        run = Run("cycle_screen", str(tmp_path / "results"), "of 1 families followed")
        assert run.prints in printed(run, tmp_path, monkeypatch, capsys)


def is_of(module, name):
    if hasattr(module, name):
        return True
    is_package = hasattr(module, "__path__")
    return is_package and importlib.util.find_spec(f"{module.__name__}.{name}") is not None


def test_what_they_take_from_the_package_is_there():
    """The longest ones run once in ten days; what states of the past lack is tried for."""
    taken = {}
    for path in sorted(BENCHMARKS.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        tried = {
            inner
            for node in ast.walk(tree)
            if isinstance(node, ast.Try)
            for inner in ast.walk(node)
        }
        for node in set(ast.walk(tree)) - tried:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("squealstudy"):
                taken |= {(node.module, name.name): path.name for name in node.names}
    assert len(taken) > 100
    assert not [
        f"{script}: {name} of {module}"
        for (module, name), script in taken.items()
        if not is_of(importlib.import_module(module), name)
    ]
