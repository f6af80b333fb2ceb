"""What the columns of other programs mean: names, units, numbers and the clock; and how they become a recording.

Each format gives a `ForeignTable`; from there on all files are treated alike, for recordings here, for force maps in
`recordings.force_map`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..quantities import with_unit
from .clock import find_gaps, is_date, mend_clock, times_of
from .labels import DAYS, TIMES, ColumnSource, parse_header, plain_stem, quantity_of, split_reference, time_column
from .table import (
    Channel,
    ForeignColumn,
    ForeignTable,
    StoredRecording,
    check_name,
    is_pressure,
    parse_scale,
    si_of,
    standard_flow,
)
from .text import MISSING, OVERLOAD, is_number, plain_text, rows_left_out, said_of, to_numbers

AMBIENT = 101325.0  # [Pa], says where vacuum is
FEWEST = 3  # samples of a record in a text table


def table_labels(table: ForeignTable) -> list[str]:
    """The labels of the columns with their units in brackets, as options name them."""
    return [f"{c.label} [{c.unit}]" if c.unit and "[" not in c.label else c.label for c in table.columns]


def column_numbers(
    column: ForeignColumn, rows: Sequence[int] | None, where: str, *, overload: bool = True
) -> np.ndarray:
    """The values of a column as float64 (n,); NaN where a cell has no value, and infinite where it says an `overload`.

    Raises:
        InputError: names the row of the first cell that is no number.
    """
    if column.values.dtype.kind != "O":
        return column.values.astype(float)
    cells = [str(cell) for cell in column.values]
    numbers = range(1, len(cells) + 1) if rows is None else rows
    given, out = [], np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        word = cell.strip().lower()
        if overload and rows is not None and word in OVERLOAD:
            out[i] = np.inf  # no reading; `without_blank_rows` says so
        elif word not in MISSING:
            given.append(i)
    out[given] = to_numbers([cells[i] for i in given], [numbers[i] for i in given], column.label, where)
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
        words = values.dtype.kind in "UO"
        label, lacking = table.columns[at].label, values == "" if words else ~np.isfinite(values)
        if 2 * lacking.sum() > len(lacking):
            problem = f"is blank in {int(lacking.sum())} of {len(lacking)} rows: it must have a value in most of them"
            raise InputError(label, None, problem, where=where)
        over = np.zeros(len(values), bool) if words else np.isinf(values)
        for blank, reason in ((lacking & ~over, "is blank"), (over, "has no reading, but an overload")):
            if blank.any():
                remarks[f"{label} {reason}"] = [
                    i + 1 if table.rows is None else table.rows[i] for i in np.flatnonzero(blank).tolist()
                ]
        keep &= ~lacking
    return keep, [rows_left_out(rows, reason) for reason, rows in sorted(remarks.items(), key=lambda item: item[1])]


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
    if timed and "time" not in columns and (at := time_column([cell for cell in header or []])) is not None:
        known[at] = ("time", known[at][1])
    chosen: dict[str, ColumnSource] = {}
    for name, wanted in columns.items():
        if name != "time":
            check_name(name, where)
        chosen[name] = known[_index(name, wanted, header, width, known, where)][1]
    for stem, column in known:
        # A column without a name is a row number, or a mark at the end of each line.
        if not stem or (columns and {*columns} != {"time"} and ("time" in columns or stem not in TIMES or not timed)):
            continue
        name = "time" if stem in TIMES else stem
        if {*columns} == {"time"} and (name == "time" or column.at == chosen["time"].at):
            continue
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


_STRESS = re.compile(r"stress|modulus|spannung|contrainte|strength", re.I)  # in units of pressure, and no pressures


def check_vacuum(
    name: str, label: str, values: np.ndarray, ambient: float, place: Callable[[int], str], where: str
) -> None:
    """Refuse a pressure below vacuum [Pa]; `place` describes the position of value i, NaN are ignored."""
    if _STRESS.search(name):
        return
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
    scales: Mapping[str, str] | None = None,
    pressure_zero: float | Mapping[str, float] = 0.0,
    ambient: float = AMBIENT,
    required: Iterable[str] = (),
    strict: bool = False,
) -> StoredRecording:
    """Make a recording of another program's table: one clock, SI units, dotted names.

    A clock that wraps, passes midnight or stamps two samples alike is mended; runs that begin anew follow one another on one
    clock, and ``meta["runs"]`` says where. Words beside the numbers become events. All of it is said in the remarks.

    Args:
        path: the file, for messages and the metadata.
        table: its columns.
        columns: channel name -> label or number of a column from 1; empty for all. The name of the time is ``time``.
        units: channel name or label -> unit as text, over what the file says; a time without a unit is in seconds.
        period: interval of the samples [s] where the file has no time.
        scales: channel name or label -> what a raw signal stands for, such as ``"2 bar/V - 1 bar"``; see `parse_scale`.
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
    table = _whole_dates(table)
    foreign = table.columns
    sources = _sources_of(table, dict(columns or {}), period is None, where)
    words = _units(sources, foreign, dict(units or {}), where)
    scaled = _scales(sources, foreign, words, dict(scales or {}), where)
    _check_known(sources, pressure_zero, required, where)
    texts = _leave_words(sources, foreign, columns or {})
    asked = {*(columns or {}), *(units or {}), *scaled, *((required,) if isinstance(required, str) else required)}
    unknown = _leave_unknown_units(sources, foreign, words, asked)
    numbers, table, clock, remarks_of_clock = _on_one_clock(sources, table, bool(columns), where)

    def keep(which: np.ndarray) -> None:
        nonlocal numbers, texts, table
        numbers = {name: values[which] for name, values in numbers.items()}
        texts = {label: cells[which] for label, cells in texts.items()}
        if table.rows is not None:
            table = table._replace(rows=np.asarray(table.rows)[which].tolist())

    blank: list[str] = []
    if table.rows is not None:
        at = {c.at: numbers[name] for name, c in sources.items() if numbers[name].dtype.kind == "f"}
        whole, blank = without_blank_rows(table, at, where)
        keep(whole)
    stamps = sources.pop("time", None)
    time, start, wrap = times_of(stamps, numbers.pop("time", None), table, clock, words, period, where)
    label = "time" if stamps is None else foreign[stamps.at].label
    # Of rows that stand twice, all channels have their numbers twice.
    alike = np.r_[False, np.all([v[1:] == v[:-1] for v in numbers.values()], axis=0)] if numbers else None
    mended = mend_clock(time, label, wrap, alike, table, strict, where)
    time, runs = mended.time, mended.runs
    if mended.kept is not None:
        keep(mended.kept)
    changed = [*remarks_of_clock, *mended.remarks, *find_gaps(time, label, table, strict, where)]
    remarks += [*unknown, *blank, *changed]
    dated = start is not None or (stamps is not None and is_date(foreign[stamps.at].values))
    if dated and len(time) and abs(time[0]) > 0.0:  # the first row is not the earliest
        late, time = float(time[0]), time - time[0]
        start = start and str(np.datetime64(start) + np.timedelta64(round(1e6 * late), "us"))
        runs = [one | {key: one[key] - late for key in ("start", "end")} for one in runs]
    if stamps is not None and table.rows is not None and not (words.get("time") or dated):
        remarks.append(f"{label} has no unit and is taken as seconds")
    events = _events(texts, time)
    for label, cells in texts.items():
        count = sum(one["column"] == label for one in events)
        what = f"kept as {count} event{'s' if count > 1 else ''}" if count else "left out: it holds no numbers"
        if any(cells):
            remarks.append(f"{label} is {what}")
    channels: dict[str, Channel] = {}
    for name, column in sources.items():
        zero = pressure_zero.get(name, 0.0) if isinstance(pressure_zero, Mapping) else pressure_zero
        if not math.isfinite(zero):
            raise InputError("pressure_zero", zero, "must be a finite pressure [Pa]", where=where)
        channels[name] = _channel(
            name, column, numbers[name], table, words.get(name), scaled.get(name), zero, ambient, where
        )
    if not channels:
        raise InputError("channels", None, "must be at least one column beside the time", where=where)
    sensors = {n: c for n, c in channels.items() if c.kind != "command"} or channels
    if strict and all(np.ptp(c.values) == 0.0 for c in sensors.values()):
        name, channel = next(iter(sensors.items()))
        problem = f"is {with_unit(float(channel.values[0]), channel.unit)} throughout, and no channel changes"
        raise InputError(name, None, problem, where=where)
    for name in sources:
        if (standard := standard_flow(words.get(name) or "")) is not None:
            changed.append(f"{foreign[sources[name].at].label} is taken as a mass flow of air, {standard[1]}")
            remarks.append(changed[-1])
    about = {
        n: {"column": foreign[c.at].label, "unit": words.get(n), **({"scale": scaled[n]} if n in scaled else {})}
        for n, c in sources.items()
    }
    source = {"file": path.name, "columns": about, **({"start": start} if start else {}), **table.notes}
    noted = source.pop("events", [])  # annotations of the file, which are times of the record
    if pressure_zero:
        source["pressure_zero"] = pressure_zero
    if blank or unknown:
        source["left_out"] = [*blank, *unknown]
    if changed:
        source["changed"] = changed
    more: dict[str, Any] = {"runs": runs} if runs else {}
    if events or noted:
        more["events"] = [*noted, *({"time": one["time"], "text": one["text"]} for one in events)]
    try:
        return StoredRecording(time, channels, {"title": path.name, "source": source, **more}, remarks)
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
    if timed and "time" not in asked and (at := date_column(table)) is not None:
        asked["time"] = at
    return choose_columns(table_labels(table) if table.named else None, len(labels), asked, timed, where)


