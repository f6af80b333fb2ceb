"""Where the exergy of a run went, as streams whose width is their energy: the gas above, the muscle's share of it below.

Both pictures balance by themselves: what enters on the left leaves on the right, and a remainder is a stream of its own. The
muscle's is drawn to a scale of its own, for what becomes work is mostly a few hundredths of what the supply gave.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path

from ...analysis.energy_parts import EnergyAccount
from . import style
from .style import COLOURS, INK, INK_2, PANEL, SMALL, number

WIDTH, HEIGHT = 8.4, 6.6  # [inch]
IN_MUSCLE, BACK_TO_GAS = "work in the muscle", "work back to the gas"
MUSCLE = ("shaft_work", "friction", "viscous", "tendon", "muscle", "other_walls")
WORDS = {
    "supply": "supply", "machines": "compressors", "walls": "warm walls", "valve": "valve", "tube": "tube",
    "way_in": "valve and tube, on the way in", "dead_volume": "dead volume", "exhaust": "exhaust", "leak": "leak",
    "machine": "compressor losses", "mixing": "mixing of hot and cold", "heat": "heat to the walls",
    "other_walls": "other walls", "friction": "friction", "viscous": "damping", "shaft_work": "shaft work",
    "gas": "stored in the gas", "muscle": "stored in bladder and braid", "tendon": "stored in tendon and end",
    "remainder": "remainder",
}  # fmt: skip
BACK = {
    "shaft_work": "work of the load", "gas": "taken from the gas", "muscle": "from bladder and braid",
    "tendon": "from tendon and end", "supply": "given back to the supply",
}  # fmt: skip
# Quantity whose colour a stream has, and a hatch by which it is told in grey.
LOOKS: dict[str, tuple[str, str]] = {
    "supply": ("pressure", ""), "valve": ("valve", "////"), "tube": ("valve", "////"), "way_in": ("valve", "////"),
    "dead_volume": ("flow", "...."), "exhaust": ("flow", ""), "leak": ("flow", "...."), "shaft_work": ("tension", ""),
    "friction": ("valve", "xxxx"), "viscous": ("valve", "xxxx"), "mixing": ("valve", ""), "heat": ("valve", ""),
    "gas": ("pressure", "----"), "muscle": ("length", "----"), "tendon": ("length", "----"), IN_MUSCLE: ("tension", ""),
}  # fmt: skip
LEAST = 5e-4  # share of the whole below which a stream is told and not drawn


class Stream(NamedTuple):
    """One stream, above zero [J]; `key` says what it is, `words` what it is called."""

    key: str
    words: str
    value: float


class Streams(NamedTuple):
    """What enters on the left and leaves on the right; both sums are the same."""

    into: tuple[Stream, ...]
    out: tuple[Stream, ...]

    @property
    def whole(self) -> float:
        """What passes [J]."""
        return sum(s.value for s in self.into)


def streams(account: EnergyAccount) -> tuple[Streams, Streams]:
    """Of the gas and of the muscle; a part that is negative stands on the other side, its size unchanged."""
    gas: tuple[list[Stream], list[Stream]] = ([], [])
    muscle: tuple[list[Stream], list[Stream]] = ([], [])
    work = 0.0
    for part in account.parts:
        inside = part.name in MUSCLE
        if inside:
            work += part.value if part.side != "into" else -part.value
        sides = muscle if inside else gas
        forward = (part.value > 0.0) != (part.side == "into")
        if part.value:
            words = "the friction's springs" if (part.name, part.side) == ("friction", "stored") else WORDS[part.name]
            back = forward is (part.side == "into") and part.name in BACK
            sides[forward].append(Stream(part.name, BACK[part.name] if back else words, abs(part.value)))
    if work:
        passed = Stream(IN_MUSCLE, IN_MUSCLE if work > 0.0 else BACK_TO_GAS, abs(work))
        gas[work > 0.0].append(passed)
        muscle[work < 0.0].append(passed)
    return Streams(*map(tuple, gas)), Streams(*map(tuple, muscle))


@style.styled()
def energy_flow_figure(account: EnergyAccount, *, title: str = "Where the exergy went") -> Figure:
    """Streams of an account.

    Args:
        account: of `analysis.energy_accounts`.
        title: over the figure.
    """
    gas, muscle = streams(account)
    fig = style.figure(WIDTH, HEIGHT)
    upper = fig.add_axes((0.02, 0.44, 0.96, 0.46))
    lower = fig.add_axes((0.02, 0.05, 0.96, 0.27))
    supply = sum(p.value for p in account.parts if p.name == "supply")
    size = _draw(upper, gas, supply)
    kind = "integrals of the run" if account.parts[0].origin == "integral" else account.parts[0].origin
    style.heading(upper, title, f"exergy in J, share of the supply; {kind}", above=16.0)
    own = _draw(lower, muscle, supply)
    grown = f"magnified {number(own / size, 0)} times" if size > 0.0 and own >= 2.0 * size else ""
    style.heading(lower, "The muscle", grown, above=16.0)
    return fig


def _draw(ax: Axes, found: Streams, supply: float) -> float:
    """Draw into empty axes; says how wide a stream of 1 J is [pixels]."""
    ax.set_axis_off()
    ax.set_xlim(0.0, 1.0)
    whole = found.whole
    if not whole > 0.0:
        ax.text(0.0, 0.5, "nothing passed", fontsize=SMALL, color=INK_2)
        return 0.0
    drawn = [s for s in found.out if s.value >= LEAST * whole]
    small = [s for s in (*found.into, *found.out) if s.value < LEAST * whole]
    gap = max(0.035, 0.4 / (len(drawn) + 6)) * whole
    height = whole + gap * max(len(drawn) - 1, 0)
    ax.set_ylim(-0.06 * height, 1.02 * height)
    middle = 0.5 * (height - whole)
    sources = [s for s in found.into if s.value >= LEAST * whole]
    y = middle
    for one in sorted(sources, key=lambda s: s.value):
        _ribbon(ax, (0.17, y, 0.27, y), one)
        _label(ax, 0.16, y + 0.5 * one.value, one, supply, "right")
        y += one.value
    ax.add_patch(Rectangle((0.27, middle), 0.012, whole, facecolor=INK, edgecolor="none", zorder=3))
    left, right, ends = middle, 0.0, []
    for one in sorted(drawn, key=lambda s: s.value):
        _ribbon(ax, (0.282, left, 0.64, right), one)
        ends.append((one, right + 0.5 * one.value))
        left += one.value
        right += one.value + gap
    box = ax.get_window_extent()
    apart = 11.5 * ax.figure.dpi / 72.0 / box.height * 1.08 * height
    for (one, at), place in zip(ends, style.spread([e[1] for e in ends], apart, 0.0, height), strict=True):
        ax.plot([0.641, 0.66], [at, place], color=style.INK_3, lw=0.5, clip_on=False)
        _label(ax, 0.665, place, one, supply, "left")
    if small:
        names = ", ".join(dict.fromkeys(s.words for s in small))
        style.note(ax, f"below {100 * LEAST:.2g} %: {names}", x=0.0, y=0.0, dy=-6.0)
    return float(box.height / (1.08 * height))


def _ribbon(ax: Axes, ends: tuple[float, float, float, float], one: Stream) -> None:
    """A stream from (x, y) to (x, y), its lower edge."""
    x0, y0, x1, y1 = ends
    bend = 0.5 * (x1 - x0)
    edge = [(x0, y0), (x0 + bend, y0), (x1 - bend, y1), (x1, y1)]
    back = [(x, y + one.value) for x, y in reversed(edge)]
    curve = [Path.CURVE4] * 3
    path = Path([*edge, *back, edge[0]], [Path.MOVETO, *curve, Path.LINETO, *curve, Path.CLOSEPOLY])
    quantity, hatch = LOOKS.get(one.key, ("valve", ""))
    look: dict[str, Any] = {"facecolor": COLOURS[quantity], "alpha": 0.62 if not hatch else 0.4}
    if one.key == "remainder":
        look = {"facecolor": PANEL, "alpha": 1.0}
    ax.add_patch(PathPatch(path, edgecolor="none", lw=0.0, zorder=2, **look))
    outline: dict[str, Any] = {"facecolor": "none", "edgecolor": COLOURS[quantity], "lw": style.HAIR, "zorder": 2.2}
    ax.add_patch(PathPatch(path, hatch=hatch or None, **outline))


def _label(ax: Axes, x: float, y: float, one: Stream, supply: float, side: str) -> None:
    digits = int(np.clip(2 - np.floor(np.log10(one.value)), 0, 5))
    share = 100.0 * one.value / supply if supply > 0.0 else 0.0
    told = f"  {number(share, 1 if share > 1.0 else 2)} %" if share >= 0.01 else ""
    text = f"{one.words}  {number(one.value, digits)} J{told}"
    if side == "right":
        text = f"{one.words}\n{number(one.value, digits)} J"
    ax.text(x, y, text, fontsize=SMALL, color=INK, ha=side, va="center", clip_on=False)
