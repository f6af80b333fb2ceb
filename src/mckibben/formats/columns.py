"""What the columns of other programs mean: names, units, numbers and the clock; and how they become a recording.

Each format gives a `ForeignTable`; from there on all files are treated alike, for recordings here, for force maps in
`recordings.force_map`.
"""

from __future__ import annotations

import functools
import math
import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, choice
from ..quantities import with_unit
from .table import Channel, ForeignColumn, ForeignTable, StoredRecording, check_name, is_pressure, si_of
from .text import MISSING, is_number, plain_text, rows_left_out, split_header, to_numbers, with_points

AMBIENT = 101325.0  # [Pa], says where vacuum is
# Between samples; more, and samples were lost. Stamps rounded to the last digit reach 1.5 to 2 times the median.
LARGEST_GAP = 3.0
FEWEST = 3  # samples of a record in a text table
# Names under which quantities are known, without accents; of a force map the first that a header holds is taken. English,
# German, French, Spanish, Italian, Portuguese and the letters of papers.
COLUMNS = {
    "length": ("length", "braid_length", "test_length", "muscle_length", "l", "muscle.length", "lange", "laenge",
               "muskellange", "longueur", "longitud", "lunghezza", "comprimento"),
    "contraction": ("contraction", "contraction_ratio", "strain", "eps", "kappa", "epsilon", "kontraktion",
                    "contraccion", "contrazione", "contracao", "shortening", "verkurzung", "raccourcissement"),
    "pressure": ("pressure", "p", "gauge_pressure", "muscle.pressure", "muscle_pressure", "druck", "uberdruck",
                 "pression", "presion", "pressione", "pressao"),
    "tension": ("tension", "force", "f", "pull", "muscle.tension", "muscle_force", "kraft", "zugkraft", "fuerza",
                "forza", "forca"),
    "rest_length": ("rest_length", "resting_length", "l0", "initial_length", "ruhelange", "ruhelaenge"),
    "branch": ("branch", "direction", "richtung"),
    "run": ("run", "run_id", "trial", "test_id", "versuch", "lauf", "essai", "ensayo", "prova", "ensaio"),
    "diameter": ("diameter", "inner_diameter", "rest_diameter", "bore", "durchmesser", "diametre", "diametro"),
}  # fmt: skip
TIMES = ("time", "t", "timestamp", "time_stamp", "elapsed_time", "zeit", "zeitstempel", "temps", "tiempo", "tempo")
# Names that say nothing: what such a column holds follows from its unit, if no other column has one of that kind.
_NAMELESS = re.compile(r"(?:(?:ch|chan|channel|kanal|sensor|signal|ai|col|column|value|y|x|f|p|l)[_ ]?\d*)")
_KINDS = {"length": "m", "pressure": "Pa", "tension": "N"}
# Units that a header may hold after an underscore; in brackets any unit is read.
_UNDERSCORED = frozenset(
    "Pa kPa MPa hPa bar mbar psi bara barg psia psig s ms us m mm cm inch N kN mN lbf kgf V mV A mA K degC kg g rad deg Hz"
    " percent % fraction".split()
)
_BRACKETS = re.compile(r"(?P<name>.*?\S)\s*[\[(](?P<unit>[^\[\]()]+(?:\([^()]*\))?)[\])]\s*")
ABSOLUTE, GAUGE = ("abs", "absolute", "a"), ("gauge", "rel", "g")
_PRESSURE_WORD = re.compile(r"([kMh]?Pa|m?bar|psi|atm|Torr|mmHg|N/m\^2|N/mm\^2|kgf/cm\^2)\b")
_SUFFIXED = ("bara", "barg", "mbara", "mbarg", "psia", "psig")


class ColumnSource(NamedTuple):
    """Source of a channel: column number from 0, name for messages, unit, and absolute or gauge if stated."""

    at: int
    label: str
    unit: str | None = None
    reference: str | None = None


