"""Words, numbers and units as screens, pictures and tables show them."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any

from squealstudy.shown_units import MAX_PREFIXED, as_written, prefixed

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

LONGEST_SHOWN = 40  # characters of a value in a message
# classes of runs in time, as the points table of a transient study has them
STABLE = "stable"  # decays to steady sliding
LIMIT_CYCLE = "limit_cycle"
IRREGULAR = "irregular"  # lasts, without a level that is steady over ten periods
GROWING = "growing"  # lasts; its level is not reached yet
ENERGY_RULE = "a step keeps the energy balance"  # a rule of the validity of runs
UNDECIDED = "undecided"  # the run is too short to tell
CHANGING = "changing"  # speed or pressure change during the run: its windows have classes
FAILED = "failed"
# classes of a window of such a run
QUIET = "quiet"  # the torque's RMS is below 1 % of that of steady sliding
STICK_SLIP = "stick_slip"  # above it, and contact begins to stick twice or more
VIBRATES = "vibrates"  # above it, and contact does not
SUSTAINED = (LIMIT_CYCLE, IRREGULAR)  # classes whose level is that of a lasting vibration
LASTING = (*SUSTAINED, GROWING)

# verdicts of studies of limit cycles
SQUEALS = "squeals"  # a mode is unstable
IF_KICKED = "squeals_if_kicked"  # all are stable, and a vibration lasts beside them
NEUTRAL = "neutral"  # small motions neither grow nor decay, and larger ones do not grow
NO_CYCLE = "no_cycle_found"
# the verdict on a design is the first of these that one of its modes has
VERDICTS = (SQUEALS, IF_KICKED, UNDECIDED, NEUTRAL, NO_CYCLE)

# letters on a map: the more silent, the less ink
VERDICT_LETTERS = {SQUEALS: "S", IF_KICKED: "K", UNDECIDED: "?", NEUTRAL: "n", NO_CYCLE: "."}
VERDICT_LETTERS[FAILED] = "x"
CLASS_LETTERS = {LIMIT_CYCLE: "L", IRREGULAR: "I", GROWING: "G", UNDECIDED: "?", STABLE: "."}
CLASS_LETTERS[CHANGING] = "~"
CLASS_LETTERS[FAILED] = "x"

LEAST_DIGITS = 3  # significant digits of a number that fixed decimals would leave too few of
MOST_RANGES = 6  # ranges of a parameter in one sentence
UNKNOWN = "-"  # in place of a number that is not known

TORQUE = "torque"  # key, in the units of a study, for columns torque_*: N m or N
TORQUE_COLUMN = re.compile(
    r"torque|torque_(mean|rms|static|peak_to_peak|residual)(_low|_high)?|worst_torque_rms"
    r"|torque_rms_(window|step|rows)|torque_(min|max)"
    r"|predicted_torque_rms|torque_peak|torque_harmonics|dominant_level|harmonic_\d_level"
)
OF_THE_ONSET = "unit of the parameter along which onsets are sought"
OF_THE_ROW = "unit of the row"  # in tables where each row has a unit of its own
OWN_UNITS = {  # units of a table's columns that have another unit in other tables
    **{table: {"cost": "", "change": ""} for table in ("cells", "designs", "variants")},
    "onsets": {"error_estimate": OF_THE_ONSET},
    "measurements": {"reference": ""},
}
# units of columns of result tables; the first pattern counts that matches a whole name
UNITS: tuple[tuple[str, str], ...] = (
    (r"\w+_velocity|velocity_(rms|peak)", "m/s"),
    (r"distance", "m"),
    (r"added_damping", "1/s"),
    (r"(friction|damping|belt|radiated)_power", "W"),
    (r"normal_force_rms", "N"),
    (r"(threshold|kick)_energy", "J"),
    (r"kick_phase", "rad"),
    (
        r"multiplier\w*|power_imbalance|harmonic_tail|(error|low|high|median|chance|within)_growth_rate"
        r"|(level|(cycle_)?frequency|velocity|torque_peak|kick|threshold|basis|regularisation)_error",
        "",
    ),
    (r"d_frequency_hz", "Hz per unit of the row"),
    (r"d_growth_rate", "1/s per unit of the row"),
    (r"d_damping_ratio", "1 per unit of the row"),
    (r"\w+_hz|hz", "Hz"),
    (
        r"\w*growth_rate\w*|growth_(mean|std)|fitted_(low|high)|error_(rung|reduction|estimate)"
        r"|step_error|growth_outside",
        "1/s",
    ),
    (r"growth_per_percent|(predicted|finite)_growth_change", "1/s"),
    (r"frequency_per_percent|(predicted|finite)_frequency_change", "Hz"),
    (r"wall_s|\w*seconds\w*|cost(_onset)?|\w*_time|time|time_reached|fit_(start|stop)", "s"),
    (r"undecided_until|time_(start|stop)", "s"),
    (r"perturbation|sliding_speed(_start|_stop)?", "m/s"),
    (r"pressure(_start|_stop)?", "Pa"),
    (r"memory_mb", "MB"),
    (r"normal_force", "N"),
    (r"contact_pressure_(min|max)", "Pa"),
    (r"energy|energy_mean|energy_mode_\d+|energy_outside", "J"),
    (r"amplitude_mode_\d+", "m kg^0.5"),
    (r"variance", "1/s^2"),
    (r"(over_)?value|value_error|line_difference|change|reference|truth|number", OF_THE_ROW),
    (r"onset|bracket_(low|high)|threshold", OF_THE_ONSET),
    (  # counts, numbers of modes and tracks, ratios
        r"n_\w+|family(_modes)?|design|round|margin|occurrence|change_cost|\w*points\w*|\w*groups|point|rounds"
        r"|evaluations|iterations\w*|halvings|newton_steps"
        r"|track|window|mode|component_mode|dominant_mode|transfer_(from|to)|missed|spurious"
        r"|\w*damping\w*|\w*share\w*|energy_(?!mean)\w+|track_mac|\w*residual|condition|match"
        r"|biorthogonality|validity_range|disagreement|slip|(stick|open)(_mean|_max)?|stick_creep|stick_number"
        r"|contraction|swing_spread|energy_balance|reference_frequency_error|deviation|probability\w*"
        r"|(first|total)(_low|_high)?|predicted|measured|error\w*|(low|high|median|chance)\w*",
        "",
    ),
)


EXPECTED = {  # what was expected in a study file, by pydantic's type of error
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "text in quotes",
    "tuple_type": "a list in square brackets",
    "model_type": "a table of keys",
    "dict_type": "a table of keys",
    "too_short": "at least {min_length}",
    "greater_than": "more than {gt:.10g}",
    "greater_than_equal": "at least {ge:.10g}",
    "less_than_equal": "at most {le:.10g}",
    "literal_error": "{expected}",
    "string_too_short": "text that is not empty",
    "string_too_long": "at most {max_length} characters",
    "string_pattern_mismatch": "letters, digits, _ and - only",
}


def expectation(kind: str, context: Mapping[str, Any]) -> str:
    """What was expected in place of a value that pydantic refuses; empty for other types of error.

    Parameters
    ----------
    kind : str
        pydantic's type of error.
    context : mapping
        Numbers and words of the error.
    """
    return EXPECTED.get(kind, "").format(**context)


def plural(n: int, word: str, many: str = "") -> str:
    """A count with its word, thousands apart; `many` where the plural has no -s."""
    return f"{n:,} {word if n == 1 else many or word + 's'}"


def any_of(n: int, word: str) -> str:
    """Words to follow "not ... at": ``the 1 point``, ``any of the 2 points``."""
    return f"{'' if n == 1 else 'any of '}the {plural(n, word)}"


def duration(seconds: float) -> str:
    """A time in words: ``0.25 s``, ``12 s``, ``40 min``, ``3.5 h``."""
    if seconds < 60:
        return f"{seconds:.0f} s" if seconds >= 1 else f"{seconds:.2f} s"
    return f"{math.ceil(seconds / 60)} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def listed(names: Sequence[str], most: int = 12) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def all_of(names: Sequence[str]) -> str:
    """All names in words: ``T1, T2 and T3``; empty for none."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def in_digits(value: float, decimals: int = 0) -> str:
    """`value` with fixed decimals; with three digits if decimals would leave fewer than two."""
    if value and abs(value) < 10.0 ** (1 - decimals):
        return f"{value:.{LEAST_DIGITS}g}"
    return f"{value:.{decimals}f}"


