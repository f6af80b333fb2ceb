"""Figures of recordings: choice of channels per pair of axes, parts of one case, and thinning of their samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...analysis.lever import stimulated_contractions
from ...analysis.segments import amount_of, steps_of
from ...documents import JsonValue
from ...errors import InputError
from ...experiments.amounts import read_amount
from ...quantities import from_si, shown_unit
from ...recordings.recording import Recording
from . import formats, style
from .places import describe, recording_source
from .style import DASHES, INK_2, PANEL, RECORDING_DASHES, SMALL, SUNKEN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    "K": ("Temperature", "K"),
    "kg": ("Mass", "g"),
    "m^3": ("Volume", "cm^3"),
    "J": ("Energy", "J"),
    "W": ("Power", "W"),
    "V": ("Voltage", "V"),
    "A": ("Current", "A"),
}


class ChannelPanel(NamedTuple):
    """A pair of axes: title, quantity of its colour (None: ink), units, and channels."""

    title: str
    quantity: str | None
    unit: str
    si_unit: str
    names: list[str]

    @property
    def heading(self) -> str:
        """Title and unit of an axis."""
        return self.title if self.unit == "1" else f"{self.title}, {_SIGNS.get(self.unit, self.unit)}"

    def scale(self) -> float:
        """Factor from SI to the displayed unit."""
        return from_si(1.0, self.si_unit, self.unit)


class ChannelFamily(NamedTuple):
    """Parts of a recording that belong together, and the label that distinguishes them."""

    words: str
    parts: list[Recording]


def panels(record: Recording, names: Sequence[str]) -> list[ChannelPanel]:
    """Channels by quantity and unit, in order of appearance."""
    grouped: dict[tuple[str, str | None, str, str], list[str]] = {}
    for name in names:
        grouped.setdefault(_axes(name, record.unit(name)), []).append(name)
    return [ChannelPanel(_title(key[0], members), *key[1:], members) for key, members in grouped.items()]


def checked_names(record: Recording, names: Iterable[str], *, field: str = "--channels") -> list[str]:
    """Names of channels without repetition, or `InputError` with the nearest known name."""
    wanted = list(dict.fromkeys(names))
    for name in wanted:
        if name not in record:
            raise InputError(field, name, "the recording has", known=record.names())
    return wanted


def usual_channels(parts: Sequence[Recording]) -> list[str]:
    """Channels of parts that are drawn by default: measured, commands in force and true values, quantity by quantity.

    Without measured channels all pressures, tensions, lengths, flows and valves that are not zero throughout.
    """
    record = parts[0]
    measured = record.names("measured")
    if measured:
        names = [*measured, *(n for n in record.names("true") if n.removeprefix("muscle.") in measured)]
        names += [n for n in record.names("estimated") if n.split(".")[1] in {m.rpartition(".")[2] for m in measured}]
        asked = [n for n in record.names("command") if n.rpartition(".")[2] in measured]
        names += [n for n in ("excitation", "activation") if n in record]
        # a valve's command in bar nearly is the pressure's, and would hide it
        names += asked + [n for n in record.names("command") if _axes(n, record.unit(n))[1] == "valve"]
    else:
        valves = [n for n in record.names() if _axes(n, record.unit(n))[1] == "valve"]
        names = [n for n in record.names() if record.unit(n) in _KNOWN and not n.endswith("_abs")] + valves
        # an atmosphere says nothing
        names = [n for n in names if any(np.nanmax(np.abs(part[n]), initial=0.0) > 0.0 for part in parts)]
    known = [n for n in record.names() if any(np.isfinite(part[n]).any() for part in parts)]
    order = [*_KNOWN]
    names = [n for n in names if n in known] or known
    return sorted(names, key=lambda n: order.index(record.unit(n)) if record.unit(n) in order else len(order))


def told_apart(parts: Sequence[Recording]) -> list[ChannelFamily]:
    """Label the parts by what varies among them: values of their cases, else their labels; sorted by amount."""
    steps = [part.meta.get("step") for part in parts]
    if not all(isinstance(step, Mapping) for step in steps):
        return [ChannelFamily("", list(parts))]
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
    return [ChannelFamily(", ".join(key) if several else "", families[key]) for key in keys]


def lane_steps(parts: Sequence[Recording]) -> list[tuple[float, float, list[str]]]:
    """Start and end [s] of the drawn steps, and possible labels, the longest first."""
    if not parts[0].meta.get("steps"):
        return []
    listed = [s for p in parts for s in steps_of(p)] if "step" in parts[0].meta else steps_of(parts[0])
    start, end = parts[0].time[0], parts[-1].time[-1]
    shown = [s for s in listed if s["recorded"] and s["end"] > start and s["start"] <= end]
    values: dict[str, set[str]] = {}
    for step in shown:
        for name, words in step["case"].items():
            values.setdefault(name, set()).add(words)
    steps = []
    for step in shown:
        case = ", ".join(words for name, words in step["case"].items() if len(values[name]) > 1)
        label = str(step["label"])
        steps.append(
            (step["start"], step["end"], [f"{label}, {case}" if label and case else label or case, case, label])
        )
    return steps


def envelope(time: np.ndarray, values: np.ndarray, columns: int = COLUMNS) -> tuple[np.ndarray, np.ndarray]:
    """Thin a line over time: of many samples the first, least, greatest and last of every pixel column.

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
    """Thin a curve of y over x: of many samples the extremes of both in every section; gaps are not bridged."""
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
    indices = [first, last]
    for extreme in (np.minimum, np.maximum):
        hits = np.flatnonzero(v == extreme.reduceat(v, first)[group])
        indices.append(hits[np.diff(group[hits], prepend=-1) > 0])  # of equal ones the first
    return np.unique(np.concatenate(indices))


