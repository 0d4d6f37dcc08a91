"""Files and texts of `squealstudy shape`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd

from squealstudy.engine.mode_names import track_names
from squealstudy.engine.mode_shapes import chosen_modes, plan_of, point_shapes
from squealstudy.engine.mode_vectors import ModeVectors, mode_vectors
from squealstudy.engine.motion_shapes import EndMotion
from squealstudy.engine.pictures import save_figure
from squealstudy.engine.plan import has_mesh
from squealstudy.engine.results import Results
from squealstudy.engine.track_names import keep_track_names
from squealstudy.errors import ResultsError
from squealstudy.files import write_text
from squealstudy.models.matrices.family import NAME as OWN_MATRICES
from squealstudy.screen import Rows
from squealstudy.shapes.files import Signal, write_uff, write_vtu
from squealstudy.shapes.names import figures_of, name_of
from squealstudy.shapes.page import page
from squealstudy.shapes.picture import draw, sources, title, words
from squealstudy.shapes.shape import Shape
from squealstudy.shapes.sources import ASSEMBLY, CONTACT
from squealstudy.tables.point_rows import point_codes
from squealstudy.tables.ranking_query import selection
from squealstudy.wording import amount, in_digits, plural, track_number

ALL, UNSTABLE = "all", "unstable"
FOLDER = "shapes"
LEAST_SHARE = 0.01  # share of kinetic energy from which a second real mode is named
CONTACT_WORDS = (" (friction that follows the contact's pressure)", ", and friction over speed")
# share of kinetic energy from which a second real mode has locked in (a choice)
LOCKED_IN_SHARE = 0.1
MOST_PLACED = 4  # parameters by which a design point is told
LISTED_MODES = 6  # of a motion
MOST_COORDINATES = 12  # of vectors listed
MICROMETRE_M = 1e-6  # m


def shapes(
    results: Results,
    point: str | None,
    modes: str | None,
    track: int | None,
    output: Path | None,
    kinds: tuple[bool, bool, bool, bool],
) -> Rows:
    """Write shapes of a design point to files; rows that describe shapes and files.

    Parameters
    ----------
    point : str or None
        Row of the points table, or a point_id.
    modes : str or None
        Numbers with commas, ``unstable`` or ``all``; None: the mode that grows fastest.
    track : int or None
        Number of a mode in `rank`, in place of `modes`.
    output : Path or None
        Folder of the files; None: ``shapes`` in the results directory.
    kinds : (picture, page, vtu, uff)
        Whether each of these kinds of file is written.

    Raises
    ------
    ResultsError
        For the reasons of `Results.shape` or `Results.end_motion`, or for two choices of modes.
    """
    signals: list[Signal] = []
    if results.kind == "transient":
        if modes is not None or track is not None:
            raise ResultsError("runs in time have a motion at their end: expected no mode or track")
        motion = results.end_motion(_row_or_id(results, point))
        chosen, rows = [motion.shape], [*_told_motion(motion.shape), *_mode_rows(motion)]
        signals = _signals(results, motion.shape.label.point_id) if kinds[-1] else []
    else:
        chosen = _shapes(results, point, modes, track)
        rows = [row for shape in chosen for row in _shape_rows(shape)]
    folder = output or results.directory / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    picture, moving, vtu, uff = kinds
    written: list[Path] = []
    for shape in chosen:
        label = shape.label
        path = folder / label.file_name
        if picture:
            save_figure(draw(shape), path.with_suffix(".png"))
            written.append(path.with_suffix(".png"))
        written += write_vtu(shape, path.with_suffix(".vtu")) if vtu else []
        written += write_uff(shape, path.with_suffix(".uff"), signals) if uff else []
    if moving:
        label = chosen[0].label
        name = label.file_name if len(chosen) == 1 else f"modes_{label.point_id}"
        written.append(folder / f"{name}.html")
        write_text(written[-1], page(chosen))
    return [*rows, *(("written", f"{path}, {_size(path)}") for path in written)]


def _signals(results: Results, point_id: str) -> list[Signal]:
    """Signals over time in a run's history, without those of single modes; [] without one."""
    try:
        history = results.history(point_id)
    except ResultsError:
        return []
    time, units = history["time"].to_numpy(), history.attrs["units"]
    names = [n for n in history.columns if n != "time" and "_mode_" not in n]
    return [Signal(n, units.get(n, ""), time, history[n].to_numpy()) for n in names]


