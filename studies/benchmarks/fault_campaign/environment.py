"""Runs whose environment fails: full disks, places that cannot be written, limits; then mended.

Each fault is a mount namespace of its own, so that nothing needs to be undone. Needs root; what
depends on permissions is run without the right to pass over them.
"""

from __future__ import annotations

import random
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fault_campaign.finding import Finding
from fault_campaign.scenes import RUN, UNWANTED, Scene, leftovers, scenes

PART = "environment"
SMALL, BRAKE, TIME = "hulten_modes", "brake_geometry", "belt_newmark"
PATIENCE_S = 300
NO_RIGHTS = "setpriv --inh-caps=-all --bounding-set=-dac_override,-dac_read_search,-fowner,-chown"
HELD, MENDED = "held", "mended"  # directories of the results, of the second run's output


@dataclass(frozen=True)
class Fault:
    """What fails, and how the command should end.

    Attributes
    ----------
    name : str
    before : str
        Shell commands that make it fail; ``$R`` is the results directory, ``$C`` the cache.
    codes : tuple of int
        Exit codes that are right: 1 for the environment's faults, 0 where a run can go on.
    limit : str
        Shell commands of the disturbed run alone, such as ulimit.
    redirect : str
    mend : str
        Shell commands that take the fault away.
    study : str
    plain_user : bool
        Without the right to pass over permissions.
    """

    name: str
    before: str = ":"
    codes: tuple[int, ...] = (1,)
    limit: str = ""
    redirect: str = ""
    mend: str = ":"
    study: str = SMALL
    plain_user: bool = False


def _full(kilobytes: int, place: str = "$R") -> str:
    return f"mkdir -p {place}; mount -t tmpfs -o size={kilobytes}k none {place}"


GROW = "mount -o remount,size=1g"
READ_ONLY_TMP = "mount -t tmpfs -o ro none /dev/shm; export TMPDIR=/proc"
FAULTS = (
    Fault("no space for results, 4 kB", _full(4), mend=f"{GROW} $R"),
    Fault("no space for results, 32 kB", _full(32), mend=f"{GROW} $R"),
    Fault("no space for results, 64 kB", _full(64), (0, 1), mend=f"{GROW} $R"),
    Fault("no space for the tables", _full(128), (0, 1), mend=f"{GROW} $R"),
    Fault("no space for results of a brake", _full(24), mend=f"{GROW} $R", study=BRAKE),
    Fault("no space for histories", _full(64), mend=f"{GROW} $R", study=TIME),
    Fault("no space for the cache", "rm -r $C; " + _full(4, "$C"), (0, 1)),
    Fault(
        "no space for the cache of a brake", "rm -r $C; " + _full(400, "$C"), (0, 1), study=BRAKE
    ),
    Fault("files limited to 4 kB", limit="ulimit -f 4"),
    Fault("read-only results", "mkdir $R; mount -t tmpfs -o ro none $R", mend="umount $R"),
    Fault(
        "results that may not be written",
        "mkdir $R; chmod a-w $R",
        mend="chmod u+w $R",
        plain_user=True,
    ),
    Fault("results below a file", "echo > $R; R=$R/below", mend="rm ${R%/below}"),
    Fault("a read-only cache", "chmod -R a-w $C", (0,), plain_user=True),
    Fault(
        "an empty read-only cache",
        "rm -r $C; mkdir $C; chmod a-w $C",
        (0,),
        study=BRAKE,
        plain_user=True,
    ),
    Fault("a cache that is a file", "rm -r $C; echo > $C", (0,)),
    Fault("a cache below a file", "export SQUEALSTUDY_CACHE=/etc/passwd/cache", (0,)),
    Fault("kernels that cannot be kept", "export NUMBA_CACHE_DIR=/proc/nowhere", (0,), study=TIME),
    Fault("no home", "unset HOME SQUEALSTUDY_CACHE", (0,)),
    Fault("a home that is not there", "unset SQUEALSTUDY_CACHE; export HOME=/nowhere", (0,)),
    Fault("no folder for temporary files", "export TMPDIR=/nowhere", (0,), study=BRAKE),
    Fault("no room for shared memory", READ_ONLY_TMP, (0, 1), mend="umount /dev/shm", study=BRAKE),
    Fault("8 open files", limit="ulimit -n 8"),
    Fault("16 open files", codes=(0, 1), limit="ulimit -n 16"),
    Fault("20 open files and workers", codes=(0, 1), limit="ulimit -n 20", study=BRAKE),
    Fault("600 MB of memory", codes=(0, 1), limit=f"ulimit -v {600 * 1024}"),
    Fault("1 GB of memory", codes=(0, 1), limit=f"ulimit -v {1024**2}"),
    Fault("700 MB and workers", codes=(0, 1), limit=f"ulimit -v {700 * 1024}", study=BRAKE),
    Fault("1.2 GB and workers", codes=(0, 1), limit=f"ulimit -v {1200 * 1024}", study=BRAKE),
    Fault("1 GB in time", codes=(0, 1), limit=f"ulimit -v {1024**2}", study=TIME),
    Fault("no standard output", codes=(0, 1), redirect=">&-"),
    Fault("standard output full", redirect="> /dev/full"),
    Fault("no standard error", codes=(0,), redirect="2>&-"),
    Fault("no standard input", codes=(0,), redirect="<&-"),
    Fault(
        "results removed in between",
        "(while ! ls $R/chunks/*.parquet; do sleep .01; done; rm -rf $R) > /dev/null 2>&1 &",
        (0, 1),
        study=BRAKE,
    ),
    Fault("files of tomorrow", "find $C -exec touch -d tomorrow {} +", (0,)),
    Fault("a study that may not be read", "chmod a-r {study}", (2,), plain_user=True),
    Fault("a study that is a folder", "rm {study}; mkdir {study}", (2,)),
    Fault("a study in UTF-16", "iconv -t UTF-16 {study} > u; mv u {study}", (2,)),
)