def _axes(name: str, unit: str) -> tuple[str, str | None, str, str]:
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


WIDTH = 8.4  # [inch]
MOST_LABELS = 16
MOST_LINES = 3  # of a note in a narrow figure
MOST_LETTERS = 26  # of a key; more would leave the page
_SAID = ("pressure", "pressure_abs", "mass_flow", "tension", "length")
_UNITS = {"Pa": "pressure", "N": "tension", "m": "length"}


@style.styled()
def time_figure(
    parts: Recording | Sequence[Recording], *, channels: Sequence[str] | None = None, title: str | None = None
) -> Figure:
    """Draw channels over time, one pair of axes per quantity and unit.

    Args:
        parts: a recording, or parts of one, by time, such as `analysis.segments.segments` gives.
        channels: names; `recording_panels.usual_channels` by default.
        title: instead of the recording's own.

    Raises:
        InputError: there is no such channel, or nothing to draw.
    """
    parts = [parts] if isinstance(parts, Recording) else parts
    record = parts[0]
    names = usual_channels(parts) if channels is None else checked_names(record, channels)
    _check_known(parts, names)
    drawn = panels(record, names)
    steps = lane_steps(parts)
    top, each, gap, foot = 0.72 + (0.3 if steps else 0.0), 1.3, 0.42, 0.5  # [inch]
    heights = [0.75 * each if p.quantity == "valve" else each for p in drawn]
    height = top + sum(heights) + gap * (len(drawn) - 1) + foot
    fig = style.figure(WIDTH, height)
    low, high = float(parts[0].time[0]), float(parts[-1].time[-1])
    limits = (low, high) if high > low else (low - 0.5, high + 0.5)
    y = height - top
    for i, (panel, own) in enumerate(zip(drawn, heights, strict=True)):
        ax = fig.add_axes((0.065, (y - own) / height, 0.715, own / height))
        y -= own + gap
        draw_panel(ax, parts, panel)
        ax.set_xlim(*limits)
        last = i == len(drawn) - 1
        style.quantity_axes(ax, x=("Time, s" if last else "", None), y=(panel.heading, panel.quantity))
        if not last:
            ax.tick_params(labelbottom=False)
        if i == 0:
            _head(ax, record, title, above=24.0 + (22.0 if steps else 0.0))
            if steps:
                _lane(ax, steps, limits)
    describe(fig, recording_source(record))
    return fig