def parse_header(at: int, cell: str) -> tuple[str, ColumnSource]:
    """Read a header as channel name and column: ``Tank.Pressure_abs [kPa]`` -> tank.pressure_abs, kPa, absolute."""
    label = cell or f"column {at + 1}"
    bracket = _BRACKETS.fullmatch(cell)
    unit: str | None
    if bracket and bracket["unit"].strip():
        stem, tail = split_header(bracket["name"], ())
        unit = bracket["unit"].strip()
        head, *words = re.sub(r"[()]", " ", unit).split() or [unit]
        if {word.lower() for word in words} <= {*ABSOLUTE, *GAUGE}:  # [bar abs], [bar(g)], but not [Pa s]
            unit = head
        else:
            words = []
        said = [word.lower() for word in (*tail, *words)]
    else:
        stem, tail = split_header(cell, _UNDERSCORED)
        inch, _, last = cell.strip().rpartition("_")
        if last == "in" and quantity_of(inch) in ("length", "rest_length", "diameter"):
            return inch.lower(), ColumnSource(at, label, "inch")
        words = [word for word in tail if word in _UNDERSCORED]
        if len(words) > 1 and words != [words[0], "g"]:
            # Is velocity_m_s in m/s, torque_N_m in N/m? Only brackets can say.
            return "_".join([stem, *tail]).lower(), ColumnSource(at, label)
        unit = words[0] if words else None
        said = [word.lower() for word in tail if word != unit]
    if unit in _SUFFIXED:
        unit, suffix = unit[:-1], unit[-1]
        said.append("abs" if suffix == "a" else "gauge")
    if unit is not None and not _PRESSURE_WORD.match(unit):
        # The gauge of "strain_gauge [V]" and the like belongs to the name.
        return "_".join([stem, *said]), ColumnSource(at, label, unit)
    if any(word in ABSOLUTE for word in said):
        return stem + "_abs", ColumnSource(at, label, unit, "absolute")
    return stem, ColumnSource(at, label, unit, "gauge" if said else None)


@functools.lru_cache(maxsize=1024)
def quantity_of(stem: str) -> str | None:
    """The quantity that a name stands for, a key of `COLUMNS` or ``time``; None where it is none of these."""
    plain = _plain(stem)
    if plain in TIMES:
        return "time"
    return next((quantity for quantity, names in COLUMNS.items() if plain in names), None)


def _plain(stem: str) -> str:
    """A name without accents and reference, in lower case: ``Druck_abs`` -> druck."""
    letters = unicodedata.normalize("NFKD", stem.casefold())
    word = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return re.sub(r"[\s_]+", "_", word).removesuffix("_abs").removesuffix("_in")


def recognise_columns(labels: Sequence[str]) -> dict[str, list[str]]:
    """The columns of a force map by what they hold: by their names, and nameless ones by a unit that no other column has.

    Returns:
        Quantity -> labels; more than one where it is not clear which.
    """
    parsed = {label: parse_header(0, label) for label in labels}
    stems = {label: _plain(stem) for label, (stem, _) in parsed.items()}
    recognised: dict[str, list[str]] = {}
    for quantity, names in COLUMNS.items():
        matches = ([label for label in labels if stems[label] == name] for name in names)
        if match := next((m for m in matches if m), None):
            recognised[quantity] = match
    free = [label for label in labels if quantity_of(stems[label]) is None]
    for quantity, unit in _KINDS.items():
        alike = [label for label in free if (word := parsed[label][1].unit) and converts(word, unit)]
        missing = quantity not in recognised and not (quantity == "length" and "contraction" in recognised)
        if missing and len(alike) == 1 and _NAMELESS.fullmatch(stems[alike[0]]):
            recognised[quantity] = alike
    return recognised


def likely_columns(labels: Sequence[str]) -> dict[str, str]:
    """Columns of a force map that their units suggest, by quantity; none where several have a unit of the kind."""
    likely = {}
    for quantity, unit in _KINDS.items():
        alike = [label for label in labels if (word := parse_header(0, label)[1].unit) and converts(word, unit)]
        if len(alike) == 1:
            likely[quantity] = alike[0].partition(" [")[0]
    return likely


@functools.lru_cache(maxsize=1024)
def converts(word: str, unit: str) -> bool:
    """Whether a unit as text is one of an SI unit's kind."""
    try:
        return si_of(word, field="unit")[0] == unit
    except InputError:
        return False


def table_labels(table: ForeignTable) -> list[str]:
    """The labels of the columns with their units in brackets, as options name them."""
    return [f"{c.label} [{c.unit}]" if c.unit and "[" not in c.label else c.label for c in table.columns]


