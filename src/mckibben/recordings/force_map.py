"""Force maps: static points of length, pressure and tension, from the tables of other programs and from recordings.

A column says what it holds and in which unit: ``length_mm``, ``pressure_bar_gauge``, ``force [N]``,
``contraction_percent``, ``rest_length_mm``. Everything is converted to SI here, once. Files that are no text tables become
a header with units and rows of cells first, so that the meaning of a header is found in one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..quantities import to_si, with_unit
from .columns import without_common_prefix
from .files import load
from .formats import ForeignTable, format_of
from .text import Rows, check_width, is_number, plain_text, read_rows, split_header, to_numbers, without_blanks


@dataclass(frozen=True)
class ForceMap:
    """Static points of one or more muscles of a kind; arrays of equal shape (n,), SI.

    `tension` at or below zero means that the muscle hung slack: such a point says where the law must not pull, but not
    how large the tension is, and fits leave it out.
    """

    name: str
    length: np.ndarray
    pressure: np.ndarray
    tension: np.ndarray
    rest_length: np.ndarray | None = None
    branch: np.ndarray | None = None
    diameter: np.ndarray | None = None
    remarks: tuple[str, ...] = ()  # what was left out on reading, in words

    def __len__(self) -> int:
        return len(self.length)

    @property
    def taut(self) -> np.ndarray:
        """Mask of the points that carry tension, bool (n,)."""
        return self.tension > 0.0

    @property
    def informative_slack(self) -> np.ndarray:
        """Slack points at pressures that do inflate the muscle, bool (n,).

        They say that the law may not pull there. At a pressure below the lowest one with tension (of the same rest length)
        the bladder may just not be filled, and nothing is said about the braid.
        """
        rest = np.zeros(len(self)) if self.rest_length is None else self.rest_length
        informative = np.zeros(len(self), bool)
        for length in np.unique(rest):
            same = rest == length
            filled = self.pressure[same & self.taut]
            informative |= same & ~self.taut & (self.pressure >= (filled.min() if filled.size else np.inf))
        return informative

    @property
    def largest(self) -> float:
        """Largest tension [N], to which relative errors refer."""
        return float(self.tension.max())

    def select(self, keep: np.ndarray, name: str | None = None) -> ForceMap:
        """The points where `keep` is true."""
        some = {k: None if getattr(self, k) is None else getattr(self, k)[keep] for k in _ARRAYS}
        return ForceMap(name=name or self.name, remarks=self.remarks, **some)  # type: ignore[arg-type]

    def with_rest_length(self, rest_length: float) -> ForceMap:
        """Return a copy with one rest length for all points [m]."""
        return replace(self, rest_length=np.full(len(self), float(rest_length)))

    @property
    def contraction(self) -> np.ndarray:
        """(L0 - L)/L0; raises `InputError` where the rest length is not known."""
        if self.rest_length is None:
            allowed = "give the rest length, or a column rest_length"
            raise InputError("rest_length", "not given", allowed, where=self.name, remedy="rest_length")
        return 1.0 - self.length / self.rest_length


_ARRAYS = ("length", "pressure", "tension", "rest_length", "branch", "diameter")


# Names under which the columns are known; the first that a header holds is taken.
COLUMNS = {
    "length": ("length", "braid_length", "test_length", "muscle_length", "l", "muscle.length"),
    "contraction": ("contraction", "contraction_ratio", "strain", "eps", "kappa", "epsilon"),
    "pressure": ("pressure", "p", "gauge_pressure", "muscle.pressure"),
    "tension": ("tension", "force", "f", "pull", "muscle.tension"),
    "rest_length": ("rest_length", "resting_length", "l0", "initial_length"),
    "branch": ("branch", "direction"),
    "diameter": ("diameter", "inner_diameter", "rest_diameter", "bore"),
}
UNITS = {
    "length": "m",
    "contraction": "1",
    "pressure": "Pa",
    "tension": "N",
    "rest_length": "m",
    "diameter": "m",
}
# What a table of a McKibben muscle can hold [SI]; outside, a unit is wrong or two columns are swapped.
PLAUSIBLE = {
    "length": (2e-3, 10.0),
    "contraction": (-0.6, 0.9),
    "pressure": (-1.013e5, 1e7),
    "tension": (-1e4, 1e6),
    "rest_length": (2e-3, 10.0),
    "diameter": (5e-4, 0.5),
}
# A largest pressure or tension below this is no muscle either: bar read as pascal, kN as N, swapped columns.
LEAST_LARGEST = {"pressure": 2e3, "tension": 0.05}
LEFT_OUT = "-"
MOST_ROWS = 400  # of a recording: its samples follow one another so closely that more say nothing more
_ABSOLUTE, _GAUGE = ("abs", "absolute"), ("gauge", "rel", "g")
_UNIT_WORDS = {
    **{
        u: u for u in ("m", "mm", "cm", "Pa", "kPa", "MPa", "bar", "mbar", "psi", "N", "kN", "mN", "lbf", "kgf", "inch")
    },
    **{"in": "inch", "percent": "percent", "%": "percent", "fraction": "1", "1": "1", "ratio": "1"},
}


def read_force_map(
    path: str | Path,
    *,
    rest_length: float | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    branch: str | None = None,
    pressure_zero: float = 0.0,
    ambient: float = 101325.0,
) -> ForceMap:
    """Read a force map from a CSV file (``.csv``, ``.csv.gz``), a MATLAB or TDMS file, or a recording (``.nc``, ``.mcap``).

    Args:
        path: the file, as `text.read_rows` takes it; rows of a CSV file with a blank cell in a column that is used are left
            out, and named in the remarks.
        rest_length: one rest length for all points [m], over a column of the file.
        columns: column names for ``length``, ``pressure``, ... where the header uses others; ``-`` where a column that the
            header names so shall not be read.
        units: units for columns whose header has none; a pressure's may be ``kPa abs`` or ``kPa gauge``.
        branch: keep only the rows whose branch column has this value.
        pressure_zero: what the pressure channel reads at zero gauge pressure [Pa].
        ambient: environment pressure, for a column of absolute pressures [Pa].

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    where = str(path)
    header, rows = _table(Path(path), where)
    for what in units or {}:
        if what not in COLUMNS:
            raise InputError("unit of", what, f"known are {', '.join(COLUMNS)}", where=where)
    chosen = _choose(header, {what: plain_text(column) for what, column in (columns or {}).items()}, where)
    rows, remarks = without_blanks(rows, {header.index(column): column for column in chosen.values()}, where)
    data: dict[str, np.ndarray] = {}
    for what, column in chosen.items():
        cells = [row[header.index(column)] for _, row in rows]
        if what == "branch":
            data[what] = np.array([c.strip() for c in cells])
            continue
        numbers = to_numbers(cells, [n for n, _ in rows], column, where)
        unit, absolute = _unit(column, (units or {}).get(what), what, where)
        scale = to_si(1.0, unit, UNITS[what], field=column, where=where)
        data[what] = numbers * scale - (ambient if absolute else 0.0)
    if "pressure" in data:
        data["pressure"] = data["pressure"] - pressure_zero
    if rest_length is not None:
        data["rest_length"] = np.full(len(rows), float(rest_length))
    if "length" not in data:
        if "rest_length" not in data:
            allowed = "a contraction needs the rest length, or a column rest_length"
            raise InputError("rest_length", "not given", allowed, where=where, remedy="rest_length")
        _check_plausible("contraction", data["contraction"], chosen["contraction"], where)
        data["length"] = data["rest_length"] * (1.0 - data["contraction"])
    data.pop("contraction", None)
    for what in ("length", "rest_length", "diameter", "pressure", "tension"):
        if what in data:
            _check_plausible(what, data[what], chosen.get(what, what), where)
    points = ForceMap(name=Path(path).name, remarks=tuple(remarks), **data)
    points = _keep_branch(points, branch, where)
    _check_direction(points, where)
    return points


