"""Free modes of a component: how many are rigid, and measured values of the elastic ones.

Measured values are in a CSV file with a header: ``frequency_hz``, ``damping_ratio`` or both, and
``mode``, the number of the component mode as in sweeps, counted from the first rigid mode. Without
``mode`` a measured frequency belongs to the nearest elastic mode.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.files import OF_LINES, UnusableFileError, read_whole
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.components.bodies import Brake
from squealstudy.models.components.file_matrices import least_frequency
from squealstudy.models.file_table import PlacedError

MODE, FREQUENCY, DAMPING_RATIO = COLUMNS = ("mode", "frequency_hz", "damping_ratio")
# relative difference of measured and computed frequency up to which they may be the same mode
MAX_PARTNER_REL_DISTANCE = 0.1


@dataclass(frozen=True)
class MeasuredLine:
    """A line of the table of measured modes.

    Attributes
    ----------
    line : int
        Its number in the file, from 1.
    mode : int or None
        Number of the component mode from 1. None: the mode is found by its frequency.
    frequency_hz, damping_ratio : float or None
        None where not measured.
    """

    line: int
    mode: int | None
    frequency_hz: float | None
    damping_ratio: float | None


def read_mode_table(path: Path) -> tuple[MeasuredLine, ...]:
    """Read the table of measured modes.

    Raises
    ------
    ModelError
        The file cannot be read, has no lines, or has a wrong one.
    """
    try:
        text = read_whole(path, OF_LINES).decode("utf-8-sig")
    except UnusableFileError as error:
        raise ModelError(f"{path.name} cannot be read: {error}") from None
    except UnicodeDecodeError as error:
        raise ModelError(f"{path.name}: expected text in UTF-8") from error
    rows = csv.reader(text.splitlines())
    header: list[str] = []
    measured_lines: list[MeasuredLine] = []
    for cells in rows:
        cells = [cell.strip() for cell in cells]
        if not any(cells) or cells[0].startswith("#"):
            continue
        where = f"{path.name}:{rows.line_num}"
        if not header:
            header = _header(cells, where)
            continue
        if len(cells) != len(header):
            raise ModelError(f"{where}: expected {len(header)} values, got {len(cells)}")
        measured_lines.append(_mode(dict(zip(header, cells, strict=True)), rows.line_num, where))
    if not measured_lines:
        raise ModelError(f"{path.name}: expected a header with {', '.join(COLUMNS)} and lines")
    return tuple(measured_lines)


def _header(cells: Sequence[str], where: str) -> list[str]:
    """Names of the columns of a table of measured modes; ModelError for unknown ones."""
    unknown = [cell for cell in cells if cell not in COLUMNS]
    if unknown or len(set(cells)) < len(cells) or not {FREQUENCY, DAMPING_RATIO} & set(cells):
        got = ", ".join(cells)
        raise ModelError(
            f"{where}: expected the columns {FREQUENCY} or {DAMPING_RATIO}, and {MODE}; got {got}"
        )
    return [*cells]


def _mode(cells: Mapping[str, str], line: int, where: str) -> MeasuredLine:
    """A line of a table of measured modes; ModelError for numbers that are no mode's."""
    values = {}
    for name, text in cells.items():
        try:
            values[name] = float(text) if text else None
        except ValueError:
            raise ModelError(f"{where}: {name}: expected a number, got '{text}'") from None
    mode, hz, zeta = (values.get(name) for name in COLUMNS)
    if mode is not None and (not mode >= 1 or mode % 1):
        raise ModelError(f"{where}: {MODE}: expected a number from 1, got '{cells[MODE]}'")
    if hz is not None and not 0 < hz < math.inf:
        raise ModelError(f"{where}: {FREQUENCY}: expected a frequency above 0, got {hz:g}")
    if zeta is not None and not 0 <= zeta < 1:
        raise ModelError(
            f"{where}: {DAMPING_RATIO}: expected a ratio from 0 to 1 (0.01 is 1 %), got {zeta:g}"
        )
    if mode is None and hz is None:
        raise ModelError(f"{where}: expected {MODE} or {FREQUENCY}: which mode is it?")
    return MeasuredLine(line, None if mode is None else int(mode), hz, zeta)


FIRST_CUTOFF, LAST_CUTOFF = 2000.0, 64_000.0  # Hz, between which the cutoff is doubled