def column_numbers(column: ForeignColumn, rows: Sequence[int] | None, where: str) -> np.ndarray:
    """The values of a column as float64 (n,); NaN where a cell has no value.

    Raises:
        InputError: names the row of the first cell that is no number.
    """
    if column.values.dtype.kind != "O":
        return column.values.astype(float)
    cells = [str(cell) for cell in column.values]
    numbers = range(1, len(cells) + 1) if rows is None else rows
    given = [i for i, cell in enumerate(cells) if cell.strip().lower() not in MISSING]
    if rows is not None:
        filled = with_points([cells[i] for i in given], [numbers[i] for i in given], column.label, where)
    else:
        filled = [cells[i] for i in given]
    out = np.full(len(cells), np.nan)
    out[given] = to_numbers(filled, [numbers[i] for i in given], column.label, where)
    return out


def without_blank_rows(table: ForeignTable, used: Mapping[int, np.ndarray], where: str) -> tuple[np.ndarray, list[str]]:
    """Which rows have a value in each used column, and a sentence for those that are left out.

    Args:
        table: of the file.
        used: number of each column that is used -> its values (n,), NaN or an empty text where there is none.
        where: how errors name the file.

    Returns:
        Mask (n,), and the sentences.

    Raises:
        InputError: a column is blank in more than half of the rows.
    """
    keep = np.ones(len(next(iter(used.values()), ())), bool)
    remarks: dict[str, list[int]] = {}
    for at, values in used.items():
        blank = values == "" if values.dtype.kind in "UO" else np.isnan(values)
        if not blank.any():
            continue
        label, numbers = table.columns[at].label, np.flatnonzero(blank).tolist()
        if 2 * len(numbers) > len(blank):
            problem = f"is blank in {len(numbers)} of {len(blank)} rows: it must have a value in most of them"
            raise InputError(label, None, problem, where=where)
        rows = [i + 1 if table.rows is None else table.rows[i] for i in numbers]
        remarks[label] = rows
        keep &= ~blank
    return keep, [
        rows_left_out(rows, f"{label} is blank") for label, rows in sorted(remarks.items(), key=lambda item: item[1])
    ]


def choose_columns(
    header: list[str] | None, width: int, columns: dict[str, str | int], timed: bool, where: str
) -> dict[str, ColumnSource]:
    """Choose the columns by channel name, including the time if there is one.

    Args:
        header: cells such as ``Tank.Pressure [kPa]``, or none.
        width: number of columns.
        columns: channel name -> cell, name in a cell, or number from 1; empty for all.
        timed: a column named time is the time; else it must be asked for by name.
        where: how error messages name the file.
    """
    if header is None and not columns:
        allowed = "a file without a header needs the number of each column, such as time 1 and pressure 2"
        raise InputError("columns", None, f"are missing: {allowed}", where=where, remedy="column time")
    known = [parse_header(i, cell) for i, cell in enumerate(header or [""] * width)]
    if timed and not any(stem in TIMES for stem, _ in known):  # in other languages
        known = [("time" if quantity_of(stem) == "time" else stem, column) for stem, column in known]
    chosen: dict[str, ColumnSource] = {}
    for name, wanted in columns.items():
        if name != "time":
            check_name(name, where)
        chosen[name] = known[_index(name, wanted, header, width, known, where)][1]
    for stem, column in known:
        # A column without a name is a row number, or a mark at the end of each line.
        if not stem or (columns and ("time" in columns or stem not in TIMES or not timed)):
            continue
        name = "time" if stem in TIMES else stem
        if name in chosen:
            both = f"{chosen[name].label}, {column.label}"
            raise InputError(
                name, both, "two columns have this name; say which one is meant", where=where, remedy=f"column {name}"
            )
        if name != "time":
            check_name(name, where)
        chosen[name] = column
    for name, column in chosen.items():
        if column.reference is not None and (column.reference == "absolute") != name.endswith("_abs"):
            allowed = f"the header says {column.reference}; names of absolute pressures, and only these, end in _abs"
            raise InputError(f"column for {name}", column.label, allowed, where=where)
    return chosen