def _table(path: Path, where: str) -> tuple[list[str], Rows]:
    """The cells of the header, and the rows of cells with their numbers."""
    if path.suffix.lower() != ".csv" and format_of(path) is not None:
        return _rows_of_columns(path, where)
    lines = read_rows(path, where)
    if len(lines) < 2:
        raise InputError(
            "file", f"{max(len(lines) - 1, 0)} rows", "allowed is a header and at least one row", where=where
        )
    header = [plain_text(cell) for cell in lines[0][1]]
    if all(is_number(cell) for cell in header):
        raise InputError(
            "header", ",".join(header), "the first row must name the columns, such as length_mm", where=where
        )
    check_width(lines[1:], len(header), f"the header has {len(header)} columns", where)
    return header, lines[1:]


def _choose(header: list[str], columns: dict[str, str], where: str) -> dict[str, str]:
    for quantity, column in columns.items():
        if quantity not in COLUMNS:
            raise InputError("column", quantity, f"known are {', '.join(COLUMNS)}", where=where)
        if column not in (*header, LEFT_OUT):
            raise InputError("column", column, f"the file has {', '.join(header)}", where=where)
    for quantity, match in recognise_columns(header).items():
        if len(match) > 1 and quantity not in columns:
            allowed = f"several columns may be the {quantity}; say which one is"
            raise InputError(quantity, ", ".join(match), allowed, where=where, remedy=f"column {quantity}")
        columns.setdefault(quantity, match[0])
    columns = {quantity: column for quantity, column in columns.items() if column != LEFT_OUT}
    for quantity in ("pressure", "tension"):
        if quantity not in columns:
            raise _no_column(quantity, header, where)
    if "length" not in columns and "contraction" not in columns:
        raise _no_column("length", header, where)
    if "length" in columns:
        columns.pop("contraction", None)
    return columns


