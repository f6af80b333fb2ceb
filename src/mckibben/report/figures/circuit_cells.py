"""Cells of circuit diagrams: a symbol with its label, its command, vents to free air, and lines to its sides."""

from __future__ import annotations

import dataclasses
import functools
import math
import types
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...components.flow import FlowElement
from ...muscles import braid
from ...muscles.braid import braid_of
from ...muscles.law import TensionLaw
from ...pneumatics.circuit import Circuit
from ...pneumatics.orifice import Orifice
from ...pneumatics.volume import FixedVolume, MovingVolume, Reservoir
from ...quantities import declared, from_si, shown_unit
from .circuit_symbols import (
    SYMBOLS,
    THIN,
    Box,
    Point,
    Stroke,
    Symbol,
    around,
    exhaust,
    line,
    muscle,
    plain_box,
    roles,
    shape,
    source,
    tank,
)
from .style import COLOURS, INK, INK_2, INK_3, NORMAL, SMALL, number, symbol_text

if TYPE_CHECKING:
    from ...components import Module

STANDARD = 101325.0
NEAR_STANDARD = (
    15e3  # a constant reservoir this close to the standard atmosphere [Pa] is the air outside, up to 1.3 km high
)
MOST = 2
_MORE_GREEK = {"omega": "ω", "eta": "η"}
_UNITS = {"m^3/(s*Pa)": "L/(min*bar)"}


class Words(NamedTuple):
    """A line of a label."""

    text: str
    size: float = SMALL
    bold: bool = False
    colour: str = INK_2


class Text(NamedTuple):
    """A line of text at its place: x by its alignment, y its baseline [pt], and its rectangle."""

    words: Words
    x: float
    y: float
    align: str
    box: Box

    def moved(self, x: float, y: float) -> Text:
        """Return a copy at another place."""
        return self._replace(x=self.x + x, y=self.y + y, box=self.box.moved(x, y))


@functools.lru_cache(maxsize=4096)
def width(text: str, size: float, bold: bool) -> float:
    """Width of a line of text [pt]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family=["DejaVu Sans"], size=size, weight="bold" if bold else "normal")
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0])


def stacked(lines: list[Words], x: float, top: float, align: str) -> list[Text]:
    """Lines below each other, the first one's upper edge at `top` [pt]."""
    texts, y = [], top
    for words in lines:
        wide = width(words.text, words.size, words.bold)
        left = x - {"left": 0.0, "center": wide / 2.0, "right": wide}[align]
        box = Box(left, y - 1.25 * words.size, left + wide, y)
        texts.append(Text(words, x, y - 0.95 * words.size, align, box))
        y = box.y0 - 0.5
    return texts


# ---- what is written


def is_atmosphere(node: object) -> bool:
    """Whether a node is the atmosphere: a reservoir of constant pressure near the standard atmosphere."""
    return (
        isinstance(node, Reservoir) and node.signal is None and abs(float(node.pressure_abs) - STANDARD) < NEAR_STANDARD
    )


def ambient(circuit: Circuit) -> float:
    """Ambient absolute pressure [Pa], to which gauge pressures of the diagram refer."""
    for node in circuit.nodes.values():
        if is_atmosphere(node):
            return float(node.pressure_abs)  # type: ignore[union-attr]
    for node in circuit.nodes.values():
        if isinstance(node, MovingVolume):
            return float(node.ambient)
    return STANDARD


def bar(pressure_abs: float, outside: float) -> str:
    """Convert an absolute pressure [Pa] to gauge [bar]."""
    value = float(f"{from_si(pressure_abs - outside, 'Pa', 'bar'):.3g}")
    return f"{number(value)}\N{NO-BREAK SPACE}bar"


def node_words(
    name: str, circuit: Circuit, pressures: Mapping[str, float], subtitles: Mapping[str, str]
) -> list[Words]:
    """Label of a node: its name, its volume or given subtitle, and its initial pressure."""
    node = circuit.nodes[name]
    lines = [Words(name, NORMAL, True, INK)]
    if name in subtitles:
        lines += [Words(text) for text in subtitles[name].splitlines()]
    elif isinstance(node, FixedVolume):
        lines.append(Words(reading(float(node.volume), "m^3")))
    elif isinstance(node, MovingVolume) and float(node.dead_volume) > 0.0:
        lines.append(Words(f"{reading(float(node.dead_volume), 'm^3')} in fittings"))
    if isinstance(node, Reservoir):
        if node.signal is None:
            lines.append(Words(bar(float(node.pressure_abs), ambient(circuit)), SMALL, True, COLOURS["pressure"]))
    elif name in pressures:
        lines.append(Words(bar(float(pressures[name]), ambient(circuit)), SMALL, True, COLOURS["pressure"]))
    return lines


def element_words(name: str, circuit: Circuit, subtitles: Mapping[str, str]) -> list[Words]:
    """Label of an element: its name and its main values or given subtitle."""
    lines = subtitles[name].splitlines() if name in subtitles else main_values(circuit.elements[name])
    return [Words(name, NORMAL, True, INK), *map(Words, lines)]


