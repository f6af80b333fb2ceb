"""What of a recording is drawn together: channels in one pair of axes, parts of one case, and how many of their samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...analysis.segments import amount_of, steps_of
from ...errors import InputError, suggest
from ...quantities import from_si, shown_unit
from ...recordings.recording import Recording

COLUMNS = 1600  # into which a time axis is divided; more than its pixels
MOST = 8 * COLUMNS  # samples of a line that is drawn as it is
GAP = 1.5  # intervals between samples; more, and the line ends there
_DRIVEN = ("command", "opening", "position", "running")  # what the valve's axes show of pure numbers
# What axes are called, whose colour they take, the unit that is read, by SI unit; in the order in which they are stacked.
_KNOWN: dict[str, tuple[str, str | None, str]] = {
    "Pa": ("Pressure", "pressure", "bar"),
    "N": ("Tension", "tension", "N"),
    "m": ("Length", "length", "cm"),
    "m/s": ("Velocity", None, "cm/s"),
    "kg/s": ("Mass flow", "flow", "g/s"),
    "m^3/s": ("Flow", "flow", "L/min"),
}
_SIGNS = {"percent": "%", "cm^3": "cm³", "cm^2": "cm²"}
_DERIVED: dict[str, tuple[str, str]] = {
    "K": ("Temperature", "K"), "kg": ("Mass", "g"), "m^3": ("Volume", "cm^3"), "J": ("Energy", "J"), "W": ("Power", "W"),
    "V": ("Voltage", "V"), "A": ("Current", "A"),
}  # fmt: skip


class Panel(NamedTuple):
    """One pair of axes: what it shows, whose colour it takes (None: ink), its units, and its channels."""

    title: str
    quantity: str | None
    unit: str
    si_unit: str
    names: list[str]

    @property
    def heading(self) -> str:
        """Title and unit, as they stand at an axis."""
        return self.title if self.unit == "1" else f"{self.title}, {_SIGNS.get(self.unit, self.unit)}"

    def scale(self) -> float:
        """From SI to the unit that is read."""
        return from_si(1.0, self.si_unit, self.unit)


class Family(NamedTuple):
    """Parts of a recording that belong together, and what tells them from the others."""

    words: str
    parts: list[Recording]


def panels(record: Recording, names: Sequence[str]) -> list[Panel]:
    """Channels by quantity and unit, in the order in which each is first named."""
    grouped: dict[tuple[str, str | None, str, str], list[str]] = {}
    for name in names:
        grouped.setdefault(_axes(name, record.unit(name)), []).append(name)
    return [Panel(_title(key[0], found), *key[1:], found) for key, found in grouped.items()]


def checked_names(record: Recording, names: Iterable[str], *, field: str = "--channels") -> list[str]:
    """Names of channels, each once, or `InputError` with the nearest one that there is."""
    wanted = list(dict.fromkeys(names))
    for name in wanted:
        if name not in record:
            has = ", ".join(record.names())
            raise InputError(field, name, f"{suggest(name, record.names())}the recording has {has}")
    return wanted


def usual_channels(parts: Sequence[Recording]) -> list[str]:
    """What is drawn where nobody says: measured, its commands in force and its true values, one quantity after another.

    Without measured channels all pressures, tensions, lengths, flows and valves that are not zero throughout.

    Args:
        parts: of one recording.
    """
    record = parts[0]
    measured = record.names("measured")
    if measured:
        found = [*measured, *(n for n in record.names("true") if n.removeprefix("muscle.") in measured)]
        asked = [n for n in record.names("command") if n.rpartition(".")[2] in measured]
        # a valve's command in bar nearly is the pressure's, and would hide it
        found += asked + [n for n in record.names("command") if _axes(n, record.unit(n))[1] == "valve"]
    else:
        valves = [n for n in record.names() if _axes(n, record.unit(n))[1] == "valve"]
        found = [n for n in record.names() if record.unit(n) in _KNOWN and not n.endswith("_abs")] + valves
        # an atmosphere says nothing
        found = [n for n in found if any(np.nanmax(np.abs(part[n]), initial=0.0) > 0.0 for part in parts)]
    known = [n for n in record.names() if any(np.isfinite(part[n]).any() for part in parts)]
    order = [*_KNOWN]
    found = [n for n in found if n in known] or known
    return sorted(found, key=lambda n: order.index(record.unit(n)) if record.unit(n) in order else len(order))


def told_apart(parts: Sequence[Recording]) -> list[Family]:
    """The parts by what varies among them: the words of their cases, else their labels; sorted by amount."""
    steps = [part.meta.get("step") for part in parts]
    if not all(isinstance(step, Mapping) for step in steps):
        return [Family("", list(parts))]
    known = [steps_of(part)[0] for part in parts]
    values: dict[str, dict[str, None]] = {}
    for step in known:
        for name, words in step["case"].items():
            values.setdefault(name, {})[words] = None
    named = [name for name, words in values.items() if len(words) > 1]
    families: dict[tuple[str, ...], list[Recording]] = {}
    for part, step in zip(parts, known, strict=True):
        label = str(step["label"]) if not named else ""
        families.setdefault(tuple(step["case"].get(n, "") for n in named) or (label,), []).append(part)
    several = len(families) > 1
    keys = sorted(families, key=lambda key: [amount_of(word) for word in key])
    return [Family(", ".join(key) if several else "", families[key]) for key in keys]


def lane_steps(parts: Sequence[Recording]) -> list[tuple[float, float, list[str]]]:
    """Beginning and end [s] of the steps that are drawn, and what may stand on them, the longest first."""
    if not parts[0].meta.get("steps"):
        return []
    listed = [s for p in parts for s in steps_of(p)] if "step" in parts[0].meta else steps_of(parts[0])
    start, end = parts[0].time[0], parts[-1].time[-1]
    shown = [s for s in listed if s["recorded"] and s["end"] > start and s["start"] <= end]
    values: dict[str, set[str]] = {}
    for step in shown:
        for name, words in step["case"].items():
            values.setdefault(name, set()).add(words)
    found = []
    for step in shown:
        case = ", ".join(words for name, words in step["case"].items() if len(values[name]) > 1)
        label = str(step["label"])
        found.append(
            (step["start"], step["end"], [f"{label}, {case}" if label and case else label or case, case, label])
        )
    return found


def envelope(time: np.ndarray, values: np.ndarray, columns: int = COLUMNS) -> tuple[np.ndarray, np.ndarray]:
    """A line over time as it is drawn: of many samples the first, least, greatest and last of every column.

    The picture is that of all samples. A NaN stands between samples that are more than `GAP` usual intervals apart, and
    where values are not known.

    Args:
        time: increasing [s], (n,).
        values: (n,).
        columns: into which the time is divided.
    """
    at = np.flatnonzero(np.isfinite(values))
    t, v = time[at], values[at]
    if not at.size:
        return t, v
    usual = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    begins = np.concatenate([[True], (np.diff(at) > 1) | (np.diff(t) > GAP * usual)])
    if at.size > 8 * columns:
        keep = _extremes(t, v, begins, columns)
        t, v, begins = t[keep], v[keep], begins[keep]
    breaks = np.flatnonzero(begins)[1:]
    return np.insert(t, breaks, t[breaks]), np.insert(v, breaks, np.nan)


def path(time: np.ndarray, x: np.ndarray, y: np.ndarray, most: int = MOST) -> tuple[np.ndarray, np.ndarray]:
    """A curve of y over x as it is drawn: of many samples the extremes of both in every stretch; gaps are not bridged."""
    usual = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    at = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    t, x, y = time[at], x[at], y[at]
    if not at.size:
        return x, y
    begins = np.concatenate([[True], (np.diff(at) > 1) | (np.diff(t) > GAP * usual)])
    if at.size > most:
        index = np.arange(at.size, dtype=float)
        both = [_extremes(index, values, begins, most // 8) for values in (x, y)]
        keep = np.unique(np.concatenate(both))
        x, y, begins = x[keep], y[keep], begins[keep]
    breaks = np.flatnonzero(begins)[1:]
    return np.insert(x, breaks, np.nan), np.insert(y, breaks, np.nan)


def _extremes(t: np.ndarray, v: np.ndarray, begins: np.ndarray, columns: int) -> np.ndarray:
    """Indices of the first, least, greatest and last sample of every column and every part, rising."""
    column = ((t - t[0]) / (t[-1] - t[0]) * columns).astype(int)
    begins = begins | np.concatenate([[True], np.diff(column) > 0])
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(t)) - 1
    group = np.cumsum(begins) - 1
    found = [first, last]
    for extreme in (np.minimum, np.maximum):
        hits = np.flatnonzero(v == extreme.reduceat(v, first)[group])
        found.append(hits[np.diff(group[hits], prepend=-1) > 0])  # of equal ones the first
    return np.unique(np.concatenate(found))


def _axes(name: str, unit: str) -> tuple[str, str | None, str, str]:
    """Title, quantity, unit that is read, and SI unit of the axes of a channel."""
    if unit == "Pa" and name.endswith("_abs"):
        return "Absolute pressure", "pressure", "bar", unit
    if unit in _KNOWN:
        title, quantity, shown = _KNOWN[unit]
        return title, quantity, shown, unit
    if unit in _DERIVED:
        title, shown = _DERIVED[unit]
        return title, None, shown, unit
    owner, _, last = name.rpartition(".")
    if unit == "1" and last in _DRIVEN and not owner.startswith("motor"):
        return "Valve", "valve", "percent", unit
    words = name if last == "command" else last
    return words.replace("_", " ").replace(".", " ").capitalize(), None, shown_unit(unit), unit


def _title(title: str, names: list[str]) -> str:
    lasts = {n.rpartition(".")[2] for n in names}
    return "Span" if title == "Length" and lasts == {"span"} else title
