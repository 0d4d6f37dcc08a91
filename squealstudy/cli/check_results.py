"""Text of `squealstudy check` on a results directory: its contents and any damage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa

from squealstudy.engine.column_types import misfit
from squealstudy.engine.journal import JOURNAL, MISSING, UNFINISHED, refused_names
from squealstudy.engine.manifest import SIDE_STUDIES
from squealstudy.engine.manifest_file import PICTURES, read_manifest, version_of
from squealstudy.engine.recorded_code import extensions_of_results
from squealstudy.engine.result_names import LOCK, MANIFEST, SET_ASIDE
from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError
from squealstudy.files import TEMPORARY, is_plain_file
from squealstudy.screen import Rows
from squealstudy.study.kinds import kind_named, kind_names
from squealstudy.wording import failure_counts, plural, status_counts

FOREIGN = "of others"
EXECUTED = "you have run it on this machine; shape and report execute your file, or a copy of it"
NOT_EXECUTED = "you have not run it on this machine: no command executes it unless --extension does"
NO_CODE = "none of its own: no command executes anything of this directory"
UNKNOWN_CODE = "cannot be told without a manifest: no command executes anything of this directory"
MISFIT = "no table of this kind"  # undamaged, but with other columns than a run writes


def check_results(directory: Path) -> tuple[Rows, bool]:
    """Facts of a results directory, and whether all files are as the run wrote them.

    Reads each file once and writes nothing.

    Raises
    ------
    ResultsError
        The directory holds no results of squealstudy.
    """
    store = Store(directory)
    try:
        manifest = read_manifest(directory) or {}
    except ResultsError:
        manifest = {}  # `Store.faults` tells the fault
    if not manifest and not store.journal.begun:
        raise ResultsError(f"{directory}: holds no results of squealstudy")
    identity = tuple(str(manifest.get(key, "unknown")) for key in ("name", "kind", "model"))
    name, kind, model = identity if manifest else store.journal.owner or identity
    misfits = _misfits(store, manifest)
    rows: Rows = [("study", f"{name}: {kind} of {model}")]
    rows += [*_run(store, manifest, misfits), *_sizes(store)]
    code = [
        ("code", f"{name}: {EXECUTED if is_executed else NOT_EXECUTED}")
        for name, is_executed in extensions_of_results(manifest, directory)
    ]
    rows += code or [("code", NO_CODE if manifest else UNKNOWN_CODE)]
    if not store.journal.begun:
        return [*rows, ("whole", "cannot be told: a version that kept no journal wrote it")], True
    faults = store.faults()
    if not is_plain_file(directory / MANIFEST):
        faults.setdefault(MISSING, []).append(MANIFEST)
    finished = manifest.get("status") == "complete"
    for fault, names in _in_no_journal(store, manifest).items():
        faults.setdefault(fault, []).extend(names)
    if misfits:
        faults[MISFIT] = [f"{name}: {why}" for name, why in misfits.items()]
    rows += [(fault, file) for fault, names in faults.items() for file in sorted(names)]
    if n_unreadable := store.journal.unreadable:
        text = f"{plural(n_unreadable, 'line')} cannot be read, after a kill or by damage"
        rows.append((JOURNAL, f"{text}: what only such a line names is made anew"))
    rows += [
        (JOURNAL, f"names {refused_names(store.journal)}, which no run writes here: not touched")
    ] * bool(store.journal.refused)
    harmless = {FOREIGN} if finished else {FOREIGN, UNFINISHED}  # a killed run may leave these
    is_intact = faults.keys() <= harmless
    for folder, reason in manifest.get(SIDE_STUDIES, {}).items():
        if not reason:
            facts, is_whole = _check_side_study(directory / folder)
            rows += [(f"{folder}: {name}", text) for name, text in facts]
            is_intact &= is_whole
    verdict = "yes" if is_intact else "no: run the study again, which makes anew what is not"
    return [*rows, ("whole", verdict)], is_intact


def _check_side_study(directory: Path) -> tuple[Rows, bool]:
    """`check_results` of a side study, such as a variant; an error becomes a line of the facts."""
    try:
        return check_results(directory)
    except ResultsError as error:
        return [("whole", f"no: {error}")], False


def _misfits(store: Store, manifest: Mapping[str, Any]) -> dict[str, str]:
    """Reasons why undamaged tables are not those of a run of the kind, by file."""
    kind = str(manifest.get("kind"))
    reasons: dict[str, str] = {}
    for name in kind_named(kind).tables if kind in kind_names() else ():
        if not store.fault(name):
            try:
                schema, n_rows = store.shape_of(name)
                units, table = manifest.get("units", {}), name.removesuffix(".parquet")
                reasons[name] = misfit(schema, kind, table, units, n_rows)
            except ResultsError as error:
                reasons[name] = str(error)
    return {name: why for name, why in reasons.items() if why}


def _run(store: Store, manifest: Mapping[str, Any], misfits: Collection[str]) -> Rows:
    """Status of the run, and how many points are ok, failed and missing."""
    if not manifest:
        return []
    status, kind = manifest.get("status", "unknown"), manifest["kind"]
    rows = [("run", f"{status}, by squealstudy {version_of(dict(manifest))}")]
    if kind not in kind_names():  # of an extension
        return rows
    study_kind = kind_named(kind)
    n_points, status_tables = int(manifest.get("n_points", 0)), []
    first = study_kind.tables[0]
    if status == "complete" and not store.fault(first) and first not in misfits:
        status_tables = [store.read_table(first, ["status"])]
    if sum(map(len, status_tables)) != n_points:  # rows of the table are not the points
        status_tables = list(store.chunks(study_kind.schema, ["status"]))
    statuses = pa.chunked_array(
        [c.cast(pa.string()) for t in status_tables for c in t["status"].chunks], pa.string()
    )
    counts = [f"{status_counts(statuses).get('ok', 0)} ok", failure_counts(statuses)]
    counts.append(f"{max(0, n_points - len(statuses))} missing")
    return [*rows, (f"{study_kind.row_word}s", f"{n_points}: {', '.join(filter(None, counts))}")]


def _sizes(store: Store) -> Rows:
    """Number and size of the finished files of each folder."""
    count: Counter[str] = Counter()
    size: Counter[str] = Counter()
    for name, entry in store.journal.entries.items():
        folder = name.rpartition("/")[0] or "tables"
        count[folder] += 1
        size[folder] += entry.size
    return [(key, f"{plural(n, 'file')}, {size[key] / 1e6:.3g} MB") for key, n in count.items()]


def _in_no_journal(store: Store, manifest: Mapping[str, Any]) -> dict[str, list[str]]:
    """Files that the journal does not name: UNFINISHED ones of squealstudy, and FOREIGN ones."""
    named_files = {*store.journal.entries, MANIFEST, LOCK, JOURNAL, *manifest.get(PICTURES, [])}
    unfinished = set(store.unfinished())
    if manifest.get("kind") in kind_names():
        unfinished |= {*kind_named(manifest["kind"]).tables} - named_files
    by_origin: dict[str, list[str]] = {}
    elsewhere = tuple(f"{folder}/" for folder in (SET_ASIDE, *manifest.get(SIDE_STUDIES, {})))
    for path in sorted(p for p in store.directory.rglob("*") if p.is_file()):
        name = path.relative_to(store.directory).as_posix()
        if name not in named_files and not name.startswith(elsewhere):
            ours = name in unfinished or path.match(TEMPORARY)
            by_origin.setdefault(UNFINISHED if ours else FOREIGN, []).append(name)
    return by_origin
