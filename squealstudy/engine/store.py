"""A results directory: what its files are called, and the one place that writes and reads them.

Each file is whole or absent, and stands in the journal once it is finished; what is read is held
against the journal. The manifest is sealed by itself. A chunk file has one row for each design
point with its findings in lists, under an explicit schema.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from squealstudy.columns import column_of
from squealstudy.engine.journal import DAMAGED, JOURNAL, UNFINISHED, Journal, Owner, refused_names
from squealstudy.engine.keys import ID_TYPE, content_hash
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.parameter_units import parameter_units
from squealstudy.engine.result_names import (
    CHUNKS,
    HISTORIES,
    MANIFEST,
    PART_PREFIX,
    REFERENCES,
    RUN_FILES,
    SET_ASIDE,
    STATES,
    expect_inside,
    leads_out,
)
from squealstudy.engine.table_files import read_batches, read_chunk, read_file, readable
from squealstudy.errors import MachineError, ResultsError
from squealstudy.files import (
    OF_JSON,
    TEMPORARY,
    arrays_writer,
    is_plain_file,
    read_whole,
    text_writer,
    write_all,
    write_atomic,
)
from squealstudy.study.kinds import facts_of
from squealstudy.study.parameters import onset_parameter
from squealstudy.wording import OF_THE_ONSET, OWN_UNITS, listed, units_of

if TYPE_CHECKING:
    import pandas as pd

POINTS, MODES, GROWTH = "points.parquet", "modes.parquet", "growth.parquet"
WINDOWS = "windows.parquet"
ONSETS = "onsets.parquet"
SENSITIVITIES = "sensitivities.parquet"
MEASUREMENTS, ERRORS = "measurements.parquet", "errors.parquet"
CELLS = "cells.parquet"
CYCLES, VERDICTS, BRANCHES = "cycles.parquet", "verdicts.parquet", "branches.parquet"
DESIGNS, VARIANTS = "designs.parquet", "variants.parquet"
MARGINS, SLOPES, PROOF = "margins.parquet", "slopes.parquet", "proof.parquet"
CURVES, VELOCITIES, BORDERS = "curves.parquet", "velocities.parquet", "borders.parquet"
INACCURATE = "inaccurate"  # status of a point whose roots are there, with too large an error
PART_ROWS = 1_000_000  # most rows of one file; larger tables are several files
GROUP_ROWS = 2**17  # rows of a table that are read together
UNIT = b"unit"  # key of a column's unit in the metadata of its field


def column_units(
    manifest: Mapping[str, Any], columns: Iterable[str], table: str = ""
) -> dict[str, str]:
    """Unit of each column that has one, empty for pure numbers; onsets have their parameter's.

    `table` is the file of the table, where it is one of the results.
    """
    of_parameters = parameter_units(manifest)
    along = of_parameters.get(onset_parameter(manifest.get("sweeps", [])) or "", "")
    units = units_of(
        columns, {**of_parameters, **OWN_UNITS.get(table.removesuffix(".parquet"), {})}
    )
    return {name: along if unit == OF_THE_ONSET else unit for name, unit in units.items()}


class Store:
    """The files of a results directory beside its manifest; names are paths below it.

    Attributes
    ----------
    directory : Path
        Made where something is written.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    @cached_property
    def journal(self) -> Journal:
        """The journal as it was when first read, and what this store has written since."""
        return Journal(self.directory)

    # -- writing; one process at a time (`manifest.locked`) ------------------------------------
    def write_table(self, name: str, table: pa.Table) -> None:
        """A table as a Parquet file; a long one as a folder of several (`write_parts`)."""
        self.write_parts(name, table.num_rows, lambda rows: table.slice(rows.start, PART_ROWS))

    def write_parts(self, name: str, count: int, part: Callable[[slice], pa.Table]) -> None:
        """A table of `count` rows that is made part by part, so that it is never held whole.

        Up to PART_ROWS rows it is one file, beyond that a folder of that name with a file for each
        so many rows. `pandas.read_parquet` opens both alike.
        """
        rows = [slice(i, min(i + PART_ROWS, count)) for i in range(0, max(count, 1), PART_ROWS)]
        folder = self.directory / name
        names = [name]
        if len(rows) > 1:
            names = [f"{name}/{PART_PREFIX}{number:05}.parquet" for number in range(len(rows))]
        before = [*self.parts(name), *(n for n in self.unfinished() if n.startswith(f"{name}/"))]
        self.journal.withdraw([*before, *names])
        if len(rows) > 1 and folder.is_file():
            folder.unlink()
        for old in set(before) - set(names):
            (self.directory / old).unlink(missing_ok=True)
        if len(rows) == 1 and folder.is_dir():
            folder.rmdir()
        for path, part_rows in zip(names, rows, strict=True):
            write_atomic(self.directory / path, _parquet(self._described(part(part_rows), name)))
        self.journal.add(names)

    def _described(self, table: pa.Table, name: str) -> pa.Table:
        """The table with unit, definition and error of each column in the metadata of its field."""
        manifest = read_manifest(self.directory) or {}
        units = column_units(manifest, table.column_names, name)
        kind, parameters = manifest.get("kind", ""), frozenset(manifest.get("units", {}))
        stem, fields = name.split("/")[0].removesuffix(".parquet"), []
        for field in table.schema:
            column = column_of(kind, stem, field.name, parameters)
            metadata = dict(field.metadata or {}) | (column.metadata if column else {})
            if field.name in units:
                metadata[UNIT] = units[field.name].encode()
            fields.append(field.with_metadata(metadata) if metadata else field)
        return table.cast(pa.schema(fields, metadata=table.schema.metadata))

    def parts(self, name: str) -> list[str]:
        """The finished files of a table, in the order of its rows: itself, or those in its folder.

        Without a journal, as of older versions, the file itself where it is there.
        """
        if not self.journal.begun:
            return [name] if is_plain_file(self.directory / name) else []
        return sorted(n for n in self.journal.entries if n == name or n.startswith(f"{name}/"))

    def write_json(self, name: str, content: Any) -> None:
        """A value as JSON."""
        self._write({name: json.dumps(content, indent=2) + "\n"})

    def write_files(self, files: Mapping[str, pa.Table | Mapping[str, Any]]) -> None:
        """Files beside the tables that belong together, by their paths."""
        self._write(files)

    def write_rows(self, rows: Sequence[dict[str, Any]], schema: pa.Schema) -> None:
        """Rows as one chunk file, named by its points."""
        self._write(_chunk_by_name(pa.Table.from_pylist(list(rows), schema=schema)))

    def write_chunk(
        self, rows: pa.Table, files: Mapping[str, pa.Table | Mapping[str, Any]] | None = None
    ) -> None:
        """Write what workers return: files beside the tables first, then rows as one chunk file."""
        self._write({**(files or {}), **_chunk_by_name(rows)})

    def _write(self, contents: Mapping[str, pa.Table | str | Mapping[str, Any]]) -> None:
        """Files that belong together: finished with the last of them."""
        self.journal.withdraw(list(contents))
        write_all({self.directory / name: self._writer(name, contents[name]) for name in contents})
        self.journal.add(list(contents))

    def _writer(
        self, name: str, content: pa.Table | str | Mapping[str, Any]
    ) -> Callable[[Path], None]:
        if isinstance(content, pa.Table):
            return _parquet(content if name.startswith(CHUNKS) else self._described(content, name))
        if isinstance(content, str):
            return text_writer(content)
        return arrays_writer(content)

    def repair(self, warn: Callable[[str], None]) -> bool:
        """Leave files that are whole alone: whether all were, or only never finished.

        What is damaged is set aside, and what a killed run did not finish is removed. `warn` is
        told what is damaged or missing.
        """
        for folder, _, files in os.walk(self.directory):  # which follows no links
            for path in (Path(folder, name) for name in files):
                if path.match(TEMPORARY):
                    path.unlink(missing_ok=True)
        if self.journal.refused:
            warn(
                f"{self.directory}: {JOURNAL} names {refused_names(self.journal)}, which no run "
                "writes here: not touched"
            )
        faults = self.faults()
        for fault, names in faults.items():
            self._give_up(names, fault == DAMAGED)
            aside = f", now in {self.directory / SET_ASIDE}" if fault == DAMAGED else ""
            warn(
                f"{self.directory}: {fault}{aside}: {listed(sorted(names))}; what was in it is "
                "made again"
            )
        for name in self.unfinished():
            (self.directory / name).unlink()
        return not faults

    def clear(self, owner: Owner, others: Iterable[str]) -> None:
        """Begin anew: remove all that the study wrote, and the `others` among the files here."""
        removed = [*self.journal.entries, *others, MANIFEST]
        self.journal.restart(owner)  # first: what a kill leaves is then not finished
        unfinished = self.unfinished()
        paths = [self.directory / name for name in (*removed, *unfinished)]
        for path in (path for path in paths if not path.is_dir()):
            path.unlink(missing_ok=True)
        shutil.rmtree(self.directory / SET_ASIDE, ignore_errors=True)
        tables = {
            Path(name).parent.as_posix() for name in (*removed, *unfinished) if PART_PREFIX in name
        }
        for folder in (CHUNKS, HISTORIES, STATES, REFERENCES, *tables):
            with contextlib.suppress(OSError):  # not there, or it holds what is not ours
                (self.directory / folder).rmdir()

    def faults(self) -> dict[str, list[str]]:
        """Files that are not as the journal or their seal says, by what is wrong with them."""
        by_fault: dict[str, list[str]] = {}
        for name in self.journal.entries:
            if fault := self.journal.fault(name):
                by_fault.setdefault(fault, []).append(name)
        try:
            read_manifest(self.directory)
        except ResultsError:
            by_fault.setdefault(DAMAGED, []).append(MANIFEST)
        return by_fault

    def _give_up(self, names: Iterable[str], keep: bool) -> None:
        """Files, and with them the files that they belong together with."""
        entries = self.journal.entries
        lost = {n for name in names if name in entries for n in entries[name].group}
        self.journal.withdraw(sorted(lost))
        for name in names if keep else ():
            aside = self.directory / SET_ASIDE / name.replace(f"/{PART_PREFIX}", f"-{PART_PREFIX}")
            expect_inside(self.directory, aside.parent.relative_to(self.directory).as_posix())
            aside.parent.mkdir(parents=True, exist_ok=True)
            (self.directory / name).replace(aside)

    def unfinished(self) -> list[str]:
        """Files of our own making that stand in no journal."""
        folders = (p for p in self.directory.iterdir() if p.is_dir() and not p.is_symlink())
        names = (f"{p.name}/{file.name}" for p in folders for file in p.iterdir())
        run_files = (
            n for n in names if RUN_FILES.fullmatch(n) and not (self.directory / n).is_dir()
        )
        return [name for name in run_files if name not in self.journal.entries]

    def unsolved(self, missing: int, n_points: int) -> MachineError:
        """The error of design points that are in no chunk file, though all were solved."""
        return MachineError(
            f"{self.directory}: {missing} of {n_points} design points are not solved, for "
            "their files were removed or damaged during the run"
        )

    # -- reading -------------------------------------------------------------------------------
    def names(self, folder: str) -> list[str]:
        """Finished files of a folder that are there, sorted; without a journal all files."""
        if leads_out(self.directory, folder):
            return []
        paths = filter(is_plain_file, (self.directory / folder).glob("[!.]*"))
        names = sorted(f"{folder}/{path.name}" for path in paths)
        return [n for n in names if n in self.journal.entries or not self.journal.begun]

    def fault(self, name: str, thoroughly: bool = True) -> str:
        """Fault of a file (`Journal.fault`); files of older versions are only looked for.

        By its size alone where not `thoroughly`.
        """
        if not self.journal.begun:
            return "" if is_plain_file(self.directory / name) else UNFINISHED
        faults = (self.journal.fault(part, thoroughly) for part in self.parts(name) or [name])
        return next(filter(None, faults), "")

    def whole(self, name: str) -> Path:
        """The path of a file that is as it was written; ResultsError where it is not."""
        path = self.directory / name
        if fault := self.fault(name):
            raise ResultsError(
                f"{path}: {fault}: it is not what the run wrote; run the study again to make it "
                "anew"
            )
        return path

    def read_table(self, name: str, columns: Sequence[str] | None = None) -> pa.Table:
        """A table; ResultsError where it is not as it was written."""
        with readable(self.whole(name)):
            parts = [read_file(self.directory / part, columns) for part in self.parts(name)]
            return pa.concat_tables(parts)

    def shape_of(self, name: str) -> tuple[pa.Schema, int]:
        """Schema and number of rows of a table; ResultsError where it is not as it was written."""
        with readable(self.whole(name)):
            files = [pq.ParquetFile(self.directory / part) for part in self.parts(name)]
            rows = sum(part.metadata.num_rows for part in files)
            return files[0].schema_arrow, rows

    def batches(self, name: str, columns: Sequence[str], rows: int) -> Iterator[pa.Table]:
        """Columns of a table, so many rows at a time; ResultsError as of `read_table`."""
        with readable(self.whole(name)):
            for part in self.parts(name):
                yield from read_batches(self.directory / part, columns, rows)

    def chunks(
        self, schema: pa.Schema, columns: Sequence[str] | None = None, read: set[str] | None = None
    ) -> Iterator[pa.Table]:
        """Tables of the chunk files one after the other.

        Those of another schema or of lists that do not fit, damaged ones and those without room in
        memory are passed over: their points are not solved. So are those whose names are in `read`;
        the names of the others join it.
        """
        read = set() if read is None else read
        for name in self.names(CHUNKS):
            if name not in read and not self.fault(name):
                table = read_chunk(self.directory / name, schema, columns)
                if table is not None:
                    yield table
                read.add(name)

    def finished_points(self, schema: pa.Schema) -> np.ndarray:
        """Ids (n,) of all points in chunk files, each once, ascending."""
        tables = self.chunks(schema, ["point_id"])
        chunk_ids = [np.array(t["point_id"].to_pylist(), dtype=ID_TYPE) for t in tables]
        return np.unique(np.concatenate([np.zeros(0, ID_TYPE), *chunk_ids]))

    def rows(self, wanted_ids: Collection[str], schema: pa.Schema) -> dict[str, dict[str, Any]]:
        """Rows of the wanted points by id; a point that stands twice is taken once."""
        ids = set(wanted_ids)
        rows = (row for table in self.chunks(schema) for row in table.to_pylist())
        return {row["point_id"]: row for row in rows if row["point_id"] in ids}

    def references(self) -> dict[str, dict[str, Any]]:
        """Full-order checks by point id; damaged ones are passed over, to be made again.

        So are those that no run of the kind writes.
        """
        owner = self.journal.owner
        facts, checks = facts_of(owner[1]) if owner else None, dict[str, dict[str, Any]]()
        for name in (name for name in self.names(REFERENCES) if not self.fault(name)):
            try:
                check = json.loads(read_whole(self.directory / name, OF_JSON))
                if facts:
                    facts.model_validate({"reference": [check]})
                if check["point_id"] == Path(name).stem:
                    checks[check["point_id"]] = check
            except (ValueError, RecursionError, LookupError, TypeError):
                continue
        return checks

    def kept_histories(self) -> set[str]:
        """Ids of the design points whose histories were kept."""
        return {Path(name).stem for name in self.names(HISTORIES)}

    def history(self, point_id: str, status: str = "ok") -> pd.DataFrame:
        """The history of a design point; `status` is that of its row.

        Raises
        ------
        ResultsError
            Where none was kept, or it is not as it was written.
        """
        name = f"{HISTORIES}/{point_id}.parquet"
        if self.fault(name, thoroughly=False) == UNFINISHED:
            path = self.directory / name
            if status != "ok":
                raise ResultsError(f"{path}: no history, for the point failed: {status}")
            if n_histories := len(self.kept_histories()):
                raise ResultsError(f"{path}: no history of this point, but of {n_histories} others")
            raise ResultsError(
                f"{path}: the study kept no histories; [transient] save_every above 0 keeps them"
            )
        frame: pd.DataFrame = self.read_table(name).to_pandas()
        return frame


def _chunk_by_name(table: pa.Table) -> dict[str, pa.Table]:
    """Named by the points in it, which already name their model."""
    return {f"{CHUNKS}/{content_hash(sorted(table['point_id'].to_pylist()))}.parquet": table}


def _parquet(table: pa.Table) -> Callable[[Path], None]:
    return lambda path: pq.write_table(table, path, compression="zstd", row_group_size=GROUP_ROWS)