@style.styled()
def against_figure(
    parts: Sequence[Recording], against: str, *, channels: Sequence[str] | None = None, title: str | None = None
) -> Figure:
    """Draw channels over another channel, the parts of each case in a separate shade.

    Args:
        parts: parts of one recording, as for `time_figure`.
        against: name of the channel on the horizontal axis.
        channels: names; the measured tension by default.
        title: instead of the recording's own.

    Raises:
        InputError: there is no such channel, or nothing to draw.
    """
    record = parts[0]
    (across,) = checked_names(record, [against], field="--against")
    names = _upright(record, across) if channels is None else checked_names(record, channels)
    if across in names:
        raise InputError("--channels", across, "must be another channel; it stands on the other axis")
    _check_known(parts, [across, *names])
    (x,) = panels(record, [across])
    drawn, families = panels(record, names), told_apart(parts)
    each, top, gap, foot = 4.0 if len(drawn) == 1 else 2.6, 0.72, 0.5, 0.55  # [inch]
    height = top + each * len(drawn) + gap * (len(drawn) - 1) + foot
    fig = style.figure(style.MIDDLE, height)
    # the longest words beside the axes, with a piece of line before them
    beside = 48.0 + 0.66 * SMALL * max(len(f.words) for f in families)
    across_page = max(0.5, 0.915 - beside / (72.0 * style.MIDDLE))
    for i, panel in enumerate(drawn):
        bottom = foot + (len(drawn) - 1 - i) * (each + gap)
        ax = fig.add_axes((0.08, bottom / height, across_page, each / height))
        draw_against(ax, families, panel, x)
        last = i == len(drawn) - 1
        style.quantity_axes(ax, x=(x.heading if last else "", x.quantity), y=(panel.heading, panel.quantity))
        if not last:
            ax.tick_params(labelbottom=False)
        if i == 0:
            _head(ax, record, title, above=24.0)
        _name_families(ax, families, panel, x)
        if len(panel.names) > 1:
            style.key(ax, loc="best", bbox_to_anchor=None)
    describe(fig, recording_source(record))
    return fig


# ---- over time


def draw_panel(ax: Axes, parts: Sequence[Recording], panel: ChannelPanel) -> None:
    """Draw the channels of a panel over time."""
    time, scale = np.concatenate([p.time for p in parts]), panel.scale()
    kinds = {name: parts[0].channels[name].kind for name in panel.names}
    for name in panel.names:
        alike = [n for n in panel.names if kinds[n] == kinds[name]]
        values = np.concatenate([p[name] for p in parts])
        look = _look(kinds, name, alike.index(name), len(alike))
        ax.plot(
            *envelope(time, values * scale),
            color=style.colour(panel.quantity),
            label=_key_words(parts[0], name),
            **look,
        )
    _set_range(ax, panel)
    # A key beside the axes and not labels at the ends: command, true and measured mostly end in one point.
    style.key(ax, loc="upper left", bbox_to_anchor=(1.005, 1.1), labelcolor=style.colour(panel.quantity))


def _set_range(ax: Axes, panel: ChannelPanel) -> None:
    """Set the range: from zero if the values are near it, a valve's whole range; rounding is not magnified."""
    low, high = ax.get_ylim()
    least = 1e-3 * max(abs(low), abs(high))
    if high - low < least:
        low, high = 0.5 * (low + high - least), 0.5 * (low + high + least)
    if panel.quantity == "valve":
        low, high = min(low, -8.0), max(high, 108.0)
    elif panel.quantity in ("pressure", "tension") and 0.0 < low < 0.6 * high:
        low = 0.0
    ax.set_ylim(low, high)


def _look(kinds: Mapping[str, str], name: str, rank: int, count: int) -> dict[str, JsonValue]:
    """Style of a line by its kind, its rank among those of the same kind, and the other lines."""
    kind, held = kinds[name], set(kinds.values())
    opacity = style.graded(count, 0.55)[::-1][rank]
    if kind == "command":
        return {"lw": style.LINE, "linestyle": DASHES["length"], "alpha": opacity, "zorder": 2.6}
    if kind == "estimated":
        ends = name.endswith((".low", ".high"))
        return {"lw": 0.6 if ends else style.LINE, "linestyle": DASHES["tension"], "alpha": 0.7, "zorder": 2.9}
    if kind == "true" and "measured" in held:
        return {"lw": 0.8, "linestyle": "-", "alpha": opacity, "zorder": 2.8}
    # A true line on a measured one of the same colour is seen where that one is pale and wide.
    if kind == "measured" and any(n.endswith(f".{name}") and k == "true" for n, k in kinds.items()):
        return {"lw": style.HEAVY + 0.6, "linestyle": "-", "alpha": 0.4, "zorder": 2.3}
    dash = RECORDING_DASHES[rank % 3] if "command" not in held and kind == "true" else "-"
    return {"lw": style.LINE + 0.2, "linestyle": dash, "alpha": opacity, "zorder": 2.4 - 0.01 * rank}


