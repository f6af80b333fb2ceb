"""One part of a circuit with everything that belongs to it: symbol, label, command, triangles to free air, ends of lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ...components.flow import FlowElement
from ...pneumatics.volume import FixedVolume, MovingVolume, Reservoir
from .circuit_labels import Text, Words, braid_angle, stacked, width
from .circuit_symbols import (
    THIN,
    Box,
    Mark,
    Point,
    Symbol,
    around,
    exhaust,
    line,
    muscle,
    plain_box,
    shape,
    source,
    tank,
)
from .circuit_valves import SYMBOLS, roles
from .style import COLOURS, INK, INK_3, SMALL

DASH = (3.0, 2.2)
NEAR = 4.0  # between a symbol and its label


class Route(NamedTuple):
    """One port: the node it leads to, the side on which its line leaves, and the line from the symbol to there."""

    node: str
    side: int
    route: tuple[Point, ...]


class Cell(NamedTuple):
    """What stands at one place of the diagram, around the origin on its line [pt]."""

    marks: tuple[Mark, ...]
    symbol: Box
    triangles: tuple[Box, ...]
    texts: tuple[Text, ...]
    ports: tuple[Route, ...]

    @property
    def box(self) -> Box:
        """The rectangle around all of it."""
        lines = [Box(x, y, x, y) for port in self.ports for x, y in port.route]
        return around([self.symbol, *self.triangles, *(t.box for t in self.texts), *lines])


def symbol_of(element: FlowElement, driven: bool) -> tuple[Symbol, str]:
    """The symbol of an element, and the name to write into it where it has none of its own."""
    ports = element.ports
    if element.symbol in SYMBOLS and _suits(element.symbol, ports):
        return SYMBOLS[element.symbol](ports, driven), ""
    name = type(element).__name__
    return plain_box(name, width(name, SMALL, False))(ports, driven), name


def _suits(symbol: str, ports: Sequence[str]) -> bool:
    """Whether a symbol has places for these ports."""
    role = roles(ports)
    if symbol in ("on_off_valve", "proportional_valve"):
        return role.count("in") == 1 and 1 <= role.count("out") <= 2 and role.count("exhaust") <= 2
    if symbol in ("regulator", "quick_exhaust"):
        return len(set(role)) == len(role)
    return len(ports) == 2


def node_cell(node: Any, words: list[Words], *, leads_on: bool) -> Cell:
    """The cell of a node, its dot or the tip of its triangle at the origin."""
    if isinstance(node, Reservoir):
        symbol = source()
        texts = stacked(words, -10.5, symbol.box.y0 - NEAR, "center")
        marks = list(symbol.marks)
        if node.signal is not None:
            marks, texts = _command(marks, texts, node.signal, (-16.0, 8.4), COLOURS["pressure"])
        return Cell(tuple(marks), symbol.box, (), tuple(texts), ())
    if isinstance(node, MovingVolume):
        symbol = muscle(braid_angle(node), hanging=leads_on)
        middle = (symbol.top[0] + (8.0 if leads_on else 12.0)) / 2.0
        texts = stacked(words, middle, symbol.box.y0 - NEAR, "center")
        marks = list(symbol.marks)
        if node.signal is not None:
            x, y = symbol.top
            marks.append(line((x, y), (x + 16.0, y), width=THIN, dash=DASH, colour=COLOURS["length"]))
            label = Words(node.signal, SMALL, False, COLOURS["length"])
            texts += stacked([label], x + 19.0, y + 0.62 * SMALL, "left")
        return Cell(tuple(marks), symbol.box, (), tuple(texts), ())
    symbol = tank(float(node.size)) if isinstance(node, FixedVolume) else tank(1e-5)
    high = 1.3 * sum(w.size for w in words)
    top = max((symbol.box.y0 - 10.0 + high) / 2.0, symbol.box.y0 + high)
    texts = stacked(words, 14.0, min(top, -7.0), "left")
    return Cell(symbol.marks, symbol.box, (), tuple(texts), ())


def element_cell(
    element: FlowElement, words: list[Words], ends: Sequence[str], sides: Sequence[int], command: str | None
) -> Cell:
    """The cell of an element.

    Args:
        element: the part.
        words: its label.
        ends: the nodes at its ports.
        sides: of the diagram on which they stand, -1 left, 1 right, 0 for the air outside.
        command: the signal that drives it.
    """
    symbol, inside = symbol_of(element, command is not None)
    if sum(p.side * s for p, s in zip(symbol.ports, sides, strict=True)) < 0:
        symbol = symbol.mirrored()
    ports, low = _routes(symbol, ends, sides)
    marks = list(symbol.marks)
    free = [i for i, s in enumerate(sides) if s == 0]
    inward = {i for i in free if type(element).__name__ == "Compressor" and all(i == a for a, _ in element.paths)}
    triangles, texts = _outside(symbol, free, inward, ends, low, marks)
    taken = [*triangles, *(t.box for t in texts), *(_along(p.route) for p in ports if len(p.route) > 1)]
    label = stacked(words, 0.0, symbol.box.y0 - NEAR, "center")
    if any(t.box.overlaps(b, by=-3.0) for t in label for b in taken):
        label = stacked(words, 0.0, min(b.y0 for b in [*taken, symbol.box]) - NEAR, "center")
    texts += label
    if inside:
        texts += stacked([Words(inside, SMALL, False, INK)], 0.0, 0.62 * SMALL, "center")
    if command is not None:
        marks, texts = _command(marks, texts, command, symbol.top, COLOURS["valve"])
    return Cell(tuple(marks), symbol.box, tuple(triangles), tuple(texts), tuple(ports))


def _along(points: Sequence[Point]) -> Box:
    return around([Box(x - 1.0, y - 1.0, x + 1.0, y + 1.0) for x, y in points])


def _routes(symbol: Symbol, ends: Sequence[str], sides: Sequence[int]) -> tuple[list[Route], float]:
    """The lines from the ports to their sides, around the symbol where they leave on the other one; and their lowest."""
    found, low, turned = [], symbol.box.y0, 0
    for port, end, side in zip(symbol.ports, ends, sides, strict=True):
        if side == 0:
            continue
        points: tuple[Point, ...] = ((port.x, port.y),)
        if side != port.side:
            turned += 1
            low -= 7.0
            out = port.x + port.side * (1.0 + 4.0 * turned)
            far = symbol.box.x1 + 2.0 if side > 0 else symbol.box.x0 - 2.0
            points = (*points, (out, port.y), (out, low), (far, low))
        found.append(Route(end, side, points))
    return found, low


def _outside(
    symbol: Symbol, free: Sequence[int], inward: set[int], ends: Sequence[str], low: float, marks: list[Mark]
) -> tuple[list[Box], list[Text]]:
    """The triangles of ports to the air outside, with its name, beside the symbol and below its ports."""
    boxes: list[Box] = []
    texts: list[Text] = []
    for side in (-1, 1):
        own = sorted((i for i in free if symbol.ports[i].side == side), key=lambda i: symbol.ports[i].y)
        lowest = min((p.y for p in symbol.ports if p.side == side), default=0.0)
        start = min(lowest - 9.0, low - 8.0 if low < symbol.box.y0 else 0.0)
        for k, i in enumerate(own):
            port = symbol.ports[i]
            x = (max(port.x, symbol.box.x1) if side > 0 else min(port.x, symbol.box.x0)) + side * (10.0 + 15.0 * k)
            top = start
            marks.append(line((port.x, port.y), (x, port.y), (x, top)))
            marks += [shape((x - 6.0, top - 9.0), (x + 6.0, top - 9.0), (x, top))] if i in inward else exhaust(x, top)
            boxes.append(Box(x - 7.0, top - 10.0, x + 7.0, top))
        names = dict.fromkeys(ends[i] for i in own)
        if own:
            group = around(boxes[-len(own) :])
            align, edge = ("right", group.x1) if side < 0 else ("left", group.x0)
            lines = [Words(name, SMALL, False, INK_3) for name in names]
            texts += stacked(lines, edge, group.y0 - 2.0, align)
    return boxes, texts


def _command(marks: list[Mark], texts: list[Text], name: str, top: Point, colour: str) -> tuple[list[Mark], list[Text]]:
    """Add a dashed line up from a symbol to the name of its signal."""
    x, y = top
    dashed = line((x, y), (x, y + 15.0), width=THIN, dash=DASH, colour=colour)
    label = stacked([Words(name, SMALL, True, colour)], x, y + 16.0 + 1.25 * SMALL, "center")
    return [*marks, dashed], [*texts, *label]
