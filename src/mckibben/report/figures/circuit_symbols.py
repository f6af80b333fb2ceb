"""Symbols of pneumatic parts by ISO 1219-1, as strokes around the origin on the line.

All lengths are points. A symbol stands on its line, which runs along y = 0 from left to right; y points up. A part
without a symbol of its own is a box with the name of its type.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .style import INK, LINE, PANEL, SUNKEN

if TYPE_CHECKING:
    from matplotlib.path import Path

THIN = 0.9
LEVEL = 12.0  # between two ports on one side
Point = tuple[float, float]


class Box(NamedTuple):
    """A rectangle by its left, lower, right and upper side [pt]."""

    x0: float
    y0: float
    x1: float
    y1: float

    def moved(self, x: float, y: float) -> Box:
        """Return a copy at another place."""
        return Box(self.x0 + x, self.y0 + y, self.x1 + x, self.y1 + y)

    def overlaps(self, other: Box, by: float = 0.0) -> bool:
        """Whether two rectangles share more than `by` in either direction."""
        wide = min(self.x1, other.x1) - max(self.x0, other.x0)
        return wide > by and min(self.y1, other.y1) - max(self.y0, other.y0) > by


def around(boxes: Iterable[Box]) -> Box:
    """Smallest rectangle around some others."""
    corners = np.array(list(boxes), float)
    return Box(*map(float, (*corners[:, :2].min(axis=0), *corners[:, 2:].max(axis=0))))


class Stroke(NamedTuple):
    """A stroke: its path, fill, width [pt], dash in line widths, and what it is drawn over."""

    path: Path
    fill: str = "none"
    width: float = LINE
    colour: str = INK
    dash: tuple[float, ...] = ()

    def placed(self, x: float, y: float, *, mirrored: bool = False) -> Stroke:
        """Return a copy at another place, mirrored if requested."""
        sign = -1.0 if mirrored else 1.0
        return self._replace(path=_path(np.asarray(self.path.vertices, float) * [sign, 1.0] + [x, y], self.path.codes))


class Port(NamedTuple):
    """Point at which a line meets a symbol, and the side on which it leaves: -1 left, 1 right."""

    x: float
    y: float
    side: int


class Symbol(NamedTuple):
    """Strokes with their bounding rectangle, ports in the part's order, and the point of the command."""

    marks: tuple[Stroke, ...]
    box: Box
    ports: tuple[Port, ...]
    top: Point

    def mirrored(self) -> Symbol:
        """Return the symbol with left and right exchanged."""
        box = Box(-self.box.x1, self.box.y0, -self.box.x0, self.box.y1)
        ports = tuple(Port(-p.x, p.y, -p.side) for p in self.ports)
        return Symbol(
            tuple(m.placed(0.0, 0.0, mirrored=True) for m in self.marks), box, ports, (-self.top[0], self.top[1])
        )


# ---- strokes

MOVETO, LINETO, CURVE4, CLOSEPOLY = 1, 2, 4, 79  # codes of matplotlib's paths


def _path(vertices: Any, codes: Any = None, *, closed: bool = False) -> Path:
    """Create a path; matplotlib is loaded with the first one."""
    from matplotlib.path import Path

    return Path(vertices, codes, closed=closed)


def line(*points: Point, width: float = LINE, dash: tuple[float, ...] = (), colour: str = INK) -> Stroke:
    """An open line through points."""
    return Stroke(_path(list(points)), width=width, dash=dash, colour=colour)


def shape(*points: Point, fill: str = PANEL, width: float = LINE) -> Stroke:
    """A closed polygon."""
    return Stroke(_path([*points, points[0]], closed=True), fill, width)


def circle(x: float, y: float, radius: float, fill: str = PANEL) -> Stroke:
    """A circle."""
    from matplotlib.path import Path

    return Stroke(Path.circle((x, y), radius), fill)


def rectangle(x0: float, y0: float, x1: float, y1: float, fill: str = PANEL) -> Stroke:
    """A rectangle."""
    return shape((x0, y0), (x1, y0), (x1, y1), (x0, y1), fill=fill)