def _index(
    name: str, wanted: Any, header: list[str] | None, width: int, known: list[tuple[str, ColumnSource]], where: str
) -> int:
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        if not 1 <= wanted <= width:
            raise InputError(f"column for {name}", wanted, f"must be between 1 and {width}", where=where)
        return wanted - 1
    if header is None:
        raise InputError(
            f"column for {name}",
            str(wanted),
            f"must be a number between 1 and {width}; the file has no header",
            where=where,
        )
    match = [i for i, cell in enumerate(header) if cell == wanted]
    match = match or [i for i, (stem, _) in enumerate(known) if stem == wanted]
    if len(match) != 1:
        if not match:
            raise InputError(f"column for {name}", str(wanted), "the file has", known=header, where=where)
        raise InputError(f"column for {name}", str(wanted), "two columns have it; give a number from 1", where=where)
    return match[0]


def check_vacuum(
    name: str, label: str, values: np.ndarray, ambient: float, place: Callable[[int], str], where: str
) -> None:
    """Refuse a pressure below vacuum [Pa]; `place` describes the position of value i, NaN are ignored."""
    absolute = name.endswith("_abs")
    lowest = 0.0 if absolute else -ambient
    below = values < lowest
    if below.any():
        i = int(np.argmax(below))
        kind = "absolute" if absolute else "gauge"
        allowed = f"must be {with_unit(lowest, 'Pa')} {kind} or more; below vacuum: wrong unit, or zero?"
        raise InputError(f"{name} ({label}){place(i)}", with_unit(float(values[i]), "Pa"), allowed, where=where)


def assemble(
    path: Path,
    table: ForeignTable,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
    pressure_zero: float | Mapping[str, float] = 0.0,
    ambient: float = AMBIENT,
    required: Iterable[str] = (),
    strict: bool = False,
) -> StoredRecording:
    """Make a recording of another program's table: one clock, SI units, dotted names.

    Args:
        path: the file, for messages and the metadata.
        table: its columns.
        columns: channel name -> label or number of a column from 1; empty for all. The name of the time is ``time``.
        units: channel name or label -> unit as text, over what the file says; a time without a unit is in seconds.
        period: interval of the samples [s] where the file has no time.
        pressure_zero: what gauge pressures read at zero [Pa], one for all or by channel; it is subtracted.
        ambient: environment pressure, which says where vacuum is [Pa].
        required: channels that must be there.
        strict: refuse gaps in the time, and records in which nothing changes; else a gap is a remark.

    Raises:
        InputError: names file, column, row, value and what is allowed.
    """
    where = str(path)
    if not (math.isfinite(ambient) and ambient > 0.0):
        raise InputError("ambient", ambient, "must be a pressure above 0 Pa", where=where)
    table, remarks = _usable(table, columns or {}, where)
    foreign = table.columns
    sources = _sources_of(table, dict(columns or {}), period is None, where)
    words = _units(sources, foreign, dict(units or {}), where)
    _check_known(sources, pressure_zero, required, where)
    remarks += _leave_words(sources, foreign, columns or {})
    clock, left = _clock(sources, foreign, bool(columns), where)
    numbers = {
        name: foreign[c.at].values
        if is_date(foreign[c.at].values)
        else column_numbers(foreign[c.at], table.rows, where)
        for name, c in sources.items()
    }
    numbers = {name: _on_clock(numbers[name], foreign[c.at], clock, foreign) for name, c in sources.items()}
    blank: list[str] = []
    if table.rows is not None:
        at = {c.at: numbers[name] for name, c in sources.items() if numbers[name].dtype.kind == "f"}
        keep, blank = without_blank_rows(table, at, where)
        numbers = {name: values[keep] for name, values in numbers.items()}
        table = table._replace(rows=[n for n, kept in zip(table.rows, keep, strict=True) if kept])
    remarks += left + blank
    time, start = _time(sources.pop("time", None), numbers.get("time"), table, clock, words, period, where)
    remarks += _gaps(time, table, strict, where)
    channels: dict[str, Channel] = {}
    for name, column in sources.items():
        zero = pressure_zero.get(name, 0.0) if isinstance(pressure_zero, Mapping) else pressure_zero
        if not math.isfinite(zero):
            raise InputError("pressure_zero", zero, "must be a finite pressure [Pa]", where=where)
        channels[name] = _channel(name, column, numbers[name], table, words.get(name), zero, ambient, where)
    if not channels:
        raise InputError("channels", None, "must be at least one column beside the time", where=where)
    sensors = {n: c for n, c in channels.items() if c.kind != "command"} or channels
    if strict and all(np.ptp(c.values) == 0.0 for c in sensors.values()):
        name, channel = next(iter(sensors.items()))
        problem = f"is {with_unit(float(channel.values[0]), channel.unit)} throughout, and no channel changes"
        raise InputError(name, None, problem, where=where)
    about = {n: {"column": foreign[c.at].label, "unit": words.get(n)} for n, c in sources.items()}
    source = {"file": path.name, "columns": about, **({"start": start} if start else {}), **table.notes}
    if pressure_zero:
        source["pressure_zero"] = pressure_zero
    if blank:
        source["left_out"] = blank
    try:
        return StoredRecording(time, channels, {"title": path.name, "source": source}, remarks)
    except InputError as error:
        raise error.at(where) from None


