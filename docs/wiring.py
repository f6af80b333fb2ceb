"""Schematics of the wiring of an Arduino Uno and of an STM32F405: supply, what vents, the valve, and the sensors."""

from __future__ import annotations

import sys
from pathlib import Path

import schemdraw
import schemdraw.elements as elm
from schemdraw import logic

PAPER, INK = "#ffffff", "#1f2933"


def _drawing() -> schemdraw.Drawing:
    schemdraw.use("svg")
    drawing = schemdraw.Drawing(show=False)
    drawing.config(bgcolor=PAPER, color=INK, fontsize=11, unit=2.2, margin=0.3)
    return drawing


def _switch(d: schemdraw.Drawing, gate: tuple[float, float], name: str, load: str, diode: str) -> None:
    """A transistor that switches a load from 24 V, with the diode across the load."""
    q = d.add(elm.NFet(bulk=False).reverse().theta(0).anchor("gate").at(gate).label(name, "right", ofst=0.2))
    d.add(elm.Line().at(q.source).down(0.4))
    d.add(elm.Ground())
    drain = d.add(elm.Line().at(q.drain).up(0.4))
    d.add(elm.Dot())
    coil = d.add(elm.Inductor2().up(2.2).at(drain.end).label(load, "top", ofst=0.15))
    d.add(elm.Dot())
    d.add(elm.Line().at(coil.end).up(0.3))
    d.add(elm.Vdd().label("24 V"))
    d.add(elm.Line().at(drain.end).right(1.5))
    d.add(elm.Diode().up(2.2).label(diode, "bottom"))
    d.add(elm.Line().left(1.5))