def arrow(start: Point, end: Point, width: float = THIN) -> list[Stroke]:
    """A line with a filled head at its end."""
    angle = math.atan2(end[1] - start[1], end[0] - start[0])

    def back(length: float, wide: float) -> Point:
        return (
            end[0] - length * math.cos(angle) - wide * math.sin(angle),
            end[1] - length * math.sin(angle) + wide * math.cos(angle),
        )

    return [line(start, back(4.0, 0.0), width=width), shape(end, back(5.5, 2.2), back(5.5, -2.2), fill=INK, width=0.4)]


def spring(x: float, y: float, height: float, width: float = 8.0) -> Stroke:
    """Draw a zigzag above (x, y)."""
    turns = 5
    rows = [(x + (width / 2 if i % 2 else -width / 2), y + height * (i + 0.5) / turns) for i in range(turns)]
    return line((x, y), *rows, (x, y + height), width=THIN)


def exhaust(x: float, y: float) -> list[Stroke]:
    """The open triangle of a port to free air that points down from (x, y); 9 pt high."""
    return [shape((x - 6.0, y), (x + 6.0, y), (x, y - 9.0))]


# ---- nodes


def source() -> Symbol:
    """A pressure source: the open triangle of pneumatics that points along its line."""
    marks = (shape((-20.0, -10.5), (-20.0, 10.5), (0.0, 0.0)),)
    return Symbol(marks, Box(-21.0, -12.0, 0.0, 12.0), (Port(0.0, 0.0, 1),), (-20.0, 10.5))


def dot() -> Stroke:
    """The filled dot of a junction."""
    return circle(0.0, 0.0, 2.6, fill=INK)


def tank(volume: float) -> Symbol:
    """A vessel that hangs from its node, higher the larger its volume [m^3]."""
    size = 20.0 + 22.0 * min(max((math.log10(volume) + 7.0) / 4.0, 0.0), 1.0)
    r, top = 8.0, -12.0
    k = 0.5523 * r
    upper, lower = top - r, top - size + r
    vertices = [(-r, lower), (-r, upper), (-r, upper + k), (-k, top), (0, top), (k, top), (r, upper + k), (r, upper)]
    vertices += [
        (r, lower),
        (r, lower - k),
        (k, lower - r),
        (0, lower - r),
        (-k, lower - r),
        (-r, lower - k),
        (-r, lower),
    ]
    codes = [MOVETO, LINETO, *[CURVE4] * 6, LINETO, *[CURVE4] * 6, CLOSEPOLY]
    body = Stroke(_path([*vertices, vertices[0]], codes), PANEL)
    return Symbol(
        (line((0.0, 0.0), (0.0, top)), body, dot()), Box(-9.0, top - size - 1.0, 9.0, 3.5), _ends(0.0), (0.0, 3.5)
    )


def muscle(angle: float | None, *, hanging: bool) -> Symbol:
    """A McKibben muscle, its braid crossed at an angle from the long axis [rad], plain where that is unknown.

    Args:
        angle: braid angle, drawn as it is.
        hanging: below a node that leads on, instead of at the end of a line.
    """
    x, y = (8.0, -20.0) if hanging else (12.0, 0.0)
    long, half, ends = 84.0, 7.5, 11.0
    xs = np.linspace(0.0, long, 41)
    bulge = _bulge(xs, long, half)
    left = x + ends
    outline = [(left + a, y + b) for a, b in zip(xs, bulge, strict=True)]
    outline += [(left + a, y - b) for a, b in zip(xs[::-1], bulge[::-1], strict=True)]
    marks = [line((0.0, 0.0), (0.0, y), (x, y)), shape(*outline, fill=SUNKEN)]
    if angle is not None:
        marks += [Stroke(thread, width=0.45) for thread in _threads(left, y, long, half, angle)]
    for end in (x, left + long):
        marks.append(rectangle(end, y - 5.0, end + ends, y + 5.0))
        marks += [line((end + i * ends / 4, y - 5.0), (end + i * ends / 4, y + 5.0), width=THIN) for i in (1, 2, 3)]
    right = left + long + ends
    return Symbol(
        (*marks, dot()), Box(-3.5, y - half - 1.0, right + 1.0, max(y + half + 1.0, 3.5)), _ends(0.0), (right, y)
    )