def _usable(table: ForeignTable, columns: Mapping[str, str | int], where: str) -> tuple[ForeignTable, list[str]]:
    """The table without columns that can be no channel, and a line for each of these."""
    if table.rows is not None:  # its numbers stay those of the file
        if not table.columns:
            raise InputError("file", None, f"is empty: it must have {FEWEST} samples or more", where=where)
        if len(table.rows) < FEWEST:
            raise InputError("file", None, f"must have {FEWEST} samples or more, got {len(table.rows)}", where=where)
        return table, []
    usable = channel_columns(table)
    kept = {id(column.values) for column in usable}
    remarks = [f"{g.label} is left out: {_why(g.values)}" for g in table.columns if id(g.values) not in kept]
    if not usable:
        raise InputError("columns", None, "must be at least one column of numbers", where=where)
    return table._replace(columns=usable), remarks


def channel_columns(table: ForeignTable) -> list[ForeignColumn]:
    """The columns that can become channels, without the word that all their labels begin with."""
    if table.rows is not None:
        return table.columns
    usable = [column for column in table.columns if column.values.dtype.kind in "fiubM" and column.values.ndim == 1]
    return without_common_prefix(usable) if usable else []


def _why(values: np.ndarray) -> str:
    if values.ndim != 1:
        return f"its shape is {' x '.join(map(str, values.shape))}, and a channel is one row of numbers"
    return "it holds no real numbers"


def without_common_prefix(foreign: Sequence[ForeignColumn]) -> list[ForeignColumn]:
    """Drop the struct, group or topic that all labels begin with."""
    first = foreign[0].label.partition(".")[0] + "."
    if not all(one.label.startswith(first) and len(one.label) > len(first) for one in foreign):
        return list(foreign)
    return [one._replace(label=one.label[len(first) :]) for one in foreign]


def _sources_of(table: ForeignTable, columns: dict[str, str | int], timed: bool, where: str) -> dict[str, ColumnSource]:
    labels = [plain_text(one.label) for one in table.columns]
    # A label is found as the file writes it; what the header's words mean decides only then.
    asked = {n: plain_text(c) if isinstance(c, str) else c for n, c in columns.items()}
    asked = {
        n: labels.index(c) + 1 if isinstance(c, str) and table.named and labels.count(c) == 1 else c
        for n, c in asked.items()
    }
    return choose_columns(table_labels(table) if table.named else None, len(labels), asked, timed, where)


def _leave_words(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], columns: Mapping[str, str | int]
) -> list[str]:
    """Take columns of words out of `sources` unless they were asked for; a line for each."""
    lines = []
    for name, column in list(sources.items()):
        values = foreign[column.at].values
        if name in columns or values.dtype.kind != "O" or not len(values) or is_date(values):
            continue
        cells = [str(cell).strip() for cell in values]
        if not any(cell[:1].isdigit() or cell[1:2].isdigit() or is_number(cell) for cell in cells) and any(cells):
            lines.append(f"{foreign[column.at].label} is left out: it holds no numbers")
            del sources[name]
    return lines


def _check_known(
    sources: Mapping[str, ColumnSource], zeros: float | Mapping[str, float], required: Iterable[str], where: str
) -> None:
    for name in zeros if isinstance(zeros, Mapping) else ():
        if name not in sources:
            raise InputError("pressure_zero", name, "the channels are", known=sources, where=where)
    for name in (required,) if isinstance(required, str) else required:
        if name not in sources:
            has = ", ".join(n for n in sources if n != "time") or "none"
            raise InputError(name, None, f"is missing: the file has {has}", where=where)


