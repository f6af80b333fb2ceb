"""Labels of circuit symbols: names, and main values in customary units."""

from __future__ import annotations

import dataclasses
import functools
import math
import types
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...muscles import braid
from ...muscles.braid import braid_of
from ...muscles.law import TensionLaw
from ...pneumatics.circuit import Circuit
from ...pneumatics.orifice import Orifice
from ...pneumatics.volume import FixedVolume, MovingVolume, Reservoir
from ...quantities import declared, from_si, shown_unit
from .circuit_symbols import Box
from .style import COLOURS, INK, INK_2, NORMAL, SMALL, number, symbol_text

if TYPE_CHECKING:
    from ...components import Module

STANDARD = 101325.0
NEAR = 15e3  # a constant reservoir this close to the standard atmosphere [Pa] is the air outside, up to 1.3 km high
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
    return isinstance(node, Reservoir) and node.signal is None and abs(float(node.pressure_abs) - STANDARD) < NEAR


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
        lines.append(Words(reading(float(node.size), "m^3")))
    elif isinstance(node, MovingVolume) and float(node.dead) > 0.0:
        lines.append(Words(f"{reading(float(node.dead), 'm^3')} in fittings"))
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
    known = {n: float(v) for n in declared(element) if np.ndim(v := getattr(element, n)) == 0}
    bore = known.get("diameter", 2.0 * math.sqrt(known["area"] / math.pi) if "area" in known else None)
    if "length" in known and bore is not None:
        return [f"{reading(known['length'], 'm')} × {reading(bore, 'm')}"]
    if "area" in known and bore is not None:
        return [f"bore {reading(bore, 'm')}"]
    passages = [getattr(element, f.name) for f in dataclasses.fields(element)]
    sizes = dict.fromkeys(_conductance(p) for p in passages if isinstance(p, Orifice))
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


def _conductance(passage: Orifice) -> str:
    return reading(float(passage.conductance), "m^3/(s*Pa)").split("\N{NO-BREAK SPACE}")[0]


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