def motion_frequency(hz: float, line: float, decimals: int = 0) -> str:
    """Frequency of a motion [Hz], and the harmonic at which its torque is loudest: ``95, x3``.

    For a motion that does not repeat, the line at which its torque is loudest: ``~3131``.
    """
    if hz != hz:
        return f"~{in_digits(line, decimals)}" if line == line else UNKNOWN
    loudest = round(line / hz) if line == line else 1
    return in_digits(hz, decimals) + (f", x{loudest}" if loudest > 1 else "")


def figure(value: float, form: str = ".4g", unknown: str = UNKNOWN) -> str:
    """A number in a format; `unknown` for NaN."""
    return f"{value:{form}}" if value == value else unknown


def with_error(value: float, error: float) -> str:
    """A number and two digits of its error, ``165.2 +- 4.6``; no error if four digits are right."""
    if not math.isfinite(error):
        return f"{figure(value)} (error not known)"
    if not error > 5e-4 * abs(value):
        return figure(value)
    decimals = 1 - int(f"{error:.1e}".partition("e")[2])
    if decimals > LEAST_DIGITS:
        return f"{value:.4g} +- {error:.2g}"
    n = max(decimals, 0)
    return f"{round(value, decimals):.{n}f} +- {round(error, decimals):.{n}f}"