def _no_column(what: str, header: list[str], where: str) -> InputError:
    allowed = f"the file has {', '.join(header)}; say which one it is"
    return InputError(what, "no column", allowed, where=where, remedy=f"column {what}")


def recognise_columns(header: list[str]) -> dict[str, list[str]]:
    """The columns that a header names, by what they hold; more than one where it is not clear which."""
    stems = {column: split_header(column, _UNIT_WORDS)[0] for column in header}
    columns: dict[str, list[str]] = {}
    for quantity, names in COLUMNS.items():
        matches = ([c for c in header if stems[c] == name] for name in names)
        match = next((m for m in matches if m), None)
        if match:
            columns[quantity] = match
    return columns


def unit_of(column: str, what: str) -> tuple[str | None, bool]:
    """Unit that a header states, if any, and whether a pressure is absolute."""
    _, tail = split_header(column, _UNIT_WORDS)
    absolute = any(w.lower() in _ABSOLUTE for w in tail)
    units = [w for w in tail if w in _UNIT_WORDS]
    return (_UNIT_WORDS[units[-1]] if units else "1" if what == "contraction" else None), absolute


def _unit(column: str, given: str | None, what: str, where: str) -> tuple[str, bool]:
    unit, absolute = unit_of(column, what)
    if given is not None:
        unit, _, reference = given.partition(" ")
        if what != "pressure" or reference.lower() not in (*_ABSOLUTE, *_GAUGE, ""):
            unit = given
        elif reference:
            absolute = reference.lower() in _ABSOLUTE
    if unit is None:
        raise InputError(
            column,
            "no unit",
            f"write it into the header, such as {what}_{'bar' if what == 'pressure' else UNITS[what]}, or say it",
            where=where,
            remedy=f"unit {what}",
        )
    return unit, absolute


def _check_plausible(what: str, values: np.ndarray, column: str, where: str) -> None:
    unit = UNITS[what]
    low, high = PLAUSIBLE[what]
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        worst = float(values[bad][0])
        hint = (
            "is it in percent? name the column contraction_percent"
            if what == "contraction"
            else "wrong unit, or columns swapped?"
        )
        raise InputError(
            column,
            with_unit(worst, unit),
            f"allowed is {with_unit(low, unit)} to {with_unit(high, unit)}; {hint}",
            where=where,
        )
    if what in LEAST_LARGEST and values.max() < LEAST_LARGEST[what]:
        raise InputError(
            column,
            f"at most {with_unit(float(values.max()), unit)}",
            f"allowed is a largest value of {with_unit(LEAST_LARGEST[what], unit)} or more; wrong unit, or columns swapped?",
            where=where,
        )


def _keep_branch(points: ForceMap, branch: str | None, where: str) -> ForceMap:
    if branch is None:
        return points
    names = [] if points.branch is None else sorted(set(points.branch))
    if branch not in names:
        raise InputError("branch", branch, f"the file has {', '.join(names) or 'no branch column'}", where=where)
    assert points.branch is not None
    return points.select(points.branch == branch)


