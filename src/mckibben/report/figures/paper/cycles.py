"""Figs. 12 and 13 of the paper: working cycles of the nylon muscle and their efficiency, panel by panel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ....analysis.energy import CycleLoops, cycle_loops, energy_curve
from ....reproduction import part4
from .. import style
from ..energy_figures import Line, draw_efficiency, draw_piston, draw_tendon, printed_marks
from ..style import INK, INK_3, RECORDING_DASHES
from .common import entry, key, numbers, panel, sample, title

NO_FRICTION, POTENTIAL = RECORDING_DASHES[1], RECORDING_DASHES[2]
HIGHEST = 10e5  # [Pa]
TALL, ABOVE = 4.0, 36.0  # of the figures [inch], and of their titles over the axes [pt]


def _loops(*names: str) -> list[CycleLoops]:
    """Cycles at 5 bar, each exchanging gas with the surroundings and with the accumulator."""
    return [cycle_loops(part4.muscle(), n, part4.conditions(accumulator=a)) for n in names for a in (False, True)]


@style.styled()
def figure_12a() -> Figure:
    """Pressure over volume of the maximal cycle."""
    rows = [("ABCD", "energy.maximal.input"), ("A′BCD′", "energy.maximal.input_accumulator")]
    return _piston("12a", _loops("maximal"), "Maximal shortening at constant pressure: compressor", rows)


@style.styled()
def figure_12b() -> Figure:
    """Tension over length of the maximal cycle."""
    rows = [("Output", "energy.maximal.output"), ("Ea", "energy.maximal.efficiency"),
            ("Ea, accumulator", "energy.maximal.efficiency_accumulator")]  # fmt: skip
    return _tendon("12b", _loops("maximal"), "Maximal shortening at constant pressure: muscle", rows)


@style.styled()
def figure_12c() -> Figure:
    """Efficiency of the maximal cycle over pressure."""
    fig, ax = panel(TALL, beside=3.85)
    draw_efficiency(ax, efficiency_lines(), printed_marks())
    ax.set_ylim(0.0, 80.0)  # without friction and with the accumulator the threshold would come to 100 %
    title(ax, "12c", "Maximal shortening at constant pressure: efficiency Ea", above=ABOVE)
    rows = [
        ("Ea, 5 bar", "efficiency"), ("Ea, accumulator", "efficiency_accumulator"), ("Largest at", "best_pressure"),
        ("Zero at", "zero_pressure"), ("Largest Wa/W₁₂", "output_below_W12"),
    ]  # fmt: skip
    numbers(ax, [entry(words, f"energy.maximal.{name}") for words, name in rows], dx=82.0)
    key(
        ax, [
            sample("with 2.5 N of friction", color=INK, lw=style.LINE), sample("without", color=INK, ls=NO_FRICTION),
            sample("volume of the potential", color=INK_3, ls=POTENTIAL),
        ], dx=82.0,
    )  # fmt: skip
    return fig


def efficiency_lines() -> list[Line]:
    """Solid with friction and dashed without, as printed; dotted with friction and the volume of the potential."""
    lines = []
    for volume, friction, dash, colour in (
        ("paper", True, "-", INK), ("paper", False, NO_FRICTION, INK), ("potential", True, POTENTIAL, INK_3),
    ):  # fmt: skip
        for accumulator, words in ((False, "surroundings"), (True, "accumulator")):
            muscle, between = part4.muscle(volume), part4.conditions(accumulator=accumulator, friction=friction)
            low = 1e-3 + float(muscle.threshold())
            at = low + (HIGHEST - low) * np.linspace(0.0, 1.0, 121)[1:] ** 2  # dense where it rises
            words = words if (volume, friction) == ("paper", True) else ""
            lines.append(Line(words, energy_curve(muscle, "maximal", at, between), dash, colour))
    return lines


@style.styled()
def figure_13a() -> Figure:
    """Pressure over volume of the isotonic cycles."""
    rows = [("EFGH", "energy.isotonic.input"), ("E′FGH′", "energy.isotonic.input_accumulator"),
            ("EF′GH", "energy.valve.input"), ("E′F′GH′", "energy.valve.input_accumulator")]  # fmt: skip
    return _piston("13a", _loops("isotonic", "valve"), "Isotonic shortening: compressor", rows)


@style.styled()
def figure_13b() -> Figure:
    """Tension over length of the isotonic cycles."""
    rows = [("Output", "energy.isotonic.output"), ("Eb", "energy.isotonic.efficiency"),
            ("Eb, accumulator", "energy.isotonic.efficiency_accumulator"), ("Ec", "energy.valve.efficiency"),
            ("Ec, accumulator", "energy.valve.efficiency_accumulator")]  # fmt: skip
    return _tendon("13b", _loops("isotonic", "valve"), "Isotonic shortening: muscle", rows)


def _piston(figure: str, loops: Sequence[CycleLoops], words: str, rows: Sequence[tuple[str, str]]) -> Figure:
    fig, ax = panel(TALL)
    draw_piston(ax, loops, {})
    title(ax, figure, words, above=ABOVE)
    numbers(ax, [entry(w, r) for w, r in rows])
    return fig


def _tendon(figure: str, loops: Sequence[CycleLoops], words: str, rows: Sequence[tuple[str, str]]) -> Figure:
    fig, ax = panel(TALL)
    draw_tendon(ax, loops, {})
    title(ax, figure, words, above=ABOVE)
    numbers(ax, [entry(w, r) for w, r in rows])
    return fig