def small_percent(share: float) -> str:
    """A relative error in percent, in two digits; ``<0.001`` for smaller ones."""
    if 0.0 <= 100 * share < 0.001:
        return "<0.001"
    return figure(100 * share, ".2g" if share < 0.995 else ".0f")


def error_percent(share: float) -> str:
    """A relative error to follow "by" or "to": ``less than 0.001 %``, ``0.012 %``."""
    text = small_percent(share)
    return f"{text.replace('<', 'less than ')} %"


def units_of(names: Iterable[str], units: Mapping[str, str]) -> dict[str, str]:
    """Unit of each column that has one, empty for pure numbers.

    Parameters
    ----------
    names : iterable of str
        Columns of a table of results.
    units : mapping of name -> unit
        Units of parameters, and under ``torque`` that of the columns ``torque_*``.
    """
    unit_of = {}
    for name in names:
        unit = units.get(name)
        if TORQUE_COLUMN.fullmatch(name):
            unit = units.get(TORQUE, "N m")
        if unit is None:
            unit = _unit_by_name(name)
        if unit is not None:
            unit_of[name] = unit
    return unit_of


@lru_cache(maxsize=4096)  # tables of a study repeat the same columns
def _unit_by_name(column: str) -> str | None:
    return next((unit for names, unit in UNITS if re.fullmatch(names, column)), None)


def amount(value: float, unit: str, largest: float | None = None, digits: int = 4) -> str:
    """A value with its unit, as in ``1.2 MPa``; the prefix is that of the largest of several."""
    shown, factor = prefixed(unit, abs(value) if largest is None else largest)
    text = f"{value * factor:.{digits}g}"
    if "e+" in text and abs(value * factor) < MAX_PREFIXED:  # 10000, not 1e+04
        text = f"{float(text):.0f}"
    return f"{text} {shown}".rstrip()


def knots_text(knots_between: Mapping[str, Sequence[float]], units: Mapping[str, str]) -> str:
    """Text on knots of tables of values between design points; empty without any."""
    texts = [
        f"{name} {listed([in_column(k, units.get(name, '')) for k in knots])}"
        f" {as_written(units.get(name, ''))[0]}".rstrip()
        for name, knots in knots_between.items()
    ]
    text = (
        "between values of the sweep, where nothing is solved: what grows there alone is not seen"
    )
    return f"tables have knots at {' and at '.join(texts)}, {text}" if texts else ""


def moment(seconds: float) -> str:
    """A time of a run: ``230 ms``, from 1 s on ``16.2 s``."""
    return f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{seconds:.4g} s"


def setting(name: str, value: float, unit: str, largest: float | None = None) -> str:
    """A parameter's value with its name and unit, as in ``pressure = 1.2 MPa``."""
    return f"{name} = {amount(value, unit, largest)}"


def with_unit(name: str, units: Mapping[str, str]) -> str:
    """A name with its unit, for the title of a column of numbers by `in_column`."""
    return f"{name} {as_written(units.get(name, ''))[0]}".rstrip()