def vent() -> schemdraw.Drawing:
    """Draw the pump that holds the dump valve shut while the board is alive, and the driver of the shut-off."""
    with _drawing() as d:
        d.add(elm.Dot(open=True).label("D4 alive", "left"))
        d.add(elm.Resistor().right().label("R1\n220 Ω"))
        d.add(elm.Capacitor().right().label("C1\n100 nF"))
        x = d.add(elm.Dot())
        d.add(elm.Schottky().at(x.center).down(2.2).reverse().label("V1\n1N5819", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Schottky().at(x.center).right(2.4).label("V2 1N5819"))
        y = d.add(elm.Dot())
        d.add(elm.Capacitor().at(y.center).down(2.2).label("C2\n100 nF", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(y.center).right(2.2))
        z = d.add(elm.Dot())
        d.add(elm.Resistor().at(z.center).down(2.2).label("R2\n68 kΩ", "bottom"))
        d.add(elm.Ground())
        line = d.add(elm.Line().at(z.center).right(1.6))
        _switch(d, line.end, "Q1\nIRLZ44N", "dump valve,\nopen without\ncurrent", "V3\n1N4007")
        a = d.add(elm.Dot(open=True).at((0, -7.8)).label("D7 shut-off", "left"))
        d.add(elm.Resistor().at(a.center).right().label("R3\n220 Ω"))
        b = d.add(elm.Dot())
        d.add(elm.Resistor().at(b.center).down(2.2).label("R4\n10 kΩ", "bottom"))
        d.add(elm.Ground())
        line = d.add(elm.Line().at(b.center).right(7.6))
        _switch(d, line.end, "Q2\nIRLZ44N", "shut-off,\nopen without\ncurrent", "V4\n1N4007")
    return d


def valve() -> schemdraw.Drawing:
    """Draw the filter and amplifier from a PWM of 5 V to 0 to 10 V."""
    with _drawing() as d:
        d.add(elm.Dot(open=True).label("D9 valve", "left"))
        d.add(elm.Line().right(0.8))
        p = d.add(elm.Dot())
        d.add(elm.Resistor().at(p.center).down(2.2).label("R5\n10 kΩ", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Resistor().at(p.center).right(2.4).label("R6 4.7 kΩ"))
        a = d.add(elm.Dot())
        d.add(elm.Capacitor().at(a.center).down(2.2).label("C3\n100 nF", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Resistor().at(a.center).right(2.8).label("R7 47 kΩ"))
        b = d.add(elm.Dot())
        d.add(elm.Capacitor().at(b.center).down(2.2).label("C4\n10 nF", "bottom"))
        d.add(elm.Ground())
        line = d.add(elm.Line().at(b.center).right(2.2))
        op = d.add(
            elm.Opamp().flip().anchor("in2").at(line.end).label("U1A\nLM358", "center", fontsize=9, ofst=(-0.2, 0))
        )
        d.add(elm.Label().at((line.end[0] - 0.2, line.end[1] + 0.1)).label("3", fontsize=8))
        d.add(elm.Label().at((op.in1[0] - 0.25, op.in1[1] + 0.1)).label("2", fontsize=8))
        d.add(elm.Label().at((op.out[0] + 0.15, op.out[1] + 0.05)).label("1", fontsize=8))
        d.add(
            elm.Label()
            .at((op.out[0] - 0.6, op.out[1] + 1.6))
            .label("pin 8: 24 V, 100 nF to ground\npin 4: ground", fontsize=9)
        )
        d.add(elm.Line().at(op.out).right(0.4))
        out = d.add(elm.Dot())
        d.add(elm.Resistor().at(out.center).right(2.2).label("R18 100 Ω"))
        z = d.add(elm.Dot())
        d.add(elm.Zener().at(z.center).down(2.4).reverse().label("V5\nBZX55C12", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(z.center).right(0.8))
        d.add(elm.Dot(open=True).label("0 to 10 V,\npressure\nregulator", "right"))
        d.add(elm.Line().at(op.in1).left(0.3))
        d.add(elm.Line().down(1.6))
        f = d.add(elm.Dot())
        d.add(elm.Resistor().at(f.center).tox(out.center).label("R8 10 kΩ", "bottom"))
        d.add(elm.Line().toy(out.center))
        d.add(elm.Resistor().at(f.center).down(1.8).label("R9\n10 kΩ", "bottom"))
        d.add(elm.Ground())
    return d


def sensor() -> schemdraw.Drawing:
    """Draw the input of one sensor, of which there are three."""
    with _drawing() as d:
        d.add(elm.Dot(open=True).label("sensor,\n0.5 to 4.5 V", "left"))
        d.add(elm.Line().right(0.8))
        s = d.add(elm.Dot())
        d.add(elm.Resistor().at(s.center).down(2.6).label("R10\n100 kΩ", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Resistor().at(s.center).right(2.6).label("R11 1 kΩ"))
        m = d.add(elm.Dot())
        d.add(elm.Schottky().at(m.center).up(1.9).label("½ BAT54S", "bottom"))
        d.add(elm.Vdd().label("5 V"))
        d.add(elm.Schottky().at(m.center).down(2.6).reverse().label("½ BAT54S", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(m.center).right(3.0))
        c = d.add(elm.Dot())
        d.add(elm.Capacitor().at(c.center).down(2.6).label("C5\n1 µF", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(c.center).right(1.0))
        d.add(elm.Dot(open=True).label("A0, A1, A2", "right"))
    return d


OUTPUTS = (
    ("PB12 alive", "to R1, as D4"),
    ("PB13 shut-off", "to R3, as D7"),
    ("PC8 valve", "to R5, as D9"),
    ("PC9 motor", "to its R5, as D10"),
)


def supply() -> schemdraw.Drawing:
    """Draw the supply: fuse, protection against exchanged leads, emergency stop, and what each of them feeds."""
    with _drawing() as d:
        d.add(elm.Dot(open=True).label("24 V DC,\n2.5 A", "left"))
        d.add(elm.Fuse().right(2.4).label("F1 2 A slow"))
        p = d.add(elm.Dot())
        d.add(elm.Diode().at(p.center).down(2.4).reverse().label("V6\n1N5401", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(p.center).right(2.0))
        c = d.add(elm.Dot())
        d.add(elm.Capacitor(polar=True).at(c.center).down(2.4).label("C7\n470 µF, 35 V", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(c.center).right(1.6))
        d.add(elm.Button(nc=True).right(2.4).label("S1 emergency stop,\nopens when pressed", "top", ofst=0.25))
        d.add(elm.Line().right(0.8))
        d.add(elm.Dot(open=True).label("24 V of\ndump valve,\nshut-off,\nregulator, U1", "right"))
        d.add(elm.Dot(open=True).at((0, -4.9)).label("motor\nenable", "left"))
        d.add(elm.Line().right(6.0))
        d.add(elm.Button(nc=True).right(2.4).label("S1, second contact", "top", ofst=0.25))
        d.add(elm.Line().right(0.8))
        d.add(elm.Dot(open=True).label("drain of Q1", "right"))
    return d


def load_cell() -> schemdraw.Drawing:
    """Draw the amplifier of a load cell with strain gauges: gain 400, and 0.5 V without a load."""
    pins = [
        elm.IcPin(name="+IN", pin="3", side="left", slot="4/4", anchorname="plus"),
        elm.IcPin(name="RG", pin="8", side="left", slot="3/4", anchorname="g1"),
        elm.IcPin(name="RG", pin="1", side="left", slot="2/4", anchorname="g2"),
        elm.IcPin(name="−IN", pin="2", side="left", slot="1/4", anchorname="minus"),
        elm.IcPin(name="OUT", pin="6", side="right", slot="4/4", anchorname="out"),
        elm.IcPin(name="REF", pin="5", side="right", slot="1/4", anchorname="ref"),
        elm.IcPin(name="V+", pin="7", side="top", slot="1/1", anchorname="vs"),
        elm.IcPin(name="V−", pin="4", side="bottom", slot="1/1", anchorname="gnd"),
    ]
    with _drawing() as d:
        d.add(elm.Dot(open=True).at((0, 0)).label("signal +", "left"))
        d.add(elm.Line().right(2.6))
        box = elm.Ic(pins=pins, edgepadW=1.0, edgepadH=0.2, pinspacing=1.2, leadlen=0.6)
        box = d.add(box.anchor("plus").at((2.6, 0)).label("U3\nINA333", "center", fontsize=10))
        d.add(elm.Line().at(box.minus).tox(0))
        d.add(elm.Dot(open=True).label("signal −", "left"))
        d.add(elm.Line().at(box.g1).left(0.5))
        d.add(elm.Resistor().toy(box.g2).label("R19\n249 Ω", "top", ofst=0.1))
        d.add(elm.Line().tox(box.g2))
        d.add(elm.Line().at(box.vs).up(0.3))
        d.add(elm.Vdd().label("5 V, 100 nF to ground"))
        d.add(elm.Ground().at(box.gnd))
        d.add(elm.Line().at(box.out).right(3.0))
        d.add(elm.Dot(open=True).label("to R11 of A1", "right"))
        d.add(elm.Line().at(box.ref).right(0.4))
        f = d.add(elm.Dot())
        d.add(elm.Line().at(f.center).right(0.4))
        op = d.add(elm.Opamp().left().anchor("out").label("U4A\nMCP6002", "center", fontsize=8, ofst=(0.2, 0)))
        d.add(elm.Line().at(op.in1).right(0.4))
        d.add(elm.Line().down(1.2))
        d.add(elm.Line().tox(f.center))
        d.add(elm.Line().toy(f.center))
        d.add(elm.Line().at(op.in2).right(2.6))
        r = d.add(elm.Dot())
        d.add(elm.Resistor().at(r.center).up(2.0).label("R20\n18 kΩ", "bottom"))
        d.add(elm.Vdd().label("5 V"))
        d.add(elm.Resistor().at(r.center).down(2.0).label("R21\n2.0 kΩ", "bottom"))
        d.add(elm.Ground())
        d.add(
            elm.Label()
            .at((op.out[0] + 1.4, op.out[1] - 3.4))
            .label(
                "U4: output 1, inputs 2 (−) and 3 (+), 5 V at 8, ground at 4;\nconnect 6 with 7, and 5 to ground",
                fontsize=9,
            )
        )
    return d


def stm32_outputs() -> schemdraw.Drawing:
    """Draw the four outputs of an STM32F405, which a buffer lifts from 3.3 V to 5 V."""
    with _drawing() as d:
        for i, (pin, circuit) in enumerate(OUTPUTS):
            d.add(elm.Dot(open=True).at((0.0, -3.4 * i)).label(pin, "left"))
            d.add(elm.Line().right(1.0))
            p = d.add(elm.Dot())
            d.add(elm.Resistor().at(p.center).down(1.8).label(f"R{12 + i}\n10 kΩ", "bottom"))
            d.add(elm.Ground())
            d.add(elm.Line().at(p.center).right(2.0))
            gate = d.add(logic.Buf().right().label(f"U2{'ABCD'[i]}", "bottom", fontsize=9, ofst=0.35))
            d.add(elm.Line().at(gate.out).right(1.2))
            d.add(elm.Dot(open=True).label(circuit, "right"))
        d.add(elm.Label().at((2.5, 1.2)).label("U2: 74AHCT125, pin 14 at 5 V,\npins 1, 4, 7, 10 and 13 at ground"))
    return d


def stm32_sensor() -> schemdraw.Drawing:
    """Draw the input of one sensor of 5 V at an STM32F405, of which there are three."""
    with _drawing() as d:
        d.add(elm.Dot(open=True).label("sensor,\n0.5 to 4.5 V", "left"))
        d.add(elm.Resistor().right(2.6).label("R16 10 kΩ"))
        m = d.add(elm.Dot())
        d.add(elm.Resistor().at(m.center).down(2.6).label("R17\n20 kΩ", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(m.center).right(2.6))
        s = d.add(elm.Dot())
        d.add(elm.Schottky().at(s.center).up(1.9).label("½ BAT54S", "bottom"))
        d.add(elm.Vdd().label("3.3 V"))
        d.add(elm.Schottky().at(s.center).down(2.6).reverse().label("½ BAT54S", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(s.center).right(3.0))
        c = d.add(elm.Dot())
        d.add(elm.Capacitor().at(c.center).down(2.6).label("C6\n150 nF", "bottom"))
        d.add(elm.Ground())
        d.add(elm.Line().at(c.center).right(1.0))
        d.add(elm.Dot(open=True).label("PC0, PC1, PC2", "right"))
    return d


def save(folder: Path) -> None:
    """Write the schematics to a folder."""
    for draw in (supply, vent, valve, sensor, load_cell, stm32_outputs, stm32_sensor):
        name = draw.__name__.replace("_", "-")
        (folder / f"{name}.svg").write_bytes(draw().get_imagedata("svg"))


if __name__ == "__main__":
    save(Path(sys.argv[1]))