def _shapes(
    results: Results, point: str | None, modes: str | None, track: int | None
) -> list[Shape]:
    """The shapes of the chosen modes at one design point."""
    point_row = _row_or_id(results, point)
    if modes is not None and track is not None:
        raise ResultsError("expected --mode or --track, got both")
    if modes is None or modes in (ALL, UNSTABLE):
        row, numbers = chosen_modes(results, point_row, None, track)
        point_modes = results.modes[
            results.modes["point_id"] == results.points["point_id"].iloc[row]
        ]
        if modes == UNSTABLE:
            numbers = [
                n for n in numbers if n in set(point_modes.loc[point_modes["unstable"], "mode"])
            ]
            if not numbers:
                raise ResultsError(f"design point {row} has no unstable mode that oscillates")
        numbers = numbers[:1] if modes is None else sorted(numbers)
    else:
        mode_texts = modes.split(",")
        if not all(text.strip().isdigit() for text in mode_texts):
            raise ResultsError(
                f"expected --mode as numbers like 12 or 12,14, '{UNSTABLE}' or '{ALL}', "
                f"got '{modes}'"
            )
        numbers = list(dict.fromkeys(map(int, mode_texts)))
        for number in numbers:
            row, _ = chosen_modes(results, point_row, number)
    source = point_shapes(results, row)
    return [source.shape(number) for number in numbers]


def _row_or_id(results: Results, point: str | None) -> str | int | None:
    """A design point for `Results.row_of`: its id, or its row as a number."""
    if point is None or not point.lstrip("-").isdigit():
        return point
    return point if point in set(results.points["point_id"]) else int(point)


def _told_motion(shape: Shape) -> Rows:
    """Rows that describe the motion at the end of a run."""
    first, *values = title(shape)
    (energy,) = (text.split(": ", 1) for text in sources(shape))
    return [
        ("motion", first),
        *(("at", text) for text in values),
        (energy[0], energy[1]),
        ("in interfaces", _shares(shape)),
        ("name", f"{name_of(shape).text} ({figures_of(shape)})"),
    ]


def _mode_rows(motion: EndMotion) -> Rows:
    """Rows on the complex modes with most of the motion's energy, and on the energy in none."""
    order = np.argsort(-motion.share)[:LISTED_MODES]
    rows = [
        (
            f"complex mode {motion.number[k]}",
            f"{abs(motion.lam[k]) / (2 * np.pi):.1f} Hz, growth {motion.lam[k].real:+.4g} 1/s: "
            f"{100 * motion.share[k]:.1f} % of the energy in its plane of motion, MAC "
            f"{motion.mac[k]:.3f}",
        )
        for k in order
    ]
    text = f"{100 * motion.residual:.2g} % of the energy is in none of {len(motion.lam)} modes"
    return [*rows, ("residual", f"{text} of the band; shares overlap and do not add up")]


def _shape_rows(shape: Shape) -> Rows:
    """Rows that describe a mode."""
    first, *values = title(shape)
    energy, growth = (text.split(": ", 1) for text in sources(shape))
    return [
        ("mode", first),
        *(("at", text) for text in values),
        (energy[0], energy[1]),
        ("in interfaces", _shares(shape)),
        (growth[0], growth[1]),
        *_why(shape),
        *_pair(shape),
        ("name", f"{name_of(shape).text} ({figures_of(shape)})"),
    ]


def _shares(shape: Shape) -> str:
    """Text on the shares of layers and contacts in the elastic energy, the largest first."""
    ordered = sorted(shape.interfaces.items(), key=lambda item: -item[1])
    return ", ".join(f"{_source_text(*key)} {100 * share:.1f} %" for key, share in ordered if share)


