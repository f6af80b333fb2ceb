"""Circuit diagrams with the layout and symbols of the reports, in the page's colours; charts and numbers of a response.

Every node and element of a diagram is a group that can be focused, picked, and dropped on.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....assembly.circuit_file import CircuitPlan
from ....quantities import from_si, shown_unit, with_unit
from ....recordings import Recording
from ....report.figures import circuit_diagram, style
from ....report.figures.circuit_diagram import DiagramPlan
from ....report.figures.circuit_symbols import Box, Stroke
from ...charts import Axis, Chart, ChartLine, Mark
from ...widgets import box, raw, text
from . import document, response
from .state import CircuitAnswer, CircuitState

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
    y, lines, signs = -drawn.box.y1 - 18.0, [], pressure_signs(sensors)
    for name in (n for n in (*sensors, *flows) if n in boxes):
        box = boxes[name]
        x = (box.x0 + box.x1) / 2.0
        if name in signs:
            net = drawn.nets[name].lines if name in drawn.nets else ()
            line = net[0][-1][1] if net else box.y1
            foot = -max(line, box.y1) if box.y1 - box.y0 < 30.0 else -box.y1
            lines.append(_sensor(x, y, foot, "p", "pressure", signs[name]))
        else:
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


MS, BAR = from_si(1.0, "s", "ms"), from_si(1.0, "Pa", "bar")
DASHES = {"linear_tube": "B", "quadratic_tube": "C", "inertial_tube": "D"}


def span(seconds: float) -> str:
    """Format a short time."""
    return f"{from_si(seconds, 's', 'ms'):.3g} ms" if abs(seconds) < 1.0 else with_unit(seconds, "s", 3)


def pressure_chart(desk: CircuitState, answer: CircuitAnswer) -> Chart:
    """Chart of pressures at the sensors, with other tube models, and the time at which 90 % is reached."""
    record, numbers = answer.record, answer.numbers
    time, signs = MS * record.time, pressure_signs(desk.sensors)
    models = answer.models.items()
    lines = [ChartLine(time, BAR * p, response.MODELS[kind], dash=DASHES[kind], width=1.25) for kind, p in models]
    for node in sorted(desk.sensors, key=lambda n: n == desk.read):
        heavy = 2.75 if node == desk.read else 1.25
        name = f"{signs[node]} {node.replace('_', ' ')}"
        lines.append(ChartLine(time, BAR * record[f"{node}.pressure"], name, "pressure", width=heavy))
    marks, reached = [], None
    if numbers.settled and numbers.transition is not None and numbers.delay is not None:
        reached = numbers.command_time + numbers.delay + numbers.transition
    if reached is not None and reached <= record.time[-1]:
        node = f"{desk.read}.pressure"
        at = float(np.interp(reached, record.time, record[node]))
        share = "90 %" if numbers.rising else "10 %"
        words = f"{share} after {span(reached - numbers.command_time)}"
        x, beside = MS * reached, BAR * (0.4 * at if numbers.rising else 0.6 * numbers.before)
        marks += [Mark("", x=x), Mark(words, x=x, y=beside)]
    shown = f"Pressure of {', '.join(desk.sensors)} over {with_unit(record.time[-1], 's')}"
    ending = "has not settled"
    if numbers.settled:
        ends = "settles" if numbers.duration > 1.5 * desk.plan.duration else "ends"
        ending = f"{ends} at {with_unit(numbers.after, 'Pa')}"
    summary = f"{shown}; it {ending}"
    return Chart("Pressure", summary, Axis("Time", "ms"), Axis("Pressure", "bar", "pressure"), lines, marks, height=256)


def flow_chart(desk: CircuitState, record: Recording) -> Chart:
    """Chart of the flows at flow sensors."""
    lines = []
    for i, name in enumerate(desk.flows):
        sign = "q" if len(desk.flows) == 1 else f"q{i + 1}"
        values = response.litres(record[response.flow_channel(desk.plan, name)])
        dash = "ABCD"[i % 4] if i else ""
        lines.append(ChartLine(MS * record.time, values, f"{sign} {name}", "flow", dash=dash, width=2.0))
    summary = f"Flow of {', '.join(desk.flows)} as a volume of reference air"
    return Chart("Flow", summary, Axis("Time", "ms"), Axis("Flow", "L/min", "flow"), lines, height=150)


def numbers(desk: CircuitState, outputs: response.ResponseNumbers) -> None:
    """Show the numbers of the response and of the selected part."""
    rows: list[tuple[str, str]] = []
    node = outputs.channel.removesuffix(".pressure").capitalize()
    if outputs.settled:
        if outputs.transition is not None and outputs.delay is not None:
            label = "Rise, 0 to 90 %" if outputs.rising else "Fall, 100 to 10 %"
            rows += [(label, span(outputs.transition)), ("Delay before it", span(outputs.delay))]
        later = outputs.duration > 1.5 * desk.plan.duration
        shown = f" after the {span(desk.plan.duration)} shown" if later else ""
        rows.append((f"{node} {'settles' if later else 'ends'} at", f"{with_unit(outputs.after, 'Pa')}{shown}"))
    else:
        why = "before the next step" if outputs.ends else f"within {span(outputs.duration)}"
        drift = f"in the last fifth it changes by {abs(outputs.drift):.1%} of its step"
        rows.append((f"{node} has not settled", f"{why}: {drift}"))
    if outputs.flow_of:
        litres = from_si(outputs.flow, "m^3/s", "l/min")
        rows.append((f"Largest flow, {outputs.flow_of}", f"{litres:.4g} L/min"))
    rows += response.facts(desk.plan, desk.chosen or response.first_tube(desk.plan))
    markup = "".join(f"<dt>{html.escape(a)}</dt><dd>{html.escape(b)}</dd>" for a, b in rows)
    raw(markup, "dl", "meas")


def sweep_chart(sweep: response.ValueSweep) -> None:
    """Chart of the rise time over values of the part."""
    unit = shown_unit(sweep.unit)
    x = from_si(1.0, sweep.unit, unit) * sweep.values
    y = MS * sweep.rises
    if not np.isfinite(y).any():
        return
    word = sweep.key.replace("_", " ")
    with box("div", "sweep"):
        text("h3", f"Time to 90 % if its {word} were another")
        now = float(np.interp(sweep.now, sweep.values, sweep.rises))
        lines = [ChartLine(x, y, width=2.0)]
        if np.isfinite(now):
            present = [from_si(sweep.now, sweep.unit, unit)]
            lines.append(ChartLine(present, [from_si(now, "s", "ms")], points=True, line=False))
        across, up = Axis(word.capitalize(), unit, low=0.0), Axis("Time to 90 %", "ms", low=0.0)
        Chart(f"Rise over {word}", f"Time to 90 % for {len(x)} values of {word}", across, up, lines, height=130).show()


def palette() -> None:
    """Build the palette of parts."""
    with box("div", "hd"), box("h2"):
        text("span", "Parts")
    with box("div", "palette"):
        for name, part in document.PARTS.items():
            drawn = f'<svg width="44" height="36" viewBox="-26 -21 52 42" aria-hidden="true">{SYMBOLS[name]}</svg>'
            markup = f"{drawn}<span>{part.name}</span><kbd>{part.key}</kbd>"
            about = f"Add {part.name.lower()}: drag it, or Insert and {part.key}"
            one = raw(markup, "button", "add").set(type="button", draggable="true", title=about)
            one.set(data_add=name, data_key=part.key.lower())