def date_column(table: ForeignTable) -> int | None:
    """Number from 1 of the only column of dates, which is the time where no column is called so; None if there is none."""
    dates = [at for at, column in enumerate(table.columns, 1) if is_date(column.values)]
    unnamed = time_column([label.rpartition(".")[2] for label in table_labels(table)]) is None
    return dates[0] if len(dates) == 1 and table.named and unnamed else None


def _whole_dates(table: ForeignTable) -> ForeignTable:
    """The table with a date and the time of day beside it, each in a column of its own, as one column of times."""
    stems = [plain_stem(parse_header(at, column.label)[0]) for at, column in enumerate(table.columns)]
    days, times = [i for i, s in enumerate(stems) if s in DAYS], [i for i, s in enumerate(stems) if s in TIMES]
    if len(days) != 1 or len(times) != 1 or not all(is_date(table.columns[i].values) for i in (*days, *times)):
        return table
    both = zip(table.columns[days[0]].values, table.columns[times[0]].values, strict=True)
    joined = np.array([f"{str(day).strip()} {str(clock).strip()}" for day, clock in both], object)
    columns = [c._replace(values=joined) if i == times[0] else c for i, c in enumerate(table.columns) if i != days[0]]
    return table._replace(columns=columns)


def _leave_words(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], columns: Mapping[str, str | int]
) -> dict[str, np.ndarray]:
    """Take columns of words out of `sources` unless they were asked for: their cells by label."""
    texts = {}
    for name, column in list(sources.items()):
        values = foreign[column.at].values
        if name in columns or values.dtype.kind != "O" or not len(values) or is_date(values):
            continue
        cells = [str(cell).strip() for cell in values]
        if not any(cell[:1].isdigit() or cell[1:2].isdigit() or is_number(cell) for cell in cells):
            texts[foreign[column.at].label] = np.array(cells, object)
            del sources[name]
    return texts


