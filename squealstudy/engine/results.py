"""Results of a study: its tables as pandas frames, rankings, pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, cast

import pandas as pd

from squealstudy.engine.journal import MISSING, UNFINISHED
from squealstudy.engine.manifest_file import PICTURES, read_manifest
from squealstudy.engine.pictures import Plots, draw_pictures
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError
from squealstudy.screen import as_text
from squealstudy.study.sweeps import BOUNDARY, RANDOM_DESIGNS, SOBOL_INDICES
from squealstudy.wording import GROWING, SUSTAINED, UNDECIDED, plural

if TYPE_CHECKING:
    from squealstudy.engine.exploration import Exploration
    from squealstudy.engine.kind_screen import KindScreen
    from squealstudy.engine.motion_shapes import EndMotion
    from squealstudy.shapes.shape import Shape

NOT_IN_NAMES = str.maketrans(dict.fromkeys(".[],- ", "_"))
KEEP_PICTURES = 100_000  # points from which on pictures take long enough to be kept
PUBLIC = (  # of results of every kind
    *("along", "columns", "design", "directory", "draw", "kind", "manifest", "n_points"),
    *("parameters", "plot", "rank", "swept", "table", "tables", "units"),
)
OF_SOME_KINDS = (  # methods and facts that `dir` lists where results have what they need
    *("boundary", "compare", "end_motion", "explore", "history", "names"),
    *("occurrence", "robust", "shape", "sobol_indices"),
)
EXPLORE = "squealstudy.explore.page"
EXPLORED = ("complex_modes", "limit_cycles", "transient")  # kinds that have such a page
MOST_NAMED = 12  # design points of a track at which it is named, unless more are asked for


@dataclass(frozen=True)
class Results(ResultTables):
    """A finished results directory.

    Its tables are attributes, DataFrames with a unit of every numeric column in
    ``attrs["units"]``: ``points`` and ``modes`` of most kinds of study, and others by kind
    (`tables` lists them). ``plot`` draws: ``results.plot.evolution(along="friction")``.

    Attributes
    ----------
    plot : Plots
        The plots as methods that return matplotlib figures.
    """

    plot: Plots = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "plot", Plots(self))  # no property: editors complete its names

    @cached_property
    def screen(self) -> KindScreen:
        """What is shown of results of this kind; ResultsError of a kind that there is not."""
        return cast("KindScreen", super().screen)

    def __dir__(self) -> list[str]:
        """What is for users, and of it what these results have."""
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

    def __repr__(self) -> str:
        """Directory, kind, model, what varies and how many points there are, on one line."""
        facts = self.manifest
        text = f"{self.kind} of {facts.get('model', 'methods')}"
        text += f" over {', '.join(self.swept)}" if self.swept else ""
        count, failed = self.n_points, facts.get("n_failed", 0)
        text += f": {plural(count, self.screen.row_word)}"
        text += f", {failed} failed" if failed else ""
        return f"<Results {str(self.directory)!r}: {text}>"

    def _repr_html_(self) -> str:
        """What a run prints first, and the first picture, for a notebook."""
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
            Missing, not of squealstudy, or not finished.
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
            ``point_id`` of a design point, or its row of `points`, counted from 0; by default that
            at which the track, or any mode, grows fastest.
        mode : int or None
            Number at that point, as in `modes`.
        track : int or None
            Instead of `mode` its number in rankings.

        Raises
        ------
        ResultsError
            Results of another kind, a model without a mesh, no such point or mode, a point that
            failed, or results that this version of squealstudy does not find again.
        """
        from squealstudy.engine.mode_shapes import shape

        return shape(self, point, mode, track)

    def end_motion(self, point: str | int | None = None) -> EndMotion:
        """The motion at the end of a run: on all nodes, and by its complex modes.

        See `engine.motion_shapes.EndMotion`. By default of the run with the largest torque's RMS.
        ResultsError of other kinds, and where no motion is there.
        """
        from squealstudy.engine.motion_shapes import end_motion, loudest

        return end_motion(self, loudest(self) if point is None else self.row_of(point))

    def names(
        self, tracks: Iterable[int] | None = None, most: int | None = MOST_NAMED
    ) -> pd.DataFrame:
        """Names of modes by their shapes, a row a mode (`engine.mode_names.mode_names`).

        By default at up to MOST_NAMED points of each mode that is unstable somewhere;
        ``modes.merge(names, on=["point_id", "mode"])`` has them as a column.
        """
        from squealstudy.engine.mode_names import mode_names

        return mode_names(self, tracks, most)

    def explore(self, where: str | None = None) -> Exploration:
        """A page in which the results are explored; a notebook shows it.

        ``results.explore().save("page.html")`` writes it. Of complex modes, limit cycles and runs
        in time; needs the extra ``explore``.

        Parameters
        ----------
        where : str or None
            A pandas query over `points`: those that the page has; by default all.

        Raises
        ------
        ResultsError
            Another kind, no Bokeh, too many design points or none, a query that cannot be used.
        """
        exploration: Exploration = import_module(EXPLORE).explore(
            self, where
        )  # a layer above this one
        return exploration

    def draw(self, directory: Path | None = None) -> list[Path]:
        """Draw every picture that the tables allow, beside them or elsewhere; their paths.

        Those beside them stand in the manifest, so that new tables remove them.
        """
        return draw_pictures(self, directory)

    @property
    def drawn(self) -> list[Path]:
        """Pictures of very many points, or nodes, that a run found as it had left them; else none.

        Those of fewer points are drawn anew in seconds.
        """
        names = self.manifest.get(PICTURES, [])
        paths = [self.directory / name for name in names]
        shown = self.n_points
        if self.design == BOUNDARY and self.boundary is not None:
            shown = self.boundary["full_grid_points"]
        are_kept = self.solved == 0 and shown >= KEEP_PICTURES
        return paths if are_kept and all(path.is_file() for path in paths) else []

    def file_word(self, parameter: str) -> str:
        """A parameter's name as it stands in names of files."""
        return parameter.translate(NOT_IN_NAMES)

    def rank(
        self, by: str = "share", top: int | None = None, where: str | None = None
    ) -> pd.DataFrame:
        """Unstable modes, the most important first, one row each.

        Unstable tracked modes (tables.mode_ranking.rank_modes), or the modes that carry
        the energy of a transient study (tables.energy_ranking.rank_energy), which has no
        choice of `by`.

        Raises
        ------
        ResultsError
            A kind of study without such a ranking, an unknown `by`, a query that cannot be used.
        """
        table = self.screen.rank(self, by, top, where)
        attrs = dict(table.attrs)
        self._give_units(table)
        table.attrs |= attrs
        return table

    def occurrence(
        self,
        bins_hz: Sequence[float],
        bins: Sequence[float],
        weights: Sequence[float] | None = None,
    ) -> pd.DataFrame:
        """At how many design points something squeals, by bins of frequency and level.

        Of complex modes unstable ones that oscillate, the level being their growth rate [1/s]; in
        time the leading line of vibrations that last, the level being the RMS of the torque. Runs
        that still grow or are undecided are in no bin: ``attrs["n_undecided"]`` counts them. See
        tables.occurrence.occurrence.

        Raises
        ------
        ResultsError
            A kind of study without either; edges or weights that cannot be used.
        """
        from squealstudy.tables.occurrence import occurrence

        points, open_ = self.points, 0
        if self.kind == "complex_modes" and self.boundary is None:
            level, flags = "growth_rate", ["unstable", "overdamped"]
            squeals = self.rows(
                "modes",
                ["point_id", "frequency_hz", level, *flags],
                lambda modes: (modes["unstable"] & ~modes["overdamped"]).to_numpy(bool),
            )
        elif self.kind == "transient":
            level, sustained = "torque_rms", points[points["class"].isin(SUSTAINED).to_numpy(bool)]
            squeals = sustained.assign(
                frequency_hz=sustained["torque_line_hz"]
            )  # where it is loudest
            open_ = int(points["class"].isin((GROWING, UNDECIDED)).sum())
        else:
            raise ResultsError(
                f"{self.directory}: occurrence is of complex modes or of runs in time at design "
                f"points, this is {self.kind} of a {self.design} design"
            )
        table = occurrence(points, squeals, level, bins_hz, bins, weights)
        table.attrs["n_undecided"] = open_
        return table

    def compare(self, other: Results) -> pd.DataFrame:
        """What is predicted beside what happens in time: one study of each, in any order.

        Of complex modes see tables.comparison.compare, of limit cycles
        tables.cycle_comparison.compare_cycles. ResultsError where these are not a study that
        predicts and a transient one of one model, with common design points.
        """
        from squealstudy.engine.comparison import compare_results

        return compare_results(self, other)

    def robust(self, confidence: float = 0.95) -> pd.DataFrame:
        """Probability of instability with its interval, of any mode and of each track.

        The points of a random design count as draws (tables.robustness.robust_table);
        of a sobol_indices design its two independent samples alone.

        Raises
        ------
        ResultsError
            Where the design is not random, or every point failed.
        """
        if self.design not in RANDOM_DESIGNS or "onsets" not in self.tables:
            raise ResultsError(
                f"{self.directory}: probability of instability needs complex modes of a random "
                f"design ({', '.join(RANDOM_DESIGNS)}), this is {self.kind} of a {self.design} "
                "design"
            )
        from squealstudy.tables.robustness import GROWTH, robust_table
        from squealstudy.tables.sobol import base_rows

        n, d = len(self.points), len(self.swept)
        drawn = base_rows(n, d) if self.design == SOBOL_INDICES else None
        modes = self.rows("modes", GROWTH)
        return self._give_units(robust_table(self.points, modes, drawn, confidence))

    def sobol_indices(self, top: int | None = 8, confidence: float = 0.95) -> pd.DataFrame:
        """First and total Sobol indices of the largest growth rate and of unstable tracks.

        See tables.sobol.sobol_table.

        Raises
        ------
        ResultsError
            Where the design is not ``sobol_indices``, or too many points failed.
        """
        if self.design != SOBOL_INDICES:
            raise ResultsError(
                f"{self.directory}: Sobol indices need a design of type '{SOBOL_INDICES}', "
                f"this is {self.design}"
            )
        from squealstudy.tables.robustness import GROWTH
        from squealstudy.tables.sobol import sobol_table

        modes = self.rows("modes", GROWTH)
        indices = sobol_table(self.points, modes, self.swept, top, confidence)
        return self._give_units(indices)
