"""Figures of frequency responses, with the coherence of measured ones; and of repeatability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...analysis.frequency import FrequencyResponse
from ...analysis.repeatability import Repeatability
from . import style
from .style import INK, INK_3, RULE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT, FOOT, TOP, GAP = 0.62, 0.5, 0.8, 0.5  # around and between the axes [inch]
MAGNITUDE, PHASE, COHERENCE = 2.1, 1.5, 0.8  # heights of the axes [inch]


class BodeTitles(NamedTuple):
    """Texts of a Bode figure: its heading, the note after it, and the unit of the magnitude."""

    heading: str
    note: str = ""
    unit: str = ""


@style.styled()
def bode_figure(response: FrequencyResponse, titles: BodeTitles, *, cutoff: float = float("nan")) -> Figure:
    """Draw magnitude and phase over frequency, with the coherence if it is below one somewhere.

    Args:
        response: at frequencies in rising order.
        titles: texts of the figure.
        cutoff: frequency that is marked [Hz]; none if it is not a number.
    """
    measured = bool(np.any(response.coherence < 1.0))
    heights = [MAGNITUDE, PHASE, *([COHERENCE] if measured else [])]
    height = TOP + sum(heights) + GAP * (len(heights) - 1) + FOOT
    fig = style.figure(style.MIDDLE, height)
    axes: list[Axes] = []
    top = height - TOP
    for own in heights:
        box = (LEFT / style.MIDDLE, (top - own) / height, 1.0 - (LEFT + 0.3) / style.MIDDLE, own / height)
        axes.append(fig.add_axes(box, sharex=axes[0] if axes else None))
        top -= own + GAP
    unit = f", {titles.unit}" if titles.unit else ""
    _course(axes[0], response.frequency, response.magnitude, f"Magnitude{unit}", log=True)
    _course(axes[1], response.frequency, np.degrees(response.phase), "Phase, degrees")
    if measured:
        _course(axes[2], response.frequency, response.coherence, "Coherence")
        axes[2].set_ylim(0.0, 1.05)
    style.heading(axes[0], titles.heading, titles.note, above=30.0)
    if np.isfinite(cutoff):
        for ax in axes[:2]:
            ax.axvline(cutoff, color=INK_3, lw=0.9, ls=(0, (4, 2.3)))
        axes[0].annotate(
            f"\N{MINUS SIGN}3 dB at {cutoff:.3g} Hz",
            (cutoff, 0.04),
            xycoords=("data", "axes fraction"),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            fontsize=style.SMALL,
            color=INK_3,
        )
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel("Frequency, Hz", color=INK, fontweight="bold", fontsize=style.SMALL + 0.5, labelpad=3)
    return fig


def _course(ax: Axes, frequency: np.ndarray, values: np.ndarray, title: str, *, log: bool = False) -> None:
    style.quantity_axes(ax, x=("", None), y=(title, None))
    ax.set_xscale("log")
    if log:
        ax.set_yscale("log")
    marks: dict[str, Any] = {"marker": "o", "ms": 3.0} if len(frequency) <= 40 else {}
    ax.plot(frequency, values, color=INK, lw=style.LINE, **marks)
    ax.margins(x=0.02)


@style.styled()
def repeatability_figure(repeatability: Repeatability, *, title: str, channel: str, over: str) -> Figure:
    """Draw every repetition faintly with the mean course, and below the deviation of each from the mean.

    Args:
        repeatability: the repetitions, in the unit in which they are shown.
        title: title of the figure.
        channel: title of the channel with its unit, such as ``"Tension, N"``.
        over: title of the axis below, such as ``"Phase of the cycle"``.
    """
    upper, lower = 2.4, 1.2
    height = TOP + upper + GAP + lower + FOOT
    fig = style.figure(style.MIDDLE, height)
    across = (LEFT / style.MIDDLE, 1.0 - (LEFT + 0.3) / style.MIDDLE)
    top = fig.add_axes((across[0], (height - TOP - upper) / height, across[1], upper / height))
    low = fig.add_axes((across[0], FOOT / height, across[1], lower / height), sharex=top)
    mean = repeatability.courses.mean(axis=0)
    quantity = channel.partition(",")[0].lower()
    shade = style.colour(quantity if quantity in style.COLOURS else None)
    for course in repeatability.courses:
        top.plot(repeatability.at, course, color=shade, lw=0.7, alpha=0.35)
        low.plot(repeatability.at, course - mean, color=shade, lw=0.7, alpha=0.5)
    top.plot(repeatability.at, mean, color=INK, lw=style.HEAVY)
    low.axhline(0.0, color=RULE, lw=0.8)
    style.quantity_axes(top, x=("", None), y=(channel, quantity if quantity in style.COLOURS else None))
    style.quantity_axes(low, x=(over, None), y=(f"Distance from the mean,{channel.partition(',')[2]}", None))
    top.tick_params(labelbottom=False)
    top.margins(x=0.0)
    style.heading(top, title, f"{repeatability.repetitions} repetitions and their mean", above=30.0)
    return fig