MOST_EVENTS = 1000  # of the words of a file


def _events(texts: Mapping[str, np.ndarray], time: np.ndarray) -> list[dict[str, Any]]:
    """What columns of words say, and when: each cell that differs from the one before it."""
    found = []
    for label, cells in texts.items():
        if len(cells) != len(time):  # of another clock
            continue
        changed = [i for i, cell in enumerate(cells) if cell and (i == 0 or cell != cells[i - 1])]
        if len(changed) <= min(MOST_EVENTS, max(len(cells) // 2, 3)):
            found += [{"time": float(time[i]), "text": str(cells[i])[:200], "column": label} for i in changed]
    return sorted(found, key=lambda event: event["time"])


def _scales(
    sources: Mapping[str, ColumnSource], foreign: Sequence[ForeignColumn], words: dict[str, str | None],
    scales: Mapping[str, str], where: str,
) -> dict[str, str]:  # fmt: skip
    """Scales by channel; the unit of a raw signal without one is that of its scale, and counts are pure numbers."""
    labels = {foreign[column.at].label: name for name, column in sources.items()}
    found = {}
    for key, scale in scales.items():
        name = key if key in sources else labels.get(key)
        if name is None or name == "time":
            raise InputError("scale", key, "the columns are", known=[n for n in sources if n != "time"], where=where)
        raw = parse_scale(scale, field=f"scale of {name}", where=where).raw
        words[name] = words.get(name) or raw
        if si_of(raw, field=f"scale of {name}")[0] != si_of(words[name] or "1", field=f"unit of {name}")[0]:
            of = foreign[sources[name].at].label
            problem = f"must be per {words[name]}, the unit of {of}, such as '2 bar/{words[name]}'"
            raise InputError(f"scale of {name}", scale, problem, where=where)
        found[name] = scale
    return found


def _leave_unknown_units(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], words: Mapping[str, str | None], asked: set[str]
) -> list[str]:  # fmt: skip
    """Take columns whose unit is not known out of `sources`, unless they are asked for, by name or by what they are."""
    left: dict[str, list[str]] = {}
    others = []
    for name, column in sources.items():
        wanted = name in asked or foreign[column.at].label in asked or quantity_of(name.rpartition(".")[2]) is not None
        unit = words.get(name)
        if name == "time" or foreign[column.at].values.dtype.kind == "b":
            continue
        try:
            known = unit is not None and bool(si_of(unit, field="unit"))
        except InputError:
            known = False
        if known or wanted:
            others.append(name)
        else:
            reason = "no unit is stated" if unit is None else f"the unit {unit} is not known"
            left.setdefault(reason, []).append(name)
    if not others:
        return []  # what is said of the first of them asks for its unit
    lines = []
    for reason, names in left.items():
        labels = ", ".join(foreign[sources[name].at].label for name in names)
        lines.append(f"{labels} {'is' if len(names) == 1 else 'are'} left out: {reason}")
        for name in names:
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


_ACCELERATION = re.compile(r"accel|beschl|(?:^|[._ ])a(?:cc)?_?[xyz]?\d*$")  # in g, which is no mass there


def _units(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], units: dict[str, str], where: str
) -> dict[str, str | None]:
    """Unit of each channel that is read, including the time; a pressure that is stated as absolute is named so."""
    labels = {foreign[column.at].label: name for name, column in sources.items()}
    words = {
        name: "g_0" if column.unit == "g" and _ACCELERATION.search(name) else column.unit
        for name, column in sources.items()
    }
    for key, unit in units.items():
        name = key if key in sources else labels.get(key)
        if name is None:
            raise InputError("unit", key, "the columns are", known=sources, where=where)
        word, reference = split_reference(unit)
        if reference == "absolute" and not name.endswith("_abs"):
            named = f"{name}_abs"
            sources[named], words[named] = sources.pop(name), words.pop(name)
            name = named
        unit = word if reference else unit
        if (said := words[name]) is not None and name != "time":
            kinds = [_kind_of_unit(one) for one in (said, unit)]
            if None not in kinds and kinds[0] != kinds[1]:
                problem = (
                    f"must be of the kind that the file states, {said}; a raw signal has a scale, '2 {unit}/{said}'"
                )
                raise InputError(f"unit of {name}", unit, problem, where=where, remedy=f"scale {name}")
        words[name] = unit
    return words