def _key_words(record: Recording, name: str) -> str:
    """Name of a channel in a key; without the quantity on the axes if all channels are true values."""
    words, kind = name, record.channels[name].kind
    if not record.names("measured"):
        owner, _, last = name.rpartition(".")
        words, kind = (owner if owner and last in _SAID else name), "measured"
    words = words.replace("_", " ").replace(".", " ")
    words = words if kind == "measured" or kind in words else f"{words}, {kind}"
    return _cut(words, MOST_LETTERS)


def _lane(ax: Axes, steps: Sequence[tuple[float, float, list[str]]], limits: tuple[float, float]) -> None:
    """Draw the steps as bars above the axes, with labels where these fit."""
    box = ax.get_window_extent()
    height, points = box.height * 72.0 / ax.figure.dpi, box.width * 72.0 / ax.figure.dpi
    lane = ax.inset_axes((0.0, 1.0 + 20.0 / height, 1.0, 13.0 / height))
    lane.set_xlim(*limits)
    lane.set_ylim(0.0, 1.0)
    lane.axis("off")
    for start, end, words in steps:
        a, b = max(start, limits[0]), min(end, limits[1])
        lane.axvspan(a, b, facecolor=SUNKEN, edgecolor=PANEL, lw=1.0)
        room = (b - a) / (limits[1] - limits[0]) * points - 6.0
        fitting = next((w for w in words if w and 0.6 * SMALL * len(w) < room), "")
        lane.text(0.5 * (a + b), 0.45, fitting, fontsize=SMALL, color=INK_2, ha="center", va="center_baseline")


# ---- over another channel


def _upright(record: Recording, across: str) -> list[str]:
    for name in ("tension", "muscle.tension"):
        if name in record and name != across:
            return [name]
    raise InputError("--channels", None, f"must name channels over {across}: {', '.join(record.names())}")


def draw_against(ax: Axes, families: Sequence[ChannelFamily], panel: ChannelPanel, x: ChannelPanel) -> None:
    """Draw the channels of a panel over the one of another panel."""
    (across,) = x.names
    kinds = {name: families[0].parts[0].channels[name].kind for name in panel.names}
    for family, opacity in zip(families, style.graded(len(families), 0.4), strict=True):
        for name in panel.names:
            alike = [n for n in panel.names if kinds[n] == kinds[name]]
            curves: list[Any] = []
            for part in family.parts:
                curves += [path(part.time, part[across] * x.scale(), part[name] * panel.scale()), [[np.nan], [np.nan]]]
            look = _look(kinds, name, alike.index(name), len(alike))
            look["alpha"] = opacity * (0.65 if look["lw"] > style.HEAVY else 1.0)
            label = _key_words(family.parts[0], name) if family is families[-1] else None
            gid = family.words if name == panel.names[0] else None
            ax.plot(*np.concatenate(curves, axis=1), color=style.colour(panel.quantity), label=label, gid=gid, **look)
    _set_range(ax, panel)
    ax.set_xlim(*ax.get_xlim())  # labels at the ends need limits that are final


def _name_families(ax: Axes, families: Sequence[ChannelFamily], panel: ChannelPanel, x: ChannelPanel) -> None:
    """Label each family at the right end of its line, or in a key if the lines end at one place.

    Of very many families only some, evenly chosen.
    """
    some = [family for family in families if family.words]
    if len(some) > MOST_LABELS:
        some = [some[i] for i in np.linspace(0, len(some) - 1, MOST_LABELS).round().astype(int)]
    ends = [(*end, f.words) for f in some if (end := _right_end(f, panel, x)) is not None]
    if not ends:
        return
    units = {_UNITS.get(amount_of(words)[2]) for *_, words in ends}
    quantity = units.pop() if len(units) == 1 else None
    places = sorted(float(ax.transData.transform(end[:2])[1]) * 72.0 / ax.figure.dpi for end in ends)
    if len(places) < 2 or np.diff(places).min() >= 1.5 * SMALL:
        style.end_labels(ax, ends, quantity=quantity)
        return
    lines = {line.get_gid(): line for line in ax.get_lines() if line.get_gid()}
    shown = [f.words for f in some[::-1]]
    handles, colour = [lines[w] for w in shown], style.colour(quantity)
    key = style.key(ax, handles, shown, loc="upper left", bbox_to_anchor=(1.01, 1.02), labelcolor=colour)
    if len(panel.names) > 1:
        ax.add_artist(key)  # the key of the channels would take its place


