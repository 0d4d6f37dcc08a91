"""What small models cost in batches, in studies and in the library.

    python studies/benchmarks/small_batches.py [--samples 128 16384] [--points 100001]
        [--sensitivities 10000] [--cycles 200] [--runs 10000] [--family 10000] [--then COMMIT]

Studies are run by the command in a process of its own, without pictures, from an empty cache. For
each number of Sobol samples complex modes over the scatter of friction and of two parameters of the
structure: of Hulten's model, and of Hoffmann's with the exponential law. Then so many frictions:
sensitivities of Hoffmann's model, limit cycles of Hulten's with a contact that hardens, runs of a
mass on a belt, and all modes of a family of 60 x 60 matrices, a point of which is also held against
`scipy.linalg.eig` of its companion matrix with both vectors. Processor seconds, those beyond a
study of two points of the same sort, the same a point, peak memory, and files in the cache
afterwards; kernels are compiled before. Last modes of a batch of frictions by the library, without
a study.

With `--then` each study is solved by an earlier state of the project, too, right before: a commit,
of which a git worktree is made and removed, or its folder. Its seconds, and the ratio, follow.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import scipy.io
import scipy.linalg
from other_state import ROOT, tree_of

import squealstudy as sq

HEAD = """
[study]
name = "many"
kind = "{kind}"
[model]
name = "{model}"
{options}
[parameters]
damping_ratio = 0.01
{parameters}
[modes]
band = [10.0, 1000.0]
[[sweep]]
parameter = "friction"
"""
SCATTER = """
distribution = "truncated_normal"
mean = {mean}
std = {std}
start = 0.1
stop = 1.6
{others}
[design]
type = "sobol_indices"
samples = {samples}
seed = 3
limit = 10_000_000
"""
NORMAL = '[[sweep]]\nparameter = "{}"\ndistribution = "normal"\nmean = {}\nstd = {}\n'
MODELS = {
    "hulten": {
        "options": "",
        "friction": (0.3, 0.06),
        "others": (("frequency_1", 100.0, 2.0), ("frequency_2", 75.0, 2.0)),
    },
    "hoffmann": {
        "options": 'contact_law = "exponential"',
        "friction": (0.75, 0.1),
        "others": (("k1", 1.786e5, 5e3), ("mass", 1.0, 0.02)),
    },
}
FAMILY = """
[study]
name = "family"
kind = "complex_modes"
[model]
name = "matrices"
folder = "{folder}"
[[model.term]]
matrix = "M"
file = "M.mtx"
[[model.term]]
matrix = "C"
file = "C.mtx"
[[model.term]]
matrix = "K"
file = "K.mtx"
[[model.term]]
matrix = "K"
file = "coupling.mtx"
coefficient = "friction"
[parameters]
friction = 0.1
[[sweep]]
parameter = "friction"
start = 0.0
stop = 1.0
num = {num}
[design]
limit = 1_000_000
[modes]
band = [1.0, 20000.0]
track = false
"""
FAMILY_SIZE = 60  # coordinates
REFERENCE_POINTS = 60  # roots by LAPACK that are timed
LINES = {  # kind of study: model, options, parameters, ends of the frictions
    "sensitivity": ("hoffmann", "", "", (0.8, 1.2)),
    "limit_cycles": (
        "hulten",
        'contact_law = "cubic"',
        '"contact.cubic_stiffness" = 5e17',
        (0.32, 0.6),
    ),
    "transient": ("belt", "", "", (0.2, 0.5)),
}
SECTIONS = {"transient": "[transient]\nduration = 0.1\nstep = 2e-5\nsave_every = 0\n"}


def scatter(model: str, samples: int) -> str:
    """Text of a study of complex modes; with 0 samples that of two points."""
    given = MODELS[model]
    head = HEAD.format(kind="complex_modes", model=model, options=given["options"], parameters="")
    if not samples:
        return head + "values = [0.2, 0.4]\n"
    mean, std = given["friction"]
    others = "".join(NORMAL.format(*row) for row in given["others"])
    return head + SCATTER.format(mean=mean, std=std, others=others, samples=samples)


def line(kind: str, points: int) -> str:
    """Text of a study of so many frictions; with 0 points that of the two ends."""
    model, options, parameters, (start, stop) = LINES[kind]
    head = HEAD.format(kind=kind, model=model, options=options, parameters=parameters)
    sweep = f"start = {start}\nstop = {stop}\nnum = {points or 2}\n"
    return head + sweep + SECTIONS.get(kind, "")


def run(folder: Path, text: str, tree: Path = ROOT) -> tuple[float, float, int, int]:
    """Processor seconds, peak memory [MB], points, and files in the cache of a study.

    Solved by the code in `tree`, whose compiled kernels are kept beside the study's folder.
    """
    import pandas as pd

    path, cache = folder / "study.toml", folder / "cache"
    folder.mkdir()
    path.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "squealstudy", "run", str(path), "-o", str(folder / "out")]
    kernels = {"NUMBA_CACHE_DIR": str(folder.parent / "kernels")}
    environment = kernels | os.environ | {"SQUEALSTUDY_CACHE": str(cache), "PYTHONPATH": str(tree)}
    said = folder / "said.txt"
    with said.open("w") as lines:
        process = subprocess.Popen(
            [*command, "--no-pictures", "--yes"],
            stdout=subprocess.DEVNULL,
            stderr=lines,
            env=environment,
            cwd=folder,  # -m looks for the package here first
        )
        _, status, usage = os.wait4(process.pid, 0)
    if status:
        error = said.read_text(encoding="utf-8")
        raise RuntimeError(f"{text}: ended with {status}: {error}")
    seconds = usage.ru_utime + usage.ru_stime
    points = len(pd.read_parquet(folder / "out" / "points.parquet", columns=["status"]))
    files = sum(p.is_file() for p in (cache / "models").rglob("*"))
    return seconds, usage.ru_maxrss / 1024, points, files


def rows(name: str, texts: list[str], then: Path | None) -> float:
    """Print a row a study: what others take beyond the first, and took by the code in `then`.

    Gives the processor seconds of the last one beyond the first, by today's code.
    """
    trees = [ROOT] if then is None else [then, ROOT]
    with tempfile.TemporaryDirectory() as folder:
        for tree in trees:
            run(Path(folder) / f"compiling_{trees.index(tree)}", texts[0], tree)
        seconds_of_two: list[float] = []
        for k, text in enumerate(texts):
            runs = [run(Path(folder) / f"{k}_{i}", text, tree) for i, tree in enumerate(trees)]
            seconds_of_two = seconds_of_two or [spent[0] for spent in runs]
            beyond = [spent[0] - two for spent, two in zip(runs, seconds_of_two, strict=True)]
            seconds, memory, points, files = runs[-1]
            each = f"{1e6 * beyond[-1] / points:.0f}" if points > 2 else ""
            row = f"| {name} | {points:,} | {seconds:.2f} | {beyond[-1]:.2f} | {each} "
            if then is None:
                earlier = ""
            elif points > 2:
                earlier = f" {beyond[0]:.2f} | {beyond[-1] / beyond[0]:.3f} |"
            else:
                earlier = f" {runs[0][0]:.2f} in all | {seconds / runs[0][0]:.3f} |"
            print(f"{row}| {memory:.0f} | {files} |{earlier}", flush=True)
    return beyond[-1]


def studies(asked: argparse.Namespace, then: Path | None) -> None:
    """Print the table of studies."""
    earlier = "" if then is None else " then beyond | ratio |"
    heads = "study | points | CPU-s | beyond two points | us a point | MB | files in the cache"
    print(f"| {heads} |{earlier}")
    print("|---" * (7 if then is None else 9) + "|")
    for model in MODELS if asked.samples else ():
        texts = [scatter(model, samples) for samples in (0, *asked.samples)]
        rows(f"complex modes of {model}", texts, then)
    counts = (asked.sensitivities, asked.cycles, asked.runs)
    for kind, count in zip(LINES, counts, strict=True):
        if count:
            rows(f"{kind} of {LINES[kind][0]}", [line(kind, n) for n in (0, count)], then)


def family(count: int, then: Path | None) -> None:
    """Print the rows of a family of matrices, and what a point costs beside LAPACK's roots."""
    rng = np.random.default_rng(1)
    omega = 2 * np.pi * np.sort(rng.uniform(200.0, 5000.0, FAMILY_SIZE))
    Q = np.linalg.qr(rng.normal(size=(FAMILY_SIZE, FAMILY_SIZE)))[0]
    skew = rng.normal(size=(FAMILY_SIZE, FAMILY_SIZE))
    C, K = 2e-3 * (Q * omega) @ Q.T, (Q * omega**2) @ Q.T
    coupling = 1e-3 * omega.mean() ** 2 * (skew - skew.T)
    with tempfile.TemporaryDirectory() as folder:
        matrices = {"M": np.eye(FAMILY_SIZE), "C": C, "K": (K + K.T) / 2, "coupling": coupling}
        for name, matrix in matrices.items():
            scipy.io.mmwrite(Path(folder) / f"{name}.mtx", matrix, precision=17)
        texts = [FAMILY.format(folder=folder, num=num) for num in (2, count)]
        beyond = rows(f"modes of {FAMILY_SIZE} x {FAMILY_SIZE}", texts, then)
    started = time.process_time()
    for friction in np.linspace(0.0, 1.0, REFERENCE_POINTS):
        A = np.block(
            [[np.zeros_like(K), np.eye(FAMILY_SIZE)], [-K - friction * coupling, -C]],
        )
        scipy.linalg.eig(A, left=True, right=True)
    reference = (time.process_time() - started) / REFERENCE_POINTS
    point = beyond / (count - 2)
    print(
        f"\na point: {1e3 * point:.2f} ms; scipy.linalg.eig: {1e3 * reference:.2f} ms; "
        f"ratio {point / reference:.2f}"
    )


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, nargs="*", default=[128, 16384])
    parser.add_argument("--points", type=int, default=100_001)
    parser.add_argument("--sensitivities", type=int, default=10_000)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--family", type=int, default=10_000)
    parser.add_argument("--then", metavar="COMMIT")
    asked = parser.parse_args()
    with nullcontext() if asked.then is None else tree_of(asked.then) as then:
        studies(asked, then)
        if asked.family > 2:
            family(asked.family, then)
    model = sq.model("hulten")
    model.at(friction=np.linspace(0.0, 1.0, 3)).modes()  # imports
    started = time.process_time()
    found = model.at(friction=np.linspace(0.0, 1.0, asked.points)).modes()
    spent = time.process_time() - started
    modes = f"{found.counts.sum():,} modes"
    print(f"\nlibrary: {asked.points:,} frictions of hulten, {modes}: {spent:.2f} CPU-s")


if __name__ == "__main__":
    main()