def _kind_of_unit(word: str) -> str | None:
    try:
        return si_of(word, field="unit")[0]
    except InputError:
        return None


def _clock(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], chosen: bool, where: str
) -> tuple[str, list[str]]:
    """The clock that all channels get: that of the time where the file has one, of the first one `chosen`, else the finest.

    Channels of other clocks are interpolated to it where their times are known, and left out where they are not.
    """
    clocks = dict.fromkeys(foreign[column.at].clock for column in sources.values())
    if not clocks:
        raise InputError("channels", None, "must be at least one column with a name and a unit", where=where)
    if len(clocks) == 1:
        return next(iter(clocks)), []
    timed = {one.clock: one.time for one in foreign if one.time is not None}
    if "time" in sources:
        kept = foreign[sources["time"].at].clock
    else:
        if not {*clocks} <= {*timed}:
            of = {clock: [n for n, c in sources.items() if foreign[c.at].clock == clock] for clock in clocks}
            shown = {clock: ", ".join(names[:3]) + (", .." if len(names) > 3 else "") for clock, names in of.items()}
            problem = "; ".join(f"{clock}: {names}" for clock, names in shown.items())
            needs = "a recording has one time; choose columns"
            sentence = f"the columns have {len(clocks)} clocks ({problem}), and {needs}"
            raise InputError(
                "columns", f"of {len(clocks)} clocks", needs, sentence=sentence, where=where, remedy="column NAME"
            )
        kept = next(iter(clocks)) if chosen else max(clocks, key=lambda clock: len(timed[clock]))
    others = [name for name, column in sources.items() if foreign[column.at].clock != kept]
    if kept in timed and all(foreign[sources[name].at].clock in timed for name in others):
        return kept, said_of(others, f"interpolated to the times of {_first_of(kept, sources, foreign)}")
    labels = [foreign[sources[name].at].label for name in others]
    lines = said_of(labels, "left out: the time has other samples")
    for name in others:
        del sources[name]
    return kept, lines


