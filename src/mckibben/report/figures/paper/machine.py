"""Figs. 1 and 2 of both papers: the muscle's geometry to scale, and the test machine as it is simulated."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from ....bench.rig_file import rig
from ....muscles.braid import BraidShape, braid_of
from ....muscles.build import law_from_specimen
from ....muscles.laws.thick_wall import ThickWall
from ....quantities import from_si
from ....specimens import specimen
from .. import bench_diagram, style
from ..muscle_figures import muscle_drawing
from ..style import COLOURS, INK, INK_2, INK_3, SMALL, number
from .common import BESIDE, Entry, label, numbers, shown

TRIANGLE = 2.9  # height of the part below the muscle [inch]
SHORT = 0.75  # of the rest length
CM = from_si(1.0, "m", "cm")


@style.styled()
def geometry(figure: str) -> Figure:
    """The nylon muscle at rest and shortened, to scale, and its thread unrolled: a triangle of b, L and n pi D."""
    spec = specimen("nylon")
    law, rest = law_from_specimen(spec, "thick_wall"), spec.property_si("rest_length", "m")
    shape = braid_of(law)
    assert isinstance(law, ThickWall) and shape is not None
    lengths = [rest, SHORT * rest]
    fig = muscle_drawing(
        shape, lengths, title=f"{label(figure)}  Geometry of the nylon muscle", remarks=["at rest", "0.75 L₀"]
    )
    wide, tall = fig.get_size_inches()
    high = tall + TRIANGLE
    fig.set_size_inches(wide, high)
    fig.axes[0].set_position((0.0, TRIANGLE / high, 1.0, tall / high))
    room = wide - BESIDE - 0.4
    ax = fig.add_axes((0.2 / wide, 0.15 / high, room / wide, (TRIANGLE - 0.3) / high))
    ax.set_axis_off()
    ax.set_aspect("equal", anchor="NW")
    for length, strength in zip(lengths, (1.0, 0.45), strict=True):
        _triangle(ax, shape, length * CM, strength)
    threads = shape.thread_length * CM
    ax.set_xlim(-1.0, threads + 0.6)
    ax.set_ylim(-3.0, 13.0)
    diameter = threads / (shape.turns * math.pi)
    numbers(
        ax, [
            Entry("Thread b, cm", shown(threads, 4) + "‡"), Entry("Turns n", shown(shape.turns, 4) + "‡"),
            Entry("D₀ = b/(n π), cm", shown(diameter), "1.66"),
            Entry("Wall tk, cm", shown(float(law.wall_thickness) * CM), "0.0762"),
            *(Entry(f"θ at {number(v * CM)} cm, °", shown(shape.degrees(v))) for v in lengths),
        ], remarks=("‡ not printed: inferred from Kg and D₀",),
    )  # fmt: skip
    return fig


def _triangle(ax: Axes, shape: BraidShape, length: float, strength: float) -> None:
    """One thread unrolled: its length b, along the muscle L, and n turns of the circumference [cm]."""
    threads = shape.thread_length * CM
    around = math.sqrt(threads**2 - length**2)
    look: dict[str, Any] = {"alpha": strength, "solid_capstyle": "round"}
    ax.plot([0.0, length], [0.0, 0.0], color=COLOURS["length"], lw=style.HEAVY, **look)
    ax.plot([length, length], [0.0, around], color=INK_2, lw=style.LINE, **look)
    ax.plot([0.0, length], [0.0, around], color=INK, lw=style.HEAVY, **look)
    angle = math.degrees(math.atan2(around, length))
    size = 4.2 if strength == 1.0 else 5.6
    ax.add_patch(Arc((0.0, 0.0), size, size, theta1=0.0, theta2=angle, color=INK_3, lw=0.9, alpha=strength))
    if strength < 1.0:
        return
    half = math.radians(0.5 * angle)
    words: dict[str, Any] = {"fontsize": style.NORMAL, "color": INK, "ha": "center", "va": "center"}
    ax.text(2.9 * math.cos(half), 2.9 * math.sin(half), "θ", **words)
    ax.text(0.5 * length, -0.9, f"L = {number(length)} cm", **words | {"color": COLOURS["length"]})
    ax.text(length + 0.35, 0.42 * around, f"n π D = {number(around, 1)} cm", **words | {"ha": "left"})
    slope = math.degrees(math.atan2(around, length))
    ax.text(
        0.47 * length + 0.45, 0.47 * around - 0.75, f"b = {number(threads)} cm", **words | {"rotation": slope},
        rotation_mode="anchor",
    )  # fmt: skip
    ax.text(0.5 * length, -2.1, "grey: the same thread at 0.75 L₀", **words | {"fontsize": SMALL, "color": INK_3})


@style.styled()
def machine(figure: str) -> Figure:
    """Hardware and software of the simulated test machine."""
    return bench_diagram.draw(rig("paper"), title=f"{label(figure)}  Dynamic testing machine")
