"""Symbols of valves, and which part has which symbol.

Valves stand upright, their actuators above and below, so that lines reach the boxes from the sides and not through a
solenoid. The box at the spring is the rest position; that of a valve with three is in the middle. All lengths are points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .circuit_symbols import (
    LEVEL,
    THIN,
    Box,
    Mark,
    Point,
    Port,
    Symbol,
    arrow,
    circle,
    compressor,
    leak,
    level_ports,
    line,
    rectangle,
    restriction,
    spring,
    tube,
)
from .style import PANEL

BOX = 26.0


_EXHAUST = ("exhaust", "vent", "relief", "atmosphere", "r", "s", "ea", "eb", "3", "5")
_SUPPLY = ("supply", "inlet", "in", "p", "source", "1")


def roles(ports: Sequence[str]) -> list[str]:
    """What each port is for: in, out or exhaust; the first port is the inlet where no name says so."""
    found = [
        "exhaust" if p.startswith(_EXHAUST[:4]) or p in _EXHAUST else "in" if p in _SUPPLY else "out" for p in ports
    ]
    if "in" not in found:
        found[0] = "in"
    return found


def _by_role(ports: Sequence[str], at: dict[str, Port]) -> tuple[Port, ...]:
    return tuple(at[role] for role in roles(ports))


def check_valve(ports: Sequence[str], driven: bool) -> Symbol:
    """A ball in its seat; gas lifts it from left to right."""
    seat = line((3.0, 11.0), (-8.5, 0.0), (3.0, -11.0))
    marks = (line((-11.0, 0.0), (-8.5, 0.0)), seat, circle(0.0, 0.0, 5.9), line((5.9, 0.0), (11.0, 0.0)))
    return Symbol(marks, Box(-11.0, -12.0, 11.0, 12.0), level_ports(11.0), (0.0, 12.0))


def regulator(ports: Sequence[str], driven: bool) -> Symbol:
    """A pressure reducing valve: adjustable spring on top, pilot line from its outlet."""
    marks = [rectangle(-13.0, -13.0, 13.0, 13.0), line((13.0, 0.0), (18.0, 0.0))]
    marks += arrow((-13.0, -4.0), (13.0, -4.0))
    marks.append(line((18.0, 0.0), (18.0, -19.0), (0.0, -19.0), (0.0, -13.0), width=THIN, dash=(3.0, 2.0)))
    marks.append(spring(0.0, 13.0, 14.0))
    marks += arrow((-12.0, 14.0), (12.0, 28.0), width=0.7)
    at = {"in": Port(-13.0, 0.0, -1), "out": Port(18.0, 0.0, 1), "exhaust": Port(13.0, -9.0, 1)}
    return Symbol(tuple(marks), Box(-14.0, -20.0, 19.0, 29.0), _by_role(ports, at), (0.0, 27.0))


def quick_exhaust(ports: Sequence[str], driven: bool) -> Symbol:
    """A ball between the seats of inlet and exhaust, the outlet from between them: inlet left, exhaust below."""
    marks = [Mark(rectangle(-19.0, -17.0, 19.0, 13.0).path, PANEL, THIN, dash=(5.0, 2.0, 1.0, 2.0))]
    marks += [line((-19.0, 0.0), (-9.0, 0.0)), line((-3.0, 7.0), (-9.0, 0.0), (-3.0, -7.0)), circle(-3.0, 0.0, 3.9)]
    marks += [line((0.0, 4.0), (0.0, 10.0), (14.0, 10.0), (14.0, 0.0), (19.0, 0.0))]
    marks += [line((3.0, 7.0), (9.0, 0.0), (3.0, -7.0)), line((9.0, 0.0), (9.0, -11.0), (19.0, -11.0))]
    at = {"in": Port(-19.0, 0.0, -1), "out": Port(19.0, 0.0, 1), "exhaust": Port(19.0, -11.0, 1)}
    return Symbol(tuple(marks), Box(-20.0, -18.0, 20.0, 14.0), _by_role(ports, at), (0.0, 14.0))


def on_off_valve(ports: Sequence[str], driven: bool) -> Symbol:
    """Two positions, a spring below and a solenoid above; 2/2, 3/2 or more by its ports."""
    return _valve(ports, positions=2, proportional=False)


def proportional_valve(ports: Sequence[str], driven: bool) -> Symbol:
    """Three positions with all between them: two lines along the boxes, an arrow across the solenoid."""
    return _valve(ports, positions=3, proportional=True)


def _valve(ports: Sequence[str], *, positions: int, proportional: bool) -> Symbol:
    role = roles(ports)
    works, exhausts = role.count("out"), role.count("exhaust")
    levels = max(works, role.count("in") + exhausts)
    high, wide = BOX + LEVEL * (levels - 1), BOX / 2.0 + 2.0
    low = -LEVEL * (levels - 1) - BOX / 2.0
    kinds = ["fill", "vent"] if positions == 2 else ["fill", "closed", "vent"]
    if not exhausts:
        kinds = ["fill", "closed"]
    rest = 1 if len(kinds) == 3 else 0  # boxes below the one that the lines meet
    bottom = low - high * rest
    marks: list[Mark] = []
    for i, kind in enumerate(reversed(kinds)):
        marks.append(rectangle(-wide, bottom + i * high, wide, bottom + (i + 1) * high))
        marks += _inside(kind, wide, (i - rest) * high, role)
    top = bottom + len(kinds) * high
    marks += [spring(0.0, bottom - 11.0, 11.0), line((-6.0, bottom - 11.0), (6.0, bottom - 11.0), width=THIN)]
    marks += [rectangle(-9.0, top, 9.0, top + 9.0), line((-4.0, top), (4.0, top + 9.0), width=THIN)]
    side = wide
    if proportional:
        side = wide + 3.5
        marks += [line((s * side, bottom), (s * side, top), width=THIN) for s in (-1, 1)]
        marks += arrow((-11.0, top - 2.0), (12.0, top + 13.0))
    at, used = [], {-1: 0, 1: 0}
    for r in sorted(range(len(ports)), key=lambda i: ("in", "out", "exhaust").index(role[i])):
        way = 1 if role[r] == "out" else -1
        at.append((r, Port(way * side, -LEVEL * used[way], way)))
        marks.append(line((way * wide, at[-1][1].y), (way * side, at[-1][1].y)))
        used[way] += 1
    box = Box(-side, bottom - 12.0, side, top + (14.0 if proportional else 10.0))
    return Symbol(tuple(marks), box, tuple(p for _, p in sorted(at)), (0.0, top + 9.0))


def _inside(kind: str, wide: float, y: float, role: Sequence[str]) -> list[Mark]:
    """What a position joins, drawn into its box."""
    left = [y - LEVEL * i for i in range(role.count("in") + role.count("exhaust"))]
    right = [y - LEVEL * i for i in range(role.count("out"))]
    open_left, open_right = set(left), set(right)
    marks: list[Mark] = []

    def join(start: Point, end: Point) -> None:
        marks.extend(arrow(start, end))
        open_left.discard(start[1] if start[0] < 0 else end[1])
        open_right.discard(start[1] if start[0] > 0 else end[1])

    if kind != "closed":
        first, second = (0, 1) if kind == "fill" else (1, 0)
        exit_ = left[-1] if len(left) < 3 else left[1 + first]
        if kind == "fill" or len(right) > 1:
            join((-wide, left[0]), (wide, right[first]))
        if kind == "vent":
            join((wide, right[0]), (-wide, left[1] if len(left) > 1 else left[0]))
        elif len(right) > 1 and len(left) > 1:
            join((wide, right[second]), (-wide, exit_))
    for sign, free in ((-1.0, open_left), (1.0, open_right)):
        for at in sorted(free):
            marks.append(line((sign * wide, at), (sign * (wide - 6.0), at), width=THIN))
            marks.append(line((sign * (wide - 6.0), at - 3.5), (sign * (wide - 6.0), at + 3.5), width=THIN))
    return marks


# By the name that an element declares as its `symbol`.
SYMBOLS: dict[str, Callable[[Sequence[str], bool], Symbol]] = {
    "restriction": restriction,
    "leak": leak,
    "check_valve": check_valve,
    "on_off_valve": on_off_valve,
    "proportional_valve": proportional_valve,
    "regulator": regulator,
    "quick_exhaust": quick_exhaust,
    "compressor": compressor,
    "tube": tube,
}
