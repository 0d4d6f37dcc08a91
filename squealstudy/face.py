"""The Python face: studies and results (models: face_model.py); the command uses the same names.

import squealstudy as sq

sq.model("hulten", friction=0.5).modes()
study = sq.read_study("study.toml").with_({"modes.method": "dense"})
results = sq.run(study)
results.rank(), results.plot.evolution(along="friction")
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy import faults
from squealstudy.paths import usable_cache
from squealstudy.progress import progress
from squealstudy.study.definition import ResolvedStudy, read_tables
from squealstudy.study.source import SourceText, changed
from squealstudy.study.toml_text import toml_text

if TYPE_CHECKING:
    from distributed import Client

    from squealstudy.engine.cluster import Cluster
    from squealstudy.engine.kind import Kind, Planned
    from squealstudy.engine.results import Results
    from squealstudy.kinds.methods import MethodsFile

GOES_ON = "; what is finished is kept, and the same command goes on from there"
SENSITIVITY = "sensitivity"


@dataclass(frozen=True)
class Study:
    """A checked study file, perhaps with some keys changed.

    Attributes
    ----------
    source : SourceText
        The file as it was read, and its path.
    tables : mapping
        Its tables, changes included.
    resolved : ResolvedStudy or MethodsFile
        What its kind makes of the tables; a MethodsFile for a study of methods.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("flutter").with_(friction=[0.2, 0.5])
    >>> study.owner, len(study.plan().tasks)
    (('flutter', 'complex_modes', 'hulten'), 2)
    >>> print(study.sensitivities().text.split("[model]")[0].strip())
    [study]
    name = "flutter_sensitivity"
    kind = "sensitivity"
    """

    source: SourceText
    tables: Mapping[str, Any]
    resolved: ResolvedStudy | MethodsFile[Any]

    def __repr__(self) -> str:
        """Name, kind and model on one line."""
        name, kind, model = self.owner
        return f"<Study {name!r}: {kind} of {model}, {self.source.path}>"

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model; for a method-stability study the case in place of the model."""
        return _kind_of(self).owner(self.resolved)

    def plan(self) -> Planned:
        """The plan of the study; its `tasks` are the design points, or runs of a study of methods.

        Raises
        ------
        StudyFileError
            For errors that only the design points show.
        """
        return _kind_of(self).plan(self.resolved)

    @property
    def directory(self) -> Path:
        """Default directory of its results: results/NAME in the current directory."""
        return Path("results") / self.tables["study"]["name"]

    @property
    def text(self) -> str:
        """Text of a file with this study, changes included."""
        return toml_text(self.tables)

    def with_(self, changes: Mapping[str, Any] | None = None, /, **values: Any) -> Study:
        """The study with other values of some keys, parameters, or options of the model.

        Parameters
        ----------
        changes : mapping of str -> value
            New values by dotted key, ``{"modes.method": "dense", "sweep[1].num": 5}``; None removes
            a key.
        **values
            New values by name. Several values of a parameter, ``friction=[0.3, 0.5]``, are swept,
            in place of its sweep or as the last sweep; a single one is that of all design points.
            Names with dots are given as ``**{"contact.lambda": 1e6}``. An option of the model takes
            one value, ``mesh="coarse"``.

        Raises
        ------
        StudyFileError
            With file and key, where the study cannot take a value.

        Examples
        --------
        >>> import squealstudy as sq
        >>> study = sq.model("hulten").study().with_(friction=[0.2, 0.5], mass="2 kg")
        >>> study.tables["sweep"], study.tables["parameters"]
        ([{'parameter': 'friction', 'values': [0.2, 0.5]}], {'mass': '2 kg'})
        """
        tables = changed(self.source, self.tables, changes or {})
        if values:
            tables = self._with_values(tables, values)
        return resolved_study(self.source, tables, toml_text(tables))

    def _with_values(self, tables: dict[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
        """Tables with other values of parameters and options."""
        if not isinstance(self.resolved, ResolvedStudy):
            raise self.source.error(
                ("study", "kind"), "a study of methods has no parameters: change those of its base"
            )
        options = {option.name for option in self.resolved.model.options}
        sweeps = list(tables.get("sweep", ()))
        for name, setting in values.items():
            if name in options:
                tables["model"] = {**tables["model"], name: setting}
                continue
            plain = setting.tolist() if hasattr(setting, "tolist") else setting  # numpy, pandas
            position = next((i for i, s in enumerate(sweeps) if s.get("parameter") == name), None)
            if isinstance(plain, list | tuple):
                swept = [{"parameter": name, "values": list(plain)}]
                index = len(sweeps) if position is None else position
                sweeps[index : index + 1] = swept
                continue
            if position is not None:
                del sweeps[position]
            parameters = dict(tables.get("parameters", {}))
            if name in parameters or "[" in name:
                tables["parameters"] = {**parameters, name: plain}
            else:
                tables = changed(self.source, tables, {f"parameters.{name}": plain})
        tables.pop("sweep", None)
        return {**tables, "sweep": sweeps} if sweeps else tables

    def sensitivities(self) -> Study:
        """The study of sensitivities at the [parameters] of a complex-mode study.

        It has no sweeps, the defaults of [sensitivity], and another name. A study of sensitivities
        returns itself.

        Raises
        ------
        StudyFileError
            For a study of another kind.
        """
        kind, name = self.resolved.kind, self.tables["study"]["name"]
        if kind.name == SENSITIVITY:
            return self
        if not isinstance(self.resolved, ResolvedStudy) or not self.resolved.kind.chooses_rung:
            raise self.source.error(
                ("study", "kind"), f"expected {SENSITIVITY} or complex_modes, got {kind.name}"
            )
        removed = dict.fromkeys(("sweep", "design", "fidelity"))
        named = {"study.kind": SENSITIVITY, "study.name": f"{name}_{SENSITIVITY}"}
        return self.with_(removed | named)


def _kind_of(study: Study) -> Kind:
    """The kind of a study, with the methods that a run needs."""
    from squealstudy.engine.kind import as_kind

    return as_kind(study.resolved.kind)


def read_study(path: str | Path) -> Study:
    """Read and check a study file of any kind.

    Parameters
    ----------
    path : str or Path
        The study file.

    Raises
    ------
    StudyFileError
        For anything wrong with the file; it names file, line and key, and what was expected.

    Examples
    --------
    >>> import squealstudy as sq
    >>> files = sq.write_example("hulten_flutter")
    >>> sq.read_study(files[0])
    <Study 'hulten_flutter': complex_modes of hulten, hulten_flutter.toml>
    """
    source = SourceText.read(path)
    return resolved_study(source, source.tables, source.text)


def resolved_study(source: SourceText, tables: Mapping[str, Any], text: str) -> Study:
    """The study of a file's tables; `text` is the text of these tables."""
    resolved = replace(read_tables(source, tables), source=SourceText(source.path, text))
    return Study(source, tables, resolved)


def open_results(path: str | Path) -> Results:
    """Open a results directory.

    Parameters
    ----------
    path : str or Path
        The results directory.

    Raises
    ------
    ResultsError
        Where the directory is missing, not written by squealstudy, or not finished.

    Examples
    --------
    >>> import squealstudy as sq
    >>> _ = sq.run(sq.model("hulten").study("one_point"), jobs=1)
    >>> sq.open_results("results/one_point").points["status"].tolist()
    ['ok']
    """
    from squealstudy.engine.results import Results

    return Results.open(path)


def run(
    study: Study | str | Path,
    output: str | Path | None = None,
    jobs: int | None = None,
    yes: bool = False,
    warn: Callable[[str], None] = warnings.warn,
    fresh: bool = False,
    client: Client | str | Path | None = None,
) -> Results:
    """Run a study, or what is not finished of it, with progress on a terminal or in a notebook.

    Elsewhere progress goes to the log (`squealstudy.progress`), which Python does not show by
    default: ``logging.basicConfig(level="INFO")`` does.

    Parameters
    ----------
    study : Study, str or path
        The study, or the path of its file.
    output : str, path or None
        Results directory; results/NAME by default.
    jobs : int or None
        Number of worker processes; by default as many as there are cores and memory for.
    yes : bool
        Accept more design points than the study's limit.
    warn : callable
        Called with warnings, before design points are solved.
    fresh : bool
        Begin anew: what the study wrote there before is removed once the study is known to be
        valid; other files stay.
    client : distributed.Client, str, path or None
        A dask cluster whose workers solve the design points, or the address or file of its
        scheduler (docs/howto/cluster.md); None for processes on this machine.

    Raises
    ------
    StudyFileError
        Where the study is not valid.
    ResultsError
        Where the directory belongs to another study, or is in use.
    MachineError
        Where the machine refuses: a full disk, memory, a worker that was killed, a scheduler that
        is lost. What is finished is kept, and the next run goes on from there.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.model("hulten").study("flutter").with_(friction=[0.2, 0.5])
    >>> sq.run(study, jobs=1).points["n_unstable"].tolist()
    [0, 1]
    >>> sq.run(study, jobs=1).solved  # all is there already
    0
    """
    if not isinstance(study, Study):
        study = read_study(study)
    from squealstudy.engine.manifest import check_owner
    from squealstudy.engine.runner import run_study
    from squealstudy.engine.workers import worker_count

    directory = Path(output or study.directory)
    resolved = study.resolved
    manifest = check_owner(directory, study.owner)
    _kind_of(study).check_count(resolved, yes)
    plan = study.plan()
    with (
        faults.told(GOES_ON),
        usable_cache(warn),
        progress() as tell,
        _cluster_or_none(client, warn) as place,
    ):
        jobs = place.size if place is not None else worker_count(jobs, manifest, warn)
        if isinstance(resolved, ResolvedStudy) and resolved.definition.fidelity is not None:
            from squealstudy.fidelity.run import resolve, run_resolved

            chosen = resolve(resolved, jobs, tell, cluster=place)
            report = run_resolved(chosen, directory, yes, tell, warn, fresh)
        else:
            report = run_study(plan, directory, jobs, yes, tell, warn, fresh, place)
    return replace(open_results(directory), solved=report.n_solved)


def _cluster_or_none(
    client: Client | str | Path | None, warn: Callable[[str], None]
) -> contextlib.AbstractContextManager[Cluster | None]:
    """Context of a cluster that solves design points; of None for this machine."""
    if client is None:
        return contextlib.nullcontext()
    from squealstudy.engine.cluster import connected

    return connected(client, warn)
