"""Figures of a characterisation: loops with the fitted law and friction, relaxation, and held-out points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...quantities import from_si
from ...studies.characterisation.evaluation import HeldOut, relaxation_curve
from ...studies.characterisation.stages import ISOBARS
from ...studies.characterisation.verb import Characterisation
from . import style
from .style import COLOURS, INK, INK_3, PANEL, RULE, SUNKEN, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FINE = 61


@style.styled()
def loops_figure(found: Characterisation) -> Figure:
    """Draw measured tension over span of the map's loops, with the fitted muscle while it shortens and lengthens."""
    fig = style.figure(style.MIDDLE, 4.7)
    ax = fig.add_axes((0.09, 0.11, 0.8, 0.74))
    record, muscle, cm = found.records["map"], found.muscle, from_si(1.0, "m", "cm")
    colour, ends = COLOURS["tension"], []
    for i in range(1, ISOBARS + 1):
        parts = [record.segments(f"{way} {i}")[0] for way in ("shorten", "lengthen")]
        low, high = (float(f(parts[0]["span"])) for f in (np.min, np.max))
        if high - low < 0.01 * found.bounds.rest_length:
            continue
        pressure = float(np.mean(parts[0]["pressure"]))
        for part in parts:
            ax.plot(part["span"] * cm, part["tension"], color=INK_3, lw=style.HAIR, zorder=1)
        lengths = np.linspace(low, high, FINE)
        for way in (-1.0, 1.0):
            tension = np.asarray(muscle.quasi_static_tension(lengths, pressure, way))
            ax.plot(lengths * cm, tension, color=colour, lw=style.LINE, zorder=2)
        bar = style.pressure_text(from_si(pressure, "Pa", "bar"), unit=i == ISOBARS)
        ends.append((float(high * cm), float(parts[0]["tension"][0]), bar))
    room = 0.02 * (found.bounds.rest_length - float(record["span"].min())) * cm
    ax.set_xlim(float(record["span"].min()) * cm - room, found.bounds.rest_length * cm + room)
    ax.set_ylim(-0.02 * found.evaluation.largest, 1.08 * float(record["tension"].max()))
    style.quantity_axes(ax, x=("Span, cm", "length"), y=("Tension, N", "tension"))
    style.end_labels(ax, ends, quantity="pressure")
    style.heading(ax, "Loops of the map", "gray: measured\N{EM SPACE}— fitted, full friction either way", above=24.0)
    return fig


@style.styled()
def relaxation_figure(found: Characterisation) -> Figure:
    """Draw the tension after the stretch, measured and fitted."""
    fig = style.figure(style.NARROW, 2.9)
    ax = fig.add_axes((0.16, 0.17, 0.8, 0.62))
    time, measured, fitted = relaxation_curve(found.records, found.evaluation)
    ax.plot(time, measured, color=INK_3, lw=style.HAIR, zorder=1)
    ax.plot(time, fitted, color=COLOURS["tension"], lw=style.LINE, zorder=2)
    style.quantity_axes(ax, x=("Time since the stretch, s", None), y=("Tension, N", "tension"))
    total = found.evaluation.relaxation.total
    style.heading(ax, "Relaxation", f"{number(total.value / 100.0, 3)} N/cm from 1 s to 30 s", above=22.0)
    return fig


@style.styled()
def held_out_figure(found: Characterisation) -> Figure:
    """Draw the errors of the held-out points over the measured tension, with the 95 % interval."""
    fig = style.figure(style.NARROW, 2.9)
    ax = fig.add_axes((0.16, 0.17, 0.8, 0.62))
    _held_out(ax, found.evaluation.held_out, found.evaluation.half_width)
    share = 100.0 * found.held_out_error
    style.heading(ax, "Held-out points", f"rms {number(share, 2)} % of the largest", above=22.0)
    return fig


def _held_out(ax: Axes, points: tuple[HeldOut, ...], half: float) -> None:
    measured = np.array([p.measured for p in points])
    error = np.array([p.predicted - p.measured for p in points])
    ax.axhspan(-half, half, color=SUNKEN, ec=RULE, lw=style.HAIR, zorder=0)
    ax.axhline(0.0, color=INK_3, lw=style.HAIR, zorder=1)
    ax.plot(measured, error, style.MARKERS["tension"], mfc=COLOURS["tension"], mec=PANEL, mew=0.4, ms=4.5, zorder=2)
    ax.set_ylim(-1.6 * max(half, float(np.abs(error).max())), 1.6 * max(half, float(np.abs(error).max())))
    style.quantity_axes(ax, x=("Measured tension, N", "tension"), y=("Predicted less measured, N", "tension"))
    ax.text(0.99, 0.04, "band: 95 %", transform=ax.transAxes, ha="right", va="bottom", fontsize=style.SMALL, color=INK)
