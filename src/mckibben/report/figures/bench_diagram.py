"""Diagram of a test machine's signal path: supply, muscle and motor above, converters between, the software below.

Signals go round: down through the sensors on the one side, up through the outputs on the other. What is measured or told is
dashed, what holds gas or pulls is not. A star marks numbers that the rig infers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ...bench.hardware.converters import AnalogOut, Sensor
from ...bench.rig import Rig
from ...bench.sensors import SENSORS
from ...engine import STEP
from ...experiments.waveforms import time_words
from ...quantities import from_si, with_unit
from . import style
from .circuit_cells import Text, Words, stacked
from .circuit_diagram import draw_mark, draw_text
from .circuit_symbols import Point, Stroke, arrow, dot, line, muscle, rectangle, source, tube
from .style import COLOURS, INK, INK_3, NORMAL, PANEL, SMALL, SUNKEN

if TYPE_CHECKING:
    from matplotlib.figure import Figure


WIDE, HIGH = 756.0, 430.0  # of the picture [pt]
LEFT, RIGHT = 14.0, WIDE - 14.0
TOP = 314.0  # of the line along which the parts that hold gas or pull stand
SENSOR_ROW, BORDER, BUS, WORK, COMMANDS = 238.0, 168.0, 116.0, 90.0, 42.0  # upper edges of the rows below it
PHYSICS, SOFTWARE = (SENSOR_ROW - 52.0, HIGH - 36.0), (6.0, BUS + 10.0)  # grounds, from and to
BOX = 112.0  # width of a box of a channel
VALVE, MOTOR = 84.0, 672.0  # where commands go up
WATCH = 557.0  # of the interlocks, the last of what the software does
TAPS = {"valve_pressure": 209.0, "pressure": 325.0, "tension": 441.0, "span": 557.0}
ANGLE = 0.6  # of the threads that are drawn [rad]
DASH = (3.0, 2.0)
HEAD = 4.0  # of a lead's arrow [pt]


@style.styled()
def draw(rig: Rig, *, layout: str | None = None, sample_rate: float | None = None, title: str = "") -> Figure:
    """Draw the signal path of a rig, with its numbers.

    Args:
        rig: the rig to draw.
        layout: name of the plumbing; the usual one by default.
        sample_rate: sample rate of the software [1/s]; by default 1 kHz, or the highest rate of a slower computer.
        title: stands over it; the rig's own by default.
    """
    fig = style.drawing(WIDE / 72.0, HIGH / 72.0)
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_xlim(0.0, WIDE)
    ax.set_ylim(0.0, HIGH)
    drawing = _Drawing(rig, layout or next(iter(rig.plumbing)))
    drawing.bands(min(1000.0, float(rig.computer.highest_rate)) if sample_rate is None else sample_rate)
    drawing.machine()
    drawing.channels()
    drawing.software()
    head = Words(title or rig.title, 12.0, True, INK)
    drawing.write([head], LEFT, HIGH - 12.0, "left")
    if rig.inferred:
        drawing.write([Words("* inferred", SMALL, False, INK_3)], RIGHT, HIGH - 16.0, "right")
    for mark in drawing.marks:
        draw_mark(ax, mark)
    for text in drawing.texts:
        draw_text(ax, text)
    return fig


class _Drawing:
    """Strokes and texts of one rig, collected row by row."""

    def __init__(self, rig: Rig, layout: str) -> None:
        self.rig, self.layout, self.plumbing = rig, layout, rig.plumbing[layout]
        self.marks: list[Stroke] = []
        self.texts: list[Text] = []

    # ---- rows

    def bands(self, rate: float) -> None:
        period = time_words(self.rig.computer.period(rate))
        for (low, high), top, name, note in (
            (
                PHYSICS,
                PHYSICS[1] - 7.0,
                "Physics",
                f"steps of {_micro(time_words(STEP))} or less, a whole number to a sample",
            ),
            (
                SOFTWARE,
                24.0,
                "Software",
                f"once per sample, every {_micro(period)}; sees nothing but the measured channels",
            ),
        ):
            self.marks.append(rectangle(LEFT, low, RIGHT, high, fill=SUNKEN)._replace(width=0.0, colour=SUNKEN))
            self.write([Words(name, NORMAL, True, INK)], LEFT + 9.0, top, "left")
            self.write([Words(note, SMALL, False, INK_3)], LEFT + 66.0, top - 1.0, "left")

    def machine(self) -> None:
        """Draw supply, valve, tube, muscle, cord and motor, from left to right."""
        p, near, far = self.plumbing, TAPS["valve_pressure"], TAPS["pressure"]
        self.put(source().marks, 52.0, TOP)
        supply = self.of("supply_pressure", with_unit(float(p.supply_pressure), "Pa", 3))
        self.write([Words("supply", SMALL, True, INK), Words(supply)], LEFT + 9.0, TOP + 36.0, "left")
        self.marks += [line((52.0, TOP), (VALVE, TOP)), line((VALVE, TOP), (far, TOP))]
        self.box(VALVE - 22.0, TOP + 14.0, 44.0, 28.0, [Words("valve", SMALL, True, INK)])
        delay = p.valve.delay()
        if delay is not None:
            late = self.of("valve.dead_time", f"dead time {time_words(float(delay))}")
            self.write([Words(late)], VALVE + 8.0, TOP - 24.0, "left")
        middle = 0.5 * (near + far)
        self.marks.append(line((middle - 34.0, TOP), (middle + 34.0, TOP), width=3.0, colour=SUNKEN))
        self.put(tube(("a", "b"), False).marks, middle, TOP)
        sizes = {name: getattr(p.tube, name, None) for name in ("length", "diameter")}
        stated = [
            self.of(f"tube.{n}", f"{from_si(float(v), 'm', 'mm'):.4g} mm") for n, v in sizes.items() if v is not None
        ]
        words = [Words("tube", SMALL, True, INK), *([Words(", ".join(stated))] if stated else [])]
        self.write(words, middle, TOP + 36.0, "center")
        self.put([dot()], near, TOP)
        for x, key in ((near, "valve_accumulator"), (far, "muscle_accumulator")):
            if p.has_muscle and float(getattr(p, key)) > 0.0:
                size = self.of(key, with_unit(float(getattr(p, key)), "m^3", 3).replace("^3", "\N{SUPERSCRIPT THREE}"))
                self.write([Words("accumulator"), Words(size)], x, TOP + 58.0, "center")
        if not p.has_muscle:
            self.box(far, TOP + 14.0, 74.0, 28.0, [Words("accumulator", SMALL, True, INK)])
            return
        self.put(muscle(ANGLE, hanging=False).marks, far, TOP)
        self.write([Words("muscle", SMALL, True, INK)], far + 65.0, TOP + 26.0, "center")
        x = far + 21.0
        y = TOP - 17.0
        self.marks += [line((x, TOP - 5.0), (x, y)), line((x - 6.0, y), (x + 18.0, y))]
        self.marks += [line((x - 4.0 + 5.5 * i, y), (x - 8.0 + 5.5 * i, y - 5.0), width=0.7) for i in range(5)]
        self.write([Words("frame")], x + 23.0, y + 7.0, "left")
        motor = self.rig.motor
        wall = MOTOR - 34.0
        self.marks.append(line((far + 118.0, TOP), (wall, TOP), colour=COLOURS["tension"]))
        if motor is None:
            self.marks.append(line((wall, TOP - 18.0), (wall, TOP + 18.0), width=2.4))
            return
        force = self.of("torque_constant", with_unit(float(motor.largest_force), "N", 3), "motor")
        self.box(wall, TOP + 18.0, 68.0, 36.0, [Words("motor", SMALL, True, INK), Words(force)])

    def channels(self) -> None:
        """Draw sensors with their filters and converters, and the outputs at the sides."""
        sensors = {**self.rig.sensors, **({"span": self.rig.encoder} if self.rig.encoder is not None else {})}
        pulled = ("tension", "span") if self.plumbing.has_muscle else ()
        names = [n for n in (*TAPS, *sensors) if n in sensors and (n in pulled or n not in ("tension", "span"))]
        columns, wide = _columns(list(dict.fromkeys(names)))
        for name, x in columns.items():
            kind, one = SENSORS[name] if name in self.rig.sensors else None, sensors[name]
            label, colour = (
                ("span", COLOURS["length"]) if kind is None else (kind.label, COLOURS.get(kind.quantity, INK))
            )
            shaft = MOTOR - 26.0  # the encoder is on the motor's
            bends: list[Point] = [(shaft, TOP - 18.0), (shaft, SENSOR_ROW + 16.0), (x, SENSOR_ROW + 16.0)]
            self.lead([*(bends if name == "span" else [(x, TOP)]), (x, SENSOR_ROW)], colour)
            called = label if self.plumbing.has_muscle else label.replace("muscle", "end")
            head = Words(called, SMALL, True, colour)
            self.box(x - wide / 2, SENSOR_ROW, wide, 42.0, [head, *self._sensor_words(name, one)])
            self.lead([(x, SENSOR_ROW - 42.0), (x, BORDER)], colour)
            self.box(x - wide / 2, BORDER, wide, 30.0, self._converter_words(name, one))
            self.lead([(x, BORDER - 30.0), (x, BUS)], colour)
        valve = self._output_words("valve", self.rig.valve_out, "Pa")
        self.output(VALVE, TOP - 14.0, valve)
        if self.rig.motor is not None and self.rig.motor_out is not None and self.plumbing.has_muscle:
            self.output(MOTOR, TOP - 18.0, self._output_words("motor", self.rig.motor_out, "N"))

    def _sensor_words(self, name: str, one: Any) -> list[Words]:
        if not isinstance(one, Sensor):
            edges = self.of("edges", f"{one.edges} edges each", "encoder")
            return [Words(self.of("steps_per_turn", f"{one.steps_per_turn} steps a turn", "encoder")), Words(edges)]
        low, high = (with_unit(float(v), SENSORS[name].unit, 4) for v in (one.low, one.high))
        cutoff = self.of("cutoff", f"filter {float(one.cutoff):g} Hz", f"sensors.{name}")
        return [Words(self.of("high", f"{low} to {high}", f"sensors.{name}")), Words(cutoff)]

    def _converter_words(self, name: str, one: Any) -> list[Words]:
        if isinstance(one, Sensor):
            each, kind, bits = _step(float(one.resolution), SENSORS[name].unit), "converter", one.converter.bits
        else:
            each, kind, bits = _step(float(one.resolution), "m"), "counter", one.counter_bits
        return [Words(kind, SMALL, True, INK), Words(f"{bits} bits, {each}")]

    def _output_words(self, name: str, out: AnalogOut, unit: str) -> list[Words]:
        each = _step(float(out.resolution), unit)
        head = Words(f"output, {name}", SMALL, True, INK)
        return [head, Words(f"{out.bits} bits, {each}"), Words("holds until the next")]

    def output(self, x: float, to: float, words: list[Words]) -> None:
        self.box(x - 50.0, BORDER + 8.0, 100.0, 42.0, words)
        self.lead([(WATCH, COMMANDS), (x, COMMANDS), (x, BORDER - 34.0)], COLOURS["valve"])
        self.lead([(x, BORDER + 8.0), (x, to)], COLOURS["valve"])

    def software(self) -> None:
        """Draw what the software does with a sample, in order; its commands take effect one latency later."""
        self.box(150.0, BUS, 464.0, 13.0, [Words("measured channels", SMALL, True, INK)])
        rows = (
            (209.0, "sequencer", "set-points, until tests"),
            (383.0, "controllers", "pressure, span, tension"),
            (WATCH, "interlocks", "stop, vent, brake"),
        )
        for x, name, note in rows:
            self.box(x - 59.0, WORK, 118.0, 30.0, [Words(name, SMALL, True, INK), Words(note)])
            self.lead([(x, BUS - 13.0), (x, WORK)], INK)
        for (x, *_), (following, *_) in zip(rows, rows[1:], strict=False):
            self.lead([(x + 59.0, WORK - 15.0), (following - 59.0, WORK - 15.0)], INK)
        self.marks.append(line((WATCH, WORK - 30.0), (WATCH, COMMANDS), dash=DASH, colour=COLOURS["valve"]))
        latency = self.of("latency", _micro(time_words(float(self.rig.computer.latency))), "computer")
        self.write([Words(f"commands, {latency} after the sample")], VALVE + 8.0, COMMANDS + 13.0, "left")

    # ---- strokes and words

    def of(self, key: str, words: str, table: str = "") -> str:
        path = f"{table or f'plumbing.{self.layout}'}.{key}"
        return words + ("*" if any(path == p or path.startswith(f"{p}.") for p in self.rig.inferred) else "")

    def put(self, marks: Iterable[Stroke], x: float, y: float) -> None:
        self.marks += [m.placed(x, y) for m in marks]

    def box(self, x: float, top: float, wide: float, high: float, words: list[Words]) -> None:
        self.marks.append(rectangle(x, top - high, x + wide, top, fill=PANEL))
        block = sum(1.25 * w.size + 0.5 for w in words)
        self.write(words, x + wide / 2, top - (high - block) / 2, "center")

    def lead(self, points: list[Point], colour: str) -> None:
        head = arrow(points[-2], points[-1])[1]
        (x, y), (near_x, near_y) = points[-1], points[-2]
        far = math.hypot(x - near_x, y - near_y)
        back = (x - HEAD * (x - near_x) / far, y - HEAD * (y - near_y) / far)
        self.marks.append(line(*points[:-1], back, dash=DASH, colour=colour))
        self.marks.append(head._replace(fill=colour, colour=colour))

    def write(self, words: list[Words], x: float, top: float, align: str) -> None:
        self.texts += stacked(words, x, top, align)


def _columns(names: list[str]) -> tuple[dict[str, float], float]:
    """Positions and width of the boxes of channels [pt]; evenly spaced for unusual channels."""
    if set(names) <= set(TAPS):
        return {name: TAPS[name] for name in names}, BOX
    first, last = min(TAPS.values()), max(TAPS.values())
    apart = (last - first) / (len(names) - 1)
    return {name: first + i * apart for i, name in enumerate(names)}, min(BOX, apart - 4.0)


def _step(size: float, unit: str) -> str:
    scale, small = {"Pa": (1e-2, "mbar"), "m": (1e6, "um")}.get(unit, (1.0, unit))
    return _micro(f"{style.number(float(f'{scale * size:.2g}'))} {small}")


def _micro(words: str) -> str:
    return words.replace(" us", " \N{MICRO SIGN}s").replace(" um", " \N{MICRO SIGN}m")