def _units(
    sources: Mapping[str, ColumnSource], foreign: Sequence[ForeignColumn], units: dict[str, str], where: str
) -> dict[str, str | None]:
    """Unit of each channel that is read, including the time."""
    labels = {foreign[column.at].label: name for name, column in sources.items()}
    words = {name: column.unit for name, column in sources.items()}
    for key, unit in units.items():
        name = key if key in sources else labels.get(key)
        if name is None:
            raise InputError("unit", key, "the columns are", known=sources, where=where)
        words[name] = unit
    return words


def _clock(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], chosen: bool, where: str
) -> tuple[str, list[str]]:
    """Common clock of all channels; columns with other clocks are removed if the file states which is which."""
    clocks = dict.fromkeys(foreign[column.at].clock for column in sources.values())
    if len(clocks) == 1:
        return next(iter(clocks)), []
    if chosen and all(foreign[column.at].time is not None for column in sources.values()):
        kept = next(iter(clocks))
        return kept, [
            f"{name} is interpolated to the times of {kept}"
            for name, column in sources.items() if foreign[column.at].clock != kept
        ]  # fmt: skip
    if chosen or "time" not in sources:
        of = {clock: [n for n, c in sources.items() if foreign[c.at].clock == clock] for clock in clocks}
        shown = {clock: ", ".join(names[:3]) + (", .." if len(names) > 3 else "") for clock, names in of.items()}
        problem = "; ".join(f"{clock}: {names}" for clock, names in shown.items())
        needs = "a recording has one time; choose columns"
        sentence = f"the columns have {len(clocks)} clocks ({problem}), and {needs}"
        raise InputError(
            "columns", f"of {len(clocks)} clocks", needs, sentence=sentence, where=where, remedy="column NAME"
        )
    kept = foreign[sources["time"].at].clock
    others = [name for name, column in sources.items() if foreign[column.at].clock != kept]
    lines = [f"{foreign[sources[n].at].label} is left out: its samples are not those of the time" for n in others]
    for name in others:
        del sources[name]
    return kept, lines


def _on_clock(values: np.ndarray, column: ForeignColumn, clock: str, foreign: Sequence[ForeignColumn]) -> np.ndarray:
    """Values at the times of a clock: those of another one by linear interpolation, NaN outside of its times."""
    if column.clock == clock or column.time is None:
        return values
    times = next(one.time for one in foreign if one.clock == clock)
    order = np.argsort(column.time, kind="stable")
    on_clock: np.ndarray = np.interp(np.asarray(times), column.time[order], values[order], left=np.nan, right=np.nan)
    return on_clock


def _time(
    column: ColumnSource | None,
    values: np.ndarray | None,
    table: ForeignTable,
    clock: str,
    words: Mapping[str, str | None],
    period: float | None,
    where: str,
) -> tuple[np.ndarray, str | None]:
    """The time [s], and the date of its beginning where the file has dates."""
    count, implied = next((len(g.values), g.time) for g in table.columns if g.clock == clock)
    if period is not None:
        if column is not None:
            allowed = f"the file has the time {table.columns[column.at].label}; give one of the two"
            raise InputError("period", period, allowed, where=where)
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", period, "must be a time above 0 s", where=where)
        return np.arange(count if table.rows is None else len(table.rows)) * float(period), None
    if column is None or values is None:
        if implied is not None:
            return implied, None
        allowed = f"none is named {choice(TIMES[:3])}; say which one it is, or state the period of the samples"
        raise InputError("time", None, f"is in no column: {allowed}", where=where, remedy="column time")
    label = table.columns[column.at].label
    if values.dtype.kind == "O":
        values = _dates([str(cell).strip() for cell in values])
    if values.dtype.kind == "M":
        dates = values.astype("datetime64[ns]")
        time = np.where(np.isnat(dates), np.nan, (dates - dates[:1]).astype("int64") * 1e-9)
        start = str(values[0]) if len(values) else None
    else:
        unit, scale, offset = si_of(words.get("time") or "s", field=f"unit of time ({label})", where=where)
        if unit != "s":
            raise InputError(f"unit of time ({label})", words["time"], "must be a time such as s or ms", where=where)
        time, start = values * scale + offset if scale != 1.0 or offset else values.astype(float), None
    steps = np.diff(time)
    if table.rows is not None and not (steps > 0.0).all():
        i = int(np.argmin(steps > 0.0))
        problem = f"{time[i + 1]!s} s after {time[i]!s} s"
        raise InputError(f"{label}{table.place(i + 1)}", problem, "times must increase, each once", where=where)
    return time, start


