"""The diagram of a pneumatic circuit: symbols of ISO 1219-1, lines, names, main values and pressures at the start.

Lines are ink; where pressures are given they take the colour of pressure, the stronger the higher. Commands are dashed.
Crossing lines join only where there is a dot.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from ...errors import InputError
from ...pneumatics.circuit import Circuit
from ...pneumatics.volume import Reservoir
from . import style
from .circuit_labels import Text, Words, ambient, element_words, is_atmosphere, node_words, stacked
from .circuit_layout import DiagramWiring, Net, SymbolCell, arrange, element_cell, node_cell, wiring
from .circuit_symbols import Box, Point, Stroke
from .style import COLOURS, INK, LINE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MARGIN = 18.0
TITLE = 12.0


class DiagramPlan(NamedTuple):
    """A diagram before drawing: all strokes, texts and lines [pt], and the occupied rectangles."""

    box: Box
    symbols: dict[str, Box]
    triangles: tuple[Box, ...]
    texts: tuple[Text, ...]
    marks: tuple[Stroke, ...]
    nets: dict[str, Net]


def plan(
    circuit: Circuit, *, pressures: Mapping[str, float] | None = None, subtitles: Mapping[str, str] | None = None
) -> DiagramPlan:
    """Lay a circuit out; arguments as for `draw`."""
    pressures, subtitles = pressures or {}, subtitles or {}
    _check(circuit, pressures, subtitles)
    wires = _wires(circuit)
    cells: dict[tuple[str, str], SymbolCell] = {}
    for name in wires.order:
        words = node_words(name, circuit, pressures, subtitles)
        cells["node", name] = node_cell(circuit.nodes[name], words, leads_on=bool(wires.leaving(name)))
    for name, (ends, command) in circuit.ends.items():
        sides = [-1 if n in wires.left[name] else 1 if n in wires.right[name] else 0 for n in ends]
        words = element_words(name, circuit, subtitles)
        cells["element", name] = element_cell(circuit.elements[name], words, ends, sides, command)
    grid = arrange(wires, cells)
    marks, texts, triangles, symbols = [], [], [], {}
    for key, cell in cells.items():
        x, y = grid.at[key]
        symbols[" ".join(key)] = cell.symbol.moved(x, y)
        marks += [m.placed(x, y) for m in cell.marks]
        texts += [t.moved(x, y) for t in cell.texts]
        triangles += [b.moved(x, y) for b in cell.triangles]
    return DiagramPlan(grid.box, symbols, tuple(triangles), tuple(texts), tuple(marks), grid.nets)


@style.styled()
def draw(
    circuit: Circuit,
    *,
    title: str = "",
    pressures: Mapping[str, float] | None = None,
    subtitles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw a circuit of any topology: supplies left, flow to the right, branches below each other.

    Args:
        circuit: the network.
        title: stands over it.
        pressures: absolute pressures at the start by node [Pa], as `Circuit.initial` takes them; shown as gauge pressures.
        subtitles: by node or element, what stands below its name instead of its values.

    Raises:
        InputError: names a pressure or a subtitle of something that the circuit has not.
    """
    layout = plan(circuit, pressures=pressures, subtitles=subtitles)
    head = stacked([Words(title, TITLE, True, INK)], layout.box.x0, 0.0, "left") if title else []
    wide = max(layout.box.x1 - layout.box.x0, *(t.box.x1 - t.box.x0 for t in head), 60.0) + 2.0 * MARGIN
    above = 16.0 + TITLE if title else 0.0
    high = layout.box.y1 - layout.box.y0 + 2.0 * MARGIN + above
    fig = style.drawing(wide / 72.0, high / 72.0)
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    left, bottom = layout.box.x0 - MARGIN, layout.box.y0 - MARGIN
    ax.set_xlim(left, left + wide)
    ax.set_ylim(bottom, bottom + high)
    strength = _strengths(circuit, pressures or {})
    for name, net in layout.nets.items():
        _draw_net(ax, net, strength.get(name))
    for mark in layout.marks:
        draw_mark(ax, mark)
    for text in [*layout.texts, *(t.moved(0.0, layout.box.y1 + above) for t in head)]:
        draw_text(ax, text)
    return fig


def _check(circuit: Circuit, pressures: Mapping[str, float], subtitles: Mapping[str, str]) -> None:
    for name in pressures:
        if name not in circuit.nodes:
            raise InputError("pressures", name, "nodes are", known=circuit.nodes, where="circuit")
    for name in subtitles:
        if name not in circuit.nodes and name not in circuit.elements:
            parts = [*circuit.nodes, *circuit.elements]
            raise InputError("subtitles", name, "parts are", known=parts, where="circuit")


def _wires(circuit: Circuit) -> DiagramWiring:
    nodes = [name for name, node in circuit.nodes.items() if not is_atmosphere(node)]
    supplies = [name for name in nodes if isinstance(circuit.nodes[name], Reservoir)]
    ends = {e: tuple(n for n in ports if n in nodes) for e, (ports, _) in circuit.ends.items()}
    starts = {
        e
        for e, (ports, _) in circuit.ends.items()
        if type(circuit.elements[e]).__name__ == "Compressor" and ports[0] not in nodes
    }
    return wiring(supplies, nodes, ends, starts)


def _strengths(circuit: Circuit, pressures: Mapping[str, float]) -> dict[str, float]:
    """Line strength of each node with a known pressure: its gauge pressure over the largest."""
    if not pressures:
        return {}
    known = dict(pressures)
    for name, node in circuit.nodes.items():
        if isinstance(node, Reservoir) and node.signal is None:
            known[name] = float(node.pressure_abs)
    outside = ambient(circuit)
    top = max(max(p - outside for p in known.values()), 1.0)
    return {name: 0.4 + 0.6 * min(max((p - outside) / top, 0.0), 1.0) for name, p in known.items()}


# ---- strokes


def _draw_net(ax: Axes, net: Net, strength: float | None) -> None:
    """Draw all lines of a node as one stroke, so that crossings are not darker."""
    from matplotlib.path import Path

    colour = INK if strength is None else COLOURS["pressure"]
    codes: list[Any] = []
    points: list[Point] = []
    for run in net.lines:
        points += run
        codes += [Path.MOVETO] + [Path.LINETO] * (len(run) - 1)
    if not points:
        return
    width = LINE if strength is None else 1.8 * LINE
    draw_mark(ax, Stroke(Path(points, codes), width=width, colour=colour), alpha=strength, order=1.0)
    for x, y in net.dots:
        draw_mark(ax, Stroke(Path.circle((x, y), 2.6), fill=INK, width=0.0, colour=INK), order=1.5)


def draw_mark(ax: Axes, mark: Stroke, *, alpha: float | None = None, order: float = 2.0) -> None:
    """Draw one stroke on axes whose unit is the point."""
    from matplotlib.patches import PathPatch

    ax.add_patch(
        PathPatch(
            mark.path,
            facecolor=mark.fill,
            edgecolor=mark.colour,
            linewidth=mark.width,
            linestyle=(0, mark.dash) if mark.dash else "-",
            joinstyle="round",
            capstyle="butt" if mark.dash else "projecting" if order < 2.0 else "round",
            alpha=alpha,
            zorder=order,
            clip_on=False,
        )
    )


def draw_text(ax: Axes, text: Text) -> None:
    """Draw one line of text on axes whose unit is the point."""
    words = text.words
    ax.text(
        text.x,
        text.y,
        words.text,
        ha=text.align,
        va="baseline",
        fontsize=words.size,
        fontweight="bold" if words.bold else "normal",
        color=words.colour,
        parse_math=False,
        zorder=3,
    )
