"""Force maps: static points of length, pressure and tension, from the tables of other programs and from recordings.

A column says what it holds and in which unit: ``length_mm``, ``pressure_bar_gauge``, ``force [N]``,
``contraction_percent``, ``rest_length_mm``; `formats.columns` has the names and the units. Everything is converted to SI
here, once.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..documents import JsonValue, path_text, write_text
from ..errors import InputError
from ..extras import library
from ..formats.columns import AMBIENT, column_numbers, table_labels, without_blank_rows, without_common_prefix
from ..formats.labels import (
    COLUMNS,
    converts,
    likely_columns,
    parse_header,
    quantity_of,
    recognise_columns,
    split_reference,
)
from ..formats.registry import format_of, load
from ..formats.table import ForeignColumn, ForeignTable
from ..formats.text import plain_text
from ..quantities import to_si, values_in_si, with_unit

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class ForceMap:
    """Static points of one or more muscles of a kind; arrays of equal shape (n,), SI.

    `tension` at or below zero means that the muscle hung slack: such a point says where the law must not pull, but not
    how large the tension is, and fits leave it out. `run` labels the run (recording, file) in which each point was
    measured: points of one run share errors.

    Examples:
        >>> import mckibben as mk
        >>> points = mk.ForceMap("bench", [0.12, 0.13], [3e5, 3e5], [20.0, 35.0])
        >>> points.largest
        35.0
        >>> points.to_dataframe().columns.tolist()
        ['length', 'pressure', 'tension']
    """

    name: str
    length: np.ndarray
    pressure: np.ndarray
    tension: np.ndarray
    rest_length: np.ndarray | None = None
    branch: np.ndarray | None = None
    diameter: np.ndarray | None = None
    run: np.ndarray | None = None
    remarks: tuple[str, ...] = ()  # what was left out on reading, in words

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, np.asarray(getattr(self, name)))
        for name in _ARRAYS:
            column = getattr(self, name)
            if column is None:
                continue
            if column.shape != self.length.shape or column.ndim != 1:
                problem = f"must be one number per point, {self.length.shape}, got an array {column.shape}"
                raise InputError(name, None, problem, where=self.name)
            if name in UNITS and column.dtype.kind not in "fiu":
                raise InputError(name, None, f"must be numbers in {UNITS[name]}", where=self.name)

    def __len__(self) -> int:
        return len(self.length)

    def __repr__(self) -> str:
        taut = (
            f"{int(self.taut.sum())} with tension, largest {self.largest:.4g} N" if len(self) else "none with tension"
        )
        return f"ForceMap({self.name!r}: {len(self)} points, {taut})"

    def to_dataframe(self) -> pandas.DataFrame:
        """The points as a data frame: a column per quantity that is known [SI].

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        columns = {name: getattr(self, name) for name in _ARRAYS if getattr(self, name) is not None}
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(columns)
        return frame

    @classmethod
    def joined(cls, maps: Iterable[ForceMap], name: str = "joined") -> ForceMap:
        """The points of several maps as one.

        Args:
            maps: one or more; what not all of them know, such as a rest length, is left out. Maps of different names are
                different runs.
            name: of the map.

        Raises:
            InputError: there is no map.
        """
        each = list(maps)
        if not each:
            raise InputError("maps", None, "must be one or more")
        shared = [key for key in _ARRAYS if all(getattr(one, key) is not None for one in each)]
        columns = {key: np.concatenate([getattr(one, key) for one in each]) for key in shared}
        if len({one.name for one in each}) > 1:
            labels = [(one.name, run) for one in each for run in ([""] * len(one) if one.run is None else one.run)]
            columns["run"] = np.array([f"{name} {run}".strip() for name, run in labels], str)
        remarks = tuple(f"{one.name}: {remark}" for one in each for remark in one.remarks)
        return cls(name=name, remarks=remarks, **columns)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the points to a ``.csv`` file that `read` reads back; returns its path."""
        path = Path(path)
        if path.suffix.lower() != ".csv":
            raise InputError("suffix", path.suffix or str(path), known=[".csv"], where=str(path))
        names = [name for name in _ARRAYS if getattr(self, name) is not None]
        head = [f"{name} [{UNITS[name]}]" if name in UNITS else name for name in names]
        columns = [getattr(self, name).tolist() for name in names]
        rows = [",".join(str(value) for value in row) for row in zip(*columns, strict=True)]
        write_text(path, "\n".join([",".join(head), *rows]) + "\n")
        return path

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
            allowed = "is missing: give the rest length, or a column rest_length"
            raise InputError("rest_length", None, allowed, where=self.name, remedy="rest_length")
        contraction: np.ndarray = 1.0 - self.length / self.rest_length
        return contraction


_ARRAYS = ("length", "pressure", "tension", "rest_length", "branch", "diameter", "run")


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


LEAST_CONTRACTION = 0.01  # of a table in percent, below which it probably is a fraction: 0.25 is a usual largest one

TEXT_QUANTITIES = ("branch", "run")  # quantities whose values are words
LEFT_OUT = "-"
MOST_ROWS = 400  # of a recording: its samples follow one another so closely that more say nothing more
ALIASES = {"force": "tension", "strain": "contraction", "l0": "rest_length"}  # words for `columns` and `units`


def read_force_map(
    path: str | Path,
    *,
    rest_length: float | None = None,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    branch: str | None = None,
    pressure_zero: float = 0.0,
    ambient: float = AMBIENT,
    pressure: object = None,
    length_zero: object = None,
    **options: object,
) -> ForceMap:
    r"""Read a force map from a file of any format that `read` takes, from a recording, or from one file per pressure.

    Args:
        path: the file, or a folder or pattern of files that each hold one pressure; rows with a blank cell in a column that
            is used are left out, and named in the remarks.
        rest_length: one rest length for all points [m], over a column of the file.
        columns: label of the columns of ``length``, ``pressure``, ... or their number from 1, where the header uses other
            names; ``-`` where a column that the header names so shall not be read.
        units: units for columns whose header has none; a pressure's may be ``kPa abs`` or ``kPa gauge``.
        branch: keep only the rows whose branch column has this value.
        pressure_zero: what the pressure channel reads at zero gauge pressure [Pa].
        ambient: environment pressure, for a column of absolute pressures [Pa].
        pressure: gauge pressure of a file without such a column [Pa], of several one for each in the order of their names;
            by default that in the head or the name of each.
        length_zero: length of the muscle where the length column reads zero [m], one or one for each file; by default that
            in the head.
        options: options of the format, as `read` takes them.

    Raises:
        InputError: names file, column, value and what is allowed.

    Examples:
        >>> import mckibben as mk
        >>> from pathlib import Path
        >>> _ = Path("map.csv").write_text("length [mm],pressure [bar],force [N]\n120,3,20\n130,3,35\n")
        >>> mk.read_force_map("map.csv", rest_length=0.14).contraction.round(3).tolist()
        [0.143, 0.071]
        >>> _ = Path("pull 3 bar.csv").write_text("length [mm],force [N]\n-20,20\n-10,35\n")
        >>> mk.read_force_map("pull ? bar.csv", length_zero="14 cm").length.round(3).tolist()
        [0.12, 0.13]
    """
    of_map: dict[str, Any] = {"columns": columns, "units": units, "rest_length": rest_length, "branch": branch}
    of_map |= {"pressure_zero": pressure_zero, "ambient": ambient}
    return map_and_table(Path(path_text(path)), of_map, pressure, length_zero, options)[0]


def map_and_table(
    path: Path, of_map: Mapping[str, Any], pressure: object, length_zero: object, options: Mapping[str, object]
) -> tuple[ForceMap, ForeignTable]:
    """A force map and the table of it, of several files that of the first; `of_map` goes to `map_of_table`."""
    several = series_files(path)
    files = several or [path]
    pressures, zeros = _one_each(pressure, "Pa", "pressure", files), _one_each(length_zero, "m", "length_zero", files)
    maps, tables = [], []
    for file, stated, zero in zip(files, pressures, zeros, strict=True):
        table = table_of(file, **options)
        if several or stated is not None or zero is not None:
            table, zero = at_pressure(file, table, of_map["columns"] or {}, stated, zero)
        maps.append(map_of_table(file, table, length_zero=zero, alone=not several, **of_map))
        tables.append(table)
    whole = ForceMap.joined(maps, path.name) if several else maps[0]
    for quantity in LEAST_LARGEST if several else ():
        _check_largest(quantity, getattr(whole, quantity), quantity, str(path))
    return whole, tables[0]


def series_files(path: Path) -> list[Path]:
    """Files of a folder or of a pattern in the order of their names, numbers by size; none where a path is one file.

    Raises:
        InputError: a folder or a pattern has no file that can be read.
    """
    pattern = bool(re.search(r"[*?\[]", path.name)) and not path.exists()
    if not pattern and not (path.is_dir() and not (path / "metadata.yaml").is_file()):
        return []
    found = path.parent.glob(path.name) if pattern else path.iterdir()
    files = [one for one in found if one.is_file() and format_of(one) is not None and not one.name.startswith(".")]
    if not files:
        raise InputError("file", str(path), "must hold files of measured rows, one for each pressure")
    return sorted(files, key=lambda one: [int(w) if w.isdecimal() else w for w in re.split(r"(\d+)", one.name.lower())])


def _one_each(value: object, unit: str, field: str, files: list[Path]) -> list[float | None]:
    """A quantity of each file [unit]: one for all, or one for each."""
    if value is None:
        return [None] * len(files)
    several = values_in_si(value, unit, field=field)
    if len(several) not in (1, len(files)):
        names = ", ".join(one.name for one in files)
        problem = f"must be one, or one for each of the {len(files)} files {names}; got {len(several)}"
        raise InputError(field, None, problem)
    return [*(several * len(files) if len(several) == 1 else several)]


_LENGTH_ZERO = re.compile(
    r"(?i)\b(?:gauge|grip|clamp\w*|initial|start\w*|rest|anfangs|einspann|mess|ausgangs)[ _-]?(?:length|l.{1,2}nge)\b"
)
_AMOUNT = re.compile(r"([-+]?\d+(?:[.,]\d+)?)[\s_;:,\[]*([a-zA-Z]+)")


def at_pressure(
    path: Path, table: ForeignTable, columns: Mapping[str, str | int], pressure: float | None, zero: float | None
) -> tuple[ForeignTable, float | None]:
    """A table that was measured at one pressure with that as a column, and the zero of its length.

    Args:
        path: of the file, whose name may say the pressure.
        table: of the file; its head may say the pressure, and the length where the length column reads zero.
        columns: those that are named.
        pressure: gauge pressure, where it is stated [Pa].
        zero: length of the muscle where the length column reads zero, where it is stated [m].

    Raises:
        InputError: head and name state several pressures or none, or a pressure is stated beside a column of it.
    """
    labels, where, said = table_labels(table), str(path), []
    named = {*recognise_columns(labels), *(ALIASES.get(name, name) for name in columns)}
    head = [str(line) for line in table.notes.get("preamble", [])]

    def amounts(text: str, unit: str) -> list[tuple[float, int]]:
        """Amounts of a unit in a text [SI], and where each begins."""
        return [
            (to_si(float(m[1].replace(",", ".")), m[2], unit, field="pressure"), m.start())
            for m in _AMOUNT.finditer(text) if converts(m[2], unit)
        ]  # fmt: skip

    if pressure is not None and "pressure" in named:
        raise InputError("pressure", with_unit(pressure, "Pa"), "is for files without a column of it", where=where)
    if pressure is None and "pressure" not in named:
        of_head = [line for line in head if quantity_of(re.split(r"[\s:;=,(\[]", line.strip())[0]) == "pressure"]
        said_at = {value: "head" for line in of_head for value, _ in amounts(line, "Pa")}
        # 2_5bar may be 2.5 bar, or 5 bar of the second muscle
        clear = [value for value, at in amounts(path.stem, "Pa") if not re.search(r"\d[_p,-]$", path.stem[:at])]
        said_at |= {value: "name" for value in clear if value not in said_at}
        if len(said_at) != 1:
            has = " and ".join(with_unit(one, "Pa") for one in said_at) or "no clear pressure"
            problem = f"must be stated, such as '3 bar': head and name of the file say {has}"
            raise InputError("pressure", None, problem, where=where, remedy="pressure")
        ((pressure, place),) = said_at.items()
        said.append(f"taken at {with_unit(pressure, 'Pa')}, as its {place} says")
    if zero is None:
        tails = [line[begin.end() :] for line in head if (begin := _LENGTH_ZERO.search(line))]
        lengths = {value for tail in tails for value, _ in amounts(tail, "m")[:1]}
        if len(lengths) == 1:
            (zero,) = lengths
            said.append(f"its length is counted from {with_unit(zero, 'm', 6)}, as its head says")
    kept = list(table.columns)
    for quantity, label in likely_columns(labels).items():  # such as Standardweg and Standardkraft
        if quantity != "pressure" and not {quantity, "contraction" if quantity == "length" else quantity} & named:
            at = next(i for i, one in enumerate(labels) if one.partition(" [")[0] == label)
            kept[at] = kept[at]._replace(label=f"{quantity} [{parse_header(0, labels[at])[1].unit}]", unit=None)
            said.append(f"{label} is taken for the {quantity}, by its unit")
    if pressure is not None:
        kept.append(ForeignColumn("pressure [Pa]", np.full(len(kept[0].values), pressure)))
    return table._replace(columns=kept, remarks=[*table.remarks, *(["; ".join(said)] if said else [])]), zero


def map_of_table(
    path: Path,
    table: ForeignTable,
    *,
    rest_length: float | None = None,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    branch: str | None = None,
    pressure_zero: float = 0.0,
    ambient: float = AMBIENT,
    length_zero: float | None = None,
    alone: bool = True,
) -> ForceMap:
    """Make a force map of a table; see `read_force_map`. It is `alone` if it is not one of several that make a map."""
    where = str(path)
    header = _checked_header(table, where)
    units_by_name = {ALIASES.get(name, name): unit for name, unit in (units or {}).items()}
    for quantity in units_by_name:
        if quantity not in COLUMNS:
            raise InputError("unit of", quantity, known=COLUMNS, where=where)
    chosen = choose_map_columns(header, columns or {}, where)
    data = {}
    for quantity, label in chosen.items():
        column = table.columns[header.index(label)]._replace(label=label)
        if quantity in TEXT_QUANTITIES:
            data[quantity] = np.array([_word(cell) for cell in column.values])
            continue
        numbers = column_numbers(column, table.rows, where)
        if np.isinf(numbers).any():
            i = int(np.argmax(np.isinf(numbers)))
            raise InputError(f"{label}{table.place(i)}", str(numbers[i]), "must be a finite number", where=where)
        data[quantity] = numbers
    used = {header.index(label): data[quantity] for quantity, label in chosen.items()}
    labelled = [c._replace(label=label) for c, label in zip(table.columns, header, strict=True)]
    keep, remarks = without_blank_rows(table._replace(columns=labelled), used, where)
    for quantity, label in chosen.items():
        data[quantity] = data[quantity][keep]
        if quantity not in TEXT_QUANTITIES:
            unit, absolute = _unit(label, units_by_name.get(quantity), quantity, where)
            shortens = quantity == "contraction" and converts(unit, "m")  # such as the travel of a testing machine
            hangs = quantity == "tension" and converts(unit, "kg")
            scale = to_si(1.0, unit, "m" if shortens else "kg" if hangs else UNITS[quantity], field=label, where=where)
            if absolute:
                less = with_unit(ambient, "Pa")
                remarks = [*remarks, f"{label} is absolute; the map has gauge pressures, less {less}"]
            if hangs:
                scale *= GRAVITY
                remarks = [*remarks, f"{label} is taken as what hangs on the muscle, {GRAVITY} N for each kg"]
            data["shortening" if shortens else quantity] = data[quantity] * scale - (ambient if absolute else 0.0)
    if "pressure" in data:
        data["pressure"] = data["pressure"] - pressure_zero
    if rest_length is not None:
        data["rest_length"] = np.full(int(keep.sum()), float(rest_length))
    if length_zero is not None:
        if "length" not in data and "shortening" not in data:  # a contraction in percent is of the rest length
            data.setdefault("rest_length", np.full(int(keep.sum()), length_zero))
        else:
            data["length"] = (
                length_zero - data.pop("shortening") if "shortening" in data else data["length"] + length_zero
            )
    if "length" not in data:
        if "rest_length" not in data:
            allowed = "is missing: contractions are shares of it; state it, or write a column rest_length"
            raise InputError("rest_length", None, allowed, where=where, remedy="rest_length")
        if "shortening" in data:
            data["contraction"] = data.pop("shortening") / data["rest_length"]
        unit = _unit(chosen["contraction"], units_by_name.get("contraction"), "contraction", where)[0]
        remarks = [*remarks, *_check_contraction(data["contraction"], chosen["contraction"], unit, where)]
        data["length"] = data["rest_length"] * (1.0 - data["contraction"])
    data.pop("contraction", None)
    for quantity in ("length", "rest_length", "diameter", "pressure", "tension"):
        if quantity in data:
            _check_plausible(quantity, data[quantity], chosen.get(quantity, quantity), where)
            if alone:
                _check_largest(quantity, data[quantity], chosen.get(quantity, quantity), where)
    if "length" in chosen and "rest_length" in data:
        _check_near_rest(data["length"], data["rest_length"], chosen["length"], where)
    points = ForceMap(name=path.name, remarks=(*table.remarks, *remarks), **data)
    points = _keep_branch(points, branch, where)
    _check_direction(points, where)
    pushes = points.tension < -PUSHED * points.tension.max()
    if pushes.any():
        most = with_unit(-float(points.tension.min()), "N")
        said = f"{int(pushes.sum())} of {len(pushes)} rows push, with {most} at most, as no muscle can; they count as slack"
        points = replace(points, remarks=(*points.remarks, said))
    if table.rows is None:  # samples of a recording: those of a hold are alike
        return points
    return replace(points, remarks=(*points.remarks, *_repeated(points)))


def table_of(path: Path, **options: object) -> ForeignTable:
    """The table in a file; of a recording of mckibben evenly some of its samples, at most `MOST_ROWS`.

    Of columns of numbers those whose length differs from that of most are left out.

    Raises:
        InputError: there is no such file, it cannot be read, or it has no columns of numbers.
    """
    content = load(path, **options)
    if not isinstance(content, ForeignTable):
        every = -(-len(content.time) // MOST_ROWS)
        channels = content.channels.items()
        return ForeignTable([ForeignColumn(f"{name} [{c.unit}]", c.values[::every]) for name, c in channels])
    return unpivoted(content) if content.rows is not None else even_table(content, str(path))


PUSHED = 0.05  # share of the largest tension by which a slack reading may be negative: zeros of cells drift less
GRAVITY = 9.80665  # standard acceleration of free fall [m/s^2]
_PRESSURE_IN_LABEL = re.compile(r"([-+]?\d+(?:[.,]\d+)?)\s*([a-zA-Z][a-zA-Z/^0-9]*(?:\s?\(?(?:abs|gauge|rel|g)\)?)?)")


def unpivoted(table: ForeignTable) -> ForeignTable:
    """A table with a column of forces per pressure, "1 bar", "2 bar", .., as one row per point; others as they are."""
    stated: dict[int, tuple[str, str]] = {}
    for at, column in enumerate(table.columns):
        match = _PRESSURE_IN_LABEL.search(column.label)
        if match and converts(split_reference(match[2])[0], "Pa"):
            stated[at] = (match[1].replace(",", "."), match[2])
    others = [at for at in range(len(table.columns)) if at not in stated]
    if len(stated) < 2 or len({unit for _, unit in stated.values()}) > 1 or not others or not table.named:
        return table
    if quantity_of(parse_header(0, table_labels(table)[others[0]])[0]) not in ("length", "contraction"):
        return table
    rows = range(len(table.columns[others[0]].values))
    unit = next(iter(stated.values()))[1]
    tails = {parse_header(0, table.columns[at].label)[1].unit for at in stated}
    tail = next(iter(tails)) if len(tails) == 1 else None
    force = f"force [{tail}]" if tail is not None and converts(tail, "N") else "force"
    columns = [
        ForeignColumn(
            table.columns[at].label, np.array([table.columns[at].values[i] for _ in stated for i in rows], object)
        )
        for at in others
    ]
    columns += [
        ForeignColumn(f"pressure [{unit}]", np.array([value for value, _ in stated.values() for _ in rows], object)),
        ForeignColumn(force, np.array([table.columns[at].values[i] for at in stated for i in rows], object)),
    ]
    first, last = table.columns[min(stated)].label, table.columns[max(stated)].label
    remark = f"the columns {first} to {last} are forces at these pressures"
    numbers = None if table.rows is None else [table.rows[i] for _ in stated for i in rows]
    return table._replace(columns=columns, rows=numbers, remarks=[*table.remarks, remark])


def even_table(table: ForeignTable, where: str) -> ForeignTable:
    """The columns of most samples of a table, without the word that all labels begin with."""
    usable = [c for c in table.columns if c.values.ndim == 1 and c.values.dtype.kind in "fiubUO"]
    if not usable:
        raise InputError("columns", None, "must be at least one column of numbers", where=where)
    counts = [len(c.values) for c in usable]
    most = max(sorted(set(counts)), key=counts.count)
    remarks = [
        f"{c.label} is left out: it has {len(c.values)} values, and most columns have {most}"
        for c in usable if len(c.values) != most
    ]  # fmt: skip
    even = without_common_prefix([c for c in usable if len(c.values) == most])
    return table._replace(columns=even, remarks=[*table.remarks, *remarks])


def _checked_header(table: ForeignTable, where: str) -> list[str]:
    """The labels of a table that has names and rows."""
    count = len(table.columns[0].values) if table.columns else 0
    if not count:
        raise InputError("file", None, f"must have a header and at least one row, got {count} rows", where=where)
    if not table.named:
        first = ",".join(str(column.values[0]) for column in table.columns)
        raise InputError("header", first, "the first row must name the columns, such as length_mm", where=where)
    return table_labels(table)


def choose_map_columns(header: list[str], columns: Mapping[str, str | int], where: str) -> dict[str, str]:
    """The label of each quantity of a force map.

    Args:
        header: labels of the file, with units.
        columns: quantity -> label, label without unit, or number from 1, where the header uses other names; ``-`` for none.
        where: how errors name the file.

    Raises:
        InputError: length or contraction, pressure or tension has no column, or several.
    """
    asked: dict[str, str] = {}
    for name, column in columns.items():
        quantity = ALIASES.get(name, name)
        if quantity not in COLUMNS:
            raise InputError("column", quantity, known=COLUMNS, where=where)
        asked[quantity] = _asked_column(header, column, quantity, where)
    for quantity, match in recognise_columns(header).items():
        if len(match) > 1 and quantity not in asked:
            problem = f"several columns may be the {quantity}; say which one is"
            raise InputError(quantity, ", ".join(match), problem, where=where, remedy=f"column {quantity}")
        if match[0] not in asked.values():
            asked.setdefault(quantity, match[0])
    asked = {quantity: column for quantity, column in asked.items() if column != LEFT_OUT}
    for quantity in ("pressure", "tension"):
        if quantity not in asked:
            raise _no_column(quantity, header, where)
    if "length" not in asked and "contraction" not in asked:
        raise _no_column("length", header, where)
    if "length" in asked:
        asked.pop("contraction", None)
    return asked


def _asked_column(header: list[str], column: str | int, quantity: str, where: str) -> str:
    if isinstance(column, int):
        if not 1 <= column <= len(header):
            raise InputError(f"column {quantity}", column, f"must be between 1 and {len(header)}", where=where)
        return header[column - 1]
    label = plain_text(column)
    if label in (*header, LEFT_OUT):
        return label
    alike = [cell for cell in header if cell.partition(" [")[0] == label]
    if len(alike) == 1:
        return alike[0]
    raise InputError("column", column, "the file has", known=header, where=where)


def _no_column(quantity: str, header: list[str], where: str) -> InputError:
    values = [label for label in header if re.match(r"[-+]?\d", label)]
    if len(values) > 1:
        problem = (
            f"is missing: the columns {values[0]} to {values[-1]} seem to be values of one quantity; write one row per "
            "point, with the columns length or contraction, pressure and tension"
        )
        return InputError(quantity, None, problem, where=where)
    problem = f"is missing: the file has {', '.join(header)}; say which one it is"
    return InputError(quantity, None, problem, where=where, remedy=f"column {quantity}")


def unit_of(column: str, quantity: str) -> tuple[str | None, bool]:
    """Unit that a header states, if any, and whether a pressure is absolute."""
    source = parse_header(0, column)[1]
    return source.unit or ("1" if quantity == "contraction" else None), source.reference == "absolute"


def _unit(column: str, stated: str | None, quantity: str, where: str) -> tuple[str, bool]:
    unit, absolute = unit_of(column, quantity)
    if stated is not None:
        unit, reference = split_reference(stated) if quantity == "pressure" else (stated, None)
        if reference is not None:
            absolute = reference == "absolute"
    if unit is None:
        example = f"{quantity}_{'bar' if quantity == 'pressure' else UNITS[quantity]}"
        problem = f"has no unit: write it into the header, such as {example}, or state it"
        raise InputError(column, None, problem, where=where, remedy=f"unit {quantity}")
    return unit, absolute


def _check_plausible(what: str, values: np.ndarray, column: str, where: str, *, percent: bool = False) -> None:
    """Refuse values that no muscle has; `percent` says that the file has a contraction in percent."""
    unit = UNITS[what]
    low, high = PLAUSIBLE[what]
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        worst, hint = float(values[bad][0]), "wrong unit, or columns swapped?"
        words = [with_unit(v, unit) for v in (low, high, worst)]
        if what == "contraction" and not percent:
            hint = "is it in percent? name the column contraction_percent"
        elif what == "contraction":
            words = [f"{100.0 * v:g} %" for v in (low, high, worst)]
            hint = "wrong unit, rest length or column?"
        raise InputError(column, words[2], f"must be between {words[0]} and {words[1]}; {hint}", where=where)


def _check_largest(what: str, values: np.ndarray, column: str, where: str) -> None:
    """Refuse a map that no muscle reaches; a file of several may hold a slack one."""
    unit = UNITS[what]
    if what in LEAST_LARGEST and values.max() < LEAST_LARGEST[what]:
        problem = f"must reach {with_unit(LEAST_LARGEST[what], unit)} or more; wrong unit, or columns swapped?"
        raise InputError(column, with_unit(float(values.max()), unit), problem, where=where)


def _check_contraction(contraction: np.ndarray, column: str, unit: str, where: str) -> list[str]:
    """Refuse contractions that no muscle has; a sentence where a column in percent seems to hold fractions."""
    percent = not converts(unit, "m") and to_si(1.0, unit, "1", field=column, where=where) < 1.0
    _check_plausible("contraction", contraction, column, where, percent=percent)
    most = float(np.abs(contraction).max())
    if not percent or not 0.0 < most < LEAST_CONTRACTION:
        return []
    return [f"{column} reaches {100.0 * most:.3g} % only; if it is a fraction, name the column contraction"]


def _check_near_rest(length: np.ndarray, rest_length: np.ndarray, column: str, where: str) -> None:
    """Refuse lengths that no muscle of the rest length can have."""
    least, most = PLAUSIBLE["contraction"]
    contraction = 1.0 - length / rest_length
    bad = ~((contraction >= least) & (contraction <= most))
    if bad.any():
        i = int(np.argmax(bad))
        problem = (
            f"must be between {1.0 - most:g} and {1.0 - least:g} times the rest length of "
            f"{with_unit(float(rest_length[i]), 'm')}; wrong unit, rest length or column?"
        )
        raise InputError(column, with_unit(float(length[i]), "m"), problem, where=where)


def _repeated(points: ForceMap) -> list[str]:
    """A sentence on points with tension that equal an earlier one in everything that the table holds."""
    words = {name: getattr(points, name) for name in _ARRAYS if getattr(points, name) is not None}
    keys = np.stack([np.unique(v[points.taut], return_inverse=True)[1].ravel() for v in words.values()], axis=1)
    count = len(keys) - len(np.unique(keys, axis=0))
    if not count:
        return []
    which = "one point with tension equals an earlier one" if count == 1 else (
        f"{count} points with tension equal earlier ones")  # fmt: skip
    return [f"{which} in every column; where these are copies, delete them: they make intervals look narrower"]


def _word(cell: object) -> str:
    """A cell as a word; a whole number without decimals."""
    return f"{cell:g}" if isinstance(cell, float | np.floating) else str(cell).strip()


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
    words = [column for column in (points.branch, points.run) if column is not None]
    names = np.zeros(len(points), dtype=int)
    if words:
        names = np.unique(["/".join(each) for each in zip(*words, strict=True)], return_inverse=True)[1]
    for fixed, moving, over in (("length", "pressure", "Pa"), ("pressure", "length", "m")):
        groups = np.stack([getattr(points, fixed), rest, names], axis=1)
        group = np.unique(groups, axis=0, return_inverse=True)[1].ravel()
        order = np.lexsort((getattr(points, moving), group))
        for member in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
            tension, at = points.tension[member], getattr(points, moving)[member]
            fall = np.maximum.accumulate(tension) - tension
            if len(tension) > 1 and fall.max() > room:
                i, key = int(fall.argmax()), groups[member[0]]
                place = with_unit(float(key[0]), "m" if fixed == "length" else "Pa")
                problem = (
                    f"falls by {fall[i]:.4g} N to {tension[i]:.4g} N at {with_unit(float(at[i]), over)} while the "
                    f"{moving} rises at {place}; columns swapped, or a sign wrong?"
                )
                raise InputError("tension", None, problem, where=where)


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


def preview_table(path: str | Path, rows: int = 60, **options: JsonValue) -> TablePreview:
    """Look into a table that `read_force_map` may read, with the options of its format.

    Raises:
        InputError: there is no such file, or it is no table at all.
    """
    table = table_of(Path(path_text(path)), **options)
    header = _checked_header(table, str(path))
    meant = {quantity: match[0] for quantity, match in recognise_columns(header).items() if len(match) == 1}
    if "length" in meant:
        meant.pop("contraction", None)
    count = len(table.columns[0].values)
    shown = [[_cell(value) for value in column.values[:rows]] for column in table.columns]
    return TablePreview(header, [list(row) for row in zip(*shown, strict=True)], count, meant)


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    # repr of a float is the shortest text that reads back to the same bits
    return repr(float(value)) if isinstance(value, np.number | np.bool_ | float | int) else str(value)


def stated_unit(column: str, what: str) -> str:
    """Unit that a header states, as ``--unit`` takes it; empty if it states none."""
    if what not in COLUMNS:
        return ""
    unit, absolute = unit_of(column, what)
    return f"{unit} abs" if unit and absolute and what == "pressure" else unit or ""
