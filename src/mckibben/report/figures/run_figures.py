"""Figures of runs over time: of a circuit with its fit to records, and of a joint with two muscles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...identification import CircuitFit, Trial
from ...quantities import from_si
from ...recordings.recording import Recording
from . import formats, style
from .places import BannerRow, Margins, describe, recording_source, set_margins
from .recording_figures import checked_names, envelope
from .style import COLOURS, DASHES, INK, INK_2, INK_3, RECORDING_DASHES, RULE, SMALL, SUNKEN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch


WIDTH = 8.4  # [inch]
POINTS = 4000  # per line; more than a page can show


class CircuitPanel(NamedTuple):
    """A pair of axes: quantity, unit and colour."""

    title: str
    quantity: str
    unit: str
    si_unit: str
    names: list[str]


@style.styled()
def run_figure(recording: Recording) -> Figure:
    """Draw the recording of a circuit, one panel per quantity.

    Args:
        recording: as `mckibben.bench.circuit_run.run_circuit` makes it, or one with channels of those names.

    Raises:
        InputError: if it has none of the quantities that are drawn.
    """
    panels = _panels(recording)
    if not panels:
        raise InputError("recording", None, "must have pressures, flows, lengths or commands")
    top, each, gap, foot = 0.75, 1.25, 0.42, 0.5  # [inch]
    heights = [
        each * (1.6 if p.title.startswith("Pressure") else 0.7 if p.quantity == "valve" else 1.0) for p in panels
    ]
    height = top + sum(heights) + gap * (len(panels) - 1) + foot
    fig = style.figure(WIDTH, height)
    y = height - top
    for i, (panel, own) in enumerate(zip(panels, heights, strict=True)):
        ax = fig.add_axes((0.06, (y - own) / height, 0.7, own / height))
        y -= own + gap
        last = i == len(panels) - 1
        _draw_circuit(ax, recording, panel, last=last)
        if i == 0:
            meta = recording.meta
            style.heading(ax, str(meta.get("title", "")), _note(recording), above=30.0)
    describe(fig, recording_source(recording))
    return fig


def _note(recording: Recording) -> str:
    closed = recording.meta.get("balance")
    text = f"mass closes to {closed['mass']:.0e}, energy to {closed['energy']:.0e}" if closed else ""
    late = [w.split(" ")[0] for w in recording.meta.get("warnings", ()) if "has not settled" in str(w)]
    if late:
        text += f"; not settled: {', '.join(late)}"
    return text if recording.meta.get("result", "done") == "done" else f"{recording.meta.get('message', '')} {text}"


def _panels(recording: Recording) -> list[CircuitPanel]:
    names = recording.names()
    units = {n: recording.unit(n) for n in names}
    fixed = recording.names("command")
    pressures = [n for n in names if n.endswith(".pressure") and n not in fixed]
    # volumes first: what is given stands behind what follows
    pressures.sort(key=lambda n: f"{n.removesuffix('.pressure')}.mass" not in names)
    lengths = [n for n in names if n.endswith(".length") and np.ptp(recording[n]) > 0.0]
    wanted = [n for n in fixed if units[n] == "Pa"]
    flows = [n for n in names if n.endswith(".mass_flow")]
    openings = [n for n in names if n.endswith(("opening", ".position", ".running")) and n not in fixed]
    panels = [
        CircuitPanel("Pressure, bar", "pressure", "bar", "Pa", [*_moving(recording, pressures), *wanted]),
        CircuitPanel("Mass flow, g/s", "flow", "g/s", "kg/s", _moving(recording, flows)),
        CircuitPanel("Tension, N", "tension", "N", "N", [n for n in names if n.endswith(".tension")]),
        CircuitPanel("Length, cm", "length", "cm", "m", lengths),
        CircuitPanel(
            "Command and opening",
            "valve",
            "1",
            "1",
            [*[n for n in fixed if units[n] == "1"], *_moving(recording, openings)],
        ),
    ]
    return [p for p in panels if p.names]


def _moving(recording: Recording, names: list[str]) -> list[str]:
    """Names of the channels that are not constant zero, such as an atmosphere."""
    return [n for n in names if np.nanmax(np.abs(recording[n]), initial=0.0) > 0.0]


def _draw_circuit(ax: Axes, recording: Recording, panel: CircuitPanel, *, last: bool) -> None:
    scale = from_si(1.0, panel.si_unit, panel.unit)
    time = recording.time
    opacities = style.graded(len(panel.names), 0.4)[::-1]
    commands = set(recording.names("command"))
    for i, (name, opacity) in enumerate(zip(panel.names, opacities, strict=True)):
        t, values = thinned(time, recording[name] * scale)
        ax.plot(
            t,
            values,
            color=COLOURS[panel.quantity],
            lw=style.LINE + 0.2,
            alpha=opacity,
            linestyle=RECORDING_DASHES[i % len(RECORDING_DASHES)],
            drawstyle="steps-post" if name in commands and panel.quantity == "valve" else "default",
            label=_short(name),
            zorder=3 - 0.01 * i,
        )
    ax.set_xlim(float(time[0]), float(time[-1]))
    low, high = ax.get_ylim()
    if panel.quantity == "valve":
        ax.set_ylim(min(low, -0.08), max(high, 1.08))
    elif panel.quantity in ("pressure", "tension") and low > 0.0:
        ax.set_ylim(0.0 if low < 0.6 * high else low, high)
    style.quantity_axes(ax, x=("Time, s" if last else "", None), y=(panel.title, panel.quantity))
    if not last:
        ax.tick_params(labelbottom=False)
    # A key and not labels at the ends: pressures that were different have become equal there.
    style.key(
        ax, loc="upper left", bbox_to_anchor=(1.005, 1.06), handlelength=2.8, labelcolor=style.colour(panel.quantity)
    )


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduce a line to some thousand points; the extremes of every section are kept, so that peaks survive."""
    count = len(values)
    if count <= POINTS:
        return time, values
    edges = np.linspace(0, count, POINTS // 2 + 1).astype(int)
    keep = {0, count - 1}
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        keep |= {a + int(np.argmin(values[a:b])), a + int(np.argmax(values[a:b]))}
    at = np.array(sorted(keep))
    return time[at], values[at]


def _short(name: str) -> str:
    """Name of a channel without the quantity of its panel."""
    for ending in (".pressure", ".mass_flow", ".tension", ".length"):
        name = name.removesuffix(ending)
    return name.replace("_", " ").replace(".", " ")


PRESSURE = ".pressure_abs"
MOST_COLUMNS, LEAST_COLUMN = 3, 3.0  # columns, and the width of one in a narrow figure [inch]
FINE = 0.1e5  # residuals within this are shown in mbar [Pa]
# Of the figure [inch]: margins, the key at the right, panels and what stands between them.
LEFT, KEY, BETWEEN, TOP, FOOT = 0.62, 1.75, 0.3, 1.0, 0.5
UPPER, LOWER, GAP, STEP = 2.1, 1.05, 0.42, 1.12
LETTER = 0.082  # width of a bold letter [inch]


@style.styled()
def overview(fit: CircuitFit, trials: Sequence[Trial], *, title: str) -> Figure:
    """Draw one column per record: absolute pressures, measured and modelled, and their difference on a common scale.

    Records that the fit did not see stand on grey.

    Args:
        fit: the fit.
        trials: all its records, fitted and predicted.
        title: title of the circuit.

    Raises:
        InputError: if no record holds a pressure.
    """
    channels = list(dict.fromkeys(c for t in trials for c in t.channels if c.endswith(PRESSURE)))
    if not channels:
        raise InputError("records", None, "must have the pressure of a volume")
    shown = [t for t in trials if any(c in channels for c in t.channels)]
    columns = len(shown) if len(shown) <= MOST_COLUMNS else 2 if len(shown) == 4 else MOST_COLUMNS
    columns = min(columns, max(int(formats.drawn_width(style.WIDE) / LEAST_COLUMN), 1))
    lines = math.ceil(len(shown) / columns)
    width = style.MIDDLE + 0.6 if columns == 1 else style.WIDE
    each = UPPER + GAP + LOWER
    height = TOP + lines * each + (lines - 1) * STEP + FOOT
    column_width = (width - LEFT - KEY - (columns - 1) * BETWEEN) / columns
    fig = style.figure(width, height)
    levels, limit = _levels(fit, shown, channels), _limit(fit, shown, channels)
    unit = "mbar" if limit < FINE else "bar"
    for i, trial in enumerate(shown):
        line, column = divmod(i, columns)
        x, y = LEFT + column * (column_width + BETWEEN), height - TOP - line * (each + STEP)
        upper = fig.add_axes((x / width, (y - UPPER) / height, column_width / width, UPPER / height))
        lower = fig.add_axes((x / width, (y - each) / height, column_width / width, LOWER / height), sharex=upper)
        _draw_trial(upper, lower, trial, fit, channels, unit)
        upper.set_ylim(*levels)
        lower.set_ylim(from_si(-limit, "Pa", unit), from_si(limit, "Pa", unit))
        _titles(upper, lower, unit, first=column == 0)
        letters = int(column_width / LETTER)
        name = Path(trial.name).name
        name = name if len(name) <= letters else "…" + name[1 - letters :]
        style.heading(upper, name, above=31.0)
        errors = [e for e in fit.errors if e.trial == trial.name and e.channel.endswith(PRESSURE)]
        rms = float(np.sqrt(np.mean([e.rms**2 for e in errors])))
        largest = max(e.largest for e in errors)
        word = "fitted" if _fitted(fit, trial) else "predicted"
        text = f"{word}: rms {_told(rms)}, largest {_told(largest)}"
        style.note(upper, text, y=1.0, dy=20.0, va="bottom", color=INK_2)
        if i == columns - 1:
            _key(upper, channels, grey=not all(_fitted(fit, t) for t in shown))
    y = 1.0 - 0.14 / height
    head = fig.text(LEFT / width, y, title, fontsize=style.NORMAL + 1.5, fontweight="bold", va="top", color=INK)
    set_margins(fig, Margins(banner=(BannerRow(head),)))
    return fig


def _draw_trial(upper: Axes, lower: Axes, trial: Trial, fit: CircuitFit, channels: Sequence[str], unit: str) -> None:
    time = trial.period * np.arange(trial.samples + 1)
    bar, fine = from_si(1.0, "Pa", "bar"), from_si(1.0, "Pa", unit)
    for i, channel in enumerate(channels):
        if channel not in trial.channels:
            continue
        measured, predicted = np.asarray(trial.measured[channel]), fit.predicted[trial.name][channel]
        look: Any = {"color": COLOURS["pressure"], "alpha": _opacity(i, channels), "ls": _dash(i)}
        upper.plot(*thinned(time, predicted * bar), lw=style.HEAVY + 0.3, zorder=2.5, **look)
        upper.plot(*thinned(time, measured * bar), color=INK, lw=0.6, zorder=3)
        lower.plot(*thinned(time, (predicted - measured) * fine), lw=style.LINE - 0.3, zorder=2.5, **look)
    lower.axhline(0.0, color=INK_3, lw=style.HAIR, zorder=2)
    upper.set_xlim(float(time[0]), float(time[-1]))
    upper.tick_params(labelbottom=False)
    if not _fitted(fit, trial):
        for ax in (upper, lower):
            ax.set_facecolor(SUNKEN)
            ax.grid(color=RULE)


def _titles(upper: Axes, lower: Axes, unit: str, *, first: bool) -> None:
    from matplotlib.ticker import MaxNLocator

    style.quantity_axes(upper, x=("", None), y=("Pressure, bar abs" if first else "", "pressure"))
    style.quantity_axes(lower, x=("Time, s", None), y=(f"Predicted less measured, {unit}" if first else "", "pressure"))
    lower.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    for ax in (upper, lower):
        ax.tick_params(labelleft=first)


def _told(pressure: float) -> str:
    unit = "mbar" if pressure < FINE else "bar"
    rounded = float(f"{from_si(pressure, 'Pa', unit):.2g}")
    return f"{style.number(rounded)}\N{NO-BREAK SPACE}{unit}"


def _key(ax: Axes, channels: Sequence[str], *, grey: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [Line2D([], [], color=INK, lw=0.6, label="measured")]
    for i, channel in enumerate(channels):
        name = channel.removesuffix(PRESSURE).replace("_", " ")
        name = name if len(name) <= 17 else name[:16] + "…"
        look: Any = {"color": COLOURS["pressure"], "alpha": _opacity(i, channels), "ls": _dash(i)}
        handles.append(Line2D([], [], lw=style.HEAVY + 0.3, label=name if i else f"{name}, predicted", **look))
    colours = [INK, *[COLOURS["pressure"]] * len(channels), INK_2]
    if grey:
        handles.append(Patch(fc=SUNKEN, ec=RULE, lw=style.HAIR, label="not seen by the fit"))
    style.key(
        ax,
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(1.01, 1.03),
        handlelength=2.8,
        labelcolor=colours[: len(handles)],
    )


def _fitted(fit: CircuitFit, trial: Trial) -> bool:
    return any(e.fitted for e in fit.errors if e.trial == trial.name)


def _opacity(i: int, channels: Sequence[str]) -> float:
    return style.graded(len(channels), 0.45)[::-1][i]


def _dash(i: int) -> Any:
    return RECORDING_DASHES[i % len(RECORDING_DASHES)]


def _levels(fit: CircuitFit, trials: Sequence[Trial], channels: Sequence[str]) -> tuple[float, float]:
    """Limits of the pressure axis [bar]: all measured values, and predicted ones not far beyond."""
    known = np.concatenate([np.asarray(t.measured[c]) for t in trials for c in channels if c in t.channels])
    low, high = float(known.min()), float(known.max())
    room = 0.6 * max(high - low, 0.01 * high, 1.0)
    model = np.concatenate([fit.predicted[t.name][c] for t in trials for c in channels if c in t.channels])
    low, high = (min(low, max(float(model.min()), low - room, 0.0)), max(high, min(float(model.max()), high + room)))
    edge = 0.05 * max(high - low, 1.0)
    return from_si(low - edge, "Pa", "bar"), from_si(high + edge, "Pa", "bar")


def _limit(fit: CircuitFit, trials: Sequence[Trial], channels: Sequence[str]) -> float:
    """Limit of the axes of differences [Pa]: the largest one, but not more than the largest measured value."""
    pairs = [(fit.predicted[t.name][c], np.asarray(t.measured[c])) for t in trials for c in channels if c in t.channels]
    largest = max(float(np.abs(predicted - measured).max()) for predicted, measured in pairs)
    highest = max(float(measured.max()) for _, measured in pairs)
    return 1.1 * max(min(largest, highest), 1.0)


JOINT_WIDTH = 8.4  # [inch]


class _Line(NamedTuple):
    """A channel, its label in the key, and whether it is a set-point or the second of two."""

    name: str
    words: str
    look: str = "solid"


class _JointPanel(NamedTuple):
    heading: str
    quantity: str | None
    scale: float
    lines: tuple[_Line, ...]
    height: float = 1.0


ANGLE = (_Line("command.angle", "set-point", "asked"), _Line("angle", "measured"))
STIFFNESS = (_Line("command.stiffness", "set-point", "asked"), _Line("joint.stiffness", "of the muscles"))
PRESSURES = (_Line("flexor_pressure", "flexor"), _Line("extensor_pressure", "extensor", "second"))
MOMENT = (_Line("moment.command", "from outside"),)
_LOOKS: dict[str, dict[str, Any]] = {
    "solid": {"lw": style.LINE + 0.2, "linestyle": "-", "zorder": 2.4},
    "second": {"lw": style.LINE + 0.2, "linestyle": style.RECORDING_DASHES[1], "zorder": 2.4},
    "asked": {"lw": style.LINE, "linestyle": DASHES["length"], "zorder": 2.6, "alpha": 0.55},
}


@style.styled()
def joint_figure(record: Recording, *, title: str | None = None) -> Figure:
    """Draw angle, stiffness, pressures, and external moment over time; grey while the loop is off.

    Args:
        record: such as `bench.joint_run.run_joint` gives.
        title: instead of the recording's own.

    Raises:
        InputError: if a channel is missing.
    """
    bar = from_si(1.0, "Pa", "bar")
    drawn = [
        _JointPanel("Angle, rad", None, 1.0, ANGLE, 1.25),
        _JointPanel("Stiffness, N m/rad", None, 1.0, STIFFNESS),
        _JointPanel("Pressure, bar", "pressure", bar, PRESSURES),
        _JointPanel("Moment, N m", None, 1.0, MOMENT, 0.6),
    ]
    checked_names(record, [line.name for p in drawn for line in p.lines])
    if not np.any(record["moment.command"]):
        drawn = drawn[:-1]
    top, each, gap, foot = 0.62, 1.3, 0.42, 0.5  # [inch]
    heights = [each * p.height for p in drawn]
    height = top + sum(heights) + gap * (len(drawn) - 1) + foot
    fig = style.figure(JOINT_WIDTH, height)
    y = height - top
    for i, (panel, own) in enumerate(zip(drawn, heights, strict=True)):
        ax = fig.add_axes((0.065, (y - own) / height, 0.755, own / height))
        y -= own + gap
        _draw_joint(ax, record, panel)
        last = i == len(drawn) - 1
        style.quantity_axes(ax, x=("Time, s" if last else "", None), y=(panel.heading, panel.quantity))
        if not last:
            ax.tick_params(labelbottom=False)
        if i == 0:
            style.heading(ax, str(record.meta.get("title", "")) if title is None else title, above=24.0)
    describe(fig, recording_source(record))
    return fig


def _draw_joint(ax: Axes, record: Recording, panel: _JointPanel) -> None:
    colour = style.colour(panel.quantity)
    for line in panel.lines:
        ax.plot(
            *envelope(record.time, record[line.name] * panel.scale), color=colour, label=line.words, **_LOOKS[line.look]
        )
    low, high = ax.get_ylim()
    ax.set_ylim(0.0 if 0.0 < low < 0.6 * high else low, high)
    ax.set_xlim(float(record.time[0]), float(record.time[-1]))
    for start, end in _off(record):
        ax.axvspan(start, end, facecolor=SUNKEN, edgecolor="none", zorder=0.5)
        if panel.lines is ANGLE:
            where = ax.get_xaxis_transform()
            ax.text(start, 0.02, " loop off", transform=where, fontsize=SMALL, color=style.INK_2, va="bottom")
    style.key(ax, loc="upper left", bbox_to_anchor=(1.005, 1.1), labelcolor=colour)


def _off(record: Recording) -> list[tuple[float, float]]:
    """Intervals in which the angle is not fed back: starts and ends [s]."""
    if "loop.active" not in record:
        return []
    off = np.concatenate([[False], record["loop.active"] < 0.5, [False]])
    begins, ends = np.flatnonzero(~off[:-1] & off[1:]), np.flatnonzero(off[:-1] & ~off[1:])
    last = len(record) - 1
    return [(float(record.time[a]), float(record.time[min(int(b), last)])) for a, b in zip(begins, ends, strict=True)]