def in_column(value: float, unit: str) -> str:
    """A number in a column whose title has the unit."""
    return f"{value * as_written(unit)[1]:.6g}"


def by_ranges(name: str, unit: str, values: Sequence[float], words: Sequence[str]) -> str:
    """Words by ranges of a parameter: ``stable at friction 0.1 to 0.3 (3 points), ...``.

    The number in brackets is that of values in a range. Empty if there are more than MOST_RANGES
    ranges, or if a value occurs twice or is NaN.
    """
    pairs = sorted(zip(map(float, values), words, strict=True))
    if any(not a[0] < b[0] for a, b in pairwise(pairs)) or any(v != v for v, _ in pairs):
        return ""
    ranges = [
        (word, [v for v, _ in same_word]) for word, same_word in groupby(pairs, key=lambda p: p[1])
    ]
    if not pairs or len(ranges) > MOST_RANGES:
        return ""
    texts, largest = [], max(abs(v) for v, _ in pairs)
    shown_unit = prefixed(unit, largest)[0]
    for word, same_word in ranges:
        first, last = (amount(v, unit, largest) for v in (same_word[0], same_word[-1]))
        first = first.removesuffix(shown_unit).rstrip()  # 0.1 to 0.3 m/s
        range_text = f"{first} to {last} ({len(same_word)} points)" if len(same_word) > 1 else last
        texts.append(f"{word} at {name} {range_text}")
    return ", ".join(texts)


def percent(low: float, high: float) -> str:
    """Two shares in percent: ``12.3 to 45.6``."""
    return f"{100 * low:.1f} to {100 * high:.1f}"


def status_counts(status: Sequence[str] | pd.Series | pa.ChunkedArray) -> dict[str, int]:
    """How many rows have each status, the most frequent status first."""
    import pyarrow as pa

    column = status if isinstance(status, pa.ChunkedArray) else pa.array(status, pa.string())
    counts = {
        str(pair["values"]): int(pair["counts"]) for pair in column.value_counts().to_pylist()
    }
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def failure_counts(status: Sequence[str] | pd.Series | pa.ChunkedArray) -> str:
    """How many rows have each status but ok, the most frequent first: ``3 not_converged``."""
    counts = status_counts(status)
    counts.pop("ok", None)
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def name_where_fastest(named: tuple[str, bool]) -> str:
    """The name of a track, and whether it has other names elsewhere (`Results.track_names`)."""
    text, changes = named
    return f"{text} (changes)" if changes else text


def named_tracks(tracks: Iterable[int], names: Mapping[int, tuple[str, bool]]) -> list[str]:
    """A line for each track that has a name: its number and name."""
    named = dict.fromkeys(int(track) for track in tracks if track in names)
    return [f"{track_number(track)}: {name_where_fastest(names[track])}" for track in named]


def band_text(band_hz: Sequence[float]) -> str:
    """A band of frequency in words: ``between 1 and 8000 Hz``."""
    low, high = band_hz
    return f"between {low:g} and {high:g} Hz"


def track_number(track: int) -> str:
    """Name of a track, a mode that is followed over design points: ``T3``."""
    return f"T{track}"


def real_mode_number(mode: int) -> str:
    """Name of a real mode of the assembly: ``R3``."""
    return f"R{mode}"


def did_you_mean(word: str, known_words: Iterable[str]) -> str:
    """Ending of a message with the known words that are closest to a word; may be empty."""
    matches = difflib.get_close_matches(word, list(dict.fromkeys(known_words)), n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(map(repr, matches))}?" if matches else ""


def shown(value: object) -> str:
    """Text of a value that a user gave, short enough for a message."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and abs(value) >= 10**LONGEST_SHOWN:
        return "a number too large"
    if isinstance(value, dict | list):
        kind = "table" if isinstance(value, dict) else "list"
        return f"a {kind}" if value else f"an empty {kind}"
    text = f"'{value}'" if isinstance(value, str) else str(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def sufficient_step(reasons: str) -> float:
    """Longest step [s] with which a run breaks no rule about the step; NaN if it breaks none.

    Parameters
    ----------
    reasons : str
        Texts of the rules that the run breaks, which have the steps.
    """
    steps = re.findall(r"which a step of (\S+) s (?:would show|avoids)", reasons)
    return min(map(float, steps), default=float("nan"))