def _first_of(clock: str, sources: Mapping[str, ColumnSource], foreign: Sequence[ForeignColumn]) -> str:
    return next(n for n, c in sources.items() if foreign[c.at].clock == clock and n != "time")


def _on_one_clock(
    sources: dict[str, ColumnSource], table: ForeignTable, chosen: bool, where: str
) -> tuple[dict[str, np.ndarray], ForeignTable, str, list[str]]:
    """The numbers of all sources on one clock, the table cut to the times that all have, that clock, and what was done."""
    foreign = table.columns
    clock, remarks = _clock(sources, foreign, chosen, where)
    times = next((one.time for one in foreign if one.clock == clock), None)
    numbers: dict[str, np.ndarray] = {}
    known = np.ones(0 if times is None else len(times), bool)
    for name, source in sources.items():
        column = foreign[source.at]
        values = column.values
        if not is_date(values):
            values = column_numbers(column, table.rows, where, overload=name != "time")
        if column.clock != clock and column.time is not None and times is not None:
            order = np.argsort(column.time, kind="stable")
            values = np.interp(times, column.time[order], values[order], left=np.nan, right=np.nan)
            known &= (times >= column.time[order[0]]) & (times <= column.time[order[-1]])
        numbers[name] = values
    if known.all() or not known.any() or times is None:
        return numbers, table, clock, remarks
    times = times[known]
    remarks.append(f"the record is cut to {times[0]:.6g} s to {times[-1]:.6g} s, which all channels have")
    cut = [c._replace(time=times, values=c.values[known]) if c.clock == clock else c for c in foreign]
    return {n: v[known] for n, v in numbers.items()}, table._replace(columns=cut), clock, remarks


def _channel(
    name: str, column: ColumnSource, values: np.ndarray, table: ForeignTable, unit: str | None, scale: str | None,
    zero: float, ambient: float, where: str,
) -> Channel:  # fmt: skip
    foreign = table.columns[column.at]
    if values.dtype.kind != "f":
        allowed = "is a column of dates, which only the time can be: read the column as the time"
        raise InputError(f"{name} ({foreign.label})", None, allowed, where=where, remedy="column time")
    if unit is None and foreign.values.dtype.kind == "b":
        unit = "1"
    if unit is None:
        problem = "has no unit: state one, such as bar, N, mm or V, or 1 where it is a plain number"
        if table.rows is not None:
            problem = f"has no unit: write it into the header, such as '{name} [kPa]', or state it"
        raise InputError(name, None, problem, where=where, remedy=f"unit {name}")
    si, factor, offset = si_of(unit, field=f"unit of {name} ({foreign.label})", where=where)
    if factor != 1.0 or offset:
        values = values * factor + offset
    if scale is not None:
        scaled = Channel(values, si).scaled(scale)
        values, si = scaled.values, scaled.unit
    if is_pressure(si):
        if not name.endswith("_abs"):
            values = values - zero if zero else values
        check_vacuum(name, foreign.label, values, ambient, table.place, where)
    kind = "command" if name.split(".")[-1] == "command" else "measured"
    return Channel(values, si, kind)