def _bulge(x: np.ndarray, long: float, half: float) -> np.ndarray:
    bulge: np.ndarray = half * (0.6 + 0.4 * np.minimum(np.minimum(x, long - x) / 12.0, 1.0) ** 0.5)
    return bulge


def _threads(left: float, y: float, long: float, half: float, angle: float) -> list[Path]:
    """Threads of both hands between the fittings, as one zigzag each that turns at the outline."""
    slope = math.tan(min(max(angle, 0.15), 1.4))
    run = 2.0 * half / slope  # along the axis while a thread crosses from edge to edge
    gap = min(run, 7.0)
    parts: list[Path] = []
    for hand in (1.0, -1.0):
        start = -run
        while start < long:
            low, high = max(start, 0.0), min(start + run, long)
            if high - low > 1.0:
                at = np.linspace(low, high, 9)
                edge = _bulge(at, long, half)
                across = hand * slope * (at - start - run / 2.0)
                # A thread stays within the narrowing beside the fittings.
                parts.append(_path(np.column_stack([left + at, y + np.clip(across, -edge, edge)])))
            start += gap
    return parts


def _ends(x: float) -> tuple[Port, Port]:
    return Port(x, 0.0, -1), Port(x, 0.0, 1)


# ---- elements


def restriction(ports: Sequence[str], driven: bool) -> Symbol:
    """Draw a restriction as two arcs; with an arrow across if a command opens it."""
    arcs = [
        Stroke(_path([(-11.0, s * 9.5), (-5.0, s * 1.2), (5.0, s * 1.2), (11.0, s * 9.5)], _CURVE)) for s in (1.0, -1.0)
    ]
    marks = [line((-14.0, 0.0), (14.0, 0.0)), *arcs]
    if driven:
        marks += arrow((-12.0, -12.0), (12.0, 13.0))
    high = 14.0 if driven else 9.0
    return Symbol(
        tuple(marks), Box(-15.0, -high, 15.0, high), level_ports(14.0), (12.0, 13.0) if driven else (0.0, 9.0)
    )


_CURVE = [MOVETO, CURVE4, CURVE4, CURVE4]


def leak(ports: Sequence[str], driven: bool) -> Symbol:
    """Symbol of a leak: a restriction with a drop below it."""
    plain = restriction(ports, driven)
    drops = []
    for x, y, s in ((-4.0, -10.0, 1.0), (4.5, -13.0, 0.8)):
        tip, r = (x, y), 2.6 * s
        vertices = [tip, (x + r, y - 4 * s), (x + r * 1.3, y - 8 * s), (x, y - 8 * s)]
        vertices += [(x - r * 1.3, y - 8 * s), (x - r, y - 4 * s), tip]
        drops.append(Stroke(_path(vertices, [MOVETO, *[CURVE4] * 6]), INK, 0.5))
    return plain._replace(marks=(*plain.marks, *drops), box=plain.box._replace(y0=-21.0))


def tube(ports: Sequence[str], driven: bool) -> Symbol:
    """A flexible tube: a long line that waves."""
    x = np.linspace(-33.0, 33.0, 97)
    wave = [(float(a), 4.2 * math.sin(2.0 * math.pi * 5.0 * (a + 33.0) / 66.0)) for a in x]
    marks = (line((-36.0, 0.0), *wave, (36.0, 0.0), width=1.7),)
    return Symbol(marks, Box(-36.0, -6.0, 36.0, 6.0), level_ports(36.0), (0.0, 6.0))