def _why(shape: Shape) -> Rows:
    """Rows on growth by friction (by kind and pair), on damping, and on the power of both."""
    friction = [s for s in shape.sources if s.of_friction]
    damping = sorted((s for s in shape.sources if not s.of_friction), key=lambda s: s.growth_rate)
    by_kind = ", ".join(f"{s.growth_rate:+.4g} {s.kind} at {words(s.where)}" for s in friction)
    by_place = ", ".join(
        f"{s.growth_rate:+.4g} in {_source_text(s.kind, s.where)}" for s in damping
    )
    fed, taken = (MICROMETRE_M**2 * sum(s.power for s in kind) for kind in (friction, damping))
    return [
        ("friction 1/s", by_kind or "none"),
        ("damping 1/s", by_place or "none"),
        ("power at 1 um", f"{fed:+.3g} W of friction, {taken:+.3g} W of damping"),
    ]


def _pair(shape: Shape) -> Rows:
    """Row on the two real modes that friction couples; none where there are not two."""
    if len(shape.pair) < 2:
        return []
    (hz, share), (other_hz, other) = shape.pair
    text = f"{100 * share:.1f} % of the real mode at {hz:.1f} Hz without coupling by friction"
    if other >= LEAST_SHARE:
        text += f", {100 * other:.1f} % of that at {other_hz:.1f} Hz, {shape.pair_phase:.0f} deg "
        text += "apart (friction feeds by the sine of it)"
    return [("made of", text)]


def _source_text(kind: str, where: str) -> str:
    """Text of a place of damping or energy; for components and layers just the name."""
    if kind == ASSEMBLY:
        return "all modes of the assembly"
    return f"contact of {words(where)}" if kind == CONTACT else words(where)


def reasons(
    results: Results, tracks: Iterable[int], points: Mapping[int, str] = MappingProxyType({})
) -> Rows:
    """Rows on why ranked modes grow, by track at a `point_id`, by default where it grows fastest.

    Raises
    ------
    ResultsError
        For the reasons of `Results.shape`.
    """
    rows: Rows = []
    is_meshed = has_mesh(plan_of(results).study)
    for track in (int(track) for track in tracks if track >= 0):  # real roots have none
        if not is_meshed:
            rows += _of_vectors(results, track, points.get(track))
            continue
        shape = results.shape(points.get(track), track=track)
        growth = f"growth {shape.growth_rate:+.4g} 1/s {_location(results, shape.label.row)}"
        name = f"{shape.frequency_hz:.0f} Hz, {name_of(shape).text}"
        rows += [(track_number(track), f"{name}; {growth}"), *_why(shape)]
    return rows


def points_of_ranking(results: Results, ranking: pd.DataFrame, where: str | None) -> dict[int, str]:
    """By track the `point_id` at which it grows fastest of the points that a ranking counts."""
    modes, points, point_of = results.modes, results.points, dict[int, str]()
    point_rows = point_codes(points, modes)
    counted, in_query = selection(points, modes, point_rows, where)
    modes = modes[in_query & counted[point_rows]]
    for track, growth in zip(ranking["track"], ranking["max_growth_rate"], strict=True):
        fastest = (modes["track"] == track) & (modes["growth_rate"] == growth)
        if track >= 0:
            point_of[int(track)] = str(modes.loc[fastest, "point_id"].iloc[0])
    return point_of


def _location(results: Results, row: int) -> str:
    """Text that places a design point, by its number and (if few) the parameters that vary."""
    points, units = results.points, results.units
    varied = [name for name in results.parameters if len(points[name].unique()) > 1]
    texts = [f"{name} {amount(points[name].iloc[row], units.get(name, ''))}" for name in varied]
    prefix = f"at {', '.join(texts)}, " if 0 < len(texts) <= MOST_PLACED else "at "
    return f"{prefix}design point {row}"


