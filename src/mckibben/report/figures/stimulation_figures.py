"""Figures of stimulated muscles: tension against the rate of stimulation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...analysis.stimulation import stimulated_contractions
from ...errors import InputError
from ...experiments.amounts import read_amount
from ...recordings import Recording
from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RATE = "rate"  # parameter of the protocols that stimulate
LEAST = 3  # rates that make a curve
WIDTH, HEIGHT = 5.2, 3.4  # [inch]


@style.styled()
def force_frequency_figure(record: Recording) -> Figure | None:
    """Draw largest and mean active tension over the rate of stimulation; None unless `LEAST` rates tell steps apart."""
    try:
        each = [one for one in stimulated_contractions(record) if RATE in one.case]
    except InputError:
        return None
    points = {read_amount(one.case[RATE], "1/s", field=RATE).value: one for one in each}
    if len(points) < LEAST or len(points) < len(each):
        return None
    rates = sorted(points)
    fig = style.figure(WIDTH, HEIGHT)
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