def run(
    count: int, seed: int, work: Path, names: tuple[str, ...] = (SMALL, BRAKE, TIME)
) -> Iterator[Finding]:
    """Try `count` of the faults of some studies, all where there are no more."""
    chosen = [number for number, fault in enumerate(FAULTS) if fault.study in names]
    if count < len(chosen):
        chosen = sorted(random.Random(seed).sample(chosen, count))
    names = tuple(dict.fromkeys(FAULTS[number].study for number in chosen))
    made = {scene.name: scene for scene in scenes(names, work / PART)}
    for number in chosen:
        fault = FAULTS[number]
        verdict, text = _tried(fault, made[fault.study], work / PART / f"fault{number}")
        yield Finding(PART, number, fault.name, verdict, text)


def _tried(fault: Fault, scene: Scene, folder: Path) -> tuple[str, str]:
    """Run the study with the fault and without; the verdict and what was said."""
    folder.mkdir()
    shutil.copytree(scene.cache, folder / "cache")
    for path in [*scene.folder.glob("*.toml"), *scene.folder.glob("*.mtx")]:
        shutil.copy(path, folder)
    study = f"{scene.name}.toml"
    command = [sys.executable, "-c", RUN, "run", study, "--no-pictures", "--jobs", "2"]
    words = f"{shlex.join(command)} --output $R"
    alone = f"exec {NO_RIGHTS} " if fault.plain_user else "exec "
    script = f"""
        cd {shlex.quote(str(folder))}
        export PYTHONDONTWRITEBYTECODE=1 OMP_NUM_THREADS=1
        export SQUEALSTUDY_CACHE=$PWD/cache NUMBA_CACHE_DIR={shlex.quote(str(scene.kernels))}
        R=$PWD/{HELD} C=$PWD/cache
        ( ( {fault.before.format(study=study) if "{study}" in fault.before else fault.before}
            echo $R > place
            ( {fault.limit or ":"}; {alone}{words} ) > said 2> problems {fault.redirect}
            echo $? > code
            {fault.mend} ) )
        cp {shlex.quote(str(scene.folder))}/{study} . 2> nothing || {{
            rm -rf {study}; cp {shlex.quote(str(scene.folder))}/{study} .; }}
        {_again(fault)}
        {words} > said_again 2>&1
        echo $? > code_again
        cp -r $R {MENDED}
    """
    done = subprocess.run(
        ["unshare", "-m", "bash", "-c", script],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    if not (folder / "code_again").is_file():
        return "crash", f"the script of this fault fails: {done.stderr}"
    return _judged(fault, scene, folder)


def _again(fault: Fault) -> str:
    """What the second run needs where the first one's cache was spoilt."""
    return "mkdir -p again; export SQUEALSTUDY_CACHE=$PWD/again" if "$C" in fault.before else ":"


def _judged(fault: Fault, scene: Scene, folder: Path) -> tuple[str, str]:
    code, again = (int((folder / name).read_text()) for name in ("code", "code_again"))
    said = (folder / "problems").read_text(errors="replace")
    sentences = [line for line in said.splitlines() if line.startswith("squealstudy:")]
    text = f"exit {code}: {said}"
    if "internal error" in said:
        return "internal error", text
    if any(word in said for word in UNWANTED):
        return "traceback", text
    if code not in fault.codes:
        return "crash", f"expected exit {fault.codes}, {text}"
    silenced = "2>" in fault.redirect
    if code and len(sentences) != 1 and not silenced:
        return "silent", f"expected one sentence, {text}"
    if again:
        return "crash", f"the run after it: {(folder / 'said_again').read_text()}"
    if different := scene.differences(folder / MENDED):
        return "differs", "; ".join(different)
    if left := leftovers(folder / MENDED):
        return "leftover", ", ".join(map(str, left))
    return ("message" if sentences else "equal"), text