def first_elastic(K: sp.csr_matrix, M: sp.csr_matrix, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] (m,) and shapes (n, m) of the first `count` elastic free modes.

    m is less than `count` where there are no more modes up to LAST_CUTOFF.
    """
    cutoff = first_cutoff(K, M)
    while True:
        omega, phi = real_modes(M, K, cutoff)
        rigid = rigid_count(K, M, omega)
        if len(omega) >= rigid + count or 2 * cutoff > LAST_CUTOFF:
            return omega[rigid:][:count] / (2 * np.pi), phi[:, rigid:][:, :count]
        cutoff *= 2


def first_cutoff(K: sp.csr_matrix, M: sp.csr_matrix) -> float:
    """Frequency [Hz] up to which free modes are computed first.

    FIRST_CUTOFF for most parts. It is lower where it would include most modes of the model, as with
    a density in wrong units: sqrt(max K_ii / M_ii) / (2 pi) / (5 n^(1/3)), for n nodes.
    """
    diagonal = np.abs(M.diagonal())
    ratios = np.abs(K.diagonal()) / np.where(diagonal > 0, diagonal, np.inf)
    side = (M.shape[0] / 3) ** (1 / 3)
    cutoff_hz = np.sqrt(ratios.max(initial=0.0)) / (2 * np.pi) / max(side, 1.0) / 5
    return float(min(FIRST_CUTOFF, cutoff_hz)) if cutoff_hz > 0.0 else FIRST_CUTOFF


def rigid_count(K: sp.csr_matrix, M: sp.csr_matrix, omega: np.ndarray) -> int:
    """Number of rigid modes among angular frequencies omega [rad/s].

    Rigid are modes below `first_cutoff` / 2000, which is 1 Hz for most parts, and those below
    `least_frequency`.
    """
    slow = 2 * np.pi * first_cutoff(K, M) / FIRST_CUTOFF
    return int((omega < max(slow, least_frequency(K, M))).sum())


@dataclass(frozen=True)
class MeasuredMode:
    """A component mode with measured values.

    Attributes
    ----------
    number : int
        As in sweeps, from 1.
    computed_hz : float
    frequency_hz, damping_ratio : float or None
        Measured; None where not measured.
    """

    number: int
    computed_hz: float
    frequency_hz: float | None
    damping_ratio: float | None

    @property
    def frequency_scale(self) -> float | None:
        """Measured over computed frequency; None where it is not measured."""
        return None if self.frequency_hz is None else self.frequency_hz / self.computed_hz


def measured_modes(
    path: Path, K: sp.csr_matrix, M: sp.csr_matrix, cutoff_hz: float
) -> list[MeasuredMode]:
    """Measured modes of a table whose computed frequency is up to a cutoff [Hz].

    Raises
    ------
    ModelError
        As in `read_mode_table`; a line is about a rigid mode; two lines are about the same mode;
        no mode is near a frequency.
    """
    table = read_mode_table(path)
    # a mode above the cutoff may be the nearest to a measured frequency
    omega, _ = real_modes(M, K, (1.0 + MAX_PARTNER_REL_DISTANCE) * cutoff_hz)
    rigid, hz = rigid_count(K, M, omega), omega / (2 * np.pi)
    line_of: dict[int, MeasuredLine] = {}
    for row in table:
        where = f"{path.name}:{row.line}"
        number = row.mode if row.mode is not None else _nearest(row, hz, rigid, where)
        if number is None or number > len(hz):
            continue
        if number <= rigid:
            raise ModelError(
                f"{where}: {MODE}: {number} is a rigid mode, the elastic ones begin at {rigid + 1}"
            )
        if number in line_of:
            raise ModelError(f"{where}: mode {number} was in line {line_of[number].line} already")
        line_of[number] = row
    return [
        MeasuredMode(number, float(hz[number - 1]), row.frequency_hz, row.damping_ratio)
        for number, row in sorted(line_of.items())
        if hz[number - 1] <= cutoff_hz
    ]


def tabled_modes(
    brake: Brake, name: str, K: sp.csr_matrix, M: sp.csr_matrix, cutoff_hz: float
) -> list[MeasuredMode]:
    """Measured modes of a component of a model file; none where it names no table.

    Raises
    ------
    PlacedError
        The table is wrong, or [[fixed]] holds the component.
    """
    table, keys = brake.file.components[name].measured, ("components", name, "measured")
    if table is None:
        return []
    for fixed in brake.file.fixed:
        if fixed.set.partition(".")[0] == name:
            text = f"[[fixed]] holds {fixed.set}: modes measured on a free part are not its own"
            raise PlacedError(keys, text)
    try:
        return measured_modes(brake.located(table), K, M, cutoff_hz)
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error


def _nearest(row: MeasuredLine, hz: np.ndarray, rigid: int, where: str) -> int | None:
    """Number of the elastic mode nearest in frequency; None if it may be above those computed."""
    assert row.frequency_hz is not None
    rel_distance = np.abs(hz[rigid:] / row.frequency_hz - 1.0)
    if len(rel_distance) and rel_distance.min() <= MAX_PARTNER_REL_DISTANCE:
        return rigid + 1 + int(rel_distance.argmin())
    if not len(rel_distance) or row.frequency_hz > hz[-1]:
        return None
    nearest_hz = hz[rigid + int(rel_distance.argmin())]
    raise ModelError(
        f"{where}: no free mode is within {100 * MAX_PARTNER_REL_DISTANCE:g} % of "
        f"{row.frequency_hz:g} Hz, the nearest is at {nearest_hz:.1f} Hz: give its number in a "
        f"column {MODE}"
    )