def compressor(ports: Sequence[str], driven: bool) -> Symbol:
    """A circle with the open triangle of pneumatics at its outlet."""
    marks = [circle(0.0, 0.0, 14.0), shape((4.0, -6.5), (4.0, 6.5), (14.0, 0.0))]
    return Symbol(tuple(marks), Box(-15.0, -15.0, 15.0, 15.0), level_ports(14.0), (0.0, 14.0))


def plain_box(name: str, width: float) -> Callable[[Sequence[str], bool], Symbol]:
    """A box for a part without symbol, `width` wide [pt]; the layout writes its name into it."""

    def box(ports: Sequence[str], driven: bool) -> Symbol:
        half = max(width / 2.0 + 6.0, 16.0)
        left = (len(ports) + 1) // 2
        right = len(ports) - left
        low = -LEVEL * (max(left, right, 1) - 1) - 13.0
        at = [Port(-half, -LEVEL * i, -1) for i in range(left)] + [Port(half, -LEVEL * i, 1) for i in range(right)]
        frame = rectangle(-half, low, half, 13.0)
        return Symbol((frame,), Box(-half - 1, low - 1, half + 1, 14.0), tuple(at), (0.0, 13.0))

    return box


def level_ports(x: float) -> tuple[Port, Port]:
    """Ports of a part in line."""
    return Port(-x, 0.0, -1), Port(x, 0.0, 1)


BOX = 26.0


_EXHAUST = ("exhaust", "vent", "relief", "atmosphere", "r", "s", "ea", "eb", "3", "5")
_SUPPLY = ("supply", "inlet", "in", "p", "source", "1")


def roles(ports: Sequence[str]) -> list[str]:
    """Role of each port by its name: in, out or exhaust; the first port is the inlet if no name says it."""
    names = [
        "exhaust" if p.startswith(_EXHAUST[:4]) or p in _EXHAUST else "in" if p in _SUPPLY else "out" for p in ports
    ]
    if "in" not in names:
        names[0] = "in"
    return names


def _by_role(ports: Sequence[str], at: dict[str, Port]) -> tuple[Port, ...]:
    return tuple(at[role] for role in roles(ports))


def check_valve(ports: Sequence[str], driven: bool) -> Symbol:
    """A ball in its seat, opened by flow from left to right."""
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
    marks = [Stroke(rectangle(-19.0, -17.0, 19.0, 13.0).path, PANEL, THIN, dash=(5.0, 2.0, 1.0, 2.0))]
    marks += [line((-19.0, 0.0), (-9.0, 0.0)), line((-3.0, 7.0), (-9.0, 0.0), (-3.0, -7.0)), circle(-3.0, 0.0, 3.9)]
    marks += [line((0.0, 4.0), (0.0, 10.0), (14.0, 10.0), (14.0, 0.0), (19.0, 0.0))]
    marks += [line((3.0, 7.0), (9.0, 0.0), (3.0, -7.0)), line((9.0, 0.0), (9.0, -11.0), (19.0, -11.0))]
    at = {"in": Port(-19.0, 0.0, -1), "out": Port(19.0, 0.0, 1), "exhaust": Port(19.0, -11.0, 1)}
    return Symbol(tuple(marks), Box(-20.0, -18.0, 20.0, 14.0), _by_role(ports, at), (0.0, 14.0))


def on_off_valve(ports: Sequence[str], driven: bool) -> Symbol:
    """Draw two positions, a spring below and a solenoid above; 2/2, 3/2 or more by its ports."""
    return _valve(ports, positions=2, proportional=False)


def proportional_valve(ports: Sequence[str], driven: bool) -> Symbol:
    """Three positions with continuous transitions: two lines along the boxes, an arrow across the solenoid."""
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
    marks: list[Stroke] = []
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


def _inside(kind: str, wide: float, y: float, role: Sequence[str]) -> list[Stroke]:
    left = [y - LEVEL * i for i in range(role.count("in") + role.count("exhaust"))]
    right = [y - LEVEL * i for i in range(role.count("out"))]
    open_left, open_right = set(left), set(right)
    marks: list[Stroke] = []

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