def _gaps(time: np.ndarray, table: ForeignTable, strict: bool, where: str) -> list[str]:
    """A line for the largest gap in the time [s] of a text table; refused where `strict`."""
    steps = np.diff(time)
    if table.rows is None or len(steps) < 2:
        return []
    usual = float(np.median(steps))
    # Stamps are decimals: an interval of three times the median may be a bit longer in binary.
    if steps.max() <= LARGEST_GAP * usual * (1.0 + 1e-9) + 4.0 * np.spacing(np.abs(time).max()):
        return []
    i = int(steps.argmax())
    if not strict:
        count = int((steps > LARGEST_GAP * usual).sum())
        several = f", the largest of {count}" if count > 1 else ""
        return [f"gap of {steps[i]:.6g} s before{table.place(i + 1)[1:]}{several}; the usual interval is {usual:.6g} s"]
    most = f"{LARGEST_GAP:g} times the usual interval, {LARGEST_GAP * usual:.6g} s"
    problem = f"must be at most {most}, after the row before, got {steps[i]:.6g} s at {time[i + 1]:.6g} s; is it a gap?"
    at = next((c.label for c in table.columns if quantity_of(parse_header(0, c.label)[0]) == "time"), "time")
    raise InputError(f"{at}{table.place(i + 1)}", None, problem, where=where)


def is_date(values: np.ndarray) -> bool:
    """Whether values are dates, or cells in words that are."""
    if values.dtype.kind != "O":
        return values.dtype.kind == "M"
    filled = next((str(cell).strip() for cell in values if str(cell).strip()), "")
    return not is_number(filled) and len(_dates([filled])) == 1


_DATE_FORMATS = (
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%y %H:%M:%S",
    "%m/%d/%Y %H:%M:%S",
    "%d/%m/%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S",
    "%H:%M:%S",
)


def _dates(cells: Sequence[str]) -> np.ndarray:
    """Cells as dates (n,) datetime64[us], by the first way of writing that fits all; empty where none does."""
    plain = [cell.replace(",", ".") for cell in cells]

    def iso(cell: str) -> datetime:
        return datetime.fromisoformat(cell).replace(tzinfo=None)

    def written(form: str) -> Callable[[str], datetime]:
        return lambda cell: datetime.strptime(cell, f"{form}.%f" if "." in cell[8:] else form)

    for parse_cell in (iso, *map(written, _DATE_FORMATS)):
        try:
            return np.array([parse_cell(cell) for cell in plain], "datetime64[us]")
        except ValueError:
            continue
    return np.empty(0, "datetime64[us]")


def _channel(
    name: str, column: ColumnSource, values: np.ndarray, table: ForeignTable, unit: str | None, zero: float, ambient: float,
    where: str,
) -> Channel:  # fmt: skip
    foreign = table.columns[column.at]
    if values.dtype.kind != "f":
        allowed = "is a column of dates, which only the time can be: read the column as the time"
        raise InputError(f"{name} ({foreign.label})", None, allowed, where=where, remedy="column time")
    if unit is None and foreign.values.dtype.kind == "b":
        unit = "1"
    if unit is None:
        if table.rows is None:
            field, problem = f"unit of {name} ({foreign.label})", "say it: bar, kPa, N, mm, V, 1, .."
        else:
            field, problem = f"unit of {name}", f"write it into the header, such as '{name} [kPa]', or say it"
        raise InputError(field, None, f"has no unit: {problem}", where=where, remedy=f"unit {name}")
    si, scale, offset = si_of(unit, field=f"unit of {name} ({foreign.label})", where=where)
    if scale != 1.0 or offset:
        values = values * scale + offset
    if is_pressure(si):
        if not name.endswith("_abs"):
            values = values - zero if zero else values
        check_vacuum(name, foreign.label, values, ambient, table.place, where)
    kind = "command" if name.split(".")[-1] == "command" else "measured"
    return Channel(values, si, kind)
