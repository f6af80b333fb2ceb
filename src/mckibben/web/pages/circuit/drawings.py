"""Charts and numbers of a response."""

from __future__ import annotations

import html

import numpy as np

from ....quantities import from_si, shown_unit, with_unit
from ....recordings import Recording
from ...charts import Axis, Chart, ChartLine, Mark
from ...widgets import box, raw, text
from . import diagram, edit, response
from .diagram import pressure_signs
from .state import CircuitAnswer, CircuitState

DASHES = {"linear_tube": "B", "quadratic_tube": "C", "inertial_tube": "D"}


def span(seconds: float) -> str:
    """Format a short time."""
    return f"{from_si(seconds, 's', 'ms'):.3g} ms" if abs(seconds) < 1.0 else with_unit(seconds, "s", 3)


def _ms(record: Recording) -> np.ndarray:
    return np.asarray(from_si(1.0, "s", "ms") * record.time)


def pressure_chart(desk: CircuitState, answer: CircuitAnswer) -> Chart:
    """Chart of pressures at the sensors, with other tube models, and the time at which 90 % is reached."""
    record, numbers = answer.record, answer.numbers
    time, signs = _ms(record), pressure_signs(desk.sensors)
    lines = [
        ChartLine(time, from_si(1.0, "Pa", "bar") * values, response.MODELS[kind], dash=DASHES[kind], width=1.25)
        for kind, values in answer.models.items()
    ]
    for node in sorted(desk.sensors, key=lambda n: n == desk.read):
        heavy = 2.75 if node == desk.read else 1.25
        values = from_si(1.0, "Pa", "bar") * record[f"{node}.pressure"]
        lines.append(ChartLine(time, values, f"{signs[node]} {node.replace('_', ' ')}", "pressure", width=heavy))
    marks, reached = [], None
    if numbers.settled and numbers.transition is not None and numbers.delay is not None:
        reached = numbers.command_time + numbers.delay + numbers.transition
    if reached is not None and reached <= record.time[-1]:
        node = f"{desk.read}.pressure"
        at = float(np.interp(reached, record.time, record[node]))
        share = "90 %" if numbers.rising else "10 %"
        words = f"{share} after {span(reached - numbers.command_time)}"
        x, y = from_si(reached, "s", "ms"), from_si(at, "Pa", "bar")
        marks += [
            Mark("", x=x),
            Mark(words, x=x, y=0.4 * y if numbers.rising else from_si(0.6 * numbers.before, "Pa", "bar")),
        ]
    summary = (
        f"Pressure of {', '.join(desk.sensors)} over {with_unit(record.time[-1], 's')}; it {ending(desk, numbers)}"
    )
    return Chart("Pressure", summary, Axis("Time", "ms"), Axis("Pressure", "bar", "pressure"), lines, marks, height=256)


def flow_chart(desk: CircuitState, record: Recording) -> Chart:
    """Chart of the flows at flow sensors."""
    lines = []
    for i, name in enumerate(desk.flows):
        sign = "q" if len(desk.flows) == 1 else f"q{i + 1}"
        values = response.litres(record[response.flow_channel(desk.plan, name)])
        lines.append(
            ChartLine(_ms(record), values, f"{sign} {name}", "flow", dash="ABCD"[i % 4] if i else "", width=2.0)
        )
    summary = f"Flow of {', '.join(desk.flows)} as a volume of reference air"
    return Chart("Flow", summary, Axis("Time", "ms"), Axis("Flow", "L/min", "flow"), lines, height=150)


def ending(desk: CircuitState, outputs: response.ResponseNumbers) -> str:
    """Final value of a pressure, as text after its name."""
    if outputs.settled:
        longer = outputs.duration > 1.5 * desk.plan.duration
        return f"{'settles' if longer else 'ends'} at {with_unit(outputs.after, 'Pa')}"
    return "has not settled"


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
        rows.append(
            (f"{node} has not settled", f"{why}: in the last fifth it changes by {abs(outputs.drift):.1%} of its step")
        )
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
    y = from_si(1.0, "s", "ms") * sweep.rises
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
        Chart(
            f"Rise over {word}",
            f"Time to 90 % for {len(x)} values of {word}",
            Axis(word.capitalize(), unit, low=0.0),
            Axis("Time to 90 %", "ms", low=0.0),
            lines,
            height=130,
        ).show()


def palette() -> None:
    """Build the palette of parts."""
    with box("div", "hd"), box("h2"):
        text("span", "Parts")
    with box("div", "palette"):
        for name, part in edit.PARTS.items():
            markup = f"{diagram.symbol(name)}<span>{part.name}</span><kbd>{part.key}</kbd>"
            raw(markup, "button", "add").set(
                type="button",
                draggable="true",
                data_add=name,
                data_key=part.key.lower(),
                title=f"Add {part.name.lower()}: drag it, or Insert and {part.key}",
            )
