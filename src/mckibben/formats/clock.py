"""The clock of another program's file: dates, stamps that repeat, wrap or pass midnight, runs that begin anew, and gaps."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np

from ..errors import InputError, choice
from .labels import DAYS, TIMES, ColumnSource, parse_header, plain_stem
from .table import ForeignTable, si_of
from .text import is_number, rows_left_out

# Between samples; more, and samples were lost. Stamps rounded to the last digit reach 1.5 to 2 times the median.
LARGEST_GAP = 3.0


def times_of(
    column: ColumnSource | None,
    values: np.ndarray | None,
    table: ForeignTable,
    clock: str,
    words: Mapping[str, str | None],
    period: float | None,
    where: str,
) -> tuple[np.ndarray, str | None, float | None]:
    """The time [s], the date of its beginning where the file has dates, and after what the clock begins anew [s].

    A time of day begins anew after 86400 s, a counter of whole numbers after 2**32 or 2**16 of them.
    """
    count, implied = next((len(g.values), g.time) for g in table.columns if g.clock == clock)
    if period is not None:
        if column is not None:
            allowed = f"the file has the time {table.columns[column.at].label}; give one of the two"
            raise InputError("period", period, allowed, where=where)
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", period, "must be a time above 0 s", where=where)
        return np.arange(count if table.rows is None else len(table.rows)) * float(period), None, None
    if column is None or values is None:
        if implied is not None:
            return implied, None, None
        allowed = f"none is named {choice(TIMES[:3])}; say which one it is, or state the period of the samples"
        raise InputError("time", None, f"is in no column: {allowed}", where=where, remedy="column time")
    label = table.columns[column.at].label
    of_day = False
    if values.dtype.kind in "iuf" and plain_stem(parse_header(0, label)[0]) in DAYS and _are_days(values):
        values = np.array([str(int(day)) for day in values], object)  # 20240502
    if values.dtype.kind == "O":
        cells = [str(cell).strip() for cell in values]
        of_day = bool(cells) and _TIME_OF_DAY.fullmatch(cells[0]) is not None
        values = parse_dates(cells)
    if values.dtype.kind == "M":
        dates = values.astype("datetime64[ns]")
        time = np.where(np.isnat(dates), np.nan, (dates - dates[:1]).astype("int64") * 1e-9)
        # Some programs write the time of day anew beside the date on which the record began.
        one_day = len(np.unique(dates.astype("datetime64[D]"))) == 1
        return time, str(values[0]) if len(values) and not of_day else None, 86400.0 if one_day else None
    unit, scale, offset = si_of(words.get("time") or "s", field=f"unit of time ({label})", where=where)
    if unit != "s":
        raise InputError(f"unit of time ({label})", words["time"], "must be a time such as s or ms", where=where)
    time = values * scale + offset if scale != 1.0 or offset else values.astype(float)
    if len(time) and time.min() >= _THIS_CENTURY[0] and time.max() < _THIS_CENTURY[1]:
        begin = time[0]
        since = np.round(time - begin, 6)  # doubles hold no less of seconds since 1970
        return since, str(np.datetime64(round(1e6 * begin), "us")), None
    counted = len(values) > 1 and bool((values == np.round(values)).all())
    wrap = None
    if counted and (back := float(np.diff(values).min())) < 0.0:
        # A step back of almost all that a counter holds is the counter, and no new run.
        wrap = next((2.0**bits * scale for bits in (16, 32) if -(2.0**bits) < back < -0.9 * 2.0**bits), None)
    return time, None, wrap


_THIS_CENTURY = (946_684_800.0, 4_102_444_800.0)  # seconds since 1970, and no run's own clock: 30 years and above


def _are_days(values: np.ndarray) -> bool:
    """Whether numbers are days as year, month and day."""
    whole = len(values) > 0 and bool(((values >= 19e6) & (values < 21e6) & (values == np.round(values))).all())
    return whole and len(parse_dates([str(int(day)) for day in values])) > 0


_TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d(?::\d\d(?:[.,]\d*)?)?(?: ?[AP]M)?|\d+ days? .*", re.I)
_ELAPSED = re.compile(r"(?:(\d+) days?[.,]? )?(\d+)(:\d\d:\d\d(?:\.\d{1,9})?)")  # as pandas and Python write it


class MendedClock(NamedTuple):
    """Times that increase.

    Args:
        time: times [s].
        kept: of a clock that lost samples, the numbers of those that are kept; None for all.
        runs: where runs begin anew in the file: of each its start and end on this clock and the time that it began with in
            the file [s]; empty for one run.
        remarks: a sentence for each thing that was mended.
    """

    time: np.ndarray
    kept: np.ndarray | None
    runs: list[dict[str, float]]
    remarks: list[str]


def _not_later(time: np.ndarray, i: int, label: str, table: ForeignTable, where: str) -> InputError:
    problem = f"{time[i + 1]!s} s after {time[i]!s} s"
    return InputError(f"{label}{table.place(i + 1)}", problem, "times must increase, each once", where=where)


SHARED = 0.2  # of the samples; more have the stamp of the one before, and the clock is a coarse one


def mend_clock(
    time: np.ndarray,
    label: str,
    wrap: float | None,
    alike: np.ndarray | None,
    table: ForeignTable,
    strict: bool,
    where: str,
) -> MendedClock:
    """Make a time increase: across midnight and the end of a counter, equal stamps, samples out of order, and new runs.

    Args:
        time: times as the file has them [s].
        label: of their column.
        wrap: after what the clock begins anew [s]; None if it does not.
        alike: which samples equal the one before in all channels (n,); None where that is not known.
        table: of the file, for the rows.
        strict: refuse what is no one run.
        where: how errors name the file.

    Raises:
        InputError: a time is no number, or there are several runs where one is wanted.
    """
    remarks: list[str] = []
    if len(time) < 2 or not np.isfinite(time).all() or (np.diff(time) > 0.0).all():
        return MendedClock(time, None, [], remarks)
    time, count, steps = time.copy(), len(time), np.diff(time)
    kept, falls = np.arange(count), (steps < 0.0) & (steps >= -math.inf if wrap is None else steps >= -0.5 * wrap)
    if not strict and 2 * falls.sum() > (steps != 0.0).sum():
        time, kept = time[::-1].copy(), kept[::-1]
        alike, steps = None if alike is None else np.r_[False, alike[:0:-1]], np.diff(time)
        remarks.append("the newest sample stands first; the rows are put in the order of their times")
    if wrap is not None and (at := np.flatnonzero(steps < -0.5 * wrap)).size:
        for i in at:
            time[i + 1 :] += wrap
        what = "midnight passes" if wrap == 86400.0 else f"the counter of the time begins anew after {wrap:.10g} s"
        remarks.append(f"{what}{' before' + table.place(int(kept[at[0] + 1])).removeprefix(',')}; the time goes on")
        steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    same = steps == 0.0
    if strict and not (steps > 0.0).all():
        raise _not_later(time, int(np.argmin(steps > 0.0)), label, table, where)
    if (same if alike is None else same & ~alike[1:]).mean() > SHARED and usual > 0.0:
        # Stamps of a coarse clock: samples of one stamp lie evenly up to the next.
        first = np.flatnonzero(np.r_[True, ~same])
        ends = np.r_[time[first][1:], time[first][-1] + usual]
        for begin, end, until in zip(first.tolist(), [*first[1:].tolist(), len(time)], ends, strict=True):
            if until > time[begin]:
                time[begin:end] = np.linspace(time[begin], until, end - begin, endpoint=False)
        remarks.append("several samples have one time; they are spread evenly up to the next")
        steps = np.diff(time)
    elif same.any():
        again = np.r_[False, same]
        numbers = [i + 1 if table.rows is None else table.rows[i] for i in kept[again].tolist()]
        remarks.append(rows_left_out(numbers, "it has the time of the row before"))
        time, kept = time[~again], kept[~again]
        steps = np.diff(time)
    runs: list[dict[str, float]] = []
    back = np.flatnonzero(steps < 0.0)
    anew = [int(i) for i in back if time[i + 1] - time[0] <= 0.1 * (time[: i + 1].max() - time[0])]
    if back.size and len(anew) == len(back):
        begins = [0, *(i + 1 for i in anew), len(time)]
        said = [table.place(int(kept[i])).removeprefix(", ") for i in begins[1:-1]]
        for begin, end in zip(begins, begins[1:], strict=False):
            began = float(time[begin])
            if begin:
                time[begin:end] += time[begin - 1] + usual - began
            runs.append({"start": float(time[begin]), "end": float(time[end - 1]), "began": began})
        shown = ", ".join(said[:4]) + (", .." if len(said) > 4 else "")
        remarks.append(
            f"the time begins anew in {shown}: {len(runs)} runs, one after another on one clock (Recording.runs)"
        )
    elif back.size:
        place = table.place(int(kept[back[0] + 1])).removeprefix(", ")
        order = np.argsort(time, kind="stable")
        first = np.r_[True, np.diff(time[order]) > 0.0]
        again = [i + 1 if table.rows is None else table.rows[i] for i in np.sort(kept[order][~first]).tolist()]
        kept, time = kept[order][first], time[order][first]
        remarks.append(f"{len(back)} samples stand out of their order, the first in {place}; they are put in order")
        if again:
            remarks.append(rows_left_out(again, "another row has its time"))
    return MendedClock(time, kept if len(kept) < count or (np.diff(kept) != 1).any() else None, runs, remarks)


def find_gaps(time: np.ndarray, label: str, table: ForeignTable, strict: bool, where: str) -> list[str]:
    """A line for the largest gap in the time [s] of a text table; refused where `strict`."""
    steps = np.diff(time)
    if table.rows is None or len(steps) < 2:
        return []
    usual = float(np.median(steps))
    # Whoever samples a step's tail ever more slowly leaves no gap: an interval may be as long as its neighbours let expect.
    near = np.minimum(np.r_[steps[1], steps[:-1]], np.r_[steps[1:], steps[-2]])
    limit = LARGEST_GAP * np.maximum(usual, near)
    # Stamps are decimals: an interval of three times the median may be a bit longer in binary.
    over = steps > limit * (1.0 + 1e-9) + 4.0 * np.spacing(np.abs(time).max())
    if not over.any():
        return []
    i = int(np.where(over, steps, 0.0).argmax())
    if not strict:
        several = f", the largest of {over.sum()}" if over.sum() > 1 else ""
        return [f"gap of {steps[i]:.6g} s before{table.place(i + 1)[1:]}{several}; the usual interval is {usual:.6g} s"]
    most = f"{LARGEST_GAP:g} times the usual interval, {limit[i]:.6g} s"
    problem = f"must be at most {most}, after the row before, got {steps[i]:.6g} s at {time[i + 1]:.6g} s; is it a gap?"
    raise InputError(f"{label}{table.place(i + 1)}", None, problem, where=where)


def is_date(values: np.ndarray) -> bool:
    """Whether values are dates, or cells in words that are."""
    if values.dtype.kind != "O":
        return values.dtype.kind == "M"
    filled = next((str(cell).strip() for cell in values if str(cell).strip()), "")
    return not is_number(filled) and len(parse_dates([filled])) == 1


_FRACTION = re.compile(r":\d\d\.\d")
_DATE_FORMATS = (
    "%d.%m.%Y %H:%M:%S", "%d.%m.%y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%d/%m/%Y %H:%M:%S", "%Y/%m/%d %H:%M:%S",
    "%m/%d/%Y %I:%M:%S %p", "%d/%m/%Y %I:%M:%S %p", "%Y/%m/%d %H:%M", "%d.%m.%Y %H:%M", "%m/%d/%Y %H:%M",
    "%d/%m/%Y %H:%M", "%d-%b-%Y %H:%M:%S", "%d-%b-%Y", "%d-%b-%y", "%Y/%m/%d",
    "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%H:%M:%S", "%I:%M:%S %p",
    "%H:%M",
)  # fmt: skip


def parse_dates(cells: Sequence[str]) -> np.ndarray:
    """Cells as dates (n,) datetime64[us], by the first way of writing that fits all; empty where none does.

    Where day and month could be either, they are those by which the times lie closer together: no record lasts a month.
    """
    plain = [cell.replace(",", ".") for cell in cells]

    def iso(cell: str) -> datetime:
        return datetime.fromisoformat(cell).replace(tzinfo=None)

    def written(form: str) -> Callable[[str], datetime]:
        return lambda cell: datetime.strptime(cell, form.replace("%S", "%S.%f") if _FRACTION.search(cell) else form)

    def elapsed(cell: str) -> datetime:
        if (found := _ELAPSED.fullmatch(cell)) is None:
            raise ValueError
        days, hour, rest = found.groups()
        return datetime.fromisoformat(f"1970-01-01T00{rest[:13]}") + timedelta(days=int(days or 0), hours=int(hour))

    readings = []
    for parse_cell in (iso, *map(written, _DATE_FORMATS), elapsed):
        try:
            readings.append(np.array([parse_cell(cell) for cell in plain], "datetime64[us]"))
        except ValueError:
            continue
        if not plain or "/" not in plain[0] or len(readings) == 2:
            break
    return min(readings, key=np.ptp) if plain and readings else np.empty(0, "datetime64[us]")
