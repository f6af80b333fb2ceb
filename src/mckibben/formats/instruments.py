"""Text that instruments and programs of laboratories write in a way of their own, as the plain rows that `text` reads.

Each has one recogniser: it looks at the rows and gives them back as names with units over rows of numbers, or says that
they are none of its own. What else the file says becomes a note.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

Rows = list[tuple[int, list[str]]]


class PlainRows(NamedTuple):
    """Rows with names and units before the numbers.

    Args:
        rows: cells with the number of their row in the file.
        notes: what else the file says, for the metadata.
        remarks: a sentence for each thing that was left out or added.
        decimal: the decimal mark, where the file states it.
    """

    rows: Rows
    notes: dict[str, Any] = {}
    remarks: list[str] = []
    decimal: str | None = None


def plain(rows: Rows) -> PlainRows:
    """The rows as `text.table_of_rows` reads them; unchanged where no instrument is recognised."""
    for recognise in (_labview, _rigol, _tektronix_columns, _tektronix_lines, _opensim, _serial_monitor):
        found = recognise(rows) if rows else None
        if found is not None:
            return found
    return PlainRows(rows)


def _cell(row: list[str], at: int = 0) -> str:
    return row[at].strip() if at < len(row) else ""


def _labelled(labels: list[str], units: list[str]) -> list[str]:
    return [
        f"{label} [{unit}]" if unit and "[" not in label else label
        for label, unit in zip(labels, [*units, *[""] * len(labels)], strict=False)
    ]


def _labview(rows: Rows) -> PlainRows | None:
    """LabVIEW's measurement files (.lvm): a head, then segments, each with a head of its channels and rows of numbers.

    With one X column for all channels, or one each; those that equal the first are left out. The own reader stands here as
    lvm_read 1.26 takes the number of columns from the number of channels, and so loses the last one of several X columns.
    """
    if _cell(rows[0][1]) != "LabVIEW Measurement":
        return None
    head = {_cell(row): _cell(row, 1) for _, row in rows if _cell(row) and not _cell(row).startswith("***")}
    begin = next((i for i, (_, row) in enumerate(rows) if _cell(row) == "X_Value"), None)
    if begin is None:
        return None
    number, names = rows[begin]
    about = {_cell(row): row for _, row in rows[:begin]}
    units_row = about.get("Y_Unit_Label", [])
    several = [at for at, name in enumerate(names) if name.strip() == "X_Value"]
    units = [_cell(units_row, at) for at in range(len(names))]  # below their channels, with one X column or several
    body = rows[begin + 1 :]
    comma = head.get("Decimal_Separator") == ","
    if body and not any(_cell(row) for _, row in body) and "Delta_X" in about:
        first, step = (float(_cell(about.get(key, []), 1).replace(",", ".") or 0.0) for key in ("X0", "Delta_X"))
        times = (repr(first + step * at) for at in range(len(body)))
        body = [(n, [x.replace(".", ",") if comma else x, *row[1:]]) for x, (n, row) in zip(times, body, strict=True)]
    alike = [at for at in several[1:] if all(_cell(row, at) in ("", _cell(row)) for _, row in body)]
    kept = [at for at in range(len(names)) if at not in alike]
    remarks = []
    if len(alike) < len(several) - 1:
        other = next(at for at in several[1:] if at not in alike)
        last = max(at for at in kept if at < other)
        kept = [at for at in kept if at <= last]
        left = [name.strip() for name in names[other:] if name.strip() not in ("X_Value", "Comment")]
        remarks.append(f"{', '.join(left)} left out: their X column is not that of the first channel")
    of_time = _cell(about.get("X_Dimension", []), 1) in ("", "Time")
    labels = ["time [s]" if at == 0 and of_time else label for at, label in enumerate(_labelled(names, units))]
    table = [(number, [labels[at] for at in kept])] + [(n, [_cell(row, at) for at in kept]) for n, row in body]
    start = f"{head.get('Date', '')} {head.get('Time', '')[:15]}".strip()
    return PlainRows(table, {"start": start} if start else {}, remarks, head.get("Decimal_Separator"))


def _rigol(rows: Rows) -> PlainRows | None:
    """Rigol: rows are numbered, and the second row has units, the time of the first sample and the interval."""
    names = [cell.strip() for cell in rows[0][1]]
    if names[:1] != ["X"] or "Start" not in names or "Increment" not in names or len(rows) < 3:
        return None
    second = rows[1][1]
    try:
        start = float(_cell(second, names.index("Start")))
        step = float(_cell(second, names.index("Increment")))
        times = [start + step * float(_cell(row)) for _, row in rows[2:]]
    except ValueError:
        return None
    end = names.index("Start")
    units = [
        {"volt": "V", "volts": "V", "ampere": "A"}.get(_cell(second, at).lower(), _cell(second, at))
        for at in range(end)
    ]
    labels = ["time [s]", *_labelled(names[1:end], units[1:])]
    body = [(n, [repr(t), *row[1:end]]) for t, (n, row) in zip(times, rows[2:], strict=True)]
    return PlainRows([(rows[0][0], labels), *body], {"start_offset": start, "interval": step})


def _tektronix_columns(rows: Rows) -> PlainRows | None:
    """Tektronix TDS and TBS: for each channel three columns of what it is, then time and value."""
    first = rows[0][1]
    blocks = [at for at, cell in enumerate(first) if cell.strip() == "Record Length"]
    if not blocks or blocks[0] != 0 or len(first) < 5:
        return None
    labels, notes, kept, left = ["time [s]"], {}, list[int](), list[str]()
    for count, at in enumerate(blocks, 1):
        about = {_cell(row, at): _cell(row, at + 1) for _, row in rows if _cell(row, at)}
        name = about.get("Source", f"CH{count}")
        notes[name] = about
        if any(_cell(row, at + 3) != _cell(row, 3) for _, row in rows):
            left.append(name)
            continue
        kept.append(at)
        labels += _labelled([name], [about.get("Vertical Units", "V")])
    remarks = [f"{', '.join(left)} left out: the times are not those of the first channel"] if left else []
    body = [(n, [_cell(row, 3), *(_cell(row, at + 4) for at in kept)]) for n, row in rows if _cell(row, 3)]
    return PlainRows([(rows[0][0], labels), *body], {"instrument": notes}, remarks)


def _tektronix_lines(rows: Rows) -> PlainRows | None:
    """Tektronix MSO and DPO: lines of what the record is, with a unit and a label for each channel, above TIME, CH1, .."""
    head = next((i for i, (_, row) in enumerate(rows[:60]) if _cell(row) == "TIME" and len(row) > 1), None)
    about = {} if head is None else {_cell(row): row[1:] for _, row in rows[:head]}
    if head is None or "Vertical Units" not in about:
        return None
    number, names = rows[head]
    units = [cell.strip() for cell in about["Vertical Units"]]
    said = [_cell(about.get("Label", []), at) for at in range(len(names) - 1)]
    labels = [label or name.strip() for label, name in zip(said, names[1:], strict=True)]
    time = f"time [{_cell(about.get('Horizontal Units', []), 0) or 's'}]"
    notes = {key: ", ".join(cell.strip() for cell in cells) for key, cells in about.items() if key}
    return PlainRows([(number, [time, *_labelled(labels, units)]), *rows[head + 1 :]], {"instrument": notes})


# OpenSim states no units: its storage files are in SI units, angles in degrees where the head says so.
_OPENSIM = (
    ("force", "N"),
    ("tension", "N"),
    ("moment", "N m"),
    ("length", "m"),
    ("velocity", "m/s"),
    ("activation", "1"),
)


def _opensim(rows: Rows) -> PlainRows | None:
    """OpenSim's storage and motion files (.sto, .mot): a head up to ``endheader``, then names and numbers."""
    end = next((i for i, (_, row) in enumerate(rows[:60]) if _cell(row) == "endheader"), None)
    if end is None or end + 2 > len(rows):
        return None
    head = dict(_cell(row).partition("=")[::2] for _, row in rows[:end] if "=" in _cell(row))
    number, names = rows[end + 1]
    angle = "deg" if head.get("inDegrees", "").strip().lower() == "yes" else "rad"
    units = ["s" if at == 0 else _opensim_unit(name.strip().lower(), angle) for at, name in enumerate(names)]
    remark = "the file states no units; they are those of OpenSim, SI by the names of the columns"
    return PlainRows(
        [(number, _labelled([n.strip() for n in names], units)), *rows[end + 2 :]], {"head": head}, [remark]
    )


def _opensim_unit(name: str, angle: str) -> str:
    if re.search(r"angle|flexion|rotation|adduction|inversion|_r[xyz]\b|pelvis_(tilt|list)", name):
        return angle
    return "m" if re.search(r"_t[xyz]\b", name) else next((unit for word, unit in _OPENSIM if word in name), "")


_STAMPED = re.compile(r"(\d{1,2}:\d\d:\d\d(?:[.,]\d+)?) -> ?(.*)")


def _serial_monitor(rows: Rows) -> PlainRows | None:
    """The serial monitor of Arduino with time stamps: ``23:59:58.100 -> 0.0,0.00``."""
    stamps = [_STAMPED.fullmatch(_cell(row)) for _, row in rows]
    if sum(stamp is not None for stamp in stamps) < max(len(rows) - 1, 2):
        return None

    def cells() -> Iterator[tuple[int, list[str]]]:
        for stamp, (number, row) in zip(stamps, rows, strict=True):
            if stamp is not None:
                yield number, [stamp[1], stamp[2], *row[1:]]

    return PlainRows([*cells()])