def main_values(element: Module) -> list[str]:
    """Length and bore of a tube, set pressure, conductances of passages; else the first values that have no default."""
    known = {n: float(v) for n in declared(element) if (v := getattr(element, n)) is not None and np.ndim(v) == 0}
    bore = known.get("diameter", 2.0 * math.sqrt(known["area"] / math.pi) if "area" in known else None)
    if "length" in known and bore is not None:
        return [f"{reading(known['length'], 'm')} × {reading(bore, 'm')}"]
    if "area" in known and bore is not None:
        return [f"bore {reading(bore, 'm')}"]
    parts = [getattr(element, f.name) for f in dataclasses.fields(element)]
    flows = (reading(float(p.conductance), "m^3/(s*Pa)") for p in parts if isinstance(p, Orifice))
    sizes = dict.fromkeys(text.split("\N{NO-BREAK SPACE}")[0] for text in flows)
    values = [f"C\N{NO-BREAK SPACE}{' / '.join(sizes)}\N{NO-BREAK SPACE}L/(min\N{NO-BREAK SPACE}bar)"] if sizes else []
    if "set_pressure" in known:
        return [f"set to {reading(known['set_pressure'], 'Pa')}", *values]
    if values:
        return values
    needed = {f.name for f in dataclasses.fields(element) if f.default is dataclasses.MISSING}
    for name, q in declared(element).items():
        if name in known and name in needed:
            symbol = _MORE_GREEK.get(q.symbol) or symbol_text(q.symbol, name.replace("_", " "))
            values.append(f"{symbol}\N{NO-BREAK SPACE}{reading(known[name], q.unit)}")
    return values[:MOST]


def reading(value: float, unit: str) -> str:
    """Format a value, a length in a suitable unit."""
    shown = _UNITS.get(unit, shown_unit(unit))
    if unit == "m" and value:
        shown = "m" if abs(value) >= 1.0 else "cm" if abs(value) >= 0.05 else "mm"
    if unit == "m^3" and abs(value) >= 1e-3:
        shown = "L"
    converted = from_si(value, unit, shown) if shown != unit else value
    text = f"{converted:.{4 if unit == 'm' else 3}g}"
    if "e" in text:
        head, power = text.split("e")
        text = f"{head}·10{str(int(power)).translate(_HIGH)}".replace("-", "\N{MINUS SIGN}")
    else:
        text = number(float(text))
    if unit == "1":
        return text
    if shown == "L/(min*bar)":
        return f"{text}\N{NO-BREAK SPACE}L/(min\N{NO-BREAK SPACE}bar)"
    for plain, high in (("^2", "²"), ("^3", "³"), ("*", "\N{NO-BREAK SPACE}"), ("deg", "°")):
        shown = shown.replace(plain, high)
    return f"{text}\N{NO-BREAK SPACE}{shown}"


_HIGH = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def braid_angle(node: MovingVolume) -> float | None:
    """The braid angle of a muscle's law at its rest or upper working length [rad]; None if it has no braid."""
    law = node.of.__self__ if isinstance(node.of, types.MethodType) else getattr(node.of, "__self__", None)
    if not isinstance(law, TensionLaw):
        return None
    shape = braid_of(law)
    if shape is None:
        return None
    lengths = (getattr(law, n, None) for n in ("rest_length", "upper_length"))
    length = next((float(v) for v in lengths if v is not None), 0.9 * shape.thread_length)
    return float(braid.angle(min(length, 0.995 * shape.thread_length), thread_length=shape.thread_length))


# ---- cells


DASH = (3.0, 2.2)
NEAR = 4.0  # between a symbol and its label


class Route(NamedTuple):
    """The line of a port: the node it leads to, the side on which it leaves, and its points."""

    node: str
    side: int
    route: tuple[Point, ...]


class SymbolCell(NamedTuple):
    """A symbol in one cell of the grid, around the origin on its line [pt]."""

    marks: tuple[Stroke, ...]
    symbol: Box
    triangles: tuple[Box, ...]
    texts: tuple[Text, ...]
    ports: tuple[Route, ...]

    @property
    def box(self) -> Box:
        """Bounding rectangle."""
        lines = [Box(x, y, x, y) for port in self.ports for x, y in port.route]
        return around([self.symbol, *self.triangles, *(t.box for t in self.texts), *lines])


def symbol_of(element: FlowElement, driven: bool) -> tuple[Symbol, str]:
    """Symbol of an element, and the name to write into it if it has no symbol of its own."""
    ports = element.ports
    if element.symbol in SYMBOLS and _suits(element.symbol, ports):
        return SYMBOLS[element.symbol](ports, driven), ""
    name = type(element).__name__
    return plain_box(name, width(name, SMALL, False))(ports, driven), name