def _right_end(family: ChannelFamily, panel: ChannelPanel, x: ChannelPanel) -> tuple[float, float] | None:
    part = family.parts[-1]
    across, up = part[x.names[0]], part[panel.names[0]]
    both = np.isfinite(across) & np.isfinite(up)
    if not both.any():
        return None
    # Noise decides which sample lies furthest right: the middle of the last hundredth is steadier.
    right = across[both] >= np.quantile(across[both], 0.99)
    return float(across[both].max()) * x.scale(), float(np.median(up[both][right])) * panel.scale()


def _head(ax: Axes, record: Recording, title: str | None, *, above: float) -> None:
    meta = record.meta
    words = {"specimen": "", "rig": "rig "}
    said = [f"{before}{meta[key]}" for key, before in words.items() if isinstance(meta.get(key), str)]
    if meta.get("result", "done") != "done":
        said.append(str(meta.get("message") or meta["result"]))
    clipped = meta.get("saturation")
    for name, entry in clipped.items() if isinstance(clipped, Mapping) else ():
        share = entry.get("share") if isinstance(entry, Mapping) else None
        if isinstance(share, int | float) and share > 0.0:
            said.append(f"{name} at the end of its range in {100.0 * share:.2g} % of the recording")
    note = ", ".join(said)
    head = str(record.meta.get("title", "")) if title is None else title
    style.heading(ax, head, above=above + (12.0 if note else 0.0))
    if note:
        most = int(ax.figure.bbox.width / ax.figure.dpi * 72.0 * 0.92 / (0.58 * SMALL))
        lines = 1 if formats.current_style().width is None else MOST_LINES
        style.note(ax, _cut(note, lines * most), dy=above, va="bottom")


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}\N{HORIZONTAL ELLIPSIS}"


def _check_known(parts: Sequence[Recording], names: Sequence[str]) -> None:
    for name in names:
        if not any(np.isfinite(part[name]).any() for part in parts):
            raise InputError("--channels", name, "must be a channel with values there")
    if not names:
        raise InputError("recording", None, "must have a channel with values")


RATE = "rate"  # parameter of the protocols that stimulate
LEAST_RATES = 3  # rates that make a curve


@style.styled()
def force_frequency_figure(record: Recording) -> Figure | None:
    """Draw largest and mean active tension over the rate of stimulation; None below `LEAST_RATES` rates."""
    try:
        each = [one for one in stimulated_contractions(record) if RATE in one.case]
    except InputError:
        return None
    points = {read_amount(one.case[RATE], "1/s", field=RATE).value: one for one in each}
    if len(points) < LEAST_RATES or len(points) < len(each):
        return None
    rates = sorted(points)
    fig = style.figure(5.2, 3.4)
    ax = fig.add_axes((0.09, 0.16, 0.86, 0.62))
    mean: dict[str, Any] = {"marker": "o", "ms": 4.0, "ls": (0, (4, 2)), "mfc": style.PANEL}
    looks = (("peak", "largest", {"marker": "^", "ms": 4.5}), ("mean", "mean between the last two stimuli", mean))
    for name, words, look in looks:
        tensions = [getattr(points[rate], name) for rate in rates]
        ax.plot(rates, tensions, color=style.COLOURS["tension"], lw=style.LINE, label=words, **look)
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(left=0.0)
    style.quantity_axes(ax, x=("Rate of stimulation, Hz", None), y=("Active tension, N", "tension"))
    style.heading(ax, "Tension against the rate of stimulation", str(record.meta.get("specimen") or ""), above=24.0)
    ax.legend(loc="lower right", frameon=False, fontsize=style.SMALL, labelcolor=style.INK_2)
    return fig
