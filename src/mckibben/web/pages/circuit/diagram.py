"""Circuit diagrams of the web interface: layout and symbols of the reports, in the page's colours.

Every node and element is a group that can be focused, picked, and dropped on.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from ....assembly.circuit_file import CircuitPlan
from ....report.figures import circuit_diagram, style
from ....report.figures.circuit_diagram import DiagramPlan
from ....report.figures.circuit_symbols import Box, Stroke
from .edit import PARTS

TOKENS = {
    style.INK: "--ink", style.INK_2: "--ink-2", style.PANEL: "--panel", style.SUNKEN: "--sunken", style.RULE: "--rule",
    style.GRID: "--grid", **{colour: f"--q-{name}" for name, colour in style.COLOURS.items()},
}  # fmt: skip
ROW = 46.0  # above the diagram, for the sensors [pt]
ROOM = 14.0  # around it [pt]
SUBS = str.maketrans("0123456789", "\u2080\u2081\u2082\u2083\u2084\u2085\u2086\u2087\u2088\u2089")


def nicely(name: str) -> str:
    """Name of a file in readable form."""
    return html.escape(name.replace("_", " ").replace("-", " "))


def pressure_signs(sensors: Sequence[str]) -> dict[str, str]:
    """Symbol of each pressure sensor by its node."""
    return {node: f"P{i + 1}".translate(SUBS) for i, node in enumerate(sensors)}


def svg(plan: CircuitPlan, *, chosen: str, sensors: Sequence[str], flows: Sequence[str]) -> str:
    """Draw the diagram as SVG."""
    room = float(plan.environment.pressure_abs)
    pressures = {name: start + room for name, start in plan.starts.items() if start}
    said = {
        name: "" if n.needs_volume else "\n".join(n.words.split(", ")[:2])
        for name, n in plan.nodes.items()
        if n.needs_volume or n.law is not None
    }
    drawn = circuit_diagram.plan(plan.circuit, pressures=pressures, subtitles=said)
    boxes = {key.split(" ", 1)[1]: box for key, box in drawn.symbols.items()}
    x0, x1 = drawn.box.x0 - ROOM, drawn.box.x1 + ROOM
    high, low = -drawn.box.y1 - (ROW if sensors or flows else ROOM), -drawn.box.y0 + ROOM
    parts = [*_nets(plan, drawn, chosen), *_sensors(drawn, boxes, sensors, flows)]
    parts += [_mark(m) for m in drawn.marks]
    parts += [_text(t) for t in drawn.texts]
    parts += [_part(name, box, plan, chosen) for name, box in boxes.items()]
    names = ", ".join(nicely(n) for n in boxes)
    about = f"Diagram of the circuit: {names}" + (f"; {nicely(chosen)} is selected" if chosen else "")
    size = f'viewBox="{x0:.1f} {high:.1f} {x1 - x0:.1f} {low - high:.1f}"'
    wide = f"max-width:{1.9 * (x1 - x0):.0f}px;min-width:{min(1.15 * (x1 - x0), 700):.0f}px"
    return f'<svg class="diagram" {size} style="{wide}" role="group" aria-label="{about}">{"".join(parts)}</svg>'


def _path(vertices: Any, codes: Any) -> str:
    out: list[str] = []
    pending: list[str] = []
    for i, (x, y) in enumerate(vertices):
        code = (1 if i == 0 else 2) if codes is None else int(codes[i])
        at = f"{x:.2f} {-y:.2f}"
        if code in (3, 4):
            pending.append(at)
            if len(pending) == code - 1:
                out.append(("Q" if code == 3 else "C") + " ".join(pending))
                pending = []
        else:
            out.append("Z" if code == 79 else ("M" if code == 1 else "L") + at)
    return "".join(out)


def _colour(name: str) -> str:
    return f"var({TOKENS[name]})" if name in TOKENS else "none" if name == "none" else "var(--ink)"


def _mark(mark: Stroke) -> str:
    dash = f' stroke-dasharray="{" ".join(f"{d * mark.width:.1f}" for d in mark.dash)}"' if mark.dash else ""
    return (
        f'<path d="{_path(mark.path.vertices, mark.path.codes)}" fill="{_colour(mark.fill)}" '
        f'stroke="{_colour(mark.colour)}" stroke-width="{mark.width:.2f}" stroke-linejoin="round"{dash}/>'
    )


def _text(text: Any) -> str:
    w = text.words
    anchor = {"left": "start", "center": "middle", "right": "end"}[text.align]
    weight = ' font-weight="600"' if w.bold else ""
    return (
        f'<text class="w" x="{text.x:.1f}" y="{-text.y:.1f}" text-anchor="{anchor}" font-size="{w.size:g}"{weight} '
        f'style="fill:{_colour(w.colour)}">{html.escape(w.text.replace("_", " "))}</text>'
    )


def _nets(plan: CircuitPlan, drawn: DiagramPlan, chosen: str) -> list[str]:
    """Draw the lines of each node, with a wide one beneath as a drop target."""
    lines = []
    for name, net in drawn.nets.items():
        path = "".join("M" + "L".join(f"{x:.1f} {-y:.1f}" for x, y in run) for run in net.lines)
        gas = plan.nodes[name].kind != "reservoir"
        colour = "var(--q-pressure)" if gas else "var(--ink)"
        dots = "".join(f'<circle cx="{x:.1f}" cy="{-y:.1f}" r="2.6" fill="var(--ink)"/>' for x, y in net.dots)
        lines.append(
            f'<g class="net" data-part="{name}"><path class="hit" d="{path}"/><path d="{path}" fill="none" '
            f'stroke="{colour}" stroke-width="{2.6 if gas else 1.6}" stroke-linecap="square"/>{dots}</g>'
        )
    return lines


def _sensors(drawn: DiagramPlan, boxes: Mapping[str, Box], sensors: Sequence[str], flows: Sequence[str]) -> list[str]:
    y = -drawn.box.y1 - 18.0
    lines = []
    signs = pressure_signs(sensors)
    for name in (n for n in sensors if n in boxes):
        box = boxes[name]
        x = (box.x0 + box.x1) / 2.0
        line = drawn.nets[name].lines[0][-1][1] if name in drawn.nets and drawn.nets[name].lines else box.y1
        lines.append(
            _sensor(x, y, -max(line, box.y1) if box.y1 - box.y0 < 30.0 else -box.y1, "p", "pressure", signs[name])
        )
    for name in (n for n in flows if n in boxes):
        box = boxes[name]
        x = (box.x0 + box.x1) / 2.0
        label = "q" if len(flows) == 1 else f"q{flows.index(name) + 1}".translate(SUBS)
        lines.append(_sensor(x, y, -box.y1, "q", "flow", label))
    return lines


def _sensor(x: float, y: float, foot: float, letter: str, quantity: str, label: str) -> str:
    colour = f"var(--q-{quantity})"
    return (
        f'<g class="sensor"><path d="M{x:.1f} {foot:.1f}V{y + 9:.1f}" stroke="{colour}" stroke-width=".8" '
        f'stroke-dasharray="2 2"/><circle cx="{x:.1f}" cy="{y:.1f}" r="9" fill="var(--panel)" stroke="var(--ink)" '
        f'stroke-width="1.2"/><text x="{x:.1f}" y="{y + 3.4:.1f}" text-anchor="middle" font-size="10" font-style="italic" '
        f'font-weight="600" style="fill:{colour}">{letter}</text><text x="{x:.1f}" y="{y - 13:.1f}" text-anchor="middle" '
        f'font-size="9.5" font-weight="600" style="fill:{colour}">{label}</text></g>'
    )


def _part(name: str, box: Box, plan: CircuitPlan, chosen: str) -> str:
    """Draw the selectable rectangle around a symbol."""
    x, y, w, h = box.x0 - 5.0, -box.y1 - 3.5, box.x1 - box.x0 + 10.0, box.y1 - box.y0 + 7.0
    on = name == chosen
    corners = (
        "".join(
            f'<rect x="{a - 2.6:.1f}" y="{b - 2.6:.1f}" width="5.2" height="5.2" fill="var(--panel)" stroke="var(--ink)"/>'
            for a in (x, x + w)
            for b in (y, y + h)
        )
        if on
        else ""
    )
    kind = plan.nodes[name].kind if name in plan.nodes else str(plan.document["elements"][name]["kind"])
    return (
        f'<g class="part{" on" if on else ""}" data-part="{name}" tabindex="0" role="button" '
        f'aria-pressed="{"true" if on else "false"}" aria-label="{nicely(name)}, {kind.replace("_", " ")}">'
        f'<rect class="frame" x="{x:.1f}" y="{y:.1f}" width="{w:.1f}" height="{h:.1f}" rx="3"/>{corners}</g>'
    )


_INK = 'stroke="var(--ink)" stroke-width="1.5" fill="var(--panel)"'
_SENSOR = '<text y="4" text-anchor="middle" class="sign" style="fill:var(--q-{})">{}</text>'
SYMBOLS = {
    "supply": f'<circle r="13" {_INK}/><path d="M0 -8l7 12h-14z" fill="var(--ink)"/>',
    "regulator": f'<rect x="-13" y="-13" width="26" height="26" {_INK}/><path d="M-13 4H13M8 0l5 4-5 4M0 -13v-5m-4 0l8-3" '
    'stroke="var(--ink)" stroke-width="1.5" fill="none"/>',
    "valve": f'<rect x="-13" y="-13" width="26" height="26" {_INK}/><path '
    'd="M-13 4H13M8 0l5 4-5 4M-9 10L9 -10m0 0l-5 1m5-1l-1 5" '
    'stroke="var(--ink)" stroke-width="1.3" fill="none"/>',
    "tube": '<path d="M-22 0c4-9 7 9 11 0s7 9 11 0 7 9 11 0 7 9 11 0" fill="none" stroke="var(--ink)" stroke-width="1.8"/>',
    "orifice": '<path d="M-18 0H18M-9 -8q9 7 18 0M-9 8q9 -7 18 0" fill="none" stroke="var(--ink)" stroke-width="1.5"/>',
    "volume": f'<rect x="-9" y="-18" width="18" height="36" rx="9" {_INK}/>',
    "muscle": f'<path d="M-24 -3C-17 -10 17 -10 24 -3V3C17 10 -17 10 -24 3z" {_INK}/><path '
    'd="M-22 -3C-13 11 -6 6 4 -8M-13 -7C-4 13 6 11 17 -6M-22 3C'
    '-13 -11 -6 -6 4 8M-13 7C-4 -13 6 -11 17 6" stroke="var(--ink)" stroke-width=".9" fill="none"/>',
    "pressure": f'<circle r="11" {_INK}/>' + _SENSOR.format("pressure", "p"),
    "flow": f'<circle r="11" {_INK}/>' + _SENSOR.format("flow", "q"),
    "leak": '<path d="M0 -14V2M-5 2L0 12 5 2z" fill="none" stroke="var(--ink)" stroke-width="1.5"/>',
    "exhaust": '<path d="M0 -12V0M-8 0h16l-8 12z" fill="none" stroke="var(--ink)" stroke-width="1.5"/>',
}


def symbol(part: str, width: int = 44) -> str:
    """Symbol of a part of the palette."""
    assert part in PARTS
    return f'<svg width="{width}" height="36" viewBox="-26 -21 52 42" aria-hidden="true">{SYMBOLS[part]}</svg>'