def _suits(symbol: str, ports: Sequence[str]) -> bool:
    role = roles(ports)
    if symbol in ("on_off_valve", "proportional_valve"):
        return role.count("in") == 1 and 1 <= role.count("out") <= 2 and role.count("exhaust") <= 2
    if symbol in ("regulator", "quick_exhaust"):
        return len(set(role)) == len(role)
    return len(ports) == 2


def node_cell(node: object, words: list[Words], *, leads_on: bool) -> SymbolCell:
    """Cell of a node, its dot or the tip of its triangle at the origin."""
    if isinstance(node, Reservoir):
        symbol = source()
        texts = stacked(words, -10.5, symbol.box.y0 - NEAR, "center")
        marks = list(symbol.marks)
        if node.signal is not None:
            marks, texts = _command(marks, texts, node.signal, (-16.0, 8.4), COLOURS["pressure"])
        return SymbolCell(tuple(marks), symbol.box, (), tuple(texts), ())
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
        return SymbolCell(tuple(marks), symbol.box, (), tuple(texts), ())
    symbol = tank(float(node.volume)) if isinstance(node, FixedVolume) else tank(1e-5)
    high = 1.3 * sum(w.size for w in words)
    top = max((symbol.box.y0 - 10.0 + high) / 2.0, symbol.box.y0 + high)
    texts = stacked(words, 14.0, min(top, -7.0), "left")
    return SymbolCell(symbol.marks, symbol.box, (), tuple(texts), ())


def element_cell(
    element: FlowElement, words: list[Words], ends: Sequence[str], sides: Sequence[int], command: str | None
) -> SymbolCell:
    """Cell of an element.

    Args:
        element: the part.
        words: label of the symbol.
        ends: the nodes at its ports.
        sides: sides of the diagram on which they stand, -1 left, 1 right, 0 for the air outside.
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
    routes = [p.route for p in ports if len(p.route) > 1]
    lines = [around([Box(x - 1.0, y - 1.0, x + 1.0, y + 1.0) for x, y in route]) for route in routes]
    taken = [*triangles, *(t.box for t in texts), *lines]
    label = stacked(words, 0.0, symbol.box.y0 - NEAR, "center")
    if any(t.box.overlaps(b, by=-3.0) for t in label for b in taken):
        label = stacked(words, 0.0, min(b.y0 for b in [*taken, symbol.box]) - NEAR, "center")
    texts += label
    if inside:
        texts += stacked([Words(inside, SMALL, False, INK)], 0.0, 0.62 * SMALL, "center")
    if command is not None:
        marks, texts = _command(marks, texts, command, symbol.top, COLOURS["valve"])
    return SymbolCell(tuple(marks), symbol.box, tuple(triangles), tuple(texts), tuple(ports))


def _routes(symbol: Symbol, ends: Sequence[str], sides: Sequence[int]) -> tuple[list[Route], float]:
    """Lines from the ports to their sides, around the symbol if necessary; and their lowest point."""
    routes, low, turned = [], symbol.box.y0, 0
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
        routes.append(Route(end, side, points))
    return routes, low


def _outside(
    symbol: Symbol, free: Sequence[int], inward: set[int], ends: Sequence[str], low: float, marks: list[Stroke]
) -> tuple[list[Box], list[Text]]:
    """Triangles of ports to free air, with names, beside the symbol and below its ports."""
    boxes: list[Box] = []
    texts: list[Text] = []
    for side in (-1, 1):
        open_ports = sorted((i for i in free if symbol.ports[i].side == side), key=lambda i: symbol.ports[i].y)
        lowest = min((p.y for p in symbol.ports if p.side == side), default=0.0)
        start = min(lowest - 9.0, low - 8.0 if low < symbol.box.y0 else 0.0)
        for k, i in enumerate(open_ports):
            port = symbol.ports[i]
            x = (max(port.x, symbol.box.x1) if side > 0 else min(port.x, symbol.box.x0)) + side * (10.0 + 15.0 * k)
            top = start
            marks.append(line((port.x, port.y), (x, port.y), (x, top)))
            marks += [shape((x - 6.0, top - 9.0), (x + 6.0, top - 9.0), (x, top))] if i in inward else exhaust(x, top)
            boxes.append(Box(x - 7.0, top - 10.0, x + 7.0, top))
        names = dict.fromkeys(ends[i] for i in open_ports)
        if open_ports:
            group = around(boxes[-len(open_ports) :])
            align, edge = ("right", group.x1) if side < 0 else ("left", group.x0)
            lines = [Words(name, SMALL, False, INK_3) for name in names]
            texts += stacked(lines, edge, group.y0 - 2.0, align)
    return boxes, texts


def _command(
    marks: list[Stroke], texts: list[Text], name: str, top: Point, colour: str
) -> tuple[list[Stroke], list[Text]]:
    """Add a dashed line up from a symbol to the name of its signal."""
    x, y = top
    dashed = line((x, y), (x, y + 15.0), width=THIN, dash=DASH, colour=colour)
    label = stacked([Words(name, SMALL, True, colour)], x, y + 16.0 + 1.25 * SMALL, "center")
    return [*marks, dashed], [*texts, *label]