def _of_vectors(results: Results, track: int, point: str | None) -> Rows:
    """Rows on why a mode of a model without a mesh grows, and on its vectors by coordinate."""
    mode = mode_vectors(results, track, point)
    hz, growth = abs(mode.lam) / (2 * np.pi), mode.lam.real
    of_contact = results.manifest["model"] != OWN_MATRICES
    head = f"{in_digits(hz, 1)} Hz, growth {growth:+.4g} 1/s {_location(results, mode.row)}"
    rows = [(track_number(track), head)]
    if np.isfinite(mode.by_stiffness):
        follows, falls = CONTACT_WORDS if of_contact else ("", "")
        text = f"{mode.by_stiffness:+.4g} of unsymmetric stiffness{follows}, "
        rows.append(("growth 1/s", f"{text}{mode.by_velocity + 0.0:+.4g} of damping{falls}"))
    if np.isfinite(mode.pair_hz).all():
        rows.append(("made of", _pair_text(mode, of_contact)))
    listed = np.argsort(-np.maximum(abs(mode.right), abs(mode.left)), kind="stable")
    for k in sorted(listed[:MOST_COORDINATES]):
        right_text, left_text = (
            f"{abs(x[k]):.3f} at {round(np.degrees(np.angle(x[k])))} deg"
            for x in (mode.right, mode.left)
        )
        rows.append((f"  {mode.coordinates[k]}", f"right {right_text}, left {left_text}"))
    if (more := len(listed) - MOST_COORDINATES) > 0:
        rows.append(("", f"{plural(more, 'coordinate')} with smaller entries left out"))
    return rows


def _pair_text(mode: ModeVectors, of_contact: bool) -> str:
    """Text on the real modes that a mode is made of, and on what they mean for its growth."""
    # of shares that print the same the lower frequency comes first, whatever round-off says
    ordered = sorted(zip(mode.pair_share, mode.pair_hz, strict=True), key=_by_printed_share)
    (share, other), (first, second) = (x for x, _ in ordered), (_held_at(hz) for _, hz in ordered)
    without = "without friction" if of_contact else "of the symmetric stiffness"
    text = f"{100 * share:.1f} % of the real mode {first} {without}"
    if other < LEAST_SHARE or not np.isfinite(mode.phase_deg):
        return f"{text}: one real mode alone, no lock-in"
    text += (
        f", {100 * other:.1f} % of that {second}; they move {mode.phase_deg:.0f} deg out of phase"
    )
    feeds_most = mode.by_stiffness > max(mode.by_velocity, 0.0)  # not friction that falls
    shared = other >= LOCKED_IN_SHARE and min(mode.pair_hz) > 0
    if mode.locked_in and feeds_most and shared:
        feeds = "friction" if of_contact else "unsymmetric stiffness"
        text += f": the two have locked in; {feeds} feeds by the sine of this phase"
    return text


def _by_printed_share(share_and_hz: tuple[float, float]) -> tuple[float, float]:
    share, hz = share_and_hz
    return -round(100 * share, 1), hz


def _held_at(hz: float) -> str:
    """Text of a real mode's frequency; it has none where stiffness does not hold it."""
    return f"at {in_digits(hz, 1)} Hz" if hz > 0 else "that no stiffness holds,"


def names(results: Results, tracks: Iterable[int]) -> Rows:
    """Rows on names of ranked modes: the most frequent one, and its grounds at the fastest growth.

    Real roots and modes without a track have no name. The names are stored beside the tables, for
    the legends of pictures.

    Raises
    ------
    ResultsError
        For the reasons of `Results.shape`.
    """
    tracked = [int(track) for track in tracks if track >= 0]
    table = track_names(results.names(tracked), results.modes)
    rows: Rows = []
    row_of = table.to_dict("index")
    for track in tracked:
        row, shape = row_of[track], results.shape(track=track)
        text = f"{row['name']}, at {row['n_named']} of {plural(row['n_points'], 'point')} looked at"
        text += f"; changes: {row['others']}" if row["changes"] else ""
        rows.append((track_number(track), text))
        label = f"design point {shape.label.row}, {shape.frequency_hz:.0f} Hz"
        rows.append(("", f"{label}: {name_of(shape).text}; {figures_of(shape)}"))
    keep_track_names(results.store, table)
    return rows


def _size(path: Path) -> str:
    size = path.stat().st_size
    return f"{size / 1e6:.2f} MB" if size >= 1e5 else f"{size / 1e3:.1f} kB"
