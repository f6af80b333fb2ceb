"""A run of a circuit: pressures, flows, tensions, lengths and commands over one time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...errors import InputError
from ...quantities import from_si
from ...recordings.recording import Recording
from . import style
from .style import COLOURS, RECORDING_DASHES

WIDTH = 8.4  # [inch]
POINTS = 4000  # per line; more than a page can show


class Panel(NamedTuple):
    """One pair of axes: what it shows, in which unit, in whose colour."""

    title: str
    quantity: str
    unit: str
    si_unit: str
    names: list[str]


@style.styled()
def run_figure(recording: Recording) -> Figure:
    """What happened in a circuit, one panel per quantity.

    Args:
        recording: as `mckibben.bench.circuit_run.run_circuit` makes it, or one with channels of those names.

    Raises:
        InputError: if it has none of the quantities that are drawn.
    """
    panels = _panels(recording)
    if not panels:
        raise InputError("recording", "no channel", "allowed is one with pressures, flows, lengths or commands")
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
        _draw(ax, recording, panel, last=last)
        if i == 0:
            meta = recording.meta
            style.heading(ax, str(meta.get("title", "")), _note(recording), above=30.0)
    return fig


def _note(recording: Recording) -> str:
    closed = recording.meta.get("balance")
    text = f"mass closes to {closed['mass']:.0e}, energy to {closed['energy']:.0e}" if closed else ""
    late = [w.split(" ")[0] for w in recording.meta.get("warnings", ()) if "has not settled" in str(w)]
    if late:
        text += f"; not settled: {', '.join(late)}"
    return text if recording.meta.get("result", "done") == "done" else f"{recording.meta.get('message', '')} {text}"


def _panels(recording: Recording) -> list[Panel]:
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
        Panel("Pressure, bar", "pressure", "bar", "Pa", [*_moving(recording, pressures), *wanted]),
        Panel("Mass flow, g/s", "flow", "g/s", "kg/s", _moving(recording, flows)),
        Panel("Tension, N", "tension", "N", "N", [n for n in names if n.endswith(".tension")]),
        Panel("Length, cm", "length", "cm", "m", lengths),
        Panel(
            "Command and opening",
            "valve",
            "1",
            "1",
            [*[n for n in fixed if units[n] == "1"], *_moving(recording, openings)],
        ),
    ]
    return [p for p in panels if p.names]


def _moving(recording: Recording, names: list[str]) -> list[str]:
    """Those that are not constant zero; an atmosphere says nothing."""
    return [n for n in names if np.nanmax(np.abs(recording[n]), initial=0.0) > 0.0]


def _draw(ax: Axes, recording: Recording, panel: Panel, *, last: bool) -> None:
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
    ax.legend(
        loc="upper left", bbox_to_anchor=(1.005, 1.06), frameon=False, fontsize=style.SMALL, handlelength=2.8,
        labelcolor=style.colour(panel.quantity), labelspacing=0.35, borderpad=0.2,
    )  # fmt: skip


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most some thousand points of a line; the extremes of every stretch are kept, for peaks must survive."""
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
    """A channel's name without the quantity that its panel states."""
    for ending in (".pressure", ".mass_flow", ".tension", ".length"):
        name = name.removesuffix(ending)
    return name.replace("_", " ").replace(".", " ")
