"""Figures of controllers on a bench: wanted and true output with what they command, and errors on all plants."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...control.references import SKIPPED
from ...control.scores import ControlScores
from ...errors import InputError
from . import style
from .places import describe
from .style import INK, INK_2, INK_3, RECORDING_DASHES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT = 6.2  # [inch]
SHOWN = 12.0  # of a run, from its end [s]
MOST = 3  # controllers whose course is drawn
SHOWN_UNITS = {"m": (1e3, "mm", "Stroke", "length"), "rad": (1e3, "mrad", "Angle", "length")}


@style.styled()
def control_figure(scores: ControlScores) -> Figure:
    """Draw courses of the plant of median error, errors below them, and the tracking errors on every plant.

    Args:
        scores: of some controllers; courses are those of the first three.

    Raises:
        InputError: there is no run.
    """
    if not scores.runs:
        raise InputError("scores", None, "must hold a run")
    scale, unit, title, quantity = SHOWN_UNITS[scores.unit]
    fig = style.figure(style.WIDE, HEIGHT)
    course, error, plants = (fig.add_axes(place) for place in ((0.06, 0.6, 0.58, 0.28), (0.06, 0.17, 0.58, 0.3),
                                                               (0.76, 0.17, 0.22, 0.71)))  # fmt: skip
    colour, lines = style.colour(quantity), list(scores.runs.items())[:MOST]
    for (name, run), dash in zip(lines, RECORDING_DASHES, strict=False):
        time = np.linspace(0.0, scores.duration, len(run.wanted), endpoint=False)
        last = time >= max(scores.duration - SHOWN, SKIPPED)
        if dash == "-":
            course.plot(time[last], scale * run.wanted[last], color=INK_3, lw=style.HEAVY, label="wanted")
        course.plot(time[last], scale * run.output[last], color=colour, lw=style.LINE, linestyle=dash, label=name)
        off = scale * (run.output - run.wanted)[last]
        error.plot(time[last], off, color=INK, lw=style.LINE, linestyle=dash, label=name)
    error.axhline(0.0, color=INK_3, lw=style.HAIR)
    style.quantity_axes(course, x=("", None), y=(f"{title}, {unit}", quantity))
    style.quantity_axes(error, x=("Time, s", None), y=(f"Error, {unit}", None))
    style.key(course, loc="lower left", bbox_to_anchor=(0.3, 1.0), ncols=MOST + 1)
    of = "plant not seen of median error" if any(scores.unseen.values()) else "plant that it was built on"
    style.heading(course, f"Bench {scores.bench}, reference {scores.reference}", f"on the {of}", above=30.0)
    every = list(scores.unseen)
    for k, name in enumerate(every):
        values = [scale * one.tracking for one in scores.unseen[name].values()]
        plants.plot([k] * len(values), values, "o", ms=3.5, color=INK_2, alpha=0.6, mew=0)
        if values:
            plants.plot([k - 0.3, k + 0.3], [np.median(values)] * 2, color=INK, lw=style.HEAVY)
        if "nominal" in scores.known[name]:
            plants.plot([k], [scale * scores.known[name]["nominal"].tracking], "x", ms=5, color=INK)
    style.quantity_axes(plants, x=("", None), y=(f"Tracking error, {unit}", None))
    plants.set_xticks(range(len(every)), every, rotation=35, ha="right", fontsize=style.SMALL)
    plants.set_xlim(-0.6, len(every) - 0.4)
    plants.set_ylim(bottom=0.0)
    style.heading(plants, "Each plant", "bar: median, cross: built on", above=30.0)
    describe(fig, f"bench {scores.bench}, reference {scores.reference}, {scores.duration:g} s, simulated")
    return fig