def _check_direction(points: ForceMap, where: str) -> None:
    """Refuse a table in which tension clearly falls with pressure, or with length: columns swapped, or a sign wrong.

    A tenth of the largest tension is left for hysteresis and noise: measured loops stay within 6 %.
    """
    room = 0.1 * points.largest
    rest = np.zeros(len(points)) if points.rest_length is None else points.rest_length
    names = (
        np.zeros(len(points), dtype=int) if points.branch is None else np.unique(points.branch, return_inverse=True)[1]
    )
    for fixed, moving, over in (("length", "pressure", "Pa"), ("pressure", "length", "m")):
        groups = np.stack([getattr(points, fixed), rest, names], axis=1)
        group = np.unique(groups, axis=0, return_inverse=True)[1].ravel()
        order = np.lexsort((getattr(points, moving), group))
        for member in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
            tension, at = points.tension[member], getattr(points, moving)[member]
            fall = np.maximum.accumulate(tension) - tension
            if len(tension) > 1 and fall.max() > room:
                i, key = int(fall.argmax()), groups[member[0]]
                raise InputError(
                    "tension",
                    f"{tension[i]:.4g} N at {with_unit(float(at[i]), over)}",
                    f"it falls by {fall[i]:.4g} N while the {moving} rises at "
                    f"{with_unit(float(key[0]), 'm' if fixed == 'length' else 'Pa')}; columns swapped, or a sign wrong?",
                    where=where,
                )


def _rows_of_columns(path: Path, where: str) -> tuple[list[str], Rows]:
    """The header and the rows of a file that is no text table; of a recording evenly some samples, at most `MOST_ROWS`.

    Columns of other lengths than most of them are left out.

    Raises:
        InputError: there is no such file, it cannot be read, or no table is in it.
    """
    columns = _columns(path)
    counts = [len(values) for _, values in columns]
    if not counts:
        raise InputError("columns", "none", "allowed is a file with at least one column of numbers", where=where)
    most = max(sorted(set(counts)), key=counts.count)
    kept = [(label, values) for label, values in columns if len(values) == most]
    cells = [_cells(values) for _, values in kept]
    return [label for label, _ in kept], [(n, list(row)) for n, row in enumerate(zip(*cells, strict=True), 1)]


def _columns(path: Path) -> list[tuple[str, np.ndarray]]:
    """Label with unit, and values (n,), of each column."""
    content = load(path)
    if not isinstance(content, ForeignTable):
        every = -(-len(content.recording) // MOST_ROWS)
        return [(f"{name} [{c.unit}]", c.values[::every]) for name, c in content.recording.channels.items()]
    usable = [c for c in content.columns if c.values.ndim == 1 and c.values.dtype.kind in "fiubUO"]
    usable = without_common_prefix(usable) if usable else []
    return [(f"{c.label} [{c.unit}]" if c.unit and "[" not in c.label else c.label, c.values) for c in usable]


def _cells(values: np.ndarray) -> list[str]:
    if values.dtype.kind in "UO":
        return [str(v) for v in values]
    # repr of a float is the shortest text that reads back to the same bits
    return [repr(v) for v in values.astype(float).tolist()]


class TablePreview(NamedTuple):
    """A look into a table.

    Args:
        header: cells of the header.
        rows: cells of the first rows.
        total: how many rows there are.
        meant: what a column holds -> its cell of the header, as far as the header says it and says it once.
    """

    header: list[str]
    rows: list[list[str]]
    total: int
    meant: dict[str, str]


def preview_table(path: str | Path, rows: int = 60) -> TablePreview:
    """Look into a table that `read_force_map` may read.

    Raises:
        InputError: there is no such file, or it is no table at all.
    """
    header, lines = _table(Path(path), str(path))
    meant = {quantity: match[0] for quantity, match in recognise_columns(header).items() if len(match) == 1}
    if "length" in meant:
        meant.pop("contraction", None)
    return TablePreview(header, [row for _, row in lines[:rows]], len(lines), meant)


def stated_unit(column: str, what: str) -> str:
    """Unit that a header states, as ``--unit`` takes it; empty if it states none."""
    if what not in COLUMNS:
        return ""
    unit, absolute = unit_of(column, what)
    return f"{unit} abs" if unit and absolute and what == "pressure" else unit or ""
