"""Results of a study: its tables as pandas frames, rankings, pictures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from squealstudy.engine.journal import MISSING, UNFINISHED
from squealstudy.engine.manifest_file import PICTURES, read_manifest
from squealstudy.engine.pictures import Plots, draw_pictures
from squealstudy.engine.result_rankings import RankedResults
from squealstudy.errors import ResultsError, UnknownNameError
from squealstudy.screen import as_text
from squealstudy.study.sweeps import BOUNDARY, RANDOM_DESIGNS, SOBOL_INDICES
from squealstudy.wording import did_you_mean, plural

if TYPE_CHECKING:
    from squealstudy.engine.exploration import Exploration
    from squealstudy.engine.motion_shapes import EndMotion
    from squealstudy.shapes.shape import Shape

NOT_IN_NAMES = str.maketrans(dict.fromkeys(".[],- ", "_"))
# pictures of studies of at least this many points are stored, as drawing takes long
KEEP_PICTURES = 100_000
PUBLIC = (  # of results of every kind
    *("along", "columns", "design", "directory", "draw", "kind", "manifest", "n_points"),
    *("parameters", "plot", "rank", "swept", "table", "tables", "units"),
)
OF_SOME_KINDS = (  # methods and facts that `dir` lists only where they can be used
    *("boundary", "compare", "end_motion", "explore", "history", "names"),
    *("occurrence", "robust", "shape", "sobol_indices"),
)
EXPLORE = "squealstudy.explore.page"
EXPLORED = ("complex_modes", "limit_cycles", "transient")  # kinds that have such a page
MOST_NAMED = 12  # default number of design points at which a track is named


@dataclass(frozen=True)
class Results(RankedResults):
    """A finished results directory.

    Its tables are attributes, DataFrames with a unit of every numeric column in
    ``attrs["units"]``: ``points`` and ``modes`` of most kinds of study, and others by kind
    (`tables` lists them). ``plot`` draws: ``results.plot.evolution(along="friction")``.

    Attributes
    ----------
    plot : Plots
        The plots as methods that return matplotlib figures.

    Examples
    --------
    >>> import squealstudy as sq
    >>> model = sq.model("hulten", damping_ratio=0.01)
    >>> study = model.study("flutter", band=(10.0, 1e3)).with_(friction=[0.2, 0.5])
    >>> results = sq.run(study, jobs=1)
    >>> results.modes["unstable"].tolist(), results.table("points")["friction"].tolist()
    ([False, False, True, False], [0.2, 0.5])
    >>> results.columns("onsets")[:3], results.rank()["threshold_kind"].tolist()
    (['track', 'onset', 'bracket_low'], ['refined'])
    >>> results.occurrence(bins_hz=[0, 100, 200], bins=[0, 1e3])["n_points"].tolist()
    [1, 0]
    >>> results.plot.evolution(along="friction").savefig("evolution.png")
    >>> results.draw()[0].name, results.explore().save("page.html").name
    ('evolution_friction.png', 'page.html')

    The same design points in time, and scattered:

    >>> changes = {"study.kind": "transient", "study.name": "in_time", "modes": None}
    >>> changes["transient"] = {"duration": 0.05, "step": 1e-5}
    >>> runs = sq.run(study.with_(changes), jobs=1)
    >>> results.compare(runs)["kind"].tolist(), runs.history(1).shape[0]
    (['vibration', 'both'], 501)
    >>> sweep = {"parameter": "friction", "distribution": "normal", "mean": 0.3, "std": 0.05}
    >>> load = {"parameter": "normal_force", "distribution": "uniform", "start": 90, "stop": 110}
    >>> changes = {"study.name": "scatter", "sweep": [sweep, load]}
    >>> changes["design"] = {"type": "sobol_indices", "samples": 16, "seed": 1}
    >>> scatter = sq.run(study.with_(changes), jobs=1)
    >>> len(scatter.robust()), scatter.sobol_indices()["parameter"].unique().tolist()
    (2, ['friction', 'normal_force'])
    """

    plot: Plots = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "plot", Plots(self))  # no property: editors complete its names

    def __dir__(self) -> list[str]:
        """The public names that these results have."""
        tables_there = (name for name in self.tables if hasattr(type(self), name))
        random = self.design in RANDOM_DESIGNS and "onsets" in self.tables
        has_onsets, has_runs = "onsets" in self.tables, "growth" in self.tables
        applies = {
            "boundary": self.design == BOUNDARY,
            "compare": bool({"onsets", "growth", "cycles"} & {*self.tables}),
            "end_motion": has_runs,
            "explore": self.kind in EXPLORED,
            "history": has_runs,
            "names": has_onsets,
            "occurrence": has_runs or (has_onsets and self.boundary is None),
            "robust": random,
            "shape": has_onsets,
            "sobol_indices": random and self.design == SOBOL_INDICES,
        }
        return sorted({*PUBLIC, *tables_there, *(n for n in OF_SOME_KINDS if applies[n])})

    if not TYPE_CHECKING:  # there a name that is not above is an error

        def __getattr__(self, name: str) -> Any:
            """UnknownNameError, an AttributeError, with the names that are near."""
            if name.startswith("_") or hasattr(type(self), name):  # what an attribute itself met
                return object.__getattribute__(self, name)
            hint = did_you_mean(name, dir(self)) or f"; there are {', '.join(dir(self))}"
            raise UnknownNameError(f"results have nothing named '{name}'{hint}")

    def __repr__(self) -> str:
        """Directory, kind, model, swept parameters and number of points, on one line."""
        facts = self.manifest
        text = f"{self.kind} of {facts.get('model', 'methods')}"
        text += f" over {', '.join(self.swept)}" if self.swept else ""
        count, failed = self.n_points, facts.get("n_failed", 0)
        text += f": {plural(count, self.screen.row_word)}"
        text += f", {failed} failed" if failed else ""
        return f"<Results {str(self.directory)!r}: {text}>"

    def _repr_html_(self) -> str:
        """The findings that a run prints, and the first picture, for a notebook."""
        shown = (
            f"<p>{escape(repr(self)[1:-1])}</p><pre>{escape(as_text(self.screen.findings(self)))}"
        )
        from squealstudy.engine.report_pictures import images

        return f"{shown}</pre>{next(images(self), '')}"

    @classmethod
    def open(cls, path: str | Path) -> Results:
        """Open the results directory at a path.

        Raises
        ------
        ResultsError
            The directory is missing, not one of squealstudy, or its run is not finished.
        """
        directory = Path(path)
        if directory.is_file():
            raise ResultsError(
                f"{directory}: expected a results directory such as results/NAME, got a file"
            )
        if not directory.is_dir():
            raise ResultsError(f"{directory}: no such results directory")
        manifest = read_manifest(directory)
        if manifest is None:
            raise ResultsError(f"{directory}: no manifest.json here, so no results of squealstudy")
        opened = cls(directory, manifest)
        stale = not opened.screen.unfinished and manifest.get("status") != "complete"
        faults = {name: opened.store.fault(f"{name}.parquet", False) for name in opened.tables}
        if stale or {MISSING, UNFINISHED} & set(faults.values()):
            raise ResultsError(
                f"{directory}: the run is not finished; run the study again to go on"
            )
        for name in (name for name, fault in faults.items() if fault):
            opened.store.whole(f"{name}.parquet")
        return opened

    def shape(
        self, point: str | int | None = None, mode: int | None = None, track: int | None = None
    ) -> Shape:
        """A complex mode on all nodes of a meshed model (shapes.shape.Shape).

        The point is solved again; the first shape of a structure takes about as long as its
        reduction. By default it is the mode that grows fastest.

        Parameters
        ----------
        point : str, int or None
            ``point_id`` of a design point, or its row in `points`, counted from 0; by default the
            point at which the track, or any mode, grows fastest.
        mode : int or None
            Number of the mode at that point, as in `modes`.
        track : int or None
            Number of the mode in rankings, in place of `mode`.

        Raises
        ------
        ResultsError
            The results are of another kind, or the model has no mesh; there is no such point or
            mode; the point failed; or this version of squealstudy does not reproduce the mode.

        Examples
        --------
        >>> import squealstudy as sq
        >>> sq.open_results("results/first_brake").shape(track=23)  # doctest: +SKIP
        """
        from squealstudy.engine.mode_shapes import shape

        return shape(self, point, mode, track)

    def end_motion(self, point: str | int | None = None) -> EndMotion:
        """The motion at the end of a run, on all nodes and as a sum of complex modes.

        See `engine.motion_shapes.EndMotion`.

        Parameters
        ----------
        point : str, int or None
            As in `shape`; by default the run with the largest RMS torque.

        Raises
        ------
        ResultsError
            The results are of another kind, or have no motion of this run.

        Examples
        --------
        >>> import squealstudy as sq
        >>> sq.open_results("results/squeal_nominal").end_motion()  # doctest: +SKIP
        """
        from squealstudy.engine.motion_shapes import end_motion, loudest

        return end_motion(self, loudest(self) if point is None else self.row_of(point))

    def names(
        self, tracks: Iterable[int] | None = None, most: int | None = MOST_NAMED
    ) -> pd.DataFrame:
        """Names of modes by their shapes: one row for each mode (`engine.mode_names.mode_names`).

        ``modes.merge(names, on=["point_id", "mode"])`` adds them to the modes.

        Parameters
        ----------
        tracks : iterable of int or None
            Numbers of modes in rankings; by default those of modes that are unstable somewhere.
        most : int or None
            Largest number of design points at which each is named; None for all.

        Raises
        ------
        ResultsError
            The results are of another kind, or the model has no mesh.

        Examples
        --------
        >>> import squealstudy as sq
        >>> sq.open_results("results/first_brake").names()  # doctest: +SKIP
        """
        from squealstudy.engine.mode_names import mode_names

        return mode_names(self, tracks, most)

    def explore(self, where: str | None = None) -> Exploration:
        """A page to explore the results in; a notebook shows it.

        ``results.explore().save("page.html")`` writes it. It exists for complex modes, limit cycles
        and runs in time, and needs the extra ``explore``.

        Parameters
        ----------
        where : str or None
            A pandas query over `points` that selects those of the page; by default all.

        Raises
        ------
        ResultsError
            The results are of another kind; Bokeh is not installed; there are too many design
            points or none; the query is wrong.
        """
        exploration: Exploration = import_module(EXPLORE).explore(
            self, where
        )  # a layer above this one
        return exploration

    def draw(self, directory: Path | None = None) -> list[Path]:
        """Draw all pictures that the tables allow, and return their paths.

        The manifest lists pictures in the results directory, so that new tables remove them.

        Parameters
        ----------
        directory : Path or None
            Folder of the pictures; by default the results directory.

        Raises
        ------
        ExtensionError
            A plot from outside the package fails; the others are drawn.
        OSError
            A file cannot be written.
        """
        return draw_pictures(self, directory)

    @property
    def drawn(self) -> list[Path]:
        """Pictures of an earlier run that need not be drawn again, else none.

        They are kept if the last run solved no point and there are at least KEEP_PICTURES points,
        or nodes of a boundary design. Pictures of fewer points are drawn again in seconds.
        """
        names = self.manifest.get(PICTURES, [])
        paths = [self.directory / name for name in names]
        shown = self.n_points
        if self.design == BOUNDARY and self.boundary is not None:
            shown = self.boundary["full_grid_points"]
        are_kept = self.solved == 0 and shown >= KEEP_PICTURES
        return paths if are_kept and all(path.is_file() for path in paths) else []

    def file_word(self, parameter: str) -> str:
        """A parameter's name as part of the name of a file."""
        return parameter.translate(NOT_IN_NAMES)
